"""The contact that takes time: closed forms, what is conserved, and the limit of the instant."""

import copy
import math
import operator
import pickle
import threading

import numpy as np
import pinocchio as pin
import pytest
from chains import floating_kick, in_units, random_kick, random_leg, slides
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenes import wide_scene

import kickdyn as kd
from kickdyn.impact import compliant_contact
from kickdyn.robot.urdf_file import shipped_urdf

LEG = kd.Leg.human()
Q = np.radians([5, 10, -5])
TOUCH = kd.Contact((1, 0, 0.3), 0.5)

KICK = LEG.posture(Q), LEG.posture(Q).joint_velocity((14.0, 0.0, 4.0))


def human(contact=TOUCH, **options):
    return kd.collide(*KICK, kd.Ball(), contact, **options)


def slider(mass=2.0, gravity=False):
    """A mass on a rail along x."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    body = pin.Inertia(mass, np.zeros(3), 0.01 * np.eye(3))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    if not gravity:
        model.gravity = pin.Motion.Zero()
    return kd.Leg.from_model(model, "toe")


@pytest.mark.parametrize("e", [1.0, 0.8, 0.4, 0.1])
def test_two_masses(e):
    """Restitution, contact time and impulse come out exactly; so does Hertz's crush."""
    ball, contact, speed = kd.Ball(), kd.Contact((1, 0, 0), e), 9.0
    hit = kd.collide(
        slider().posture([0.0]), [speed], ball, contact,
        contact_time=0.009, tol=1e-12,
    )  # fmt: skip
    assert hit.contact_time == pytest.approx(0.009, rel=1e-9)
    expected = kd.normal_impulse(speed, e, 2.0, ball.mass)
    assert hit.impulse == pytest.approx([expected, 0, 0], rel=1e-9)
    assert hit.ball_after.velocity[0] - hit.v_after[0] == pytest.approx(e * speed, rel=1e-8)
    mass = 1 / (1 / 2.0 + 1 / ball.mass)
    lost = 0.5 * mass * speed**2 * (1 - e * e)
    assert hit.energy_lost == pytest.approx(lost, rel=1e-8, abs=1e-12)
    k = hit.force_model.stiffness
    crush = (5 * mass * speed**2 / (4 * k)) ** 0.4
    if e == 1.0:
        unit = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9)  # 2.94328
        closed = unit * crush / speed  # Johnson 1985, Eqs. 11.23, 11.24
        assert hit.contact_time == pytest.approx(closed, rel=1e-9)
    assert hit.deflection == pytest.approx(crush, rel=1e-9)
    assert hit.peak_force == pytest.approx(k * crush**1.5, rel=1e-9)
    left = hit.sample(hit.contact_time).deflection
    assert left == pytest.approx((1 - e * e) * crush, rel=1e-8, abs=1e-10)
    seen = hit.contact_time + (1 - e * e) * crush / (e * speed)
    assert hit.visible_contact_time == pytest.approx(seen, rel=1e-8)


@pytest.mark.parametrize("e", [1.0, 0.7, 0.3])
def test_an_inflated_ball_is_a_linear_spring(e):
    """Half a sine in compression, e times as brief a one in restitution."""
    ball, speed = kd.Ball(pressure=80e3), 9.0
    hit = kd.collide(
        slider().posture([0.0]), [speed], ball, kd.Contact((1, 0, 0), e),
        stiffness="pressure", tol=1e-12,
    )  # fmt: skip
    mass, k = 1 / (1 / 2.0 + 1 / ball.mass), 2 * math.pi * ball.radius * 80e3
    rate = math.sqrt(k / mass)
    assert hit.force_model.exponent == 1.0
    assert hit.contact_time == pytest.approx((1 + e) / 2 * math.pi / rate, rel=1e-9)
    assert hit.deflection == pytest.approx(speed / rate, rel=1e-9)
    assert hit.peak_force == pytest.approx(speed * math.sqrt(k * mass), rel=1e-9)
    assert hit.ball_after.velocity[0] - hit.v_after[0] == pytest.approx(e * speed, rel=1e-8)
    times = np.array([0.3, 0.8]) * math.pi / 2 / rate
    forces = k * speed / rate * np.sin(rate * times)
    assert hit.sample(times).force[:, 0] == pytest.approx(forces, rel=1e-9)
    back = hit.contact_time - np.array([0.1, 0.6]) * e * math.pi / 2 / rate
    forces = k * speed / rate * np.sin([0.1 * math.pi / 2, 0.6 * math.pi / 2])
    assert hit.sample(back).force[:, 0] == pytest.approx(forces, rel=1e-8)


