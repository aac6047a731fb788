"""The strike: momentum and energy, limits, units, frames; inputs that every way refuses."""

import math

import numpy as np
import pytest
from chains import in_units, kinetic_energy, random_kick, random_leg, slides
from extremes import extreme_impacts
from extremes.extreme_impacts import BENT, USUAL, chain
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.impact.laws import LAWS
from kickdyn.impact.strike import strike_by_pinocchio

LEG = kd.Leg.human()
V = np.array([0.1, -2.0, -1.0])
seeds = st.integers(0, 2**32 - 1)
laws = pytest.mark.parametrize("law", LAWS)


def paper_posture(ankle_deg):
    return LEG.posture(np.radians([5, 10, ankle_deg]))


@laws
@pytest.mark.parametrize("friction", [0.0, 0.1, 1.0])
@given(seed=seeds)
@settings(max_examples=20)
def test_momentum_and_energy_balance(law, friction, seed):
    rng = np.random.default_rng(seed)
    kick, options = random_kick(rng, random_leg(rng), friction=friction)
    impact = kd.strike(*kick, law, **options)
    posture, v, ball, contact = kick
    before, after, n = impact.ball_before, impact.ball_after, contact.normal
    tolerance = closed_form(posture.condition)
    energy = kinetic_energy(posture, v, ball, before)
    lost = energy - kinetic_energy(posture, impact.v_after, ball, after)
    assert impact.energy_lost == pytest.approx(lost, abs=tolerance * energy)
    assert impact.momentum_residual <= tolerance
    jump = options["ball_velocity"] + impact.impulse / ball.mass
    assert after.velocity == pytest.approx(jump, abs=closed_form(10) * (1 + np.abs(jump).max()))
    spin = np.cross(-ball.radius * n, impact.impulse) / ball.inertia
    gained = after.spin - options["ball_spin"]
    rounding = closed_form(10) * (np.abs(options["ball_spin"]).max() + np.abs(impact.impulse).max()
                        * ball.radius / ball.inertia)  # fmt: skip
    assert gained == pytest.approx(spin, abs=rounding)
    agrees(after.position, posture.contact_point + ball.radius * n, closed_form())
    if law == "newton":
        assert impact.restitution_residual <= 100 * tolerance
    if law == "stronge" or (friction == 0.0 and law == "newton"):
        assert impact.energy_lost >= 0.0
        assert not impact.creates_energy


@laws
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.4, 3.0])
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_an_obstacle_is_the_limit_of_heavy_balls(law, friction, seed):
    """Of a planar leg, which cannot move across its plane, and of chains about any axes."""
    if seed is None:
        posture, normal = paper_posture(15), (1, 0, 0.6)
        v = posture.joint_velocity((3, 0, 1))
    else:
        leg = random_leg(np.random.default_rng(seed), joints=6)
        (posture, v, _, contact), _ = random_kick(np.random.default_rng(seed), leg)
        normal = np.sign(contact.normal @ posture.point_velocity(v)) * contact.normal
    contact = kd.Contact(normal, 0.8, friction)
    heavy, impact = (kd.strike(posture, v, kd.Ball(m), contact, law) for m in (1e12, math.inf))
    agrees(impact.impulse, heavy.impulse, optimized(1e-9))
    agrees(impact.joint_impulses, heavy.joint_impulses, optimized(1e-9))
    agrees(impact.v_after, heavy.v_after, optimized(1e-8))
    assert impact.energy_lost == pytest.approx(heavy.energy_lost, abs=optimized(1e-9))
    assert impact.sticking == heavy.sticking
    assert not impact.ball_after.velocity.any()
    assert not impact.ball_after.spin.any()
    if law == "newton":
        assert impact.digits > 10
        slope = impact.sensitivity().impulse["v"] @ v
        agrees(slope, impact.impulse, optimized(1e-9))  # linear in v


@laws
def test_an_obstacle_that_the_leg_cannot_move_towards_is_refused(law):
    kick = paper_posture(15), np.zeros(3), kd.Ball(math.inf), kd.Contact((0, 1, 0), 0.8), law
    with pytest.raises(kd.InvalidInput, match="ball mass is inf and the leg cannot move"):
        kd.strike(*kick, ball_velocity=(0.0, -3.0, 0.0))


