"""Limits of joints and bodies by hand; `test_motion_problem` has those of the ground."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import kickdyn as kd
from kickdyn.motion import limits as module
from kickdyn.motion.kick_task import _friction, check_sole
from kickdyn.motion.limits import Apart, Clearance, RestingTorqueLimit, Sample
from kickdyn.robot.ground_clearance import Spheres


def margins(limit, sample):
    values = np.array(ca.DM(limit.margins(sample))).ravel()
    assert len(values) == len(limit.labels)
    return values


def state(v, q=(0.0, 0.0), torque=(0.0, 0.0), resting=None):
    tree = SimpleNamespace(q=ca.DM(q), v=ca.DM(v))
    return Sample(tree, ca.DM(torque), None, 1.0, None if resting is None else ca.DM(resting))


def test_limits_of_joints_are_shares_of_their_limits():
    names, most = ("hip", "knee"), np.array([4.0, 8.0])
    sample = state((-1.0, 6.0), (0.5, -0.25), (-3.0, 2.0))
    muscles = module.MuscleTorqueLimit(names, most, np.array([2.0, 8.0]))
    # Hill 1938: (1 - u) / (1 + 4 u) of the limit at the share u of the speed limit
    hip, knee = (1 - 0.5) / (1 + 4 * 0.5), (1 - 0.75) / (1 + 4 * 0.75)
    assert margins(muscles, sample) == pytest.approx([hip - 0.75, knee - 0.25])
    resting = RestingTorqueLimit(("elbow",), np.array([4.0]), [1])
    at_rest = state((0.0, 0.0), resting=(9.0, -3.0))
    assert margins(resting, at_rest) == pytest.approx([0.25])
    row, low, high = resting.rows(at_rest)
    assert (float(row), low, high) == pytest.approx((-0.75, -0.99, 0.99))


def test_bodies_are_above_the_ground_and_beside_the_supporting_foot():
    centres, radii = np.array([(0.1, 0.2, 0.3), (0.4, -0.1, 0.05)]), np.array([0.04, 0.02])
    spheres, tree = Spheres(centres, radii), SimpleNamespace(point=lambda joint, centre: centre)
    sample = SimpleNamespace(tree=tree)
    assert margins(Clearance(1, spheres), sample) == pytest.approx([0.26, 0.03])
    right = margins(Apart(1, spheres, edge=0.25, side=-1.0), sample)
    assert right == pytest.approx([0.05 - 0.04, 0.35 - 0.02])
    left = margins(Apart(1, spheres, edge=-0.15, side=1.0), sample)
    assert left == pytest.approx([0.35 - 0.04, 0.05 - 0.02])


def test_the_width_of_a_sole_is_that_of_its_largest_circle():
    """The radius of a triangle's is twice its area over its perimeter."""
    corners = np.array([(0.0, 0.0), (0.012, 0.0), (0.0, 0.016)])
    standing = SimpleNamespace(sole=corners, support=SimpleNamespace(frame="foot"))
    with pytest.raises(kd.InvalidInput, match=r"is 8 mm wide"):
        check_sole(standing)


@pytest.mark.parametrize(("width", "is_wide_enough"), [(13.9, False), (14.1, True)])
def test_a_sole_has_room_for_its_edges_of_3_mm_and_the_solver_s_4_mm(width, is_wide_enough):
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    corners = np.array([(x, y) for x in (-0.1, 0.1) for y in (-width / 2e3, width / 2e3)])
    standing = SimpleNamespace(sole=corners @ turn.T, support=SimpleNamespace(frame="foot"))
    if is_wide_enough:
        check_sole(standing)
        assert _friction(SimpleNamespace(support=kd.Support("foot"))) == 0.7  # as plan_kick says
    else:
        with pytest.raises(kd.InvalidInput, match=r"is 13\.9 mm wide.* wider than 14 mm"):
            check_sole(standing)