@given(
    e=st.floats(0.05, 1.0),
    friction=st.floats(0.0, 1.0),
    stiffness=st.sampled_from([None, "pressure"]),
    seed=st.integers(0, 1000),
)
@settings(max_examples=15)
def test_energy_never_grows(e, friction, stiffness, seed):
    rng = np.random.default_rng(seed)
    (posture, v, ball, contact), options = random_kick(rng, random_leg(rng))
    ball = kd.Ball(ball.mass, ball.radius, ball.inertia_factor, pressure=1e6)
    contact = kd.Contact(contact.normal, e, friction)
    time = 1e-4 if stiffness is None else None
    hit = kd.collide(
        posture, v, ball, contact, contact_time=time, stiffness=stiffness, tol=1e-7, **options,
    )  # fmt: skip
    assert hit.energy_lost >= -1e-6 * hit.approach.energy()
    assert hit.energy_residual < 1e-3


def test_the_run_that_tells_the_error_has_the_same_force():
    hit = kd.collide(*KICK, kd.Ball(pressure=80e3), TOUCH, stiffness="pressure", tol=1e-7)
    assert hit.error < 1e-5 * np.linalg.norm(hit.impulse)
    again = pickle.loads(pickle.dumps(hit))
    assert again.force_model == hit.force_model
    assert (again.impulse == hit.impulse).all()


def test_pressed_twice():
    """A push in restitution that exceeds the first compression: the contact hardens again."""

    def push(t, q, v):
        return [8000.0 * math.exp(-(((t - 0.009) / 0.0015) ** 2))]

    hit = kd.collide(
        slider().posture([0.0]), [5.0], kd.Ball(), kd.Contact((1, 0, 0), 0.6),
        contact_time=0.009, torque=push, tol=1e-11,
    )  # fmt: skip
    deflection = hit.sample(np.linspace(0, hit.contact_time, 400)).deflection
    falls = np.flatnonzero(np.diff(np.sign(np.diff(deflection))) < 0)
    assert len(falls) == 2
    assert deflection[falls[1]] > 1.05 * deflection[falls[0]]
    assert hit.energy_residual < 1e-8
    at_end = hit.sample(hit.contact_time)
    assert at_end.deflection == pytest.approx((1 - 0.36) * hit.deflection, rel=1e-6)
    assert np.linalg.norm(at_end.force) < 1e-6 * hit.peak_force


def test_stick_tends_to_energetic_restitution():
    """The hysteresis returns e^2 of the work of compression, as the law `stronge`."""
    kick = (*KICK, kd.Ball(), kd.Contact((1, 0, 0.6), 0.5, 0.8))
    stronge, newton = (kd.strike(*kick, law=law) for law in ("stronge", "newton"))
    far = np.linalg.norm(newton.impulse - stronge.impulse)
    hit = kd.collide(*kick, contact_time=1e-6)
    assert np.linalg.norm(hit.impulse - stronge.impulse) < 0.1 * far
    assert far > 1e-2 * np.linalg.norm(stronge.impulse)


def test_gravity_and_torque_act_meanwhile():
    """On the rail both are constant: centre of mass and relative motion follow by hand."""
    ball, push, seconds = kd.Ball(), 30.0, None
    hit = kd.collide(
        slider(gravity=True).posture([0.0]), [5.0], ball, kd.Contact((1, 0, 0), 1), torque=[push]
    )
    seconds = hit.contact_time
    assert hit.impulse[2] == pytest.approx(0.0, abs=1e-9)
    assert hit.ball_after.velocity[2] == pytest.approx(-9.81 * seconds, rel=1e-9)
    momentum = 2.0 * hit.v_after[0] + ball.mass * hit.ball_after.velocity[0]
    assert momentum == pytest.approx(2.0 * 5.0 + push * seconds, rel=1e-9)
    assert hit.ball_after.position[2] == pytest.approx(-9.81 / 2 * seconds**2, rel=1e-7)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("units", [(2.0**-8, 2.0**12, 1.0), (2.0**6, 2.0**-9, 2.0**3)])
def test_units_change_no_more_than_the_integrator(seed, units):
    """Powers of numbers, as in Hertz's law, are rounded, so the last digits may differ."""
    rng = np.random.default_rng(seed)
    (posture, v, ball, contact), motion = random_kick(
        rng, random_leg(rng), restitution=0.7, friction=0.3 * (seed % 2)
    )
    m, kg, s = units
    sliding = slides(posture.leg)
    leg = in_units(posture.leg, 1.0, 1.0)
    hit = kd.collide(leg.posture(posture.q), v, ball, contact, contact_time=0.01, **motion)
    again = kd.collide(
        in_units(leg, m, kg).posture(posture.q * m**sliding),
        v * m**sliding / s,
        kd.Ball(ball.mass * kg, ball.radius * m),
        contact,
        contact_time=0.01 * s,
        ball_velocity=motion["ball_velocity"] * m / s,
        ball_spin=motion["ball_spin"] / s,
    )
    assert again.impulse == pytest.approx(hit.impulse * kg * m / s, rel=1e-8)
    assert again.contact_time == pytest.approx(hit.contact_time * s, rel=1e-9)
    assert again.energy_lost == pytest.approx(hit.energy_lost * kg * m**2 / s**2, rel=1e-7)
    assert again.v_after == pytest.approx(hit.v_after * m**sliding / s, rel=1e-7)


