"""Feet that may leave the ground: the contact laws themselves, and the fixed foot as a limit."""

import dataclasses

import numpy as np
import pytest
from chains import constraint_speed, kinetic_energy
from tolerances import agrees, closed_form, optimized

import kickdyn as kd

FOOT, OTHER = "left_ankle_roll_link", "right_ankle_roll_link"
SOLE = [(x, y, -0.035) for x in (-0.05, 0.12) for y in (-0.03, 0.03)]
ROBOT = kd.Leg.from_robot("g1", OTHER, base="floating", drives=False)
Q = {"right_hip_pitch_joint": -0.4, "right_knee_joint": 0.6, "left_knee_joint": 0.3}
Q["left_ankle_pitch_joint"] = -0.3  # the sole is level


def stance(friction=0.6, scale=1.0, **options):
    options = {"sole": scale * np.array(SOLE), **options}
    return ROBOT.with_supports(kd.Support(FOOT, friction=friction, **options))


def kick(leg, wish=(4.0, 0.5, 1.0), normal=None, friction=0.3, e=0.7, offset=None):
    posture = leg.posture(leg.configuration(Q))
    contact = kd.Contact(wish if normal is None else normal, e, friction, offset)
    return posture, posture.joint_velocity(wish), kd.Ball(), contact


KICKS = {
    "forward": kick(stance()),
    "down": kick(stance(), (1, 0, -4)),
    "up": kick(stance(), (1, 0, 4)),
    "sideways": kick(stance(), (1, 4, 0), (1, 3, 0.5)),
    "slippery": kick(stance(0.05), (4, 0, 0.3)),
    "frictionless": kick(stance(0.0), (4, 0, -1), friction=0.0),
    "down, large foot": kick(stance(0.6, 3), (1, 0, -4)),
    "point foot": kick(stance(sole=None, point=True), (3, 0, 2)),
    "instep": kick(stance(), offset=(0.05, 0.01, 0.02)),
}
OPTIONS = {"ball_velocity": (-1.0, 0.2, 0.0), "ball_spin": (3.0, -20.0, 1.0)}


def corner_levers(impact):
    (support,) = impact.posture.leg.constraints.supports
    (block,) = impact.posture.constraint_projector.blocks
    return np.zeros((1, 3)) if support.sole is None else support.sole @ block.rotation_world_frame.T


def check_coulomb(tangential, pressing, friction, sliding, scale, speed):
    assert np.linalg.norm(tangential) <= friction * pressing + optimized(1e-10) * scale
    slip = np.linalg.norm(sliding)
    if slip > 1e-6 * speed:  # friction is full, and opposes the sliding
        opposed = -friction * pressing * sliding
        near = optimized(1e-9) * scale * speed
        assert tangential * slip == pytest.approx(opposed, abs=near)


@pytest.mark.parametrize("name", KICKS)
def test_contact_laws_hold_after_the_impact(name):
    """Signorini and Coulomb at ground and ball, from v_after and the impulses alone."""
    _, v, ball, contact = KICKS[name]
    impact = kd.unilateral_strike(*KICKS[name], **OPTIONS)
    posture, n = impact.posture, contact.normal
    scale, speed = np.linalg.norm(impact.impulse), impact.approach_speed
    rows = posture.constraint_projector.rows @ impact.v_after
    assert impact.cone_residual <= optimized(1e-12)
    corners = corner_levers(impact), impact.solution.impulses[1:], impact.point_velocities[FOOT]
    for lever, p, u in zip(*corners, strict=True):
        velocity = rows[:3] + (np.cross(rows[3:], lever) if len(rows) == 6 else 0)
        assert u == pytest.approx(velocity, abs=closed_form(1e3) * speed)
        assert u[2] >= -optimized(1e-10) * speed
        assert p[2] >= -optimized(1e-10) * scale
        assert abs(u[2] * p[2]) <= optimized(1e-10) * speed * scale
        friction = posture.leg.constraints.supports[0].friction
        check_coulomb(p[:2], p[2], friction, u[:2], scale, speed)
    state, pressing = impact.ball_after, impact.impulse @ n
    surface = state.velocity - ball.radius * np.cross(state.spin, n)
    slip = surface - posture.jacobian @ impact.v_after
    tangential = impact.impulse - pressing * n
    sliding = slip - (slip @ n) * n
    check_coulomb(tangential, pressing, contact.friction, sliding, scale, speed)
    slow = [np.hypot(*u[:2]) < 1e-9 * speed for u in (*impact.point_velocities[FOOT],)]
    stuck = np.linalg.norm(sliding) < 1e-9 * speed
    assert impact.sticking is bool(stuck and contact.friction)
    assert impact.solution.sticking[1:] == tuple(bool(x and friction) for x in slow)
    assert impact.restitution_residual <= optimized(1e-10)
    assert impact.momentum_residual <= closed_form(100)
    assert np.abs(impact.joint_impulses[0]).max() < closed_form(100) * scale  # the base
    energy = kinetic_energy(posture, v, ball, impact.ball_before)
    lost = energy - kinetic_energy(posture, impact.v_after, ball, state)
    assert 0.0 < impact.energy_lost == pytest.approx(lost, abs=closed_form(100) * energy)


