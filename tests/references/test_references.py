"""The references stand on their own: closed forms, laws to forty digits, Pinocchio to float64."""

import numpy as np
import pytest
from chains import random_kick, random_leg
from flight_methods import kicks
from tolerances import EPSILON, agrees, closed_form, integrated

import kickdyn as kd
from references import exact_flight, vector_flight
from references.exact_impact import exact_impact, given
from references.exact_leg import ExactPosture, leg_numbers, length, mp, numbers

BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")
TINY = mp.mpf(10) ** -40


@pytest.mark.parametrize("spins", [True, False])
def test_both_flights_land_alike_whatever_the_step(spins, monkeypatch):
    state, air = kicks(1)[0], AIR
    if not spins:
        state, air = kd.BallState(velocity=(24, 1, 9)), kd.Air(drag="brazuca", lift=None)
    exact = exact_flight.landing(state, BALL, air)
    _, y = vector_flight.landing(state, BALL, air)
    assert y[:2] == pytest.approx(exact[:2], abs=integrated(1e-13))
    if not spins:
        monkeypatch.setattr(exact_flight, "STEP", 0.13)
        assert exact_flight.landing(state, BALL, air) == pytest.approx(exact, abs=50 * EPSILON)


@pytest.mark.parametrize("seed", range(3))
def test_a_leg_is_that_of_pinocchio(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng)
    q = rng.uniform(-2, 2, leg.nq)
    exact, posture = ExactPosture(*leg_numbers(leg), numbers(q)), leg.posture(q)
    for name in ("inertia", "jacobian", "contact_point"):
        agrees(np.array(getattr(exact, name), dtype=float), getattr(posture, name), closed_form())
    right = numbers(rng.normal(size=leg.nv))
    solved = exact.unwhiten(exact.whiten(right))
    assert length(exact.inertia @ solved - right) < TINY


@pytest.mark.parametrize("friction", [0.0, 0.05, 2.0])
def test_restitution_cone_and_energy_hold_to_forty_digits(friction):
    rng = np.random.default_rng(1)
    args, options = random_kick(rng, random_leg(rng), friction=friction)
    hit = kd.strike(*args, **options)
    structure, scene = given(hit)
    exact = exact_impact(structure, scene)
    n = scene["normal"] / length(scene["normal"])
    before = scene["ball_velocity"] - exact["foot velocity"].exact
    after = scene | {"v": exact["joint velocity"].exact, "coefficients": numbers([0, 0])}
    relative = exact["ball velocity"].exact - exact_impact(structure, after)["foot velocity"].exact
    assert abs(n @ relative + scene["coefficients"][0] * (n @ before)) < TINY
    pressing = n @ exact["impulse"].exact
    tangential, limit = length(exact["impulse"].exact - pressing * n), pressing * numbers(friction)
    assert tangential <= limit + TINY
    if friction == 0.05:
        assert abs(tangential - limit) < TINY
    ball, states = hit.ball, ((hit.v_before, hit.ball_before), (hit.v_after, hit.ball_after))
    kinetic = [0.5 * (v @ hit.posture.inertia @ v + ball.mass * b.velocity @ b.velocity
        + ball.inertia * b.spin @ b.spin) for v, b in states]  # fmt: skip
    lost = float(exact["energy lost"].exact[0])
    assert lost == pytest.approx(kinetic[0] - kinetic[1], abs=closed_form(10) * kinetic[0])