@pytest.mark.parametrize(("seed", "friction"), [(0, 0.0), (1, 0.0), (2, 0.3), (3, 0.3)])
def test_a_free_leg_and_the_ball_keep_their_momentum(seed, friction):
    """Linear and angular, about the origin: force and lever arm are opposite and equal."""
    rng = np.random.default_rng(seed)
    (posture, v, ball, contact), options = floating_kick(rng)
    contact = kd.Contact(contact.normal, max(contact.restitution, 0.1), friction)
    model = posture.leg.model
    model.gravity = pin.Motion.Zero()
    leg = kd.Leg.from_model(model, "toe")
    hit = kd.collide(leg.posture(posture.q), v, ball, contact, **options)

    def momentum(q, v, state):
        data = model.createData()
        pin.computeCentroidalMomentum(model, data, q, v)
        linear, angular = data.hg.linear, data.hg.angular
        ours = ball.mass * state.velocity
        about = np.cross(data.com[0], linear) + np.cross(state.position, ours)
        return np.concatenate([linear + ours, angular + about + ball.inertia * state.spin])

    before = momentum(hit.posture.q, hit.v_before, hit.ball_before)
    after = momentum(hit.q_after, hit.v_after, hit.ball_after)
    assert after == pytest.approx(before, rel=1e-7, abs=1e-7 * np.abs(before).max())
    assert np.linalg.norm(hit.impulse) > 0.1
    turned = np.linalg.norm(hit.ball_after.spin - hit.ball_before.spin)
    assert bool(turned > 0.1) is (friction > 0)


@pytest.mark.parametrize("seed", range(6))
def test_energy_is_accounted_for(seed):
    rng = np.random.default_rng(seed)
    e, friction = rng.uniform(0.1, 1), 0.3 * (seed % 2)
    kick, options = random_kick(rng, random_leg(rng), restitution=e, friction=friction)
    stiffness = 10 ** rng.uniform(6, 9)
    leg = kick[0].leg
    hit = kd.collide(*kick, stiffness=stiffness, torque=lambda t, q, v: 5 * np.cos(v), **options)
    assert hit.energy_residual <= 1e-6
    assert hit.energy_lost > 0
    assert hit.v_after.shape == (leg.nv,)


def test_the_energy_residual_is_what_is_missing():
    """At a tolerance so loose that it is far above rounding; for the spring is slack at the end."""
    ball = kd.Ball()
    hit = kd.collide(slider().posture([0.0]), [9.0], ball, kd.Contact((1, 0, 0), 0.5), tol=1e-3)
    after = 0.5 * (2.0 * hit.v_after[0] ** 2 + ball.mass * hit.ball_after.speed**2)
    missing = abs(0.5 * 2.0 * 9.0**2 - hit.energy_lost - after)
    relative = 0.5 / (1 / 2.0 + 1 / ball.mass) * 9.0**2
    assert hit.energy_residual == pytest.approx(missing / relative, rel=1e-3)
    assert hit.energy_residual > 1e-10


def test_rotors_carry_energy_too():
    model = LEG.model
    model.armature = np.array([0.3, 0.2, 0.1])
    leg = kd.Leg.from_model(model, "toe")
    v = leg.posture(Q).joint_velocity((14.0, 0.0, 4.0))
    hit = kd.collide(leg.posture(Q), v, kd.Ball(), TOUCH)
    assert hit.energy_residual <= 1e-7
    assert np.linalg.norm(hit.impulse) > np.linalg.norm(human().impulse)


@pytest.mark.parametrize("scale", [0.1, 1e2])
def test_without_gravity_speed_is_time(scale):
    """Faster through a contact that is shorter in proportion: the same path."""
    model = LEG.model
    model.gravity = pin.Motion.Zero()
    leg, contact = kd.Leg.from_model(model, "toe"), kd.Contact((1, 0, 0.3), 0.5, 0.4)
    v = leg.posture(Q).joint_velocity((14.0, 0.0, 4.0))
    usual, other = (
        kd.collide(leg.posture(Q), k * v, kd.Ball(), contact, contact_time=0.01 / k)
        for k in (1.0, scale)
    )
    assert other.impulse / scale == pytest.approx(usual.impulse, rel=1e-7)
    assert other.ball_after.spin / scale == pytest.approx(usual.ball_after.spin, rel=1e-7, abs=1e-9)
    assert other.deflection == pytest.approx(usual.deflection, rel=1e-6)


