"""What a contact that takes time really changes is less than what is said of it."""

import math

import numpy as np
import pytest
from random_scenes import random_scene

import kickdyn as kd
from kickdyn.scene.contact_drift import contact_drift
from kickdyn.scene.flight_end import CONTACT_SAFETY


def struck(scene):
    motion = {"ball_velocity": scene.ball_velocity, "ball_spin": scene.ball_spin}
    parts = (scene.posture, scene.v, scene.ball, scene.contact)
    return kd.strike(*parts, **motion), lambda tol: kd.collide(
        *parts, contact_time=scene.contact_time, stiffness=scene.stiffness,
        dissipation=scene.dissipation, tol=tol, **motion,
    )  # fmt: skip


def size(array):
    return float(np.linalg.norm(array))


def test_it_bounds_the_contact_that_takes_time():
    rng, done, used = np.random.default_rng(3), 0, 0.0
    while done < 8:
        scene = random_scene(rng, contact_time=0.01)
        try:
            hit, press = struck(scene)
        except kd.NoImpact:
            continue
        done += 1
        jump, fine, rough = contact_drift(scene, hit), press(1e-6), press(1e-3)
        moved = size(fine.ball_after.velocity - hit.ball_after.velocity)
        assert moved <= jump.velocity
        assert size(fine.ball_after.spin - hit.ball_after.spin) <= jump.spin
        assert size(fine.ball_after.position - hit.ball_after.position) <= jump.position
        used = max(used, moved / jump.velocity)
        off = size(fine.ball_after.velocity - rough.ball_after.velocity) / fine.ball_after.speed
        assert off <= CONTACT_SAFETY * 1e-3
    assert used > 0.2


def test_it_bounds_the_contact_of_an_inflated_ball():
    rng, done, known = np.random.default_rng(5), 0, 0
    while done < 8:
        kind = "walton-braun" if done % 2 else "hunt-crossley"
        options = {"ball": kd.Ball(pressure=80e3), "stiffness": "pressure", "dissipation": kind}
        scene = random_scene(rng, contact_time=None, **options)
        try:
            hit, press = struck(scene)
        except kd.NoImpact:
            continue
        done += 1
        jump = contact_drift(scene, hit)
        if kind == "hunt-crossley" and scene.contact.friction > 0.0:  # it tends to no law
            assert jump.velocity == math.inf
            continue
        moved = size(press(1e-6).ball_after.velocity - hit.ball_after.velocity)
        assert 0.0 < moved <= jump.velocity
        known += jump.velocity < math.inf
    assert known > 2


def test_what_does_not_strike_on_the_way_is_not_known():
    leg = kd.Leg.human()
    posture = leg.posture([0.5, 0.1, 0.0])
    v = posture.joint_velocity([3.0, 0.0, 0.5])
    scene = kd.Scene(leg, posture.q, v, kd.Ball(), kd.Contact((0, 0, 1), 0.7), contact_time=0.05)
    assert contact_drift(scene, struck(scene)[0]).velocity == math.inf


def test_the_estimate_of_a_kick():
    """From which a factor of safety, the creep or the weight's share cannot change unnoticed."""
    leg = kd.Leg.human()
    posture = leg.posture(np.radians([5, 10, -5]))
    v, contact = posture.joint_velocity([9, 0, 4]), kd.Contact((2, 0, 1), 0.8, 0.4)
    scene = kd.Scene(leg, posture.q, v, kd.Ball(), contact, contact_time=0.01)
    drift = contact_drift(scene, struck(scene)[0])
    assert drift.velocity == pytest.approx(3.903244851, rel=1e-8)
    assert drift.spin == pytest.approx(103.2375000, rel=1e-8)
    assert drift.position == pytest.approx(0.2205274235, rel=1e-8)
