"""Every public function and method takes an argument of any type, or refuses it in one line."""

import inspect
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.core import validation

BAD = {
    "None": None,
    "text": "x",
    "nan": math.nan,
    "list": [],
    "huge": 10**400,
    "array": np.arange(12.0).reshape(3, 4),
}

LEG, Q, V = kd.Leg.human(), np.array([0.2, 0.4, -0.1]), np.array([-3.0, -6.0, -4.0])
POSTURE, BALL, CONTACT = LEG.posture(Q), kd.Ball(), kd.Contact((1, 0, 0.4), 0.8, 0.4)
IMPACT = kd.strike(POSTURE, V, BALL, CONTACT)
GOAL = kd.Goal((10.0, 0.0, 0.0), time=1.0)
SCENE = kd.Scene(POSTURE, V, BALL, CONTACT)
PLAN = kd.plan_kick(LEG, GOAL, BALL)
AIR = kd.Air(drag="goff-carre")
INFERRED = [kd.infer_impact(POSTURE, V, BALL, IMPACT.ball_before, IMPACT.ball_after)] * 2
TRACK = kd.Track(np.arange(5) / 50, np.linspace((0, 0, 1), (1, 0, 1), 5))

GOOD = {
    "leg": LEG, "posture": POSTURE, "q": Q, "v": V, "ball": BALL, "contact": CONTACT,
    "normal": (1.0, 0.0, 0.0), "restitution": 0.8, "target": (10.0, 0.0, 0.0), "stiffness": 1e5,
    "damping": 1.0, "impact": IMPACT, "state": IMPACT.ball_after, "plan": PLAN, "goal": GOAL,
    "scene": SCENE, "contact_time": 1e-2, "mass": 1.0, "approach_speed": 5.0, "leg_mass": 1.0,
    "point": (0.0, 0.0, 0.0), "model": LEG.model, "frame": "toe", "postures": {"hip": [0.1]},
    "width": 0.1,
    "kick": kd.Kick(), "joint": "hip", "joints": {"knee": 0.1}, "rotors": {"knee": 0.1},
    "name": "bolt", "friction": 0.4, "rolling_deceleration": 0.5, "t": 0.0, "x": 1.0,
    "result": "speed", "what": "a flight", "distance": 9.15, "height": 1.9,
    "position": (0.0, 0.0, 1.0), "point_velocity": (1.0, 0.0, 0.0),
    "unit": (1.0, 0.0, 0.0), "wish": (1.0, 0.0, 0.0), "joint_impulse": V, "offset": (0.0, 0.0, 0.0),
    "path": "no/such/file", "subject": kd.fly(IMPACT.ball_after, BALL),
    "track": TRACK, "times": TRACK.times, "positions": TRACK.positions, "file": "no/such/file",
    "ball_before": IMPACT.ball_before, "ball_after": IMPACT.ball_after, "seen": (10.0, 0.0),
    "jacobian": POSTURE.jacobian,
    "function": lambda state, numbers: state[2], "air": AIR, "impacts": INFERRED, "speed": 5.0,
    "kicks": {"first": INFERRED[0]},
    "rotor_inertia": 1e-5, "drives": {"knee": kd.Drive(1e-5, 50.0)}, "values": {"knee": 0.1},
    "draws": 2, "surface": "heel", "linear": (1.0, 0.0, 0.0),
    "states": kd.BallState(velocity=[IMPACT.ball_after.velocity] * 2),
    "incoming": kd.BallState((1.5, 0, -0.7), (-2, 0, 0)), "time": 1.0,
    "moved": (0.1, 0.0, 0.0), "delay": 0.1, "robot": LEG,
}  # fmt: skip
"""A valid argument for every required parameter, by its name."""

INSTANCES = {
    "Ball": BALL,
    "BodyTrack": kd.BodyTrack([0.0, 0.1], ["ball"], np.zeros((2, 1, 3))),
    "Contact": CONTACT,
    "Leg": LEG,
    "Posture": POSTURE,
    "Goal": GOAL,
    "ForceModel": kd.ForceModel(1e5, 0.5),
    "Impact": IMPACT,
    "UnilateralImpact": IMPACT,  # whose methods it has
    "Plane": kd.Plane((1, 0, 0), (-1, 0, 0)),
    "Wall": kd.Wall(9.15, 1.9),
    "Scene": SCENE,
    "Collision": kd.collide(POSTURE, V, BALL, CONTACT, tol=1e-6),
    "Event": kd.Event("low", lambda state, numbers: state[2]),
    "Flight": kd.fly(IMPACT.ball_after, BALL),
    "Course": kd.follow(IMPACT.ball_after, BALL, None, kd.Ground(-5.0, "turf")),
    "Motion": kd.Motion(
        LEG,
        LEG.joint_names,
        *(
            BSpline(np.repeat([begin, begin + 0.5], 4), np.zeros((4, 3)), 3)
            for begin in (-0.5, 0.0)
        ),
    ),
    "Uncertainty": IMPACT.uncertainty(q=0.1),
    "LegMotion": kd.fit_motion(
        kd.BodyTrack(np.arange(10) / 100, angles=dict.fromkeys(LEG.joint_names, np.arange(10.0))),
        LEG,
        angles={name: name for name in LEG.joint_names},
        contact=0.1,
    ),
    "IncomingBall": kd.IncomingBall(kd.BallState((3.0, 0.0, -0.6), (-2.0, 0.0, 0.0))),
    "KickPlan": PLAN,
    "Learner": kd.Learner(GOAL, BALL, AIR),
    "MujocoTuning": kd.tune_mujoco(POSTURE, V, BALL, CONTACT, contact_time=0.01, timestep=0.004),
    "RestitutionFit": kd.fit_restitution(INFERRED, knots=1),
    "Simulation": kd.simulate(SCENE),
}
"""One of each class that has methods with arguments."""