def kicks():
    yield (LEG.posture(Q), LEG.posture(Q).joint_velocity((14, 0, 4)), kd.Ball(), TOUCH), {}
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        yield random_kick(rng, random_leg(rng), restitution=0.6)


@pytest.mark.parametrize("kick", list(kicks()), ids=["human", "chain 1", "chain 2"])
def test_the_instant_is_the_limit(kick):
    """First order in the contact time, thus k^-0.4: each time a quarter, for 32 times the k."""
    kick, options = kick
    instant = kd.strike(*kick, **options)
    first = kd.collide(*kick, contact_time=1e-5, tol=1e-12, **options)
    stiffer = kd.collide(*kick, stiffness=32 * first.force_model.stiffness, tol=1e-12, **options)
    for read in (lambda hit: hit.impulse, lambda hit: hit.v_after, lambda hit: hit.energy_lost):
        far, near = (np.linalg.norm(read(hit) - read(instant)) for hit in (first, stiffer))
        assert near <= 1e-2 * np.linalg.norm(read(instant))
        assert far / near == pytest.approx(4.0, rel=0.02)


def test_slip_has_the_same_limit():
    """In the plane, always the same way: p stays on one line, and the masses along it constant."""
    kick = (LEG.posture(Q), LEG.posture(Q).joint_velocity((14, 0, 4)), kd.Ball())
    contact = kd.Contact((1, 0, 0.6), 0.5, 0.1)
    instant = kd.strike(*kick, contact)
    assert not instant.sticking
    hits = [kd.collide(*kick, contact, contact_time=time) for time in (4e-5, 1e-5)]
    for read in (
        lambda hit: hit.impulse,
        lambda hit: hit.ball_after.spin,
        lambda hit: hit.energy_lost,
    ):
        far, near = (np.linalg.norm(read(hit) - read(instant)) for hit in hits)
        assert far <= 3e-3 * np.linalg.norm(read(instant))
        assert far / near == pytest.approx(4.0, rel=0.05)


def test_stick_has_the_same_limit_on_a_particle():
    """Three rails: nothing couples the normal to what is across it."""
    model = pin.Model()
    parent = 0
    for kind in (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ()):
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), f"rail{parent}")
    body = pin.Inertia(1.5, np.zeros(3), 0.01 * np.eye(3))
    model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    light = pin.Inertia(1e-6, np.zeros(3), 1e-9 * np.eye(3))
    for joint in (1, 2):
        model.appendBodyToJoint(joint, light, pin.SE3.Identity())
    posture = kd.Leg.from_model(model, "toe").posture(np.zeros(3))
    kick = (posture, np.array([5.0, 1.0, -2.0]), kd.Ball())
    contact = kd.Contact((1, 0, 0), 0.5, 1.0)
    instant = kd.strike(*kick, contact)
    assert instant.sticking
    hit = kd.collide(*kick, contact, contact_time=1e-5, tol=1e-7)
    assert hit.impulse == pytest.approx(instant.impulse, abs=2e-3 * np.linalg.norm(instant.impulse))
    assert hit.ball_after.spin == pytest.approx(instant.ball_after.spin, rel=2e-3, abs=1e-3)


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_the_impulse_is_the_forces_integral(friction):
    hit = human(kd.Contact((1, 0, 0.3), 0.5, friction))
    nodes, weights = np.polynomial.legendre.leggauss(100)
    times = 0.5 * hit.contact_time * (1 + nodes)
    sampled = hit.sample(times)
    total = 0.5 * hit.contact_time * weights @ sampled.force
    gone = np.linalg.norm(total - hit.impulse)
    assert gone <= 1e-3 * np.linalg.norm(hit.impulse)
    start, end = hit.sample(0.0), hit.sample(hit.contact_time)
    assert start.force.shape == (3,)
    assert end.impulse == pytest.approx(hit.impulse, rel=1e-12)
    left = hit.force_model.separation(hit.deflection)
    assert float(end.deflection) == pytest.approx(left, rel=1e-6)
    assert sampled.deflection.max() <= hit.deflection
    assert sampled.deflection.max() == pytest.approx(hit.deflection, rel=1e-2)
    sizes = np.linalg.norm(sampled.force, axis=1)
    assert sizes.max() <= hit.peak_force
    assert sizes.max() == pytest.approx(hit.peak_force, rel=1e-2)


