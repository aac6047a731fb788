"""What an impact computes when it is read: the same, whenever and wherever that is."""

import copy
import dataclasses
import pickle
import re
import threading

import numpy as np
import pytest
from chains import any_kick

import kickdyn as kd
from kickdyn.core.representation import format_value

ARM = kd.Leg.from_robot("g1", base="floating")
LEGS = {"human": kd.Leg.human(), "g1": ARM, "g1 held": ARM.with_supports("left_ankle_roll_link")}
NUMBERS = (
    *("impulse", "effective_mass", "foot_velocity", "approach_speed", "ball_before", "ball_after"),
    *("v_before", "v_after", "joint_impulses", "constraint_impulses", "energy_lost", "sticking"),
    *("restitution_residual", "momentum_residual"),
)


def parts(hit):
    """All numbers, of balls too."""
    found = {}
    for name in NUMBERS:
        value = getattr(hit, name)
        states = isinstance(value, kd.BallState)
        for part in ("position", "velocity", "spin") if states else ("",):
            found[name + part] = getattr(value, part) if part else value
    return found


def same(one, two):
    assert one.keys() == two.keys()
    assert all(np.array_equal(one[name], two[name]) for name in one)


def strike(name, seed=3):
    kick, options = any_kick(np.random.default_rng(seed), LEGS[name], friction=0.4)
    return kd.strike(*kick, **options)


@pytest.mark.parametrize("name", LEGS)
def test_read_after_another_strike(name):
    at_once, later = parts(strike(name)), strike(name)
    kept = copy.deepcopy(at_once)
    parts(strike(name, seed=4))  # in the same workspace
    same(at_once, kept)
    same(parts(later), kept)


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("first", NUMBERS)
def test_in_any_order(name, first):
    hit = strike(name)
    value = getattr(hit, first)
    again = getattr(hit, first)
    assert again is value or again == value
    same(parts(hit), parts(strike(name)))


@pytest.mark.parametrize("name", LEGS)
def test_in_another_thread(name):
    hit, found = strike(name), []
    thread = threading.Thread(target=lambda: found.append(parts(hit)))
    thread.start()
    thread.join()
    same(found[0], parts(strike(name)))


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("again", [copy.copy, lambda hit: pickle.loads(pickle.dumps(hit))])
def test_copies_have_the_same_digits(name, again):
    other = again(strike(name))
    same(parts(other), parts(strike(name)))
    assert repr(other) == repr(strike(name))


def test_all_attributes_are_listed_before_they_are_read():
    assert set(NUMBERS) <= set(dir(strike("human")))


def test_what_is_read_cannot_be_written():
    hit = strike("human")
    for name, value in parts(hit).items():
        if isinstance(value, np.ndarray):
            assert not value.flags.writeable, name
    with pytest.raises(dataclasses.FrozenInstanceError):
        hit.v_after = 0
    with pytest.raises(AttributeError, match="'Impact' object has no attribute 'v_afer'"):
        _ = hit.v_afer


def test_residuals_that_are_rounding_show_no_digits():
    hit = strike("human")
    assert 0.0 < max(hit.restitution_residual, hit.momentum_residual) < 1e-14
    assert "  residuals             below 1e-14\n" in repr(hit)
    for worse in (2.5e-9, 1e-14, np.nan):
        vars(hit)["leg_response"] = hit.leg_response._replace(momentum_residual=worse)
        assert f", {worse:.4g})\n" in repr(hit)


@pytest.mark.parametrize(("share", "creates"), [(1e-13, False), (1e-11, True)])
def test_energy_within_the_rounding_of_a_fast_spin_is_not_created(share, creates):
    posture, ball = kd.Leg.human().posture([0.1, 0.2, 0.3]), kd.Ball()
    v, contact = posture.joint_velocity((3, 0, 1)), kd.Contact((3, 0, 1), 0.8, 0.4)
    hit = kd.strike(posture, v, ball, contact, ball_spin=(0.0, 1e6, 0.0))
    gained = share * float(np.abs(hit.impulse).max()) * ball.radius * 1e6
    solution = hit.solution._replace(energy_lost=-gained)
    assert dataclasses.replace(hit, solution=solution).creates_energy is creates


def test_digits_of_an_ordinary_kick_are_these():
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    contact = kd.Contact([0.9, 0, 0.4], 0.8, 0.4)
    hit = kd.strike(posture, posture.joint_velocity([8, 0, 4]), kd.Ball(), contact)
    assert hit.digits == pytest.approx(14.3472, abs=1e-4)
    # estimated from rounding itself, which depends on the BLAS of the processor
    assert hit.joint_digits == pytest.approx([12.589, 12.878, 13.272], abs=0.01)


def printed(result):
    """Texts of value and unit by name, as `print` shows them."""
    lines = [line.strip() for line in repr(result).splitlines()[1:]]
    return dict(re.split(r"  +", line, maxsplit=1) for line in lines)


def test_what_is_printed_are_the_attributes_in_these_units():
    kick, options = any_kick(np.random.default_rng(3), LEGS["human"], friction=0.4)
    hit = kd.strike(*kick, **options)
    text = printed(hit)
    joint, most = hit.worst_joint
    sizes = np.linalg.norm(hit.joint_impulses[:, :3], axis=1)
    assert joint == hit.posture.leg.joint_names[int(np.argmax(sizes))]
    assert most == sizes.max()
    for name, value, unit in (
        ("impulse on the ball", hit.impulse, "N s"),
        ("effective mass", hit.effective_mass, "kg"),
        ("foot before", hit.posture.jacobian @ kick[1], "m/s"),
        ("ball after", hit.ball_after.velocity, "m/s"),
        ("spin after", hit.ball_after.spin, "rad/s"),
        ("ball over foot speed", hit.ball_after.speed / np.linalg.norm(hit.foot_velocity), ""),
        (f"worst joint, {joint}", most, "N s"),
        ("energy lost", hit.energy_lost, "J"),
        ("condition", hit.posture.condition, ""),
    ):
        assert text[name] == f"{format_value(value)} {unit}".rstrip(), name


def test_what_is_printed_of_a_contact_that_takes_time():
    hit = kd.collide(*any_kick(np.random.default_rng(3), LEGS["human"], restitution=0.7)[0])
    text = printed(hit)
    for name, value, unit in (
        ("contact time", 1e3 * hit.contact_time, "ms"),
        ("visible contact time", 1e3 * hit.visible_contact_time, "ms"),
        ("peak force", hit.peak_force, "N"),
        ("deflection", 1e3 * hit.deflection, "mm"),
        ("impulse on the ball", hit.impulse, "N s"),
        ("ball after", hit.ball_after.velocity, "m/s"),
        ("spin after", hit.ball_after.spin, "rad/s"),
        ("energy lost", hit.energy_lost, "J"),
    ):
        assert text[name] == f"{format_value(value)} {unit}", name
