"""Bodies of a robot stay out of the ball and of each other: slopes and distances."""

import numpy as np
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.motion.impact_target import impact_target_for
from kickdyn.planning.ball_clearance import RESERVE, BodyClearance
from kickdyn.planning.kick_terms import KickVariables
from kickdyn.robot.collisions import TOUCHING, bodies_at

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
        (value,) = term.residual(posture, None)
        assert value == pytest.approx(TOUCHING - RESERVE - depth, abs=closed_form(1e4))