def test_the_error_is_what_it_says():
    exact = human(tol=1e-13)
    for tol in (1e-6, 1e-7, 1e-9):
        hit = human(tol=tol)
        gone = np.linalg.norm(hit.impulse - exact.impulse)
        assert gone <= hit.error <= 1e3 * tol * np.linalg.norm(exact.impulse)


def test_a_foot_that_turns_turns_the_force():
    """The plane of contact goes with the foot, by the angle that it turns in the meantime."""
    hit = human()
    sampled = hit.sample([1e-6, hit.contact_time * (1 - 1e-6)])
    ways = sampled.force / np.linalg.norm(sampled.force, axis=1)[:, None]
    turn = np.array([-1, 1, 1]) @ (hit.q_after - hit.posture.q)  # of the foot about y
    angles = np.arctan2(ways[:, 2], ways[:, 0])
    assert angles[1] - angles[0] == pytest.approx(-turn, rel=1e-3)
    assert abs(turn) > 0.07


def test_a_spring_without_damping_returns_all_energy():
    hit = human(kd.Contact((1, 0, 0.3), 1.0))
    assert hit.energy_lost == pytest.approx(0.0, abs=1e-9)


def test_a_ball_flattened_beyond_the_range_of_its_pressure_is_named():
    def hit(speed, pressure=80e3):
        foot = [speed, 0, 0]
        return kd.collide(
            LEG.posture(Q), LEG.posture(Q).joint_velocity(foot), kd.Ball(pressure=pressure),
            kd.Contact((1, 0, 0), 0.7), stiffness="pressure", tol=1e-6,
        )  # fmt: skip

    slow, fast = hit(8.0), hit(30.0)
    assert slow.deflection < 0.4 * slow.ball.radius
    assert not [line for line in slow.warnings if "flattened" in line]
    share = fast.deflection / fast.ball.radius
    assert f"the ball is flattened by {share:.2f} of its radius" in "".join(fast.warnings)
    with pytest.raises(kd.InvalidInput, match=r"ball pressure is 2000 Pa: too low"):
        hit(30.0, 2e3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"contact_time": 0.0}, "contact time is 0"),
        ({"contact_time": 10}, r"^contact time is 10(\.0)?: .* at most 0\.1 \[s\]"),
        ({"contact_time": 0.01, "stiffness": 1e5}, "give only one of them"),
        ({"stiffness": -1.0}, "stiffness is -1"),
        ({"stiffness": 1e3}, r"stiffness is 1000 N/m\^1\.5: too low, .* beyond its radius"),
        (
            {"stiffness": "air"},
            r"stiffness is 'air': it must be a number \[N/m\^1.5\], 'pressure' or 'inflated'",
        ),
        ({"stiffness": "pressure"}, "ball pressure is None: its stiffness needs it"),
        ({"stiffness": "pressure", "contact_time": 0.01}, "give only one of them"),
        (
            {"stiffness": "inflated"},
            "stiffness is 'inflated': it needs a contact with .*'inflated'",
        ),
        ({"contact_time": 1e-12}, "contact time is .*at least 1e-09"),
        ({"tol": 0.1}, r"tol is 0\.1"),
        ({"torque": [1.0]}, r"torque has shape \(1,\): it must be \(3,\)"),
        ({"torque": lambda t, q, v: math.nan * v}, "torque is .*finite"),
        ({"contact": kd.Contact((1, 0, 0.3), 0.0)}, r"restitution is 0\.0: .*at least 0\.01"),
        ({"ball_velocity": (14 - 1e-7, 0, 4)}, "approach speed is .*at least 1e-06"),
    ],
)
def test_bad_input(options, words):
    with pytest.raises(kd.InvalidInput, match=words) as caught:
        human(**options)
    assert "\n" not in str(caught.value)


FOURBAR = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf")).with_loops(
    ("shank_pin", "rocker_b_tip")
)


def test_a_supported_base_is_a_fixed_one():
    """Under gravity, torque and friction; the other leg swings."""
    free = kd.Leg.from_robot("bolt", base="floating")
    leg, fixed = free.with_supports("base_link"), kd.Leg.from_robot("bolt")
    contact, bend = kd.Contact((3, 0, 1), 0.7, friction=0.3), {"FR_HFE": 0.4, "FR_KFE": -0.8}
    one, other = (each.posture(each.configuration(bend)) for each in (leg, fixed))
    v = other.joint_velocity([3, 0, 1])
    torque = np.linspace(-1, 1, fixed.nv)
    held = kd.collide(
        one, np.append(np.zeros(6), v), kd.Ball(), contact, torque=np.append(np.zeros(6), torque)
    )
    bolted = kd.collide(other, v, kd.Ball(), contact, torque=torque)
    assert held.impulse == pytest.approx(bolted.impulse, rel=1e-7)
    assert held.v_after[6:] == pytest.approx(bolted.v_after, rel=1e-6, abs=1e-6)
    assert np.abs(held.v_after[:6]).max() < 1e-10
    assert held.energy_residual < 1e-6