RESULTS = {
    *("Collision", "Course", "Flight", "Identification", "Impact", "InferredImpact", "JointLoad"),
    *("Collisions", "Impacts", "Simulations"),
    *(
        "ContactMotion",
        "KickPlan",
        "LegMotion",
        "Launch",
        "LandingSlopes",
        "Meeting",
        "Motion",
        "MujocoRun",
        "MujocoTuning",
        "NoisyRuns",
        "Pass",
        "Posture",
        "RestitutionFit",
        "ReachRow",
        "ReachTable",
        "Segments",
        "Sensitivity",
        "Simulation",
        "Uncertainty",
        "UnilateralImpact",
    ),
}
"""Classes that functions make, not users."""

UNCHECKED = {
    *("BallState.computed", "ForceModel.force", "ForceModel.returned", "ForceModel.stored"),
    *("ForceModel.separation", "ForceModel.deflection", "ForceModel.load", "ForceModel.energy"),
    *("Event.launched", "Event.value"),
}
"""What their documentation says is not checked, because it is called as often as an integrator."""


def public_calls():
    """Return the functions, classes and methods that take arguments, by their names."""
    found = {}
    stub = Path(kd.__file__).with_suffix(".pyi").read_text()
    for name in re.findall(r"import \w+ as (\w+)", stub):
        value = getattr(kd, name)
        if inspect.isclass(value) and issubclass(value, Exception):
            continue
        if name not in RESULTS:
            found[name] = value
        for method in dir(value) if inspect.isclass(value) else ():
            static = inspect.getattr_static(value, method)
            if method[0] == "_" or not (inspect.isfunction(static) or type(static) is classmethod):
                continue
            parameters = inspect.signature(getattr(value, method)).parameters
            if parameters.keys() - {"self"}:
                owner = value if type(static) is classmethod else INSTANCES[name]
                found[f"{name}.{method}"] = getattr(owner, method)
    return {name: call for name, call in found.items() if name not in UNCHECKED}


CALLS = public_calls()


def arguments(call):
    """Yield valid arguments of a call with one that has another type."""
    parameters = inspect.signature(call).parameters.values()
    required = [p for p in parameters if p.default is p.empty and p.kind not in (2, 4)]
    good = {p.name: GOOD[p.name] for p in required}
    if call is kd.reach:  # eleven plans by default
        good["elevations"] = 30.0
    for p in parameters:
        for kind, bad in BAD.items():
            if p.kind is p.VAR_POSITIONAL:
                yield f"*{p.name} {kind}", (bad,), {}
            elif p.kind is not p.VAR_KEYWORD and bad is not p.default:
                yield f"{p.name} {kind}", (), good | {p.name: bad}


@pytest.mark.parametrize("name", CALLS)
def test_an_argument_of_any_type_is_taken_or_refused_in_a_line(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for bad, args, options in arguments(CALLS[name]):
        try:
            CALLS[name](*args, **options)
        except kd.SceneError:  # a line per fault
            pass
        except Exception as error:
            one_line = isinstance(error, kd.InvalidInput) and str(error).isprintable()
            if not one_line:
                pytest.fail(f"{bad}: {type(error).__name__}: {error}")


def test_the_calls_are_those_of_the_stub():
    assert len(CALLS) > 60
    assert {
        "Air",
        "Air.at",
        "Leg.from_urdf",
        "Posture.respond",
        "page",
    } <= CALLS.keys()


@validation.check_arguments
def annotated(ball: kd.Ball, air: kd.Air | None = None, *, strict: bool = False, rest: float = 0.0):
    return ball, air, strict, rest


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"ball": None}, r"^ball is None: it must be a kickdyn\.Ball$"),
        ({"ball": BALL, "air": BALL}, r"^air is .*: it must be a kickdyn\.Air or None$"),
        ({"ball": IMPACT}, r"^ball is of the type Impact: it must be a kickdyn\.Ball$"),
        ({"ball": BALL, "strict": 1}, "^strict is 1: it must be True or False$"),
    ],
)
def test_an_annotation_is_what_an_argument_must_be(arguments, message):
    with pytest.raises(kd.InvalidInput, match=message):
        annotated(**arguments)


def test_arguments_by_position_are_checked_too():
    with pytest.raises(kd.InvalidInput, match=r"^air is .*: it must be a kickdyn\.Air or None$"):
        annotated(BALL, BALL)


def test_what_is_converted_is_left_alone():
    assert annotated(BALL, None, strict=np.True_, rest="x") == (BALL, None, np.True_, "x")
    with pytest.raises(TypeError, match="missing 1 required"):
        annotated()


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_no_nan_comes_out_of_a_posture_or_a_contact(value):
    for attempt in (
        lambda: kd.ForceModel(value),
        lambda: kd.ForceModel(1.0, value),
        lambda: POSTURE.effective_mass((1.0, value, 0.0)),
        lambda: POSTURE.respond((1.0, value, 0.0)),
        lambda: POSTURE.solve(np.full((3, 2), value)),
        lambda: POSTURE.try_joint_velocity((1.0, value, 0.0)),
        lambda: LEG.angles_deg((1.0, value, 0.0)),
    ):
        with pytest.raises(kd.InvalidInput, match="finite"):
            attempt()


def test_an_array_in_a_message_is_one_line():
    with pytest.raises(kd.InvalidInput) as refusal:
        kd.Ball(mass=np.eye(3))
    assert "array([[1., 0., 0.], [0., 1., 0.]" in str(refusal.value)


def test_odd_blanks_in_a_message_are_escaped():
    assert str(kd.KickdynError("a\xa0b\x7fc\r\n   d\te")) == "a\\xa0b\\x7fc d\\te"
