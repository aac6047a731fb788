"""Bodies near each other and the ball, and the conditions that keep them apart."""

from itertools import pairwise

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.motion.separation import WITHIN, Surroundings
from kickdyn.robot.collisions import Placed, bodies_at
from kickdyn.robot.ground_clearance import body_frames

LEG = kd.Leg.human()
Q = np.radians([40.0, 30.0, -20.0])


def ball_ahead(radius, distance):
    """Return a ball's centre at a distance in front of the toe [m]."""
    return LEG.posture(Q).contact_point + (radius + distance) * np.array([1.0, 0.0, 0.0])


@pytest.mark.parametrize("radius", [0.11, 0.5])
def test_a_body_is_near_the_surface_of_the_ball_not_its_centre(radius):
    surroundings = Surroundings(LEG, LEG, radius)
    depths = {}
    for distance in (-0.02, 0.03, 0.06, WITHIN + 0.02):
        gaps = surroundings.gaps(Q, ball_ahead(radius, distance))
        depths[distance] = max((gap.place.depth for gap in gaps), default=None)
        assert all(gap.place.depth > -WITHIN for gap in gaps)
    assert depths.pop(WITHIN + 0.02) is None
    for distance, depth in depths.items():  # the foot is round and up to 1 cm thick
        assert -distance <= depth < -distance + 0.012


def test_conditions_hold_the_nearest_points_at_the_deepest_times():
    """Of a ball that comes near and goes again: where it is nearest, and where it is asked."""
    surroundings, times = Surroundings(LEG, LEG, 0.11), np.arange(5.0)
    distances = (0.06, 0.04, 0.02, 0.03, 0.05)
    gaps = [surroundings.gaps(Q, ball_ahead(0.11, distance)) for distance in distances]
    gaps = [[max(near, key=lambda gap: gap.place.depth)] for near in gaps]
    path = np.tile(Q, (5, 1))
    asked = np.zeros(5, bool)
    (peak,) = surroundings.conditions(gaps, times, path, asked)
    assert peak.times.tolist() == [2.0]
    asked[4] = True
    (both,) = surroundings.conditions(gaps, times, path, asked)
    assert both.times.tolist() == [2.0, 4.0]
    joint, other = both.joints
    assert (LEG.joint_names[joint - 1], other) == ("ankle", -1)
    posture = LEG.posture(Q)
    pose = posture.leg.workspace.data.oMi[joint]
    for column, distance, number in zip(both.parameters.T, (0.02, 0.05), (2, 4), strict=True):
        centre = ball_ahead(0.11, distance)
        a = pose.act(column[:3])
        depth = gaps[number][0].place.depth
        assert np.linalg.norm(centre - a) == pytest.approx(0.11 - depth, abs=1e-9)
        assert column[6:] == pytest.approx(a - depth * (pose.rotation @ column[3:6]), abs=1e-9)


def test_of_two_links_only_the_nearest_shapes_count(tmp_path):
    """A link may have dozens of shapes, and each of them would be a condition at every time.

    The long box has the largest sphere around it, and is farther away than balls are.
    """
    balls = "".join(
        f'<visual><origin xyz="{x} 0 0"/><geometry><sphere radius="0.01"/></geometry></visual>'
        for x in (0.0, 0.03, 0.06)
    )
    boxes = "".join(
        f'<visual><origin xyz="0 {y} 0"/><geometry><box size="{size} 0.002 0.002"/></geometry>'
        "</visual>"
        for y, size in ((0.02, 0.2), (-0.02, 0.15))
    )
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    links = ["base", "near", "toe"]
    text = "".join(
        f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial>{balls}{boxes}</link>'
        for name in links
    )
    for parent, child in pairwise(links):
        text += (
            f'<joint name="to_{child}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{child}"/><origin xyz="0 0 -0.02"/><axis xyz="0 0 1"/>'
            '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        )
    (tmp_path / "own.urdf").write_text(f'<robot name="own">{text}</robot>')
    leg = kd.Leg.from_urdf(tmp_path / "own.urdf", "toe", drives=False)

    q = np.array([0.3, 0.1])
    (gap,) = Surroundings(leg, leg, 0.11).gaps(q, None)
    assert gap.frames == ("base", "toe")
    placed = Placed(leg, body_frames(leg), leg.workspace.model, leg.workspace.data, q)
    depths = [
        placed.proximity(body, other).depth
        for body in bodies_at(leg, "base")
        for other in bodies_at(leg, "toe")
    ]
    assert gap.place.depth == max(depths)