@laws
@given(seed=seeds)
@settings(max_examples=10)
def test_a_base_that_moves_is_another_frame_of_reference(law, seed):
    """Seen from the point of the base over the contact, the ball is slower by its velocity."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng)
    linear, angular = rng.normal(size=3) * 3, rng.normal(size=3)
    (posture, v, ball, contact), options = random_kick(rng, leg, friction=0.3)
    carried = linear + np.cross(angular, posture.contact_point)
    moving = leg.with_base_velocity(linear, angular).posture(posture.q)
    seen = kd.strike(posture, v, ball, contact, law, **options)
    options["ball_velocity"] = options["ball_velocity"] + carried
    impact = kd.strike(moving, v, ball, contact, law, **options)
    size = np.abs([*impact.ball_after.velocity, *impact.ball_before.velocity]).max()
    rounding = max(closed_form(10) * size, 10 ** (3 - impact.digits))
    velocity = seen.ball_after.velocity + carried
    np.testing.assert_allclose(impact.ball_after.velocity, velocity, rtol=0, atol=rounding)
    np.testing.assert_allclose(impact.impulse, seen.impulse, rtol=0, atol=ball.mass * rounding)
    agrees(impact.foot_velocity, seen.foot_velocity + carried, closed_form(10))
    assert abs(impact.restitution_residual - seen.restitution_residual) < closed_form(1e5)


@laws
@given(seed=seeds, metre=st.integers(-20, 20), half=st.integers(-9, 9), second=st.integers(-20, 20))
@settings(max_examples=15)
def test_powers_of_two_of_the_units_change_no_bit(law, seed, metre, half, second):
    """Of the kilogram powers of four, for roots of masses are taken."""
    rng = np.random.default_rng(seed)
    leg, friction = random_leg(rng), rng.choice([0.0, 0.3, 2.0])
    (posture, v, ball, contact), motion = random_kick(rng, leg, friction=friction)
    impact = kd.strike(posture, v, ball, contact, law, **motion)
    m, kg, s, lengths = 2.0**metre, 4.0**half, 2.0**second, (2.0**metre) ** slides(leg)
    again = kd.strike(
        in_units(leg, m, kg).posture(posture.q * lengths), v * lengths / s,
        kd.Ball(ball.mass * kg, ball.radius * m), contact, law,
        ball_velocity=motion["ball_velocity"] * m / s, ball_spin=motion["ball_spin"] / s,
    )  # fmt: skip
    units = np.repeat([kg * m / s, kg * m**2 / s], 3)
    for result, expected in (
        (again.impulse, impact.impulse * units[0]),
        (again.energy_lost, impact.energy_lost * kg * m**2 / s**2),
        (again.v_after, impact.v_after * lengths / s),
        (again.ball_after.spin, impact.ball_after.spin / s),
        (again.joint_impulses, impact.joint_impulses * units),
    ):
        np.testing.assert_array_equal(result, expected)


@pytest.mark.parametrize(("law", "offset", "words"), [
    ("hertz", None, "'hertz'.*newton, stronge, paper"),
    ("newton", (1e100, 0, 0), "contact offset is")])  # fmt: skip
def test_bad_input(law, offset, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.strike(paper_posture(0), V, kd.Ball(), kd.Contact((1, 0, 0), offset=offset), law)


peer_seeds = st.integers(0, 2**32 - 1)
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
@given(seed=peer_seeds)
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


Q = np.radians([5.0, 10.0, -5.0])
KICK = {
    "posture": LEG.posture(Q),
    "v": LEG.posture(Q).joint_velocity((3, 0, 1)),
    "ball": kd.Ball(),
    "contact": kd.Contact((1, 0, 0.3), 0.7),
}
FUNCTIONS = (kd.strike, strike_by_pinocchio, kd.collide, kd.unilateral_strike)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
@pytest.mark.parametrize(("change", "error", "words"), [
    ({"posture": LEG}, kd.InvalidInput, "posture is .*Posture"),
    ({"v": [0, math.nan, 0]}, kd.InvalidInput, "v is .*finite"),
    ({"v": [0, -1e160, -1e160]}, kd.InvalidInput, "double precision"),
    ({"ball_velocity": (1, 2)}, kd.InvalidInput, r"ball velocity has shape \(2,\)"),
    ({"ball_velocity": (-1e150, 0, 0)}, kd.InvalidInput, r"1e\+150 m/s"),
    ({"ball_spin": (0, 1e200, 0)}, kd.InvalidInput, r"1e\+140 m/s"),
    ({"v": [0, 0, 0]}, kd.NoImpact, "do not approach"),
    ({"ball_velocity": (9, 0, 0)}, kd.NoImpact, "away from the ball"),
    (
        {"posture": LEG.posture([5, 10, -5]), "ball_velocity": (99, 0, 0)},
        kd.NoImpact,
        r"radians: hip at 286\.48 deg",
    ),
])  # fmt: skip
def test_bad_kicks_are_refused(function, change, error, words):
    with pytest.raises(error, match=words):
        function(**(KICK | change))


@pytest.mark.parametrize("metre", [2.0**-30, 1.0, 2.0**30])
@pytest.mark.parametrize("function", [kd.strike, kd.collide], ids=["strike", "collide"])
def test_an_approach_that_is_rounding_is_refused_in_every_unit_of_length(function, metre):
    kick = list(extreme_impacts.cancellations())[-2]
    posture, ball = in_units(kick.leg, metre, 1.0).posture(kick.q), kd.Ball(radius=0.1 * metre)
    with pytest.raises(kd.NoImpact, match="that is rounding"):
        function(posture, kick.v, ball, kick.contact)


def test_a_slow_approach_of_which_nothing_cancels_is_accepted():
    contact, sliding = kd.Contact((1, 0, 0), 0.8, 0.4), (-1e-300, 0.5, 0.2)
    posture = chain(USUAL).posture(BENT)
    impact = kd.strike(posture, np.zeros(3), kd.Ball(), contact, ball_velocity=sliding)
    assert impact.approach_speed == 1e-300
    assert impact.digits > 14


def test_the_energy_of_the_approach_is_that_of_the_reduced_mass():
    """Along the normal, M and m with u have the energy m M / (m + M) u^2 / 2."""
    impact = kd.strike(**KICK, ball_velocity=(-1.0, 0.2, 0.4))
    mass, ball, n = impact.effective_mass, impact.ball.mass, impact.contact.normal
    speed = n @ (impact.posture.jacobian @ KICK["v"] - [-1.0, 0.2, 0.4])
    assert impact.approach_speed == pytest.approx(speed, rel=closed_form(10))
    energy = 0.5 * mass * ball / (mass + ball) * speed**2
    assert impact.approach.energy() == pytest.approx(energy, rel=closed_form(10))
