"""Closed form against Pinocchio's impulseDynamics."""

import numpy as np
import pytest
from chains import random_kick, random_leg
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd

seeds = st.integers(0, 2**32 - 1)
LEGS = {"human": kd.Leg.human(), "testbed": kd.Leg.testbed()}


def assert_same(kick, options):
    hit, engine = kd.strike(*kick, **options), kd.engine_strike(*kick, **options)
    for ours, theirs in (
        (hit.impulse, engine.impulse),
        (hit.v_after, engine.v_after),
        (hit.ball_after.velocity, engine.ball_after.velocity),
        (hit.ball_after.spin, engine.ball_after.spin),
    ):
        assert np.abs(ours - theirs).max() <= 1e-12 * np.abs(theirs).max()
    assert hit.restitution_residual <= 1e-12
    assert hit.momentum_residual <= 1e-12


@pytest.mark.parametrize("name", LEGS)
@given(seed=seeds)
@settings(max_examples=1000, derandomize=True, deadline=None)
def test_same_on_our_legs(name, seed):
    assert_same(*random_kick(np.random.default_rng(seed), LEGS[name]))


@given(seed=seeds)
@settings(max_examples=1000, derandomize=True, deadline=None)
def test_same_on_random_chains(seed):
    rng = np.random.default_rng(seed)
    assert_same(*random_kick(rng, random_leg(rng)))


@pytest.mark.parametrize("seed", range(40))
def test_same_off_the_frames_origin(seed):
    rng = np.random.default_rng(seed)
    (posture, v, ball, _), options = random_kick(rng, random_leg(rng))
    assert_same(*off_centre(rng, posture, v, ball, options))


def off_centre(rng, posture, v, ball, options, friction=0.0):
    """The same kick with a point elsewhere on the foot, which approaches the ball."""
    offset = rng.uniform(-0.2, 0.2, size=3)
    closing = posture.with_contact_offset(offset).point_velocity(v) - options["ball_velocity"]
    contact = kd.Contact(closing, rng.uniform(0, 1), friction, offset)
    return (posture, v, ball, contact), options


def test_same_for_a_particle():
    (posture, v, _, contact), options = random_kick(np.random.default_rng(1), LEGS["human"])
    particle = kd.Ball(inertia_factor=np.inf)
    assert_same((posture, v, particle, contact), options)


def test_armature_is_honoured():
    model = kd.Leg.human().model
    model.armature = np.array([0.3, 0.2, 0.1])
    leg = kd.Leg.from_model(model, "toe")
    kick, options = random_kick(np.random.default_rng(1), leg)
    assert_same(kick, options)
    bare = kd.strike(kd.Leg.human().posture(kick[0].q), *kick[1:], **options)
    assert np.linalg.norm(kd.strike(*kick, **options).impulse) > np.linalg.norm(bare.impulse)


def test_friction_is_refused():
    kick, options = random_kick(np.random.default_rng(1), LEGS["human"], friction=0.4)
    with pytest.raises(kd.InvalidInput, match=r"friction is 0\.4: .*only 0"):
        kd.engine_strike(*kick, **options)


def test_separating_bodies_are_not_pulled():
    (posture, v, ball, contact), options = random_kick(np.random.default_rng(1), LEGS["human"])
    away = kd.Contact(-contact.normal, contact.restitution)
    with pytest.raises(kd.NoImpact, match="away from the ball"):
        kd.engine_strike(posture, v, ball, away, **options)
