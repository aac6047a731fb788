"""Bodies near each other and the ball, and the conditions that keep them apart."""

import numpy as np
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


def conditions(joints, times, parameters):
    return Conditions(joints, np.array(times), np.array(parameters, float) * np.ones((9, 1)))


def test_former_conditions_stay_at_times_without_new_ones():
    new = [conditions((1, -1), [0.1, 0.3], [1.0, 3.0])]
    former = [conditions((1, -1), [0.1, 0.2], [7.0, 2.0]), conditions((2, 1), [0.5], [5.0])]
    ball, bodies = with_former(new, former)
    assert ball.times.tolist() == [0.1, 0.2, 0.3]
    assert ball.parameters[0].tolist() == [1.0, 2.0, 3.0]
    assert (bodies.joints, bodies.times.tolist()) == ((2, 1), [0.5])
