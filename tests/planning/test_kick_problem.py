"""The terms of a kick, their slopes against differences, and where they have no solution."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning import kick_problem as module
from kickdyn.planning.ball_clearance import BodyClearance
from kickdyn.planning.kick_problem import explain_infeasible, kick_problem
from kickdyn.planning.kick_terms import (
    BallPosition,
    KickTerm,
    KickVariables,
    SpeedLimit,
    StrikeVelocity,
    TorqueLimit,
)
from kickdyn.planning.objectives import OBJECTIVES, LargestShare
from kickdyn.planning.problem import Function, Kind
from kickdyn.planning.stance import Balance, Clearance, SupportImpulse, Upright

BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")
ROUGH = kd.Contact(restitution=0.8, friction=0.4)
LEG = kd.Leg.human()
PLAN = kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR)
PLAIN = [kind() for kind in OBJECTIVES.values()]
LEGS = {"human": kd.Leg.human(), "g1": kd.Leg.from_robot("g1", legs_only=True)}
STANDING = kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(
    kd.Support("left_ankle_roll_link", friction=0.6)
)


def slope_errors(term, variables, x, step=1e-6):
    """The difference from central differences, over the largest of each row."""

    def value(x):
        return term.value(variables.point(x)).copy()

    slope = term.slope(variables.point(x))
    steps = step * np.eye(len(x))
    expected = np.array([(value(x + one) - value(x - one)) / (2 * step) for one in steps]).T
    assert slope.shape == expected.shape
    return np.abs(slope - expected) / np.abs(expected).max(axis=1, keepdims=True).clip(1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("restitution", [0.8, ((2.0, 0.9), (20.0, 0.4))])
@pytest.mark.parametrize("offset", [None, (0.02, 0, 0.01)])
def test_slopes_are_those_of_the_values(name, friction, restitution, offset):
    spin = np.array([0.0, -10.0 if friction else 0.0, 0.0])
    velocity = np.array([6.0, 0.0, 3.0])
    target = impact_target_for(
        velocity, spin, BALL, kd.Contact(None, restitution, friction, offset)
    )
    problem = kick_problem(LEGS[name], target, -0.6)
    variables = problem.variables
    x = np.append(np.random.default_rng(0).uniform(0.1, 0.5, 2 * variables.n), 0.8)
    conditions = [term for term in problem.terms if isinstance(term, Function)]
    assert len(conditions) == (5 if name == "g1" and offset is None else 4)
    for term in conditions:
        most = 1e-6 if isinstance(term, BodyClearance) else 1e-7  # coal stops at 1e-6
        assert slope_errors(term, variables, x).max() < most
    for term in PLAIN:
        assert slope_errors(term, variables, x).max() < 1e-5  # of one-sided differences
    assert slope_errors(LargestShare(), variables, x).max() < 1e-7


@pytest.mark.parametrize("offset", [None, (0.02, 0, 0.01)])
def test_slopes_of_a_stance_are_those_of_the_values(offset):
    target = impact_target_for(
        np.array([3.0, 0.5, 1.5]), np.zeros(3), BALL, kd.Contact(None, 0.8, 0.4, offset)
    )
    problem = kick_problem(STANDING, target, BALL.radius)
    variables = problem.variables
    x = np.append(np.random.default_rng(0).uniform(-0.5, 0.5, 2 * variables.n), 0.8)
    for kind in (Balance, Clearance, Upright):
        assert slope_errors(problem.find(kind), variables, x).max() < 1e-7
    assert slope_errors(problem.find(SupportImpulse), variables, x).max() < 1e-5


def test_the_strike_is_made_exact():
    problem = kick_problem(LEGS["g1"], PLAN.impact_target)
    n = problem.variables.n
    point = problem.variables.point(np.append(np.full(2 * n, 0.2), 0.7))
    strike = problem.find(StrikeVelocity)
    assert np.abs(strike.value(point)).max() > 0.1
    exact = strike.make_exact(point)
    assert np.abs(strike.value(exact)).max() < 1e-14
    assert exact.x[:n].tolist() == point.x[:n].tolist()
    assert exact.share == 0.7


def test_a_joint_without_limits_has_a_full_turn():
    model = kd.Leg.human().model
    model.lowerPositionLimit[:], model.upperPositionLimit[:] = -50, 50
    variables = KickVariables(kd.Leg.from_model(model, "toe"), None)
    assert variables.lower.tolist() == [-math.pi] * 3
    assert variables.upper.tolist() == [math.pi] * 3


def test_terms_have_one_kind_each():
    problem = kick_problem(STANDING, PLAN.impact_target, BALL.radius)
    kinds = {type(term): term.kind for term in problem.terms}
    assert kinds[StrikeVelocity] == kinds[BallPosition] == Kind.EQUALITY
    assert kinds[TorqueLimit] == kinds[Balance] == kinds[SupportImpulse] == Kind.INEQUALITY
    assert kinds[SpeedLimit] == Kind.BOUND
    assert [type(term) for term in problem.terms if not term.required] == [
        SupportImpulse,
        BodyClearance,
    ]
    free = kick_problem(STANDING, PLAN.impact_target, limits=False)
    left_out = {BallPosition, SpeedLimit, TorqueLimit}
    assert {type(term) for term in free.terms} == set(kinds) - left_out


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


@pytest.mark.parametrize("how", [{"ball_position": -2.0}, {"ball_position": (3.0, 0.0, -0.6)}])
def test_a_ball_out_of_reach_is_named(how):
    assert refusal(**how).endswith("it has one for another position of the ball")


def test_limits_that_leave_no_posture_are_named():
    said = refusal(changed(effortLimit=[1.0, 1.0, 1.0]), ball_position=-0.7)
    assert said.endswith("; it has one without its speed and torque limits")


def test_a_turned_leg_is_the_leg_in_turned_axes():
    turn = pin.rpy.rpyToMatrix(0.0, 0.0, 0.3)
    target = impact_target_for(turn @ [5.0, 0.0, 2.0], np.zeros(3), BALL, ROUGH)
    problem, leg, q = kick_problem(LEG, target), LEG, [0.4, -0.7, 0.2]
    plain, other = leg.posture(q), problem.robot.posture(q)
    assert problem.heading == pytest.approx(0.3)
    assert other.contact_point == pytest.approx(turn @ plain.contact_point, abs=1e-15)
    assert other.jacobian == pytest.approx(turn @ plain.jacobian, abs=1e-15)
    assert other.inertia == pytest.approx(plain.inertia, abs=1e-15)
    model = problem.robot.model
    base = next(f for f in model.frames if f.parentJoint == 0 and f.name != "universe")
    assert base.placement.rotation == pytest.approx(turn)
    assert model.gravity.linear == pytest.approx(leg.model.gravity.linear)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_leg_that_moves_in_a_vertical_plane_is_turned_towards_the_impulse(side):
    target = impact_target_for(np.array([1.0, side, 5.0]), np.zeros(3), BALL, ROUGH)
    assert kick_problem(LEGS["human"], target).heading == pytest.approx(side * math.pi / 4)
    assert kick_problem(LEGS["g1"], target).heading == 0.0
    tilted = LEGS["human"].model
    tilted.jointPlacements[1] = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0, 0), np.zeros(3))
    words = rf"its foot moves in a plane, and \[1\.0, {side}, 5\.0\] m/s is not in it"
    with pytest.raises(kd.InvalidInput, match=words):
        kick_problem(kd.Leg.from_model(tilted, "toe"), target)


def point_of(plan):
    """A plan as a point of its problem."""
    variables = kick_problem(plan.leg, plan.impact_target).variables
    v = plan.v / variables.velocity_scale
    return variables.point(np.array([*plan.q, *v, plan.share]))


def value(name):
    return OBJECTIVES[name]().quantity(point_of(PLAN))


def test_each_is_what_its_name_says():
    assert value("joint-speed") == pytest.approx(np.mean((PLAN.v / LEG.velocity_limit) ** 2))
    assert value("kinetic-energy") == pytest.approx(
        0.5 * PLAN.v @ PLAN.impact.posture.inertia @ PLAN.v
    )
    worst = PLAN.impact.worst_joint[1]
    assert worst <= value("joint-impulse") <= 3 ** (1 / 12) * worst


@pytest.mark.parametrize(
    ("cause", "words"),
    [
        (Upright, "it has one if its trunk may be more than 30 deg from upright"),
        (Clearance, "it has one if its kicking foot may be under the ground"),
        (Balance, "it has one if its centre of mass may be beside the sole"),
        (SpeedLimit, "it has one without its speed and torque limits"),
        (TorqueLimit, "it has one without its speed and torque limits"),
        (None, "the ranges of its joints allow none"),
    ],
)
def test_the_condition_that_a_standing_robot_cannot_meet_is_named(cause, words, monkeypatch):
    """Where only the problem without that condition has a solution."""
    target = impact_target_for(np.array([3.0, 0.0, 2.0]), np.zeros(3), BALL, ROUGH)
    problem = kick_problem(STANDING, target)

    def solve(problem, _, starts):
        assert problem.find(StrikeVelocity)
        assert problem.find(SupportImpulse) is None
        solved = cause is not None and problem.find(cause) is None
        return [problem.variables.point(starts[0])] if solved else []

    monkeypatch.setattr(module.KickProblem, "solve", solve)
    assert explain_infeasible(problem) == words


def test_conditions_that_exclude_each_other_are_not_blamed_on_the_ranges():
    """Two conditions that no posture keeps, each of which is met without the other one."""

    class Unlike(KickTerm):
        kind = Kind.INEQUALITY

        def __init__(self, sign):
            self.sign, self.explanation = sign, f"it has one without {sign}"

        def residual(self, posture, v):
            return np.array([self.sign * posture.q[1] - 9.0])  # the knee's range ends before

        def derivatives(self, posture, v):
            return self.sign * np.eye(3)[1:2], None

    problem = kick_problem(LEG, PLAN.impact_target)
    terms = (*problem.terms, Unlike(1.0), Unlike(-1.0))
    words = "it has one only without two or more of its conditions"
    assert explain_infeasible(replace(problem, terms=terms)) == words
    assert explain_infeasible(replace(problem, terms=terms[:-1])) == "it has one without 1.0"


def test_another_solver_finds_the_same_plan(monkeypatch):
    starts = []

    def recording(problem, start):
        starts.append(start)
        return module.slsqp(problem, start)

    monkeypatch.setitem(module.SOLVERS, "recording", recording)
    plan = kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR, solver="recording")
    assert len(starts) == module.STARTS
    assert plan.q.tolist() == kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR).q.tolist()


def test_an_unknown_solver_is_refused():
    with pytest.raises(kd.InvalidInput, match="solver is 'best': it must be one of slsqp"):
        kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR, solver="best")
