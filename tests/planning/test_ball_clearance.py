"""Bodies of a robot stay out of the ball and of each other, by hulls of the meshes' vertices."""

from functools import cache
from itertools import permutations

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull
from tolerances import agrees

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning.ball_clearance import RESERVE, BodyClearance, bodies_near_ball
from kickdyn.planning.kick_terms import KickVariables
from kickdyn.robot.collisions import TOUCHING, bodies_at, find_self_collisions
from kickdyn.robot.ground_clearance import body_frames, shapes_of

G1, BALL, AIR = kd.Leg.from_robot("g1", legs_only=True), kd.Ball(), kd.Air()
COAL = 1e-6
"""Relative error of differences of coal's distances, which are iterated."""


@pytest.fixture(scope="module")
def variables():
    contact = kd.Contact(restitution=0.8, friction=0.4)
    return KickVariables(G1, impact_target_for((4.0, 1.0, 2.0), np.zeros(3), BALL, contact))


def compare_slopes(term, variables, q):
    """Compare the slopes of the distances with central differences."""
    differences = [
        (
            term.residual(variables.posture(q + step), None)
            - term.residual(variables.posture(q - step), None)
        )
        / 2e-6
        for step in 1e-6 * np.eye(variables.n)
    ]
    slopes = term.derivatives(variables.posture(q), None)[0][:, variables.vs]
    agrees(slopes, np.transpose(differences), COAL)


def test_slopes_to_the_ball_are_those_of_the_distances(variables):
    term = BodyClearance(G1, variables, bodies_near_ball(G1))
    for q in np.random.default_rng(1).uniform(-0.3, 0.5, (3, variables.n)):
        compare_slopes(term, variables, q)


def test_slopes_between_bodies_are_those_of_the_distances(variables):
    """Of legs beside and inside each other, and of a foot and a thigh that move with one chain."""
    pairs = [("left_knee_link", "right_knee_link"), ("right_ankle_roll_link", "left_hip_yaw_link")]
    pairs.append(("right_hip_yaw_link", "right_ankle_roll_link"))
    bodies = [tuple(bodies_at(G1, frame)[0] for frame in pair) for pair in pairs]
    term = BodyClearance(G1, variables, bodies)
    q, values = np.zeros(variables.n), []
    for roll, bend in ((-0.2, 0.6), (0.2, 0.8), (0.45, 0.5)):
        q[1], q[3] = roll, bend
        values.append(term.residual(variables.posture(q), None)[0])
        compare_slopes(term, variables, q)
    assert min(values) < 0 < max(values)


def test_the_distance_of_a_sphere_from_the_ball_is_that_of_their_centres(tmp_path):
    (tmp_path / "leg.xml").write_text(
        '<mujoco><worldbody><body name="shank" pos="0 0 1">'
        '<joint name="knee" type="hinge" axis="0 -1 0" range="-90 90"/>'
        '<geom type="sphere" size="0.04" pos="0 0 -0.7"/>'
        '<body name="foot" pos="0 0 -0.9"><geom type="sphere" size="0.03"/></body></body>'
        "</worldbody></mujoco>"
    )
    leg = kd.Leg.from_mjcf(tmp_path / "leg.xml", "foot")
    contact = kd.Contact(restitution=0.8, friction=0.4, offset=(0.03, 0, 0))
    target = impact_target_for((5.0, 0.0, 0.0), np.zeros(3), BALL, contact)
    variables = KickVariables(leg, target)
    term = BodyClearance(leg, variables, [(bodies_at(leg, "shank")[0], None)])
    for angle in (-0.4, 0.0, 0.5):
        posture = variables.posture(np.array([angle]))
        rotation = posture.rotation_world_joint
        centre = posture.contact_point + BALL.radius * target.contact.normal
        apart = np.linalg.norm(centre - ([0, 0, 1] + rotation @ [0, 0, -0.7]))
        depth = 0.04 + BALL.radius - apart
        assert term.residual(posture, None) == pytest.approx([TOUCHING - RESERVE - depth], abs=1e-9)


@cache
def hulls(leg):
    """Return the hulls of the meshes' vertices, each with its frame."""
    return [
        (frame, number, ConvexHull(centres))
        for frame, number in body_frames(leg).items()
        for centres, radii in shapes_of(leg, frame)
        if not radii.any()
    ]


def placed(leg, q):
    """Return vertices and half spaces of the hulls in the world, with frame and joint."""
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
    """Return how deep the deepest of some points is in a hull; below 0, none is."""
    return -(half_spaces[:, :3] @ points.T + half_spaces[:, 3:]).max(axis=0).min()


def overlaps(leg, q):
    """Return frames of which a vertex of one is deep inside the other, neighbours left out."""
    parents, pairs = leg.model.parents, set()
    for (one, first, points, _), (other, second, corners, faces) in permutations(placed(leg, q), 2):
        low, high = corners.min(axis=0), corners.max(axis=0)
        near = points[((points > low) & (points < high)).all(axis=1)]
        if (
            first != second
            and first != parents[second]
            and second != parents[first]
            and len(near)
            and deepest(near, faces) > TOUCHING
        ):
            pairs.add(frozenset((one, other)))
    return pairs


@pytest.mark.slow
def test_no_plan_is_met_with_a_body_inside_the_ball_or_another_body():
    """Of drawn kicks to the side, a fifth of which would put the hand into the hip."""
    leg, draw = kd.Leg.from_robot("g1", "inside", legs_only=True), np.random.default_rng(3)
    at_rest, met = overlaps(leg, leg.configuration()), 0
    for _ in range(5):
        azimuth, distance = np.radians(draw.uniform(50, 130)), draw.uniform(0.5, 3.0)
        target = (distance * np.cos(azimuth), distance * np.sin(azimuth), 0)
        plan = kd.plan_kick(leg, kd.Goal(target, time=draw.uniform(0.4, 0.7)), BALL, AIR)
        if plan.status == "met":
            met += 1
            assert find_self_collisions(leg, plan.q) == {}
            assert overlaps(leg, plan.q) <= at_rest
            centre, radius = plan.impact.ball_before.position, plan.impact.ball.radius
            for _, _, points, faces in placed(leg, plan.q):
                assert radius - np.linalg.norm(points - centre, axis=1).min() < TOUCHING
                assert deepest(centre[None], faces) < 0
    assert met > 2


@pytest.mark.slow
def test_a_contact_point_inside_the_foot_is_never_met():
    """The origin of the ankle: whichever way the foot turns, the ball is in it."""
    ankle = kd.Leg.from_robot("g1", "right_ankle_roll_link", legs_only=True)
    plan = kd.plan_kick(ankle, kd.Goal((4, 1, 0), time=0.8), BALL, AIR)
    assert plan.status == "collides"
    assert any("right_ankle_roll_link by" in line for line in plan.collisions)


def test_a_leg_without_shapes_has_no_bodies():
    assert bodies_near_ball(kd.Leg.from_model(G1.model, "toe")) == []
