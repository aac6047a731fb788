"""Bodies near each other and the ball, and the conditions that keep them apart."""

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.motion.separation import WITHIN, Conditions, Surroundings, with_former

LEG = kd.Leg.human()
Q = np.radians([40.0, 30.0, -20.0])


def ball_ahead(radius, distance):
    """Return a ball's centre at a distance in front of the toe [m]."""
    return LEG.posture(Q).contact_point + (radius + distance) * np.array([1.0, 0.0, 0.0])


@pytest.mark.parametrize("radius", [0.11, 0.5])
@pytest.mark.parametrize("distance", [-0.02, 0.03, 0.06, WITHIN + 0.02])
def test_a_body_is_near_the_surface_of_the_ball_not_its_centre(radius, distance):
    gaps = Surroundings(LEG, LEG, radius).gaps(Q, ball_ahead(radius, distance))
    depths = [gap.place.depth for gap in gaps]
    assert all(depth > -WITHIN for depth in depths)
    assert bool(depths) == (distance < WITHIN)
    if depths:  # the foot is round and up to 1 cm thick
        assert -distance <= max(depths) < -distance + 0.012


def test_conditions_are_of_the_nearest_points_at_the_deepest_and_the_chosen_times():
    """Of a ball that comes near and goes again."""
    surroundings, times = Surroundings(LEG, LEG, 0.11), np.arange(5.0)
    distances = (0.06, 0.04, 0.02, 0.03, 0.05)
    gaps = [surroundings.gaps(Q, ball_ahead(0.11, distance)) for distance in distances]
    gaps = [[max(near, key=lambda gap: gap.place.depth)] for near in gaps]
    chosen = np.zeros(5, bool)
    (peak,) = surroundings.conditions(gaps, times, np.tile(Q, (5, 1)), chosen)
    assert peak.times.tolist() == [2.0]
    chosen[4] = True
    (both,) = surroundings.conditions(gaps, times, np.tile(Q, (5, 1)), chosen)
    assert both.times.tolist() == [2.0, 4.0]
    joint, other = both.joints
    assert (LEG.joint_names[joint - 1], other) == ("ankle", -1)
    assert "ankle" in surroundings.label(both.joints)
    posture = LEG.posture(Q)
    pose = posture.leg.workspace.data.oMi[joint]
    for column, number in zip(both.parameters.T, (2, 4), strict=True):
        a, depth = pose.act(column[:3]), gaps[number][0].place.depth
        centre = ball_ahead(0.11, distances[number])
        assert np.linalg.norm(centre - a) == pytest.approx(0.11 - depth, abs=closed_form(1e4))
        agrees(column[6:], a - depth * (pose.rotation @ column[3:6]), closed_form(1e4))


def test_nearest_points_of_two_spheres_are_in_the_axes_of_their_joints(tmp_path):
    """Of pendulums side by side at a trunk."""
    spheres, centre = (("first", 0.0, 0.05), ("second", 0.4, 0.04)), np.array([0.0, 0.0, -0.5])
    bodies = "".join(
        f'<body name="{name}" pos="{x} 0 0"><joint name="{name}" axis="0 1 0"/>'
        f'<geom size="{radius}" pos="0 0 -0.5"/></body>'
        for name, x, radius in spheres
    )
    trunk = f'<body><joint name="trunk" axis="0 1 0"/><geom size="0.1"/>{bodies}</body>'
    (tmp_path / "leg.xml").write_text(f"<mujoco><worldbody>{trunk}</worldbody></mujoco>")
    leg, q = kd.Leg.from_mjcf(tmp_path / "leg.xml", "second"), np.array([0.1, -0.3, 0.2])
    around, always = Surroundings(leg, leg, 0.11), np.ones(1, bool)
    gaps = around.gaps(q, None)
    (found,) = around.conditions([gaps], np.zeros(1), q[None], always)
    data = leg.model.createData()
    pin.forwardKinematics(leg.model, data, q)
    way = data.oMi[3].act(centre) - data.oMi[2].act(centre)
    distance = np.linalg.norm(way)
    assert -gaps[0].place.depth == pytest.approx(distance - 0.09, rel=closed_form(1e4))
    of_first, of_second = (data.oMi[joint].rotation.T @ way / distance for joint in (2, 3))
    right = [centre + 0.05 * of_first, of_first, centre - 0.04 * of_second]
    assert found.joints == (2, 3)
    agrees(found.parameters.ravel(), np.ravel(right), closed_form(1e4))


@pytest.mark.parametrize("second", [-1, 2])
def test_points_of_former_conditions_stay_out_of_the_ball_beside_new_ones(second):
    """Conditions of two bodies hold near their configuration only: new ones replace these."""
    column = np.zeros((9, 1))
    former = Conditions((1, second), np.array([0.0, 0.1]), np.hstack([column, column]))
    new = Conditions((1, second), np.zeros(1), column + 0.05)
    (both,) = with_former([new], [former])
    assert both.times.tolist() == ([0.0, 0.0, 0.1] if second < 0 else [0.0, 0.1])
    assert with_former([new], [new])[0].times.tolist() == [0.0]
