import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.heading import heading_for, turned


def about_z(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def test_a_turned_leg_is_the_leg_in_turned_axes():
    leg, turn = kd.Leg.human(), about_z(0.3)
    q = [0.4, -0.7, 0.2]
    plain, other = leg.posture(q), turned(leg, 0.3).posture(q)
    assert other.contact_point == pytest.approx(turn @ plain.contact_point, abs=1e-15)
    assert other.jacobian == pytest.approx(turn @ plain.jacobian, abs=1e-15)
    assert other.inertia == pytest.approx(plain.inertia, abs=1e-15)
    model = turned(leg, 0.3).model
    base = next(f for f in model.frames if f.parentJoint == 0 and f.name != "universe")
    assert base.placement.rotation == pytest.approx(turn)
    assert model.gravity.linear == pytest.approx(leg.model.gravity.linear)


def test_the_way_into_the_plane():
    plane = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    assert heading_for(plane, np.array([1.0, 1, 5])) == pytest.approx(math.pi / 4)
    assert heading_for(-plane[::-1], np.array([1.0, -1, 5])) == pytest.approx(-math.pi / 4)
    tilted = np.array([[1.0, 0, 0], [0, math.sin(0.1), math.cos(0.1)]])
    assert heading_for(tilted, np.array([1.0, 1, 0])) is None
    assert heading_for(np.eye(3), np.array([1.0, 1, 0])) is None
    assert heading_for(plane, np.array([0.0, 0, 1])) is None