@pytest.mark.parametrize("support", ["FL_FOOT", kd.Support("FL_FOOT", point=True)])
def test_of_a_supported_leg_it_tends_to_the_strike(support):
    leg = kd.Leg.from_robot("bolt", base="floating").with_supports(support)
    posture = leg.posture(leg.configuration({"FR_HFE": 0.4, "FR_KFE": -0.8, "FL_KFE": 0.3}))
    kick = posture, posture.joint_velocity([3, 0, 1]), kd.Ball(), kd.Contact((3, 0, 1), 0.7)
    _tends_to_the_strike(kick)


def test_of_a_closed_loop_it_tends_to_the_strike():
    q = FOURBAR.close_loops(FOURBAR.configuration({"rocker_b": 0.6, "hip": 0.2}), ["rocker_b"])
    posture = FOURBAR.posture(q)
    kick = posture, posture.joint_velocity([8, 0, 2]), kd.Ball(), kd.Contact((1, 0, 0.2), 0.7)
    hit = _tends_to_the_strike(kick)
    assert FOURBAR.posture(hit.q_after).leg is FOURBAR  # it would refuse an open loop


def test_hinges_without_motors_transmit_nothing_about_their_axes():
    """While the leg turns by 10 degrees."""
    impulses = human(contact=kd.Contact((1, 0, 0.3), 0.7, friction=0.4)).joint_impulses
    assert np.abs(impulses[:, 4]).max() < 1e-12 * np.abs(impulses).max()
    assert not impulses.flags.writeable


def test_a_rail_takes_what_the_ball_gets_across_it():
    leg = slider()
    contact = kd.Contact((1, 0.2, 0.3), 0.7, friction=0.4)
    hit = kd.collide(leg.posture([0.0]), [8.0], kd.Ball(), contact)
    assert hit.joint_impulses[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert hit.joint_impulses[0, 1:3] == pytest.approx(hit.impulse[1:], rel=1e-5)


def _tends_to_the_strike(kick):
    """Linearly in the contact time, and the constraints hold at the end."""
    strike, errors, inside = kd.strike(*kick), [], []
    for time in (1e-3, 1e-4):
        hit = kd.collide(*kick, contact_time=time, tol=1e-8)
        errors.append(np.linalg.norm(hit.impulse - strike.impulse))
        inside.append(np.abs(hit.joint_impulses - strike.joint_impulses).max())
        assert hit.energy_residual < 1e-6
        rows = kick[0].leg.posture(hit.q_after).constraint_projector.rows
        assert np.abs(rows @ hit.v_after).max() < 1e-8
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.1)
    assert errors[1] < 0.01 * np.linalg.norm(strike.impulse)
    assert inside[1] < 0.12 * inside[0]
    assert inside[1] < 0.01 * np.abs(strike.joint_impulses).max()
    return hit


def test_what_moves_a_support_is_refused():
    leg = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
    with pytest.raises(kd.InvalidInput, match="v moves FL_FOOT, a constraint of the leg"):
        kd.collide(leg.posture(leg.configuration()), np.ones(leg.nv), kd.Ball(), TOUCH)


def test_a_contact_point_off_the_frame():
    """A frame placed there, and an offset to there, are the same contact."""
    offset, urdf = np.array([0.02, 0.01, -0.03]), kd.Leg.human()
    model = urdf.model
    toe = model.frames[urdf.frame_id]
    there = toe.placement * pin.SE3(np.eye(3), offset)
    model.addFrame(pin.Frame("there", toe.parentJoint, 0, there, pin.FrameType.OP_FRAME))
    moved, contact = kd.Leg.from_model(model, "there"), (2, 0.2, 1)
    q, v = np.radians([5, 10, -5]), [0.1, -12.0, -6.0]
    one = kd.collide(moved.posture(q), v, kd.Ball(), kd.Contact(contact, 0.7))
    other = kd.collide(urdf.posture(q), v, kd.Ball(), kd.Contact(contact, 0.7, offset=offset))
    assert other.impulse == pytest.approx(one.impulse, rel=1e-8)
    assert other.v_after == pytest.approx(one.v_after, rel=1e-7)


def test_no_approach():
    with pytest.raises(kd.NoImpact):
        human(ball_velocity=(99, 0, 0))


