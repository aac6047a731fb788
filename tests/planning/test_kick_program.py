"""The nonlinear program's derivatives, against differences, and where it has no solution."""

import ctypes
import math

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import _fblas

import kickdyn as kd
from kickdyn.planning import kick_program
from kickdyn.planning.impact_target import impact_target_for
from kickdyn.planning.kick_program import (
    KickObjective,
    KickProgram,
    ProgramPoint,
    explain_infeasible,
    scatter_cost,
    turn_leg,
)
from kickdyn.planning.scatter import scatter
from kickdyn.planning.stance import Condition, Stance
from kickdyn.robot.standing import StandingRobot

BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")
LEG = kd.Leg.human()
PLAN = kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR)
OBJECTIVES = [name for name in KickObjective if name != "scatter"]
LEGS = {"human": kd.Leg.human(), "g1": kd.Leg.from_robot("g1", legs_only=True)}


@pytest.mark.parametrize("objective", [*OBJECTIVES, None])
@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("restitution", [0.8, ((2.0, 0.9), (20.0, 0.4))])
def test_slopes_are_those_of_the_values(name, friction, objective, restitution):
    spin = np.array([0.0, -10.0 if friction else 0.0, 0.0])
    impact_target = impact_target_for(
        np.array([6.0, 0.0, 3.0]), spin, BALL, restitution, friction, (0.02, 0, 0.01)
    )
    program = KickProgram(LEGS[name], impact_target, -0.6)
    cost = program.cost(objective) if objective else None
    draw, n = np.random.default_rng(0), program.n
    x = np.append(draw.uniform(0.1, 0.5, 2 * n), 0.8)

    def values(x):
        return ProgramPoint(program, x, cost, 3.0).values

    slopes = ProgramPoint(program, x, cost, 3.0).slopes
    step = 1e-6 * np.eye(len(x))
    expected = np.array([(values(x + one) - values(x - one)) / 2e-6 for one in step]).T
    assert slopes.shape == expected.shape
    size = np.abs(expected).max(axis=1, keepdims=True)
    digits = 1e-5 if objective else 1e-7  # a cost has one-sided differences
    assert np.abs(slopes - expected)[:1].max() < digits * size[0]
    assert (np.abs(slopes - expected)[1:] < 1e-7 * size[1:]).all()


def limited(what, value):
    model = kd.Leg.human().model
    limits = getattr(model, what)
    limits[1] = value
    setattr(model, what, limits)
    return kd.Leg.from_model(model, "toe")


@pytest.mark.parametrize(("what", "named"), [("velocityLimit", "speed"), ("effortLimit", "torque")])
def test_a_limit_of_0_is_refused_or_lifted_and_an_infinite_one_holds(what, named):
    goal, air = kd.Goal(10, time=1), kd.Air(drag="brazuca")
    said = f"^{named} limit of knee is 0: it must be above 0.*no-limits"
    with pytest.raises(kd.InvalidInput, match=said):
        kd.plan_kick(limited(what, 0.0), goal, BALL, air)
    lifted = kd.plan_kick(limited(what, 0.0), goal, BALL, air, limits=False)
    free = kd.plan_kick(limited(what, np.inf), goal, BALL, air)
    for plan in (lifted, free):
        assert plan.status == "met"
        others = np.delete(np.abs(plan.v) / LEGS["human"].velocity_limit, 1)
        if what == "velocityLimit":
            assert plan.speed_use == pytest.approx(others.max())
        assert np.isfinite(plan.torque_use)


def changed(**limits):
    model = LEGS["human"].model
    for name, values in limits.items():
        setattr(model, name, np.array(values))
    return kd.Leg.from_model(model, "toe")


def refusal(leg=LEGS["human"], **how):
    with pytest.raises(kd.InvalidInput, match="has no posture") as error:
        kd.plan_kick(leg, kd.Goal(15, time=1), BALL, kd.Air(drag="brazuca"), **how)
    return str(error.value)


@pytest.mark.parametrize("how", [{"ball_height": -2.0}, {"ball_at": (3.0, 0.0, -0.6)}])
def test_the_nearest_ball_within_reach_is_named(how):
    said = refusal(**how)
    assert "the nearest position of the ball for which it has one is (" in said
    near = [float(part) for part in said.rpartition("(")[2].partition(")")[0].split(",")]
    plan = kd.plan_kick(
        LEGS["human"], kd.Goal(15, time=1), BALL, kd.Air(drag="brazuca"), ball_height=near[2]
    )
    assert plan.impact.ball_after.position[2] == pytest.approx(near[2], abs=1e-3)
    wished = next(iter(how.values()))
    far = near[2] - wished if "ball_height" in how else np.linalg.norm(np.subtract(near, wished))
    assert abs(far) < (1.3 if "ball_height" in how else 2.3)  # what the leg's length leaves


def test_limits_that_leave_no_posture_are_named():
    said = refusal(changed(effortLimit=[1.0, 1.0, 1.0]), ball_height=-0.7)
    assert said.endswith("; it has one without its speed and torque limits")


