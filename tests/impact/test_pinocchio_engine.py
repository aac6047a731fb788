"""Closed form against Pinocchio's impulseDynamics; `test_newton_law` has its cone solvers."""

import numpy as np
import pytest
from chains import random_kick, random_leg
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.impact.pinocchio_engine import strike_by_pinocchio

seeds = st.integers(0, 2**32 - 1)
LEGS = {"human": kd.Leg.human(), "testbed": kd.Leg.testbed()}


def check_same(kick, options):
    impact, peer = kd.strike(*kick, **options), strike_by_pinocchio(*kick, **options)
    tolerance = closed_form(impact.posture.condition)
    size = np.linalg.norm(peer.impulse)
    agrees(impact.impulse, peer.impulse, tolerance)
    agrees(impact.v_after, peer.v_after, tolerance)
    agrees(impact.joint_impulses, peer.joint_impulses, tolerance)
    assert impact.energy_lost == pytest.approx(peer.energy_lost, rel=tolerance)
    speed = np.abs(peer.ball_before.velocity).max() + size / impact.ball.mass
    velocities = impact.ball_after.velocity, peer.ball_after.velocity
    np.testing.assert_allclose(*velocities, atol=tolerance * speed)
    agrees(impact.ball_after.spin, peer.ball_after.spin, tolerance)
    for result in (impact, peer):
        assert result.momentum_residual <= tolerance
        assert result.restitution_residual <= 10 * tolerance


@pytest.mark.parametrize("name", [*LEGS, "chain", "offset"])
@given(seed=seeds)
@settings(max_examples=40)
def test_same_as_impulse_dynamics(name, seed):
    rng = np.random.default_rng(seed)
    (posture, v, ball, contact), options = random_kick(rng, LEGS.get(name) or random_leg(rng))
    if name == "offset":
        lever = rng.uniform(-0.2, 0.2, size=3)
        closing = posture.with_contact_offset(lever).point_velocity(v) - options["ball_velocity"]
        contact = kd.Contact(closing, rng.uniform(0, 1), 0.0, lever)
    check_same((posture, v, ball, contact), options)


def test_same_for_a_particle_with_rotors_and_on_a_base_that_moves():
    (posture, v, ball, contact), options = random_kick(np.random.default_rng(1), LEGS["human"])
    particle = kd.Ball(inertia_factor=np.inf)
    check_same((posture, v, particle, contact), options)
    geared = LEGS["human"].with_armature({"hip": 0.3, "knee": 0.2}).posture(posture.q)
    check_same((geared, v, ball, contact), options)
    bare, heavy = (kd.strike(p, v, ball, contact, **options) for p in (posture, geared))
    assert np.linalg.norm(heavy.impulse) > np.linalg.norm(bare.impulse)
    base = LEGS["human"].with_base_velocity((4, 0.3, -0.2), (0.3, -2, 1))
    kick = base.posture([0.7, 0.5, -0.3]), [6.6, -14.5, 6.6], ball, kd.Contact((2, 0, 1), 0.8)
    check_same(kick, {"ball_velocity": (1, 2, 0.5), "ball_spin": (3, 4, 5)})


def test_friction_is_refused():
    kick, options = random_kick(np.random.default_rng(1), LEGS["human"], friction=0.4)
    with pytest.raises(kd.InvalidInput, match=r"friction is 0\.4"):
        strike_by_pinocchio(*kick, **options)
