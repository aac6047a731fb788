"""Every public function and method takes an argument of any type, or refuses it in one line."""

import inspect
import math
import re
from pathlib import Path

import numpy as np
import pytest
from one_of_each import one

import kickdyn as kd
from kickdyn.impact.force_model import ForceModel

BAD = {"None": None, "text": "x", "nan": math.nan, "list": [], "huge": 10**400}
BAD["array"] = np.arange(12.0).reshape(3, 4)

LEG, Q, V = kd.Leg.human(), np.array([0.2, 0.4, -0.1]), np.array([-3.0, -6.0, -4.0])
POSTURE, BALL, CONTACT = LEG.posture(Q), kd.Ball(), kd.Contact((1, 0, 0.4), 0.8, 0.4)
IMPACT = kd.strike(POSTURE, V, BALL, CONTACT)
GOAL = kd.Goal((10.0, 0.0, 0.0), time=1.0)
SCENE = kd.Scene(POSTURE, V, BALL, CONTACT)
PLAN = kd.plan_kick(LEG, GOAL, BALL)
AIR = kd.Air(drag="goff-carre")
INFERRED = [kd.infer_impact(POSTURE, V, BALL, IMPACT.ball_before, IMPACT.ball_after)] * 2
TRACK = kd.Track(np.arange(5) / 50, np.linspace((0, 0, 1), (1, 0, 1), 5))
VECTOR = (1.0, 0.0, 0.0)

GOOD = {
    "leg": LEG, "robot": LEG, "posture": POSTURE, "q": Q, "v": V, "joint_impulse": V, "ball": BALL,
    "contact": CONTACT, "impact": IMPACT, "impacts": INFERRED, "kicks": {"first": INFERRED[0]},
    "state": IMPACT.ball_after, "ball_before": IMPACT.ball_before, "ball_after": IMPACT.ball_after,
    "subject": kd.fly(IMPACT.ball_after, BALL), "plan": PLAN, "goal": GOAL, "scene": SCENE,
    "air": AIR, "track": TRACK, "times": TRACK.times, "positions": TRACK.positions,
    "model": LEG.model, "jacobian": POSTURE.jacobian, "kick": kd.Kick(),
    "states": kd.BallState(velocity=[IMPACT.ball_after.velocity] * 2),
    "incoming": kd.BallState((1.5, 0, -0.7), (-2, 0, 0)), "target": (10.0, 0.0, 0.0),
    "motion": one("motion"),
    "function": lambda state, numbers: state[2], "drives": {"knee": kd.Drive(1e-5, 50.0)},
    **dict.fromkeys(("normal", "point", "linear", "offset", "moved", "unit", "wish"), VECTOR),
    **dict.fromkeys(("point_velocity", "position"), VECTOR), "seen": (10.0, 0.0),
    **dict.fromkeys(("damping", "mass", "leg_mass", "approach_speed", "speed", "x", "time"), 1.0),
    "restitution": 0.8, "friction": 0.4, "rolling_deceleration": 0.5, "stiffness": 1e5,
    "contact_time": 1e-2, "delay": 0.1, "width": 0.1, "t": 0.0, "rotor_inertia": 1e-5,
    "distance": 9.15, "height": 1.9, "draws": 2, "frame": "toe", "joint": "hip", "name": "bolt",
    "result": "speed", "what": "a flight", "surface": "heel", "postures": {"hip": [0.1]},
    **{name: {"knee": 0.1} for name in ("joints", "rotors", "values")},
    **dict.fromkeys(("path", "file", "library"), "no/such/file"),
}  # fmt: skip
"""A valid argument for every required parameter, by its name."""

INSTANCES = {
    "Ball": BALL, "Contact": CONTACT, "Leg": LEG, "Posture": POSTURE, "Goal": GOAL, "Scene": SCENE,
    "Impact": IMPACT, "UnilateralImpact": IMPACT, "KickPlan": PLAN, "BodyTrack": one("body"),
    "ForceModel": ForceModel(1e5, 0.5), "Plane": one("plane"), "Wall": kd.Wall(9.15, 1.9),
    "Collision": kd.collide(POSTURE, V, BALL, CONTACT, tol=1e-6), "Motion": one("motion"),
    "Event": kd.Event("low", lambda state, numbers: state[2]),
    "Flight": kd.fly(IMPACT.ball_after, BALL), "IncomingBall": one("incoming ball"),
    "Course": kd.follow(IMPACT.ball_after, BALL, None, kd.Ground(-5.0, "turf")),
    "Uncertainty": IMPACT.uncertainty(q=0.1), "LegMotion": one("leg motion"),
    "Learner": kd.Learner(GOAL, BALL, AIR), "MujocoTuning": one("tuning"),
    "RestitutionFit": kd.fit_restitution(INFERRED, knots=1), "Simulation": kd.simulate(SCENE),
}  # fmt: skip
"""One of each class that has methods with arguments."""

RESULTS = """
Collision Course FileCheck Flight Identification Impact KickPlan Launch LegMotion Motion MujocoRun
MujocoTuning Pass Posture ReachTable RestitutionFit Segments Sensitivity Simulation Uncertainty
UnilateralImpact
"""
"""Classes that functions make, not users."""

UNCHECKED = {
    "BallState.computed", "ForceModel.force", "ForceModel.returned", "ForceModel.stored",
    "ForceModel.separation", "ForceModel.deflection", "ForceModel.load", "ForceModel.energy",
    "Event.launched", "Event.value",
}  # fmt: skip
"""What their documentation says is not checked, because it is called as often as an integrator."""


def public_calls():
    """Return the functions, classes and methods that take arguments, by their names."""
    calls = {}
    stub = Path(kd.__file__).with_suffix(".pyi").read_text()
    public = {name: getattr(kd, name) for name in re.findall(r"import \w+ as (\w+)", stub)}
    results = {name: type(instance) for name, instance in INSTANCES.items()}
    for name, value in (public | results).items():
        if inspect.isclass(value) and issubclass(value, Exception):
            continue
        if name not in RESULTS.split():
            calls[name] = value
        for method in dir(value) if inspect.isclass(value) else ():
            static = inspect.getattr_static(value, method)
            if method[0] == "_" or not (inspect.isfunction(static) or type(static) is classmethod):
                continue
            if inspect.signature(getattr(value, method)).parameters.keys() - {"self"}:
                owner = value if type(static) is classmethod else INSTANCES[name]
                calls[f"{name}.{method}"] = getattr(owner, method)
    return {name: call for name, call in calls.items() if name not in UNCHECKED}


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
            if not (isinstance(error, kd.InvalidInput) and str(error).isprintable()):
                pytest.fail(f"{bad}: {type(error).__name__}: {error}")
