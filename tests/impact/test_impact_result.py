"""What an impact computes when it is read: the same, whenever and wherever that is."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pinocchio as pin
import pytest
from chains import any_kick, at, rails, random_kick, serial
from scipy.integrate import quad
from tolerances import agrees, closed_form

import kickdyn as kd

ARM = kd.Leg.from_robot("g1", base="floating")
LEGS = {"human": kd.Leg.human(), "g1": ARM, "g1 held": ARM.with_supports("left_ankle_roll_link")}
NUMBERS = (
    *("impulse", "effective_mass", "foot_velocity", "approach_speed", "v_before", "v_after"),
    *("joint_impulses", "constraint_impulses", "energy_lost", "momentum_residual"),
)


def values(impact):
    """All numbers as lists, with the balls'."""
    numbers = {name: np.asarray(getattr(impact, name)).tolist() for name in NUMBERS}
    for name in ("ball_before", "ball_after"):
        state = getattr(impact, name)
        vectors = state.position, state.velocity, state.spin
        numbers[name] = [np.asarray(x).tolist() for x in vectors]
    return numbers


def strike(name, seed=3):
    kick, options = any_kick(np.random.default_rng(seed), LEGS[name], friction=0.4)
    return kd.strike(*kick, **options)


@pytest.mark.parametrize("name", LEGS)
def test_results_do_not_depend_on_when_and_where_they_are_read(name):
    """After another strike in the same workspace, in another order, copy or pickle."""
    expected, late = values(strike(name)), strike(name)
    values(strike(name, seed=4))
    assert values(late) == expected
    for attribute in NUMBERS:
        impact = strike(name)
        getattr(impact, attribute)
        assert values(impact) == expected, attribute
    for duplicate in (copy.copy(strike(name)), pickle.loads(pickle.dumps(strike(name)))):
        assert values(duplicate) == expected
        assert repr(duplicate) == repr(impact)


def test_results_cannot_be_written():
    impact = strike("human")
    for name in ("impulse", "v_after", "joint_impulses", "constraint_impulses", "foot_velocity"):
        assert not getattr(impact, name).flags.writeable, name
    with pytest.raises(dataclasses.FrozenInstanceError):
        impact.v_after = 0


def test_of_joints_in_one_point_the_first_one_transmits_most():
    leg, rng = kd.Leg.human(height=1.8, mass=75, model="3d"), np.random.default_rng(1)
    for _ in range(20):
        kick, options = random_kick(rng, leg)
        impact = kd.strike(*kick, **options)
        sizes = np.linalg.norm(impact.joint_impulses[:, :3], axis=1)
        first = np.flatnonzero(sizes > sizes.max() * (1 - closed_form()))[0]
        assert impact.worst_joint == (leg.joint_names[first], sizes[first])


def test_derived_results_follow_from_their_definitions():
    rng = np.random.default_rng(5)
    kick, options = random_kick(rng, kd.Leg.testbed(), friction=0.2)
    impact = kd.strike(*kick, "stronge", **options)
    posture, contact, ball = impact.posture, impact.contact, impact.ball_after
    n, foot = contact.normal, posture.jacobian @ kick[1]
    mass = 1 / (n @ posture.jacobian @ np.linalg.solve(posture.inertia, posture.jacobian.T @ n))
    parting = n @ (ball.velocity - posture.jacobian @ impact.v_after)
    closing = n @ (foot - options["ball_velocity"])
    residual = abs(parting - contact.restitution * closing) / closing
    assert impact.effective_mass == pytest.approx(mass, rel=closed_form(posture.condition))
    assert impact.speed_ratio == pytest.approx(ball.speed / np.linalg.norm(foot), rel=closed_form())
    assert impact.restitution_residual == pytest.approx(residual, abs=closed_form(10))
    assert impact.solution.residual == 0.0  # of a closed form
    assert kd.strike(posture, 0 * kick[1], *kick[2:], ball_velocity=-n).speed_ratio == np.inf


def test_the_effective_mass_of_stiff_joints_and_the_limits_of_drives():
    leg, q, wish = kd.Leg.human().with_armature({"hip": 0.1}), np.radians([5, 10, -5]), (3, 0, 1)
    kick = leg.posture(q).joint_velocity(wish), kd.Ball(), kd.Contact(wish, 0.7, 0.3)
    free, held = (kd.strike(one.posture(q), *kick) for one in (leg, leg.with_stiff_joints("knee")))
    assert held.free_effective_mass == pytest.approx(free.effective_mass, rel=closed_form(10))
    assert held.effective_mass > free.effective_mass
    assert free.motor_work == 0.0
    assert (free.drive_limit, held.drive_limit) == ("with rotors", "with rotors, stiff knee")
    limits = held.posture.effective_mass_limits(wish)
    assert all(f"limit {name}" in repr(held) for name in limits)


LEG = kd.Leg.human()


def strike_of(leg=LEG, seed=3, maker=random_kick):
    kick, options = maker(np.random.default_rng(seed), leg, friction=0.4)
    return kd.strike(*kick, **options)


def test_parts_add_up_and_only_rotors_act_along_the_axis():
    """A rotor of 0.05 kg m2 at the knee takes its change of angular momentum from the axis."""
    impact = strike_of(LEG.with_armature({"knee": 0.05}))
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
    impact, time = strike_of(), 0.010
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
        kd.joint_loads(strike_of(), time)
    with pytest.raises(kd.InvalidInput, match="impact is None"):
        kd.joint_loads(None)


@pytest.mark.parametrize("spread", [{}, {"v": 0.2, "restitution": 0.03}], ids=["bare", "spread"])
def test_bars_are_impulses_and_error_bars_their_deviations(spread):
    posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
    hit = kd.strike(posture, [6.6, -14.5, 6.6], kd.Ball(), kd.Contact((2, 0, 1), 0.8, 0.1))
    (axes,) = hit.plot(**spread).axes
    sizes = np.linalg.norm(hit.joint_impulses[:, :3], axis=1)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx(sizes)
    assert [label.get_text() for label in axes.get_yticklabels()] == ["hip", "knee", "ankle"]
    ends = [segment[:, 0] for bars in axes.collections for segment in bars.get_segments()]
    joints = hit.uncertainty(**spread).joints.values() if spread else ()
    deviations = [joint.force_deviation for joint in joints]
    assert [(end - begin) / 2 for begin, end in ends] == pytest.approx(deviations)
