"""What an impact computes when it is read: the same, whenever and wherever that is."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from chains import any_kick, random_kick
from tolerances import closed_form

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
