"""Limits of the ground by wrenches of known forces, and of bodies by known places."""

import math
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from kickdyn.errors import InvalidInput
from kickdyn.motion.kick_task import check_sole
from kickdyn.motion.limits import (
    Apart,
    Clearance,
    Friction,
    Impulse,
    Pressure,
    PressureCentre,
    RestingTorqueLimit,
    Sample,
    Tilt,
    Twist,
)
from kickdyn.robot.ground_clearance import Spheres

MIDDLE, MU, WEIGHT = np.array([0.3, -0.2]), 0.6, 400.0
SOLE = MIDDLE + np.array([(0.1, 0.05), (0.1, -0.05), (-0.1, -0.05), (-0.1, 0.05)])
STANDING = SimpleNamespace(sole=SOLE)


def ground(force, place, twist=0.0):
    """Return a force of the ground at a place (x, y), and a moment about the vertical there."""
    moment = np.cross([*place, 0.0], force) + np.array([0.0, 0.0, twist])
    return SimpleNamespace(wrench=ca.DM([*force, *moment]), size=WEIGHT)


def margins(limit, sample):
    values = np.array(ca.DM(limit.margins(sample))).ravel()
    assert len(values) == len(limit.labels)
    return values


def test_the_ground_presses():
    sample = ground((30.0, -20.0, 100.0), MIDDLE)
    assert margins(Pressure(0.05), sample) == pytest.approx([100 / WEIGHT - 0.05])


@pytest.mark.parametrize("facet", range(8))
def test_friction_is_limited_by_the_pyramid_inside_the_cone(facet):
    """Along the middle of a facet, and along an edge, where the pyramid touches the cone."""
    for turn, touches in ((0.0, MU * math.cos(math.pi / 8)), (math.pi / 8, MU)):
        angle = 2 * math.pi * facet / 8 + turn
        for share in (0.9, 1.1):
            across = 200.0 * share * touches * np.array([math.cos(angle), math.sin(angle)])
            least = margins(Friction(MU), ground((*across, 200.0), MIDDLE)).min()
            assert least == pytest.approx((1 - share) * MU * math.cos(math.pi / 8), abs=1e-12)


@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.07, 0.0), (-0.02, 0.04), (0.12, 0.0)])
def test_the_centre_of_pressure_has_its_distances_from_the_edges(aside):
    place = MIDDLE + aside
    shown = margins(PressureCentre(STANDING), ground((0.0, 0.0, 300.0), place))
    x, y = aside
    assert sorted(shown) == pytest.approx(sorted([0.1 - x, 0.1 + x, 0.05 - y, 0.05 + y]))
    pulled = margins(PressureCentre(STANDING), ground((50.0, -30.0, 300.0), place, 9.0))
    assert pulled == pytest.approx(shown)  # forces in the plane of the sole do not move it


@pytest.mark.parametrize("twist", [0.0, 3.0, -5.0])
@pytest.mark.parametrize("force", [(0.0, 0.0, 300.0), (50.0, -30.0, 300.0), (-20.0, 90.0, 300.0)])
def test_the_moment_about_the_vertical_is_that_about_the_middle_of_the_sole(force, twist):
    arm = 0.5 * MU * math.hypot(0.1, 0.05)
    shown = margins(Twist(STANDING, MU), ground(force, MIDDLE, twist))
    assert shown == pytest.approx([arm - twist / 300, arm + twist / 300])


def test_the_impulse_of_the_ground_has_the_same_limits():
    sample, limit = ground((50.0, -30.0, 300.0), MIDDLE + 0.02, 3.0), Twist(STANDING, MU)
    assert margins(Impulse(limit), sample) == pytest.approx(margins(limit, sample))
    assert Impulse(limit).labels[0] == f"{limit.labels[0]} in the impact"


def test_the_torque_of_a_joint_at_rest_is_a_share_of_its_limit():
    limit = RestingTorqueLimit(("elbow",), np.array([4.0]), [1])
    sample = Sample(None, ca.DM([99.0]), None, 1.0, ca.DM([9.0, -3.0]))
    assert margins(limit, sample) == pytest.approx([0.25])
    row, lowest, highest = limit.rows(sample)
    assert float(row) == pytest.approx(-0.75)
    assert (lowest, highest) == (-0.99, 0.99)


def test_bodies_are_above_the_ground_and_beside_the_supporting_foot():
    centres, radii = np.array([(0.1, 0.2, 0.3), (0.4, -0.1, 0.05)]), np.array([0.04, 0.02])
    spheres, tree = Spheres(centres, radii), SimpleNamespace(point=lambda joint, centre: centre)
    sample = SimpleNamespace(tree=tree)
    assert margins(Clearance("foot", 1, spheres), sample) == pytest.approx([0.26, 0.03])
    right = margins(Apart("foot", 1, spheres, edge=0.25, side=-1.0), sample)
    assert right == pytest.approx([0.05 - 0.04, 0.35 - 0.02])
    left = margins(Apart("foot", 1, spheres, edge=-0.15, side=1.0), sample)
    assert left == pytest.approx([0.35 - 0.04, 0.05 - 0.02])


@pytest.mark.parametrize(("degrees", "kept"), [(0, True), (39.9, True), (40.1, False)])
def test_the_trunk_may_be_tilted_by_40_degrees(degrees, kept):
    turn = math.radians(degrees)
    rotation = ca.DM([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0],
                      [-math.sin(turn), 0, math.cos(turn)]])  # fmt: skip
    tree = SimpleNamespace(rotation=lambda joint: rotation)
    (margin,) = margins(Tilt(1, np.array([0.0, 0.0, 1.0])), SimpleNamespace(tree=tree))
    assert bool(margin >= 0.0) is kept


def test_a_sole_without_room_for_the_centre_of_pressure_is_refused():
    support = SimpleNamespace(frame="foot")
    wide, narrow = (np.array([(x, y) for x in (0, 0.2) for y in (0, w)]) for w in (0.0141, 0.0139))
    check_sole(SimpleNamespace(sole=wide, support=support))
    with pytest.raises(InvalidInput, match=r"sole of foot is 13\.9 mm wide: .* wider than 14 mm"):
        check_sole(SimpleNamespace(sole=narrow, support=support))
