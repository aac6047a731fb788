"""The force of a compliant contact alone: two masses, against closed forms."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from chains import free_body, momentum, rails, random_kick, random_leg
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from tolerances import EPSILON, agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.impact import collide as collide_module
from kickdyn.impact.force_model import (
    HERTZ,
    LINEAR,
    ForceModel,
    InflatedForce,
    hertz_stiffness,
    spring_time,
)
from kickdyn.impact.patch_contact import FootPatch
from kickdyn.restitution import SHELL_RESTITUTION


@pytest.mark.parametrize("e", [1.0, 0.7, 0.2, 0.01])
def test_contact_times_and_stiffness_by_closed_forms(e):
    """Johnson 1985, Eqs. 11.23, 11.24, with 2.9432 as gamma functions; half a period for n = 1.

    Restitution lasts e times as long as compression.
    """
    k, m, speed = 3e5, 0.37, 12.0
    crush = (5 * m * speed**2 / (4 * k)) ** 0.4
    hertz = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9) * crush / speed
    assert hertz == pytest.approx(2.9432 * crush / speed, rel=1e-4)  # digits
    time = spring_time(k, e, HERTZ, m, speed)
    assert time == pytest.approx((1 + e) / 2 * hertz, rel=closed_form())
    assert hertz_stiffness(time, m, speed, e) == pytest.approx(k, rel=closed_form())
    linear = spring_time(5e4, e, LINEAR, m, speed)
    assert linear == pytest.approx((1 + e) / 2 * math.pi * math.sqrt(m / 5e4), rel=closed_form())


@given(
    e=st.floats(0.05, 1.0),
    exponent=st.sampled_from([LINEAR, HERTZ, 1.3]),
    largest=st.floats(1e-3, 1.0),
    share=st.floats(0.1, 0.9),
)
@settings(max_examples=50)
def test_hysteresis_returns_the_square_of_the_restitution(e, exponent, largest, share):
    """e^2 of the work of compression; in restitution the force is the slope of what is stored."""
    model, k = ForceModel(5e4, e, exponent), 5e4
    work = k * largest ** (exponent + 1) / (exponent + 1)
    assert model.force(largest) == pytest.approx(k * largest**exponent, rel=closed_form())
    peak = pytest.approx(model.force(largest), rel=closed_form(1e3))
    assert model.force(largest, largest) == peak
    assert model.stored(largest) == pytest.approx(e * e * work, rel=closed_form())
    end = (1 - e * e) * largest
    assert model.separation(largest) == pytest.approx(end, rel=closed_form(), abs=EPSILON)
    assert model.force(end - 1e-6, largest) == 0.0
    deflection = end + share * (largest - end)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    forces = [model.force(end + 0.5 * (deflection - end) * (1 + x), largest) for x in nodes]
    returned = 0.5 * (deflection - end) * weights @ forces
    assert model.stored(deflection, largest) == pytest.approx(returned, rel=integrated(1e-7))


BALL = kd.Ball(pressure=80e3)
CONTACT = kd.Contact((1, 0, 0), "inflated")
WALL = 1e5
"""Mass of a foot that hardly gives way [kg]."""


@pytest.fixture
def force_of(monkeypatch):
    """Let `collide` take changed values of the force."""

    def change(**values):
        law = partial(replace, **values)
        make = classmethod(
            lambda cls, ball: law(InflatedForce(ball.mass, ball.radius, ball.pressure))
        )
        monkeypatch.setattr(collide_module.InflatedForce, "of", make)

    return change


def head_on(speed, mass=1.95, ball=BALL, contact=CONTACT, tol=1e-12, **options):
    leg = rails("x", mass)
    return kd.collide(leg.posture([0.0]), [speed], ball, contact, tol=tol, **options)


@pytest.mark.parametrize("share", [1.0, 0.6])
@pytest.mark.parametrize("speed", [4.0, 21.0])
def test_with_constant_pressure_a_wall_gives_the_restitution_of_strike(force_of, share, speed):
    force_of(gas_exponent=0.0, shell_share=share)
    ball = replace(BALL, shell_share=share)
    collision = head_on(speed, WALL, ball)
    parting = collision.ball_after.velocity[0] - collision.v_after[0]
    ratio = parting / collision.approach_speed
    assert ratio == pytest.approx(CONTACT.restitution_at(speed, ball), abs=4e-6)
    if share == 1.0:
        deflection = speed * math.sqrt(ball.mass / ball.stiffness)
        assert collision.deflection == pytest.approx(deflection, rel=ball.mass / WALL)


@pytest.mark.parametrize("seed", [0, 1, 2, 4])
@pytest.mark.parametrize("friction", [0.0, 0.3, 1.5])
def test_energy_and_impulse_are_balanced(seed, friction):
    rng = np.random.default_rng(seed)
    (posture, v, _, contact), options = random_kick(rng, random_leg(rng))
    contact = kd.Contact(contact.normal, "inflated", friction)
    collision = kd.collide(posture, v, kd.Ball(pressure=9e5), contact, tol=1e-10, **options)
    assert collision.energy_residual < integrated(1e-10)
    assert collision.energy_lost > 0.0
    nodes, weights = np.polynomial.legendre.leggauss(12)
    total, motion = np.zeros(3), collision._motion
    for begin, step in zip(motion.times, np.diff(motion.times), strict=False):
        samples = collision.sample(begin + 0.5 * step * (1 + nodes)).force
        total += 0.5 * step * weights @ samples
    agrees(total, collision.impulse, integrated(1e-8))


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_free_foot_and_the_ball_keep_their_momentum(friction):
    """A body without any support, which turns; the flat part of the shell moves along."""
    posture, v = free_body(2.0), np.array([14.0, 3.0, 1.0, 2.0, -6.0, 9.0])
    leg = posture.leg
    contact = kd.Contact((1, 0.2, 0.1), "inflated", friction)
    collision = kd.collide(posture, v, BALL, contact, tol=1e-12)
    before = momentum(leg, posture.q, v, BALL, collision.ball_before)
    after = momentum(leg, collision.q_after, collision.v_after, BALL, collision.ball_after)
    agrees(after, before, integrated(1e-12))
    assert (np.abs(collision.ball_after.spin).max() > 1.0) == (friction > 0.0)


@pytest.mark.parametrize("u", [0.05, 0.3, 0.55])
@pytest.mark.parametrize("share", [0.4, 1.0])
def test_force_and_energy_at_a_deflection(u, share):
    """The work of the pressure by quadrature; travel, carried mass and momentum by hand."""
    force = InflatedForce(0.43, 0.11, 80e3, share)
    travel, rate, radius = 0.11 * (u - share * u * u / 4), 6.0, 0.11

    def push(x):
        volume = 1 - x * x * (3 - x) / 4
        pressure = (80e3 + 101_325.0) * volume**-1.4 - 101_325.0
        return pressure * math.pi * radius**2 * x * (2 - x)

    speed, carried = rate / (1 - share * u / 2), share * 0.43 * u / 2
    load, per_length = force.load(travel, rate), share * 0.43 / (2 * radius)
    exact = closed_form(10)
    assert force.deflection(travel) == pytest.approx(u * radius, rel=exact)
    assert load.carried == pytest.approx(carried, rel=exact)
    assert load.force == pytest.approx(push(u) + per_length * speed**2, rel=exact)
    loss = (1 - SHELL_RESTITUTION**2) * push(u) * speed + 0.5 * per_length * speed**3
    assert load.lost == pytest.approx(loss, rel=exact)
    back = force.load(travel, -rate, radius)
    assert back.force == pytest.approx(SHELL_RESTITUTION**2 * push(u), rel=exact)
    assert back.lost == pytest.approx(0.5 * per_length * speed**3, rel=exact)
    work = quad(push, 0, u, epsrel=1e-12)[0] * radius
    moving = 0.5 * carried * (1 - carried / 0.43) * speed**2
    energy = SHELL_RESTITUTION**2 * work + moving
    assert force.energy(travel, rate) == pytest.approx(energy, rel=closed_form(1e4))


@pytest.mark.parametrize("model", ["point", FootPatch(0.08)], ids=["point", "patch"])
@pytest.mark.parametrize(("speed", "warned"), [(20.0, False), (34.0, True)])
def test_a_speed_beyond_the_model_is_warned_of(speed, warned, model):
    collision = head_on(speed if model == "point" else 0.7 * speed, tol=1e-6, model=model)
    share = collision.flattening / BALL.radius
    assert (share > 0.6) is warned
    assert any(f"{share:.3f} of its radius" in line for line in collision.warnings) is warned


@pytest.mark.parametrize(("speed", "warned"), [(17.0, False), (18.0, True)])
def test_a_spring_beyond_its_range_is_warned_of(speed, warned):
    """From 0.4 of the radius on; the spring of an inflated ball is linear."""
    contact = kd.Contact((1, 0, 0), 0.7)
    collision = head_on(speed, contact=contact, tol=1e-6, stiffness="pressure")
    mass = 1 / (1 / 1.95 + 1 / BALL.mass)
    share = speed * math.sqrt(mass / BALL.stiffness) / BALL.radius
    assert (share > 0.4) is warned
    assert any(f"{share:.2f} of its radius" in line for line in collision.warnings) is warned
