"""Joints that hold in an impact, against the same joints locked."""

import pickle

import numpy as np
import pytest
from chains import kinetic_energy, random_kick, random_leg
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.impact.strike import strike_by_pinocchio

HUMAN = kd.Leg.human()
STIFF = HUMAN.with_stiff_joints("ankle")
Q = np.array([0.1, 0.4, -0.2])


@pytest.mark.parametrize("joints", [("ankle",), ("knee", "ankle"), ("hip",)])
def test_the_delassus_matrix_is_that_of_locked_joints(joints):
    values = dict(zip(HUMAN.joint_names, Q, strict=True))
    locked = HUMAN.locked({name: values[name] for name in joints})
    right = locked.posture([values[name] for name in locked.joint_names]).delassus()
    posture = HUMAN.with_stiff_joints(*joints).posture(Q)
    agrees(posture.delassus(), right, closed_form(posture.condition))
    free = HUMAN.posture(Q)
    agrees(posture.without_stiff_joints.delassus(), free.delassus(), closed_form())
    assert posture.joint_velocity([4, 0, 1]) == pytest.approx(free.joint_velocity([4, 0, 1]))
    assert posture.admissible([1.0, 2.0, 3.0]).tolist() == [1, 2, 3]  # they may move
    posture.check_velocity(np.ones(3))


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.sampled_from(["newton", "stronge"]), st.booleans())
def test_velocities_are_kept_and_momentum_and_energy_close(seed, law, is_rough):
    """Joints that move keep their speed: their motors do work on the others."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, int(rng.integers(3, 7)))
    names = rng.choice(leg.joint_names, 2, replace=False).tolist()
    stiff = leg.with_stiff_joints(*names)
    kick, options = random_kick(rng, stiff, friction=0.4 * is_rough)
    posture, v, ball, _ = kick
    hit, rounding = kd.strike(*kick, law, **options), optimized(1e-10)
    at = [leg.velocity_index(name) for name in names]
    jump, scale = hit.v_after - v, np.abs(hit.v_after).max()
    np.testing.assert_allclose(jump[at], 0.0, atol=rounding * scale)
    holding = np.zeros(leg.nv)
    holding[at] = hit.constraint_impulses
    momentum = holding - posture.jacobian.T @ hit.impulse
    size = rounding * np.abs(posture.jacobian.T @ hit.impulse).max()
    np.testing.assert_allclose(posture.inertia @ jump, momentum, rtol=0, atol=size)
    energy = kinetic_energy(posture, v, ball, hit.ball_before)
    lost = energy - kinetic_energy(posture, hit.v_after, ball, hit.ball_after)
    work = holding @ (v + hit.v_after) / 2
    assert hit.motor_work == pytest.approx(work, abs=rounding * energy)
    assert hit.energy_lost == pytest.approx(lost + work, abs=rounding * energy)
    loads = kd.joint_loads(hit)
    for name, impulse in zip(names, hit.constraint_impulses, strict=True):
        load = np.linalg.norm(loads[name].axis)
        assert abs(load - abs(impulse)) < optimized(1e-9) * np.linalg.norm(hit.impulse), name
    if not is_rough:
        engine = strike_by_pinocchio(*kick, **options)
        agrees(engine.impulse, hit.impulse, optimized(1e-8))


def test_stiff_joints_stay_until_they_are_replaced():
    for leg in (pickle.loads(pickle.dumps(STIFF)), STIFF.with_armature({"hip": 0.1}),
                STIFF.locked({"hip": 0.1}), STIFF.with_supports().with_loops()):  # fmt: skip
        assert leg.stiff_joints == ("ankle",)
    assert STIFF.with_stiff_joints().constraints is None
    assert STIFF.locked({"ankle": 0.1}).stiff_joints == ()