def about_z(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def test_a_turned_leg_is_the_leg_in_turned_axes():
    leg, turn = kd.Leg.human(), about_z(0.3)
    q = [0.4, -0.7, 0.2]
    plain, other = leg.posture(q), turn_leg(leg, 0.3).posture(q)
    assert other.contact_point == pytest.approx(turn @ plain.contact_point, abs=1e-15)
    assert other.jacobian == pytest.approx(turn @ plain.jacobian, abs=1e-15)
    assert other.inertia == pytest.approx(plain.inertia, abs=1e-15)
    model = turn_leg(leg, 0.3).model
    base = next(f for f in model.frames if f.parentJoint == 0 and f.name != "universe")
    assert base.placement.rotation == pytest.approx(turn)
    assert model.gravity.linear == pytest.approx(leg.model.gravity.linear)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_leg_that_moves_in_a_vertical_plane_is_turned_towards_the_impulse(side):
    target = impact_target_for(np.array([1.0, side, 5.0]), np.zeros(3), BALL, 0.8, 0.4)
    assert KickProgram(LEGS["human"], target).heading == pytest.approx(side * math.pi / 4)
    assert KickProgram(LEGS["g1"], target).heading == 0.0
    tilted = LEGS["human"].model
    tilted.jointPlacements[1] = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0, 0), np.zeros(3))
    for leg in (kd.Leg.from_model(tilted, "toe"), LEGS["human"]):
        with pytest.raises(kd.InvalidInput, match="its foot moves in a plane only"):
            KickProgram(leg, target, turn=leg is not LEGS["human"])


def value(name):
    program = KickProgram(LEG, PLAN.impact_target)
    return program.cost(name)(PLAN.impact.posture, PLAN.v)


def test_each_is_what_its_name_says():
    assert value("joint-speed") == pytest.approx(np.mean((PLAN.v / LEG.velocity_limit) ** 2))
    assert value("kinetic-energy") == pytest.approx(
        0.5 * PLAN.v @ PLAN.impact.posture.inertia @ PLAN.v
    )
    worst = PLAN.impact.worst_joint[1]
    assert worst <= value("joint-impulse") <= 3 ** (1 / 12) * worst


def test_scatter_is_that_of_the_strike():
    spread = {"speed": 0.02, "angle": 0.01, "drag": 0.05}
    radius = scatter_cost(PLAN.impact_target, PLAN.launch, AIR, spread)
    expected = scatter(PLAN.impact, AIR, **spread).radius
    assert radius(PLAN.impact.posture, PLAN.v) == pytest.approx(expected, rel=1e-6)
    assert radius(PLAN.impact.posture, -PLAN.v) > 1e3  # the foot moves away


@pytest.mark.parametrize(
    ("leg", "goal", "spread"),
    [
        (
            kd.Leg.from_robot("g1", legs_only=True),
            kd.Goal((5, 1, 0), time=0.9),
            {"speed": 0.02, "angle": 0.01, "contact": 0.002},
        ),
        (kd.Leg.testbed(), kd.Goal(2, time=0.6), {"angle": 0.02}),
    ],
)
def test_robust_scatters_no_more_than_any_other_objective(leg, goal, spread):
    robust = kd.plan_kick(leg, goal, BALL, AIR, objective="scatter", uncertainty=spread)
    own = scatter(robust.impact, AIR, **spread).radius
    for name in set(KickObjective) - {"scatter"}:
        other = kd.plan_kick(leg, goal, BALL, AIR, objective=name)
        assert other.status == "met"
        assert own <= scatter(other.impact, AIR, **spread).radius * (1 + 1e-6), name


def test_the_threads_of_blas_are_as_before_a_solution():
    found = kick_program._blas_threads()
    if found is None:
        pytest.skip("another BLAS than SciPy's own")
    count = ctypes.CDLL(_fblas.__file__).scipy_openblas_get_num_threads
    with kick_program.one_blas_thread():
        assert count() == 1
    assert count() == found[1]


@pytest.mark.parametrize("cause", [*Condition, "limits"])
def test_the_condition_that_a_standing_robot_cannot_meet_is_named(cause, monkeypatch):
    """Where only the program without that condition has a solution."""
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    standing = StandingRobot(robot.with_supports("left_ankle_roll_link"))
    impact_target = impact_target_for(np.array([3.0, 0.0, 2.0]), np.zeros(3), BALL, 0.8, 0.4)
    program = KickProgram(standing.leg, impact_target, BALL.radius, stance=Stance(standing))

    def solve(program, _):
        assert program.stance.standing is standing
        left_out = program.stance.without if program.limits else "limits"
        return "a solution" if left_out == cause else None

    monkeypatch.setattr(KickProgram, "solve", solve)
    said = {"limits": "it has one without its speed and torque limits"}
    expected = said.get(cause, f"it has one if this may be violated: {cause}")
    assert explain_infeasible(program) == expected
