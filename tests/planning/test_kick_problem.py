"""The problem of a kick: turned legs, refusals, and the condition that has no solution."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning import kick_problem as module
from kickdyn.planning.kick_limits import (
    Balance,
    KickClearance,
    KickSpeedLimit,
    KickTorqueLimit,
    SupportImpulse,
    Upright,
)
from kickdyn.planning.kick_problem import explain_infeasible, kick_problem
from kickdyn.planning.kick_terms import BallPosition, Facing, JointSpeed, LargestShare

BALL = kd.Ball()
ROUGH = kd.Contact(restitution=0.8, friction=0.4)
HUMAN, G1 = kd.Leg.human(), kd.Leg.from_robot("g1", legs_only=True)
STANDING = kd.Leg.from_robot("g1", base="floating", legs_only=True).with_supports(
    kd.Support("left_ankle_roll_link", friction=0.6)
)


def target_of(*velocity, contact=ROUGH, spin=(0, 0, 0)):
    return impact_target_for(np.array(velocity, float), np.array(spin, float), BALL, contact)


@pytest.mark.parametrize("angle", [0.3, -0.3, 2.5])
def test_a_leg_that_is_turned_and_placed_at_the_ball_is_the_leg_in_turned_axes(angle):
    turn = pin.rpy.rpyToMatrix(0.0, 0.0, angle)
    target, ball, aside = target_of(*turn @ [5.0, 0.0, 2.0]), [0.3, 0.2, -0.7], turn @ [0, 0.2, 0]
    problem, q = kick_problem(HUMAN, target, turn @ ball), [0.4, -0.7, 0.2]
    plain, other = HUMAN.posture(q), problem.robot.posture(q)
    assert problem.heading == pytest.approx(angle)
    agrees(problem.moved, aside, closed_form())
    agrees(other.contact_point, turn @ plain.contact_point + aside, closed_form())
    agrees(other.jacobian, turn @ plain.jacobian, closed_form())
    agrees(other.inertia, plain.inertia, closed_form())
    agrees(problem.robot.model.gravity.linear, HUMAN.model.gravity.linear, closed_form())


def test_a_leg_that_moves_sideways_is_not_turned_and_a_tilted_plane_is_refused():
    assert kick_problem(G1, target_of(1.0, 1.0, 5.0)).heading == 0.0
    tilted = HUMAN.model
    tilted.jointPlacements[1] = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0, 0), np.zeros(3))
    with pytest.raises(kd.InvalidInput, match=r"\[1\.0, 1\.0, 5\.0\] m/s is not in it"):
        kick_problem(kd.Leg.from_model(tilted, "toe"), target_of(1.0, 1.0, 5.0))


@pytest.mark.parametrize(("leg", "target", "words"), [
    (HUMAN, target_of(9, 0, 4, spin=(0, 0, 9)), "side spin"),
    (HUMAN.with_base_velocity((3, 1, 0)), target_of(9, 0, 4), "base moves across"),
    (STANDING.with_supports(), target_of(3, 0, 1), "does not stand")])  # fmt: skip
def test_what_a_leg_cannot_do_is_refused(leg, target, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kick_problem(leg, target)


@pytest.mark.parametrize("offset", [None, (0.02, 0.0, 0.01)])
def test_a_side_of_the_foot_is_demanded_at_the_contact_point_of_its_file_only(offset, monkeypatch):
    monkeypatch.setattr(module, "bodies_near_ball", lambda robot: ())
    contact = kd.Contact(restitution=0.8, friction=0.4, offset=offset)
    facing = kick_problem(G1, target_of(3, 0, 1, contact=contact)).find(Facing)
    assert (facing is None) == (offset is not None)


def test_postures_at_the_ball_touch_it_with_a_side_of_the_foot_that_may_meet_it(monkeypatch):
    monkeypatch.setattr(module, "bodies_near_ball", lambda robot: ())
    monkeypatch.setattr(module, "WIDELY_DRAWN", 10)
    place, target = np.array([0.2, -0.1, -0.6]), target_of(3.0, 0.3, 1.0)
    problem = kick_problem(G1, target, place)
    problem = replace(problem, drawn=problem.drawn[:15])
    found, data = problem.at_ball(3), problem.limb.leg.model.createData()
    assert len(found.drawn) == 3
    for q in found.drawn:
        posture, normal = problem.variables.posture(q), target.contact.normal
        centre = posture.contact_point + BALL.radius * normal
        assert centre == pytest.approx(place, abs=optimized(1e-7))
        assert ((problem.variables.lower <= q) & (q <= problem.variables.upper)).all()
        pin.framesForwardKinematics(posture.leg.model, data, posture.q)
        rotation = data.oMf[posture.leg.frame_id].rotation
        assert (G1.contact_normal_cone @ rotation.T @ normal > 0.0).all()
    far = BallPosition(problem.variables, 2.0 + place, np.eye(3))
    assert not len(replace(problem, terms=(far,)).at_ball(3).drawn)


@pytest.mark.parametrize(("share", "right"), [(0.7, 0.7), (1.0 - 1e-8, 1.0)])
def test_a_kick_that_only_the_largest_share_finds_is_whole_but_for_a_solvers_error(
    share, right, monkeypatch
):
    problem = kick_problem(HUMAN, target_of(9, 0, 4))
    points = [problem.variables.point(np.array([*np.full(6, 0.2), x])) for x in (0.4, share)]
    monkeypatch.setattr(module.KickProblem, "solve", lambda _, objective, starts: (
        points if isinstance(objective, LargestShare) else []))  # fmt: skip
    assert module._solve(problem, JointSpeed())[1].share == right


@pytest.mark.parametrize(("cause", "words"), [
    (Upright, "trunk"), (KickClearance, "kicking foot"), (Balance, "centre of mass"),
    (KickSpeedLimit, "speed and torque limits"), (KickTorqueLimit, "speed and torque limits"),
    (None, "ranges of its joints")])  # fmt: skip
def test_the_condition_that_a_standing_robot_cannot_meet_is_named(cause, words, monkeypatch):
    """Where only the problem without that condition has a solution."""
    problem = kick_problem(STANDING, target_of(3, 0, 2))

    def solve(problem, _, starts):
        assert problem.find(SupportImpulse) is None
        solved = cause is not None and problem.find(cause) is None
        return [problem.variables.point(starts[0])] if solved else []

    monkeypatch.setattr(module.KickProblem, "solve", solve)
    assert words in explain_infeasible(problem)
