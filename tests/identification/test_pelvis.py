"""The pelvis of OpenSim as a floating base: axes, signs, the hip's place, and a whole motion."""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.identification.pelvis import PELVIS, base_configurations

PERSON = {"height": 1.7, "mass": 60, "sex": "female", "model": "3d"}
LEG = kd.Leg.human(**PERSON, base="floating")


def pose(leg=LEG, **coordinates):
    values = dict.fromkeys(PELVIS, 0.0) | coordinates
    (q,) = base_configurations(leg, {name: np.array([x]) for name, x in values.items()})
    return pin.XYZQUATToSE3(q)


@pytest.mark.parametrize(("side", "out"), [("right", -1.0), ("left", 1.0)])
def test_the_place_of_the_hip(side, out):
    """Of Delp et al. (1990), for a thigh and shank of 396 and 430 mm."""
    leg = kd.Leg.human(**PERSON, side=side, base="floating")
    knee, ankle = (leg.model.jointPlacements[leg.model.getJointId(n)] for n in ("knee", "ankle"))
    size = (np.linalg.norm(knee.translation) + np.linalg.norm(ankle.translation)) / 0.826
    hip = size * np.array([-0.0707, out * 0.0835, -0.0661])  # x forward, y left, z up
    upright = pose(leg, pelvis_tx=2.0, pelvis_ty=1.0, pelvis_tz=0.3)
    assert upright.translation == pytest.approx(np.array([2.0, -0.3, 1.0]) + hip)
    assert upright.rotation == pytest.approx(np.eye(3))
    backwards = pose(leg, pelvis_tilt=0.2)
    assert backwards.translation == pytest.approx(backwards.rotation @ hip)


def test_directions_and_order_of_the_turns():
    """The front rises, the right side goes down, the front turns to the left; about own axes."""
    turns = {"pelvis_tilt": 0.3, "pelvis_list": 0.2, "pelvis_rotation": 0.5}
    tilt, list_, rotation = (pose(**{name: angle}).rotation for name, angle in turns.items())
    assert tilt[:, 0] == pytest.approx([np.cos(0.3), 0.0, np.sin(0.3)])
    assert list_[:, 1] == pytest.approx([0.0, np.cos(0.2), np.sin(0.2)])
    assert rotation[:, 0] == pytest.approx([np.cos(0.5), np.sin(0.5), 0.0])
    assert pose(**turns).rotation == pytest.approx(tilt @ list_ @ rotation)


def test_the_velocities_at_a_contact_are_the_rates_of_the_coordinates():
    times = np.arange(0.0, 0.2, 1 / 240)
    rates = {"pelvis_tx": 3.5, "pelvis_ty": -0.1, "pelvis_tz": 0.2, "pelvis_tilt": 0.4}
    angles = {name: rates.get(name, 0.0) * times for name in PELVIS}
    speeds = dict(zip(LEG.single_joints, (6.0, 0.5, -1.0, -12.0, 2.0, 0.3), strict=True))
    angles |= {f"{name}_r": 0.2 + rate * (times - 0.2) for name, rate in speeds.items()}
    names = {name: f"{name}_r" for name in speeds} | {"ankle": "-ankle_r"}
    track = kd.BodyTrack(times, angles=angles)
    at = kd.fit_motion(track, LEG, angles=names, contact=0.2).at_contact()
    assert at.v[6:] == pytest.approx(list((speeds | {"ankle": -2.0}).values()), abs=1e-3)
    assert at.v[3:6] == pytest.approx([0.0, -0.4, 0.0], abs=1e-3)
    before, after = (pose(**{n: r * t for n, r in rates.items()}) for t in (0.199, 0.201))
    turn = pin.XYZQUATToSE3(at.posture.q[:7]).rotation
    velocity = (after.translation - before.translation) / 0.002
    assert turn @ at.v[:3] == pytest.approx(velocity, abs=1e-3)
    assert "pelvis_tx" in kd.fit_motion(track, kd.Leg.human(**PERSON), angles=names).warnings[0]