def test_a_sample_outside_the_contact():
    hit = human()
    with pytest.raises(kd.InvalidInput, match=r"t is 1 s: the contact lasts from 0 to 0\.01"):
        hit.sample(1.0)
    with pytest.raises(kd.InvalidInput, match="must be a number or"):
        hit.sample([[0.0]])


def test_a_particle_keeps_its_energy_in_order():
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    v = posture.joint_velocity([9, 0, 4])
    ball = kd.Ball(inertia_factor=math.inf)
    hit = kd.collide(posture, v, ball, kd.Contact((2, 0, 1), 0.8, 0.3), tol=1e-6)
    assert hit.energy_residual < 1e-3
    assert not hit.ball_after.spin.any()


def test_strong_friction_is_as_quick():
    hit = human(kd.Contact((1, 0, 0.3), 0.5, 1e6))
    assert hit.evaluations < 5 * human(kd.Contact((1, 0, 0.3), 0.5, 1.0)).evaluations
    assert hit.energy_residual < 1e-5


def test_a_particle_has_an_energy_too():
    v = LEG.posture(Q).joint_velocity((14.0, 0.0, 4.0))
    particle = kd.Ball(inertia_factor=math.inf)
    for friction, spin in ((0.0, (0, 0, 0)), (0.3, (0, 0, 0)), (0.3, (5, -80, 3))):
        contact = kd.Contact((1, 0, 0.3), 0.7, friction)
        hit = kd.collide(LEG.posture(Q), v, particle, contact, ball_spin=spin)
        assert hit.energy_residual < 1e-7
        assert hit.ball_after.spin.tolist() == list(spin)  # nothing turns it


def test_joints_outside_their_range_and_too_fast_are_warned_of():
    bent = LEG.posture(LEG.configuration({"knee": -0.2}))
    fast = kd.collide(bent, [20.0, 0, 0], kd.Ball(), kd.Contact((1, 0, 0), 0.7))
    instant = kd.strike(bent, [20.0, 0, 0], kd.Ball(), kd.Contact((1, 0, 0), 0.7))
    assert len(fast.warnings) == 2
    assert fast.warnings == instant.warnings
    assert all(line in repr(fast) for line in fast.warnings)


def test_pickled_it_runs_again():
    hit = human(torque=[1.0, 2.0, 3.0], tol=1e-8)
    again = pickle.loads(pickle.dumps(hit))
    assert again.tol == hit.tol
    assert (again.impulse == hit.impulse).all()


def test_another_run_has_the_balls_motion_too():
    hit = human(
        kd.Contact((1, 0, 0.3), 0.5, 0.3),
        ball_velocity=(-2, 1, 0),
        ball_spin=(0, 300, 50),
        tol=1e-6,
    )
    again = pickle.loads(pickle.dumps(hit))
    assert again.impulse.tolist() == hit.impulse.tolist()
    assert again.ball_before == hit.ball_before
    assert hit.error < 1e-3 * np.linalg.norm(hit.impulse)


@pytest.mark.parametrize("torque", [[1e300] * 3, [1e308] * 3, lambda t, q, v: [1e308] * 3])
def test_torques_beyond_reason_are_refused_at_once(torque, monkeypatch):
    monkeypatch.setattr(compliant_contact, "MAX_EVALUATIONS", 100)
    with pytest.raises(
        kd.KickdynError, match=r"(integration exceeded double precision|integrator failed at 0 s)"
    ):
        human(torque=torque)


def test_what_gravity_moves_more_than_the_impact_is_an_error():
    leg = kd.Leg.human()
    posture = leg.posture(leg.configuration({"knee": 0.5}))
    v = posture.joint_velocity((1.1e-6, 0, 0))
    with pytest.raises(kd.KickdynError, match=r"speed of 1\.1e-06 m/s gravity or a torque"):
        kd.collide(posture, v, kd.Ball(), kd.Contact((1, 0, 0), 0.8), contact_time=0.01, tol=1e-6)


def test_what_takes_too_many_evaluations_is_given_up(monkeypatch):
    monkeypatch.setattr(compliant_contact, "MAX_EVALUATIONS", 100)
    with pytest.raises(kd.KickdynError, match=r"not ended after 100 evaluations.*friction 70"):
        human(kd.Contact((1, 0, 0.3), 0.5, 70.0))


def test_samples_are_no_evaluations_of_the_integration(monkeypatch):
    hit = human()
    known = hit.evaluations
    monkeypatch.setattr(compliant_contact, "MAX_EVALUATIONS", known + 10)
    sample = hit.sample(np.linspace(0.0, hit.contact_time, 50))
    assert sample.impulse[-1] == pytest.approx(hit.impulse, rel=1e-9)
    assert hit.evaluations == known < 1000


