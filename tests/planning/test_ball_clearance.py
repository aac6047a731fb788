"""The bodies of a robot stay out of the ball."""

from functools import cache
from itertools import permutations

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import kickdyn as kd
from kickdyn.planning.ball_clearance import BodyClearance, bodies_near_ball
from kickdyn.planning.kick_terms import KickVariables
from kickdyn.robot.collisions import TOUCHING, bodies_at, find_self_collisions
from kickdyn.robot.ground_clearance import body_frames, shapes_of

G1 = kd.Leg.from_robot("g1", legs_only=True)
PLAN = kd.plan_kick(G1, kd.Goal((4, 1, 0), time=0.8), kd.Ball(), kd.Air())


@pytest.fixture(scope="module")
def term():
    return BodyClearance(G1, KickVariables(G1, PLAN.impact_target), bodies_near_ball(G1))


def test_slopes_are_those_of_the_distances(term):
    variables, draw = KickVariables(G1, PLAN.impact_target), np.random.default_rng(1)
    for _ in range(3):
        q = draw.uniform(-0.3, 0.5, variables.n)
        slopes = term.derivatives(variables.posture(q), None)[0][:, variables.vs]
        for i, step in enumerate(1e-6 * np.eye(variables.n)):
            ahead, behind = (
                term.residual(variables.posture(q + sign * step), None) for sign in (1, -1)
            )
            assert slopes[:, i] == pytest.approx((ahead - behind) / 2e-6, abs=1e-7)


def test_slopes_between_bodies_are_those_of_their_distances():
    """Of legs beside and inside each other, and of a foot and a thigh that move with one chain."""
    variables, draw = KickVariables(G1, PLAN.impact_target), np.random.default_rng(1)
    pairs = [("left_knee_link", "right_knee_link"), ("right_ankle_roll_link", "left_hip_yaw_link")]
    pairs.append(("right_hip_yaw_link", "right_ankle_roll_link"))
    bodies = [tuple(bodies_at(G1, frame)[0] for frame in pair) for pair in pairs]
    term = BodyClearance(G1, variables, bodies)
    q = np.zeros(variables.n)
    depths = []
    for roll in (-0.2, 0.2, 0.45):
        q[1], q[3] = roll, 0.4 + draw.uniform(0.0, 0.5)
        depths.append(term.residual(variables.posture(q), None)[0])
        slopes = term.derivatives(variables.posture(q), None)[0][:, variables.vs]
        for i, step in enumerate(1e-6 * np.eye(variables.n)):
            ahead, behind = (
                term.residual(variables.posture(q + sign * step), None) for sign in (1, -1)
            )
            assert slopes[:, i] == pytest.approx((ahead - behind) / 2e-6, abs=1e-6)
    assert min(depths) < 0 < max(depths)


def test_a_plan_keeps_the_hand_out_of_the_hip(monkeypatch):
    inside = kd.Leg.from_robot("g1", "inside", legs_only=True)
    goal, ball = kd.Goal((-0.6, 1, 0), time=0.48), kd.Ball()
    plan = kd.plan_kick(inside, goal, ball, kd.Air())
    assert plan.status == "met"
    assert find_self_collisions(plan.leg, plan.q) == {}
    monkeypatch.setattr("kickdyn.planning.kick_problem.MOST_PAIRS", -1)
    without = kd.plan_kick(inside, goal, ball, kd.Air())
    assert without.status == "collides"
    assert without.value < plan.value < 1.1 * without.value


@cache
def hulls(leg):
    """The hulls of the meshes, each with its frame: by an own computation, from their vertices."""
    return [
        (frame, number, ConvexHull(centres))
        for frame, number in body_frames(leg).items()
        for centres, radii in shapes_of(leg, frame)
        if not radii.any()
    ]


def placed(leg, q):
    """Vertices and half spaces of the hulls in the world, with frame and joint."""
    model = leg.model
    data, bodies = model.createData(), []
    pin.framesForwardKinematics(model, data, q)
    for frame, number, hull in hulls(leg):
        pose, joint = data.oMf[number], int(model.frames[number].parentJoint)
        points = hull.points[hull.vertices] @ pose.rotation.T + pose.translation
        faces = hull.equations[:, :3] @ pose.rotation.T
        offsets = hull.equations[:, 3] - faces @ pose.translation
        bodies.append((frame, joint, points, np.column_stack([faces, offsets])))
    return bodies


def deepest(points, half_spaces):
    """How deep the deepest of some points is in a hull; below 0, none is."""
    return -(half_spaces[:, :3] @ points.T + half_spaces[:, 3:]).max(axis=0).min()


def overlaps(leg, q):
    """Pairs of frames of which a vertex of one is deep inside the other, neighbours left out."""
    parents, found = leg.model.parents, set()
    for (one, first, points, _), (other, second, corners, faces) in permutations(placed(leg, q), 2):
        low, high = corners.min(axis=0), corners.max(axis=0)
        near = points[((points > low) & (points < high)).all(axis=1)]
        if first != second and first != parents[second] and second != parents[first] and len(near):
            found |= {frozenset((one, other))} if deepest(near, faces) > TOUCHING else set()
    return found


def test_no_plan_is_met_with_a_body_inside_the_ball_or_another_body():
    """Of random kicks to the side, a fifth of which would put the hand into the hip."""
    leg, draw = kd.Leg.from_robot("g1", "inside", legs_only=True), np.random.default_rng(3)
    at_rest, met = overlaps(leg, leg.configuration()), 0
    for _ in range(5):
        azimuth, distance = np.radians(draw.uniform(50, 130)), draw.uniform(0.5, 3.0)
        target = (distance * np.cos(azimuth), distance * np.sin(azimuth), 0)
        plan = kd.plan_kick(leg, kd.Goal(target, time=draw.uniform(0.4, 0.7)), kd.Ball(), kd.Air())
        if plan.status == "met":
            met += 1
            assert overlaps(leg, plan.q) <= at_rest
            centre, radius = plan.impact.ball_before.position, plan.impact.ball.radius
            for _, _, points, faces in placed(leg, plan.q):
                assert radius - np.linalg.norm(points - centre, axis=1).min() < TOUCHING
                assert deepest(centre[None], faces) < 0
    assert met > 2


def test_a_plan_with_the_toe_is_clear_of_the_ball(term):
    assert PLAN.status == "met"
    assert (term.residual(PLAN.impact.posture, PLAN.v) > 0).all()


def test_a_contact_point_inside_the_foot_is_never_met():
    """The origin of the ankle: whichever way the foot turns, the ball is in it."""
    ankle = kd.Leg.from_robot("g1", "right_ankle_roll_link", legs_only=True)
    plan = kd.plan_kick(ankle, kd.Goal((4, 1, 0), time=0.8), kd.Ball(), kd.Air())
    assert plan.status == "collides"
    (line,) = [line for line in plan.warnings if "inside the ball" in line]
    assert "right_ankle_roll_link by" in line


def test_a_leg_without_shapes_has_no_bodies():
    leg = kd.Leg.from_model(G1.model, "toe")
    assert bodies_near_ball(leg) == []