def both(name):
    return kd.strike(*KICKS[name], **OPTIONS), kd.unilateral_strike(*KICKS[name], **OPTIONS)


def test_a_foot_that_the_ground_can_hold_is_fixed():
    held, loose = both("down, large foot")
    assert held.footing == loose.footing == {FOOT: "stands"}
    agrees(loose.v_after, held.v_after, optimized(1e-10))
    agrees(loose.impulse, held.impulse, optimized(1e-10))
    agrees(loose.support_impulses[FOOT], held.support_impulses[FOOT], optimized(1e-9))


@pytest.mark.parametrize("name", [name for name in KICKS if "down" not in name])
def test_a_foot_that_the_ground_cannot_hold_moves(name):
    held, loose = both(name)
    assert held.footing[FOOT] != "stands"
    assert loose.footing[FOOT] != "stands"
    assert constraint_speed(loose) > 1e-4
    assert constraint_speed(held) < closed_form(100)


def test_footing_by_the_velocities_of_the_corners():
    _, loose = both("forward")
    rise, slide = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    for velocities, motion in (
        (np.zeros((4, 3)), "stands"),
        (0.9e-9 * loose.approach_speed * np.tile(slide + rise, (4, 1)), "stands"),
        (1.1e-9 * loose.approach_speed * np.tile(slide, (4, 1)), "slips"),
        (np.tile(slide, (4, 1)), "slips"),
        (np.outer([1, 1, 0, 0], rise), "tips"),
        (np.tile(rise + slide, (4, 1)), "lifts-off"),
    ):
        impact = dataclasses.replace(loose, point_velocities={FOOT: velocities})
        assert impact.footing == {FOOT: motion}


def test_the_effective_mass_is_that_of_the_leg_without_supports():
    held, loose = both("instep")
    contact = KICKS["instep"][3]
    free = ROBOT.posture(held.posture.q).with_contact_offset(contact.offset)
    right = free.effective_mass(contact.normal)
    assert loose.effective_mass == pytest.approx(right, rel=closed_form(10))
    assert loose.effective_mass < 0.9999 * held.effective_mass


def test_digits_are_no_more_than_the_solver_leaves():
    _, loose = both("forward")
    rough = dataclasses.replace(loose, solution=loose.solution._replace(residual=1e-6))
    assert loose.digits > 10
    assert rough.digits == pytest.approx(6.0, abs=closed_form(1e5))
    assert rough.joint_digits.max() < 6.0 + closed_form()


@pytest.mark.parametrize("order", [(FOOT, OTHER), (OTHER, FOOT)])
def test_two_feet_with_a_friction_each(order):
    """Named in either order; the impulses at every corner are inside the cone of that foot."""
    hands = kd.Leg.from_robot("g1", "right_rubber_hand", base="floating")
    q = hands.configuration({**Q, "right_ankle_pitch_joint": -0.2})  # that sole is level, too
    frictions = {FOOT: 0.9, OTHER: 0.05}
    supports = [kd.Support(name, friction=frictions[name], sole=SOLE) for name in order]
    leg = hands.with_supports(*supports)
    v, contact = leg.posture(q).joint_velocity((3, 1, 1)), kd.Contact((3, 1, 1), 0.7, 0.3)
    impact = kd.unilateral_strike(leg.posture(q), v, kd.Ball(), contact)
    assert impact.cone_residual <= optimized(1e-11)
    assert impact.momentum_residual <= closed_form(100)
    corners = impact.solution.impulses[1:].reshape(2, 4, 3)
    for name, impulses in zip(order, corners, strict=True):
        excess = np.hypot(*impulses[:, :2].T) - frictions[name] * impulses[:, 2]
        assert excess.max() < optimized(1e-10), name
        agrees(impact.support_impulses[name][:3], impulses.sum(axis=0), closed_form(10))
    x, y, z = impact.support_impulses[FOOT][:3]
    assert np.hypot(x, y) > 0.06 * z


TILTED = kd.Support(FOOT, friction=0.6, sole=[(1, 0, 0), (0, 1, 1), (0, 0, 0)])


@pytest.mark.parametrize(("leg", "law", "words"), [
    (ROBOT, "newton", "no supports"),
    (ROBOT.with_supports(FOOT), "newton", f"{FOOT} has no friction"),
    (ROBOT.with_supports(kd.Support(FOOT, friction=0.5)), "newton", f"{FOOT} has no sole"),
    (ROBOT.with_supports(TILTED), "newton", f"sole of {FOOT} is tilted"),
    (stance(), "paper", "'paper'.* 5 .*'newton'"),
    (stance(), "stronge", "'stronge'.* 5 .*'newton'"), (stance(), 3, "law is 3")])  # fmt: skip
def test_bad_input(leg, law, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.unilateral_strike(*kick(leg), law)


def test_an_answer_that_misses_the_laws_is_refused(monkeypatch):
    monkeypatch.setattr("kickdyn.impact.newton_law.MAX_RESIDUAL", 0.0)
    with pytest.raises(kd.KickdynError, match="no impulses found at 5 contacts"):
        kd.unilateral_strike(*KICKS["forward"])