def test_a_ball_that_hardly_resists_turning():
    """It sticks at once: nothing keeps its surface from moving with the foot."""
    ball, contact = kd.Ball(inertia_factor=1e-6), kd.Contact((1, 0, 0.3), 0.5, 70.0)
    hit = kd.collide(*KICK, ball, contact, contact_time=1e-5)
    smooth = kd.strike(*KICK, ball, kd.Contact(contact.normal, 0.5))
    assert hit.impulse == pytest.approx(smooth.impulse, abs=2e-3 * np.linalg.norm(hit.impulse))


def test_the_callers_array_may_change():
    torque = np.array([50.0, 0.0, 0.0])
    hit = human(torque=torque, tol=1e-8)
    torque[:] = -500.0
    assert hit.error < 1e-5
    assert (pickle.loads(pickle.dumps(hit)).impulse == hit.impulse).all()


def test_threads_have_kinematics_of_their_own():
    """So that several may sample one contact; a race itself may happen not to be lost."""
    motion = human()._motion.equations
    seen = [motion.data]
    worker = threading.Thread(target=lambda: seen.append(motion.data))
    worker.start()
    worker.join()
    assert seen[0] is not seen[1]
    assert motion.data is seen[0]


def damper(t, q, v):
    return -0.5 * v


@pytest.mark.parametrize("torque", [lambda t: [0, 0, 0], lambda: None, operator.neg])
def test_it_must_take_time_q_and_v(torque):
    with pytest.raises(kd.InvalidInput, match=r"torque is .* must take three values, t, q, v"):
        human(torque=torque)


def test_functions_of_a_module_can_be_pickled():
    hit = human(torque=damper, tol=1e-6)
    assert (pickle.loads(pickle.dumps(hit)).impulse == hit.impulse).all()


def test_a_lambda_cannot_but_copies():
    hit = human(torque=lambda t, q, v: -0.5 * v, tol=1e-6)
    with pytest.raises((AttributeError, pickle.PicklingError), match=r"pickle|local object"):
        pickle.dumps(hit)
    for again in (copy.copy(hit), copy.deepcopy(hit)):
        assert (again.impulse == hit.impulse).all()


def test_the_state_at_separation_is_as_exact_as_the_steps():
    """Energy is balanced to a few times the tolerance, though the last step ends in an event."""
    along = (np.cos(np.pi / 6), 0, np.sin(np.pi / 6))
    posture = kd.Leg.human().posture(np.radians([40, 30, -20]))
    for tol in (1e-9, 1e-10):
        hit = kd.collide(posture, [8.25, -18.15, 2.48], kd.Ball(), kd.Contact(along, 0.7), tol=tol)
        assert hit.energy_residual < 30 * tol


def test_a_base_that_moves_is_another_frame_of_reference():
    leg, hip, ball_velocity = kd.Leg.human(), np.array([4.0, 0.5, -0.3]), np.array([1.0, 0.3, 0.2])
    kick = [8.25, -18.15, 2.48], kd.Ball(), kd.Contact((2, 0.3, 1), 0.7, 0.4)
    q = np.radians([40, 30, -20])
    seen = kd.collide(leg.posture(q), *kick, ball_velocity=ball_velocity - hip)
    moving = leg.with_base_velocity(hip).posture(q)
    hit = kd.collide(moving, *kick, ball_velocity=ball_velocity)
    moved = seen.ball_after.position + hip * seen.contact_time
    assert hit.ball_after.velocity == pytest.approx(seen.ball_after.velocity + hip, rel=1e-13)
    assert hit.ball_after.position == pytest.approx(moved, abs=1e-12)
    assert hit.impulse == pytest.approx(seen.impulse, rel=1e-13)
    turning = leg.with_base_velocity(hip, (0, 1, 0)).posture(q)
    with pytest.raises(kd.InvalidInput, match="unless the base does not turn, needs a base at"):
        kd.collide(turning, *kick)


@pytest.mark.parametrize("tol", [2.1195322465304573e-04, 3.980615440018348e-04])
def test_a_step_from_the_largest_deflection_beyond_separation_ends_there(tol):
    rng = np.random.default_rng(6)
    scene = [wide_scene(rng) for _ in range(79)][-1]
    parts = scene.posture, scene.v, scene.ball, scene.contact
    motion = {"ball_velocity": scene.incoming.velocity, "ball_spin": scene.incoming.spin}
    rough, exact = (
        kd.collide(*parts, **motion, **scene.law.options, tol=each).impulse for each in (tol, 1e-9)
    )
    np.testing.assert_allclose(rough, exact, rtol=0.0, atol=20 * tol * np.linalg.norm(exact))
