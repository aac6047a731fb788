"""The load of each joint: its parts on structure and axis, and the peak of a half sine."""

import math

import numpy as np
import pinocchio as pin
import pytest
from chains import at, rails, random_kick, serial
from scipy.integrate import quad
from tolerances import agrees, closed_form

import kickdyn as kd

LEG = kd.Leg.human()


def strike(leg=LEG, seed=3, maker=random_kick):
    kick, options = maker(np.random.default_rng(seed), leg, friction=0.4)
    return kd.strike(*kick, **options)


def test_parts_add_up_and_only_rotors_act_along_the_axis():
    """A rotor of 0.05 kg m2 at the knee takes its change of angular momentum from the axis."""
    impact = strike(LEG.with_armature({"knee": 0.05}))
    loads = kd.joint_loads(impact)
    assert list(loads) == ["hip", "knee", "ankle"]
    scale = np.abs(impact.joint_impulses).max()
    knee = -0.05 * (impact.v_after - impact.v_before)[1]
    for load, impulse, turning in zip(
        loads.values(), impact.joint_impulses, (0, knee, 0), strict=True
    ):
        agrees(load.structure + load.axis, impulse, closed_form())
        tolerance = closed_form(10) * scale
        np.testing.assert_allclose(load.structure[4], 0, atol=tolerance)  # all axes are y
        assert load.axis == pytest.approx(turning * np.eye(6)[4], abs=tolerance)
        assert load.peak_force is load.peak_moment is None


def test_axes_are_those_of_the_impacts_posture():
    """A universal joint's second axis turns with its first angle; the leg has moved since."""
    universal = pin.JointModelUniversal(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    place, body = at(0, 0, -0.4), pin.Inertia(2.0, np.array([0, 0.05, -0.2]), 0.02 * np.eye(3))
    joints = ("hip", universal, place, body), ("knee", pin.JointModelRY(), place, body)
    leg = kd.Leg.from_model(serial(joints, place), "toe")
    posture = leg.posture([0.7, -0.4, 0.5])
    v = posture.joint_velocity((3.0, 1.0, 0.5))
    impact = kd.strike(posture, v, kd.Ball(), kd.Contact((3.0, 1.0, 0.5), 0.8))
    assert impact.joint_impulses.any()  # computed, and kept
    leg.posture([-0.9, 0.8, 0.1])
    hip = kd.joint_loads(impact)["hip"]
    assert np.linalg.norm(hip.structure[3:]) > 1e-2
    np.testing.assert_allclose(hip.axis, 0.0, atol=closed_form(10))  # passive


def test_the_peak_is_that_of_half_a_sine_with_the_same_impulse():
    impact, time = strike(), 0.010
    loads = kd.joint_loads(impact, time)
    sine, _ = quad(lambda t: math.sin(math.pi * t / time), 0, time)
    for load, impulse in zip(loads.values(), impact.joint_impulses, strict=True):
        linear, angular = np.linalg.norm(impulse[:3]), np.linalg.norm(impulse[3:])
        assert load.peak_force == pytest.approx(linear / sine, rel=closed_form(10))
        assert load.peak_moment == pytest.approx(angular / sine, rel=closed_form(10))


def test_a_load_shows_its_linear_parts_and_the_peak_of_both():
    """A rotor behind a slide takes its momentum along the axis; bearings take the rest."""
    leg = rails("xy").with_armature({"rail_x": 0.7})
    kick = leg.posture([0.0, 0.0]), [9.0, 2.0], kd.Ball(), kd.Contact((3, 1, 2), 0.8)
    hit = kd.strike(*kick)
    rotor = 0.7 * (9.0 - hit.v_after[0])
    linear = hit.joint_impulses[0, :3]
    across = math.hypot(linear[0] - rotor, *linear[1:])
    peak = math.pi / 2 * math.hypot(*linear) / 0.01
    text = f"JointLoad(rail_x: {across:.4g} N s, {rotor:.4g} N s along the axis, peak {peak:.4g} N)"
    assert str(kd.joint_loads(hit, 0.01)["rail_x"]) == text


@pytest.mark.parametrize(("time", "words"), [
    (0, "at least 1e-09"), (9e-10, "9e-10"), (math.nan, "nan"), (10, r"10.*at most 0\.1")
])  # fmt: skip
def test_bad_input(time, words):
    with pytest.raises(kd.InvalidInput, match=f"contact time is .*{words}"):
        kd.joint_loads(strike(), time)
    with pytest.raises(kd.InvalidInput, match="impact is None"):
        kd.joint_loads(None)
