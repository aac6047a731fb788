"""The problem of a kick: turned legs, refusals, and the condition that has no solution."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning import kick_problem as module
from kickdyn.planning.kick_problem import explain_infeasible, kick_problem
from kickdyn.planning.kick_terms import KickTerm, SpeedLimit, StrikeVelocity, TorqueLimit
from kickdyn.planning.objectives import OBJECTIVES
from kickdyn.planning.problem import Kind
from kickdyn.planning.stance import Balance, Clearance, SupportImpulse, Upright

BALL = kd.Ball()
ROUGH = kd.Contact(restitution=0.8, friction=0.4)
HUMAN, G1 = kd.Leg.human(), kd.Leg.from_robot("g1", legs_only=True)
STANDING = kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(
    kd.Support("left_ankle_roll_link", friction=0.6)
)


def target_of(*velocity, contact=ROUGH, spin=(0, 0, 0)):
    return impact_target_for(np.array(velocity, float), np.array(spin, float), BALL, contact)


@pytest.mark.parametrize("angle", [0.3, -0.3, 2.5])
def test_a_turned_leg_is_the_leg_in_turned_axes(angle):
    turn = pin.rpy.rpyToMatrix(0.0, 0.0, angle)
    problem, q = kick_problem(HUMAN, target_of(*turn @ [5.0, 0.0, 2.0])), [0.4, -0.7, 0.2]
    plain, other = HUMAN.posture(q), problem.robot.posture(q)
    assert problem.heading == pytest.approx(angle)
    agrees(other.contact_point, turn @ plain.contact_point, 1e-14)
    agrees(other.jacobian, turn @ plain.jacobian, 1e-14)
    agrees(other.inertia, plain.inertia, 1e-13)
    agrees(problem.robot.model.gravity.linear, HUMAN.model.gravity.linear, 1e-14)


def test_a_leg_that_moves_sideways_is_not_turned_and_a_tilted_plane_is_refused():
    assert kick_problem(G1, target_of(1.0, 1.0, 5.0)).heading == 0.0
    tilted = HUMAN.model
    tilted.jointPlacements[1] = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0, 0), np.zeros(3))
    with pytest.raises(kd.InvalidInput, match=r"\[1\.0, 1\.0, 5\.0\] m/s is not in it"):
        kick_problem(kd.Leg.from_model(tilted, "toe"), target_of(1.0, 1.0, 5.0))


@pytest.mark.parametrize(
    ("leg", "target", "options", "words"),
    [
        (HUMAN, target_of(9, 0, 4, spin=(0, 0, 9)), {}, "side spin"),
        (HUMAN, target_of(9, 0, 4), {"solver": "best"}, "solver is 'best'.*slsqp"),
        (HUMAN, target_of(9, 0, 4), {"ball_position": np.array([0.2, 0.2, -0.7])}, "is 0.2 m from"),
        (HUMAN.with_base_velocity((3, 1, 0)), target_of(9, 0, 4), {}, "velocity of the base"),
        (STANDING.with_supports(), target_of(3, 0, 1), {}, "does not stand"),
    ],
)
def test_what_a_leg_cannot_do_is_refused(leg, target, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kick_problem(leg, target, **options)


def test_starts_are_the_drawn_postures_of_the_least_speed():
    problem = kick_problem(HUMAN, target_of(9, 0, 4), -0.7, limits=False)
    rated = problem.rated()
    assert len(rated) == len(problem.drawn) == module.DRAWN
    assert [rating for rating, *_ in rated] == sorted(rating for rating, *_ in rated)
    ball = problem.variables.target
    for rating, number, x in rated[:3]:
        assert x[:3].tolist() == problem.drawn[number].tolist()
        point = problem.variables.point(x)
        needed = ball.foot_velocity(point.posture)
        v = np.linalg.pinv(point.posture.jacobian * problem.variables.velocity_scale) @ needed
        height = point.ball_centre[2] + 0.7
        assert rating == pytest.approx(np.abs(v).max() + abs(height) / BALL.radius, rel=1e-6)
    assert [x.tolist() for x in problem.starts()] == [x.tolist() for *_, x in rated[:4]]


def test_postures_at_the_ball_touch_it():
    problem = kick_problem(G1, target_of(4, 1, 1), np.array([0.3, -0.1, -0.6])).at_ball(3)
    assert 1 <= len(problem.drawn) <= 3
    for q in problem.drawn:
        point = problem.variables.point(np.append(q, np.zeros(problem.variables.n + 1)))
        agrees(point.ball_centre, [0.3, -0.1, -0.6], 1e-5)
        assert problem.may_meet(q)
    far = kick_problem(G1, target_of(4, 1, 1), np.array([3.0, -0.1, -0.6])).at_ball(3)
    assert len(far.drawn) == 0


def test_a_polished_solution_is_the_best_of_its_neighbours():
    """Feasible displacements along the constraints make the objective larger."""
    problem, objective = kick_problem(HUMAN, target_of(9, 0, 4), -0.7), OBJECTIVES["joint-speed"]()
    (point, *_) = problem.solve(objective, problem.starts()[:1])
    polished = problem.polish(objective, point)
    again = problem.polish(objective, problem.variables.point(point.x - [*[1e-7] * 6, 0]))
    agrees(again.x, polished.x, 1e-9)
    equalities = [term for term in problem.terms if term.kind == Kind.EQUALITY]
    rows = np.vstack([term.slope(polished) for term in equalities])
    rows = np.vstack([rows, np.eye(7)[-1]])  # the share stays
    gradient = objective.slope(polished)[0]
    ends = (polished.x[:3] - problem.variables.lower < 1e-6) | (
        problem.variables.upper - polished.x[:3] < 1e-6
    )
    rows = np.vstack([rows, np.eye(7)[:3][ends]])
    along = np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows) :]
    assert np.abs(along @ gradient).max() < 1e-6 * np.linalg.norm(gradient)


@pytest.mark.parametrize(
    ("cause", "words"),
    [
        (Upright, "trunk"),
        (Clearance, "kicking foot"),
        (Balance, "centre of mass"),
        (SpeedLimit, "speed and torque limits"),
        (TorqueLimit, "speed and torque limits"),
        (None, "ranges of its joints"),
    ],
)
def test_the_condition_that_a_standing_robot_cannot_meet_is_named(cause, words, monkeypatch):
    """Where only the problem without that condition has a solution."""
    problem = kick_problem(STANDING, target_of(3, 0, 2))

    def solve(problem, _, starts):
        assert problem.find(StrikeVelocity)
        assert problem.find(SupportImpulse) is None
        solved = cause is not None and problem.find(cause) is None
        return [problem.variables.point(starts[0])] if solved else []

    monkeypatch.setattr(module.KickProblem, "solve", solve)
    assert words in explain_infeasible(problem)


def test_conditions_that_exclude_each_other_are_not_blamed_on_the_ranges():
    class Unlike(KickTerm):
        kind = Kind.INEQUALITY

        def __init__(self, sign):
            self.sign, self.explanation = sign, f"it has one without {sign}"

        def residual(self, posture, v):
            return np.array([self.sign * posture.q[1] - 9.0])  # the knee's range ends before

        def derivatives(self, posture, v):
            return self.sign * np.eye(3)[1:2], None

    problem = kick_problem(HUMAN, target_of(9, 0, 4))
    terms = (*problem.terms, Unlike(1.0), Unlike(-1.0))
    assert "two or more" in explain_infeasible(replace(problem, terms=terms))
    assert "without 1.0" in explain_infeasible(replace(problem, terms=terms[:-1]))


@pytest.mark.parametrize("position", [-2.0, (3.0, 0.0, -0.6)])
@pytest.mark.slow
def test_a_ball_out_of_reach_is_named(position):
    with pytest.raises(kd.InvalidInput, match=r"no posture .*another position of the ball"):
        kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, ball_position=position)


def test_limits_that_leave_no_posture_are_named():
    model = HUMAN.model
    model.effortLimit = np.ones(3)
    with pytest.raises(kd.InvalidInput, match=r"no posture .*without its speed and torque limits"):
        kd.plan_kick(kd.Leg.from_model(model, "toe"), kd.Goal(15, time=1), BALL, ball_position=-0.7)


def test_another_solver_takes_the_place_of_the_first(monkeypatch):
    starts = []

    def other(problem, start):
        starts.append(start)
        return module.slsqp(problem, start)

    monkeypatch.setitem(module.SOLVERS, "other", other)
    plan = kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL, solver="other")
    assert len(starts) == module.STARTS
    assert plan.q.tolist() == kd.plan_kick(HUMAN, kd.Goal(15, time=1), BALL).q.tolist()
    assert math.isclose(plan.impact.ball_after.speed, plan.launch.speed, rel_tol=1e-9)
