"""The contact that takes time: closed forms, balances, and the limit of the instant."""

import copy
import math
import pickle

import chains
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.impact import contact_phases

LEG = kd.Leg.human()
Q = np.radians([5, 10, -5])
TOUCH = kd.Contact((1, 0, 0.3), 0.5)
KICK = LEG.posture(Q), LEG.posture(Q).joint_velocity((14.0, 0.0, 4.0))
AHEAD = (1, 0, 0)


def human(contact=TOUCH, ball=None, **options):
    return kd.collide(*KICK, ball or kd.Ball(), contact, **options)


@pytest.mark.parametrize("e", [1.0, 0.8, 0.1])
def test_two_masses(e):
    """Hertz's crush (5 m u^2 / 4 k)^(2/5) and pulse; restitution and contact time are exact."""
    ball, speed, tolerance = kd.Ball(), 9.0, integrated(1e-11)
    kick = chains.rails().posture([0.0]), [speed], ball, kd.Contact(AHEAD, e)
    collision = kd.collide(*kick, contact_time=0.009, tol=1e-12)
    mass, k = 1 / (1 / 2.0 + 1 / ball.mass), collision.force_model.stiffness
    crush = (5 * mass * speed**2 / (4 * k)) ** 0.4
    remaining = (1 - e * e) * crush
    for name, value, expected in (
        ("contact time", collision.contact_time, 0.009),
        ("impulse", collision.impulse[0], (1 + e) * mass * speed),
        ("separation", collision.ball_after.velocity[0] - collision.v_after[0], e * speed),
        ("energy", collision.energy_lost, 0.5 * mass * speed**2 * (1 - e * e)),
        ("deflection", collision.deflection, crush),
        ("peak", collision.peak_force, k * crush**1.5),
        ("end", float(collision.sample(collision.contact_time).deflection), remaining),
        ("visible", collision.visible_contact_time, 0.009 + remaining / (e * speed)),
    ):
        assert value == pytest.approx(expected, rel=tolerance, abs=integrated(1e-12)), name


@pytest.mark.parametrize("e", [1.0, 0.3])
def test_an_inflated_ball_is_a_linear_spring(e):
    """Half a sine in compression, e times as brief a one in restitution."""
    ball, speed, tolerance = kd.Ball(pressure=80e3), 9.0, integrated(1e-11)
    kick = chains.rails().posture([0.0]), [speed], ball, kd.Contact(AHEAD, e)
    collision = kd.collide(*kick, stiffness="pressure", tol=1e-12)
    mass, k = 1 / (1 / 2.0 + 1 / ball.mass), 2 * math.pi * ball.radius * 80e3
    rate = math.sqrt(k / mass)
    peak = speed * math.sqrt(k * mass)
    assert collision.contact_time == pytest.approx((1 + e) / 2 * math.pi / rate, rel=tolerance)
    assert collision.deflection == pytest.approx(speed / rate, rel=tolerance)
    assert collision.peak_force == pytest.approx(peak, rel=tolerance)
    shares = np.array([0.3, 0.8]) * math.pi / 2
    times = np.concatenate([shares / rate, collision.contact_time - e * shares / rate])
    forces = peak * np.sin(np.tile(shares, 2))
    agrees(collision.sample(times).force[:, 0], forces, tolerance)


def test_gravity_and_torque_act_meanwhile():
    """On the rail both are constant: centre of mass and relative motion follow by hand."""
    ball, push, leg = kd.Ball(), 30.0, chains.rails(gravity=True)
    collision = kd.collide(leg.posture([0.0]), [5.0], ball, kd.Contact(AHEAD, 1), torque=[push])
    time, after = collision.contact_time, collision.ball_after
    assert after.velocity[2] == pytest.approx(-9.81 * time, rel=integrated(1e-9))
    assert after.position[2] == pytest.approx(-9.81 / 2 * time**2, rel=integrated(1e-9))
    assert (after.time, collision.impulse[2]) == (time, pytest.approx(0.0, abs=closed_form()))
    total = 2.0 * collision.v_after[0] + ball.mass * after.velocity[0]
    assert total == pytest.approx(2.0 * 5.0 + push * time, rel=integrated(1e-9))


@pytest.mark.parametrize("friction", [0.1, 0.8], ids=["slips", "stops"])
def test_friction_by_an_implicit_integrator(friction):
    """Radau, of a ball and a mass that does not turn; below 1e-5 m/s the friction is viscous."""
    ball, mass, e, v = kd.Ball(), 2.0, 0.6, [9.0, 1.0, 3.0]
    contact = kd.Contact((1, 0.2, 0.6), e, friction)
    motion = {"ball_velocity": (-2.0, 0.5, 1.0), "ball_spin": (20.0, 50.0, -30.0)}
    kick = chains.rails("xyz", mass).posture([0.0] * 3), v, ball, contact
    collision = kd.collide(*kick, **motion, tol=1e-9)
    n, k = contact.normal, collision.force_model.stiffness

    def rates(_, y, largest):
        centre, foot, velocity, spin = y.reshape(4, 3)
        height = n @ centre
        deflection = ball.radius - height
        size = (deflection - (1 - e * e) * largest) / e**2 if largest else deflection
        sliding = velocity - foot - height * np.cross(spin, n)
        sliding -= (n @ sliding) * n
        force = n - friction * sliding / math.hypot(*sliding, 1e-5)
        force *= k * max(size, 0.0) ** 1.5
        torque = height * np.cross(force, n)
        rate = velocity - foot, -force / mass, force / ball.mass, torque / ball.inertia
        return np.concatenate(rate)

    def ends(_, y, largest):
        if largest:
            return ball.radius - n @ y[:3] - (1 - e * e) * largest
        return n @ (y[3:6] - y[6:9])  # approach

    ends.terminal, ends.direction = True, -1.0
    y, time, largest = np.concatenate([ball.radius * n, v, *motion.values()]), 0.0, 0.0
    for _ in range(2):
        path = solve_ivp(rates, (time, 0.1), y, "Radau", events=ends, args=(largest,), rtol=1e-6,
                         atol=1e-8, first_step=1e-6)  # fmt: skip
        time, y = path.t[-1], path.y[:, -1]
        largest = ball.radius - n @ y[:3]
    near = integrated(1e-6)  # the creep is 1e-4 rad/s
    agrees(collision.impulse, ball.mass * (y[6:9] - motion["ball_velocity"]), near)
    agrees(collision.ball_after.velocity, y[6:9], near)
    agrees(collision.ball_after.spin, y[9:12], near)
    agrees(collision.v_after, y[3:6], near)
    assert collision.contact_time == pytest.approx(time, rel=near)
    pressing = n @ collision.impulse
    share = np.linalg.norm(collision.impulse - pressing * n) / (friction * pressing)
    assert share > 0.99 if friction == 0.1 else share < 0.5


@pytest.mark.parametrize(("seed", "friction"), [(0, 0.0), (2, 0.3), (3, 0.3)])
def test_a_free_leg_and_the_ball_keep_momentum_and_energy(seed, friction):
    """Linear and angular, about the origin: force and lever arm are opposite and equal."""
    rng = np.random.default_rng(seed)
    (posture, v, ball, contact), options = chains.floating_kick(rng)
    contact = kd.Contact(contact.normal, max(contact.restitution, 0.1), friction)
    leg = chains.in_units(posture.leg, 1.0, 1.0)  # without gravity
    collision = kd.collide(leg.posture(posture.q), v, ball, contact, **options)
    before = chains.momentum(leg, posture.q, v, ball, collision.ball_before)
    after = chains.momentum(leg, collision.q_after, collision.v_after, ball, collision.ball_after)
    agrees(after, before, integrated(1e-8))
    turned = np.linalg.norm(collision.ball_after.spin - collision.ball_before.spin)
    assert bool(turned > 0.1) is (friction > 0)
    energy = chains.kinetic_energy(leg.posture(posture.q), v, ball, collision.ball_before)
    left = leg.posture(collision.q_after), collision.v_after, ball, collision.ball_after
    lost = energy - chains.kinetic_energy(*left)
    assert 0 < collision.energy_lost == pytest.approx(lost, abs=integrated(1e-8) * energy)


@pytest.mark.parametrize("seed", range(6))
def test_energy_is_accounted_for(seed):
    """With torques, rotors, both springs, friction, and a particle whose spin stays."""
    rng = np.random.default_rng(seed)
    e, friction = rng.uniform(0.1, 1), 0.3 * (seed % 2)
    leg = LEG.with_armature({"hip": 0.3, "knee": 0.2}) if seed == 0 else chains.random_leg(rng)
    (posture, v, ball, contact), options = chains.random_kick(
        rng, leg, restitution=e, friction=friction
    )
    ball = kd.Ball(ball.mass, ball.radius, math.inf if seed == 5 else 2 / 3, pressure=9e5)
    stiffness = "pressure" if seed == 1 else 10 ** rng.uniform(6, 9)
    collision = kd.collide(
        posture, v, ball, contact, stiffness=stiffness, torque=lambda t, q, v: 5 * np.cos(v),
        **options,
    )  # fmt: skip
    assert collision.energy_residual <= integrated(1e-9)
    assert collision.energy_lost > 0
    if seed == 5:
        assert collision.ball_after.spin.tolist() == options["ball_spin"].tolist()


def test_the_energy_residual_is_the_energy_that_is_missing():
    """At a tolerance so loose that it is far above rounding; the spring is slack at the end."""
    ball, kick = kd.Ball(), (chains.rails().posture([0.0]), [9.0])
    collision = kd.collide(*kick, ball, kd.Contact(AHEAD, 0.5), tol=1e-3)
    after = 0.5 * (2.0 * collision.v_after[0] ** 2 + ball.mass * collision.ball_after.speed**2)
    missing = abs(0.5 * 2.0 * 9.0**2 - collision.energy_lost - after)
    share = missing / (0.5 / (1 / 2.0 + 1 / ball.mass) * 9.0**2)
    assert collision.energy_residual == pytest.approx(share, rel=closed_form(1 / share))
    assert collision.energy_residual > closed_form(1e3)


def test_pressed_twice():
    """A push in restitution that exceeds the first compression: the contact hardens again."""

    def push(t, q, v):
        return [8000.0 * math.exp(-(((t - 0.009) / 0.0015) ** 2))]

    kick = chains.rails().posture([0.0]), [5.0], kd.Ball(), kd.Contact(AHEAD, 0.6)
    collision = kd.collide(*kick, contact_time=0.009, torque=push, tol=1e-11)
    deflection = collision.sample(np.linspace(0, collision.contact_time, 400)).deflection
    first, second = np.flatnonzero(np.diff(np.sign(np.diff(deflection))) < 0)
    assert deflection[second] > 1.05 * deflection[first]
    assert collision.energy_residual < integrated(1e-11)
    end = collision.sample(collision.contact_time)
    assert end.deflection == pytest.approx((1 - 0.36) * collision.deflection, rel=integrated(1e-9))
    assert np.linalg.norm(end.force) < integrated(1e-8) * collision.peak_force


LIMITS = {
    "human": ((*KICK, kd.Ball(), TOUCH), {}, "newton"),
    "chain": (*chains.random_kick(np.random.default_rng(1),
              chains.random_leg(np.random.default_rng(1)), restitution=0.6), "newton"),
    "slip": ((*KICK, kd.Ball(), kd.Contact((1, 0, 0.6), 0.5, 0.1)), {}, "newton"),
    "stick": ((*KICK, kd.Ball(), kd.Contact((1, 0, 0.6), 0.5, 0.8)), {}, "stronge"),
}  # fmt: skip


@pytest.mark.parametrize("name", LIMITS)
def test_the_instant_is_the_limit(name):
    """The error falls with the contact time; points that stick do so by the law `stronge`."""
    kick, options, law = LIMITS[name]
    instant = kd.strike(*kick, law, **options)
    assert instant.sticking is (name == "stick")
    options = options | {"tol": 1e-9 if name == "stick" else 1e-11}
    hits = [kd.collide(*kick, contact_time=time, **options) for time in (4e-5, 1e-5, 1e-7)]
    for read in (lambda hit: hit.impulse, lambda hit: hit.v_after, lambda hit: hit.energy_lost):
        far, near, least = (np.linalg.norm(read(hit) - read(instant)) for hit in hits)
        assert 10.0 * least <= near <= 1e-2 * np.linalg.norm(read(instant))
        assert far / near == pytest.approx(4.0, rel=0.05)


BOLT = kd.Leg.from_robot("bolt", base="floating")
HELD = {
    "sole": BOLT.with_supports("FL_FOOT"),
    "point": BOLT.with_supports(kd.Support("FL_FOOT", point=True)),
    "loop": chains.fourbar(),
}


@pytest.mark.parametrize("name", HELD)
def test_with_supports_and_loops_the_instant_is_the_limit(name):
    """Linearly in the contact time; the constraints hold at the end; joints have the impulses."""
    leg = HELD[name]
    if name == "loop":
        q = leg.close_loops(leg.configuration({"rocker_b": 0.6, "hip": 0.2}), ["rocker_b"])
    else:
        q = leg.configuration({"FR_HFE": 0.4, "FR_KFE": -0.8, "FL_KFE": 0.3})
    posture = leg.posture(q)
    kick = posture, posture.joint_velocity([6, 0, 2]), kd.Ball(), kd.Contact((3, 0, 1), 0.7)
    instant, errors, joints = kd.strike(*kick), [], []
    for time in (1e-3, 1e-4):
        collision = kd.collide(*kick, contact_time=time, tol=1e-8)
        errors.append(np.linalg.norm(collision.impulse - instant.impulse))
        joints.append(np.abs(collision.joint_impulses - instant.joint_impulses).max())
        assert collision.energy_residual < integrated(1e-8)
        rows = leg.posture(collision.q_after).constraint_projector.rows
        np.testing.assert_allclose(rows @ collision.v_after, 0.0, atol=integrated(1e-8))
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.1)
    assert errors[1] < 0.01 * np.linalg.norm(instant.impulse)
    assert joints[1] < min(0.12 * joints[0], 0.01 * np.abs(instant.joint_impulses).max())


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_the_impulse_is_the_integral_of_the_force(friction):
    collision = human(kd.Contact((1, 0, 0.3), 0.5, friction))
    nodes, weights = np.polynomial.legendre.leggauss(100)
    samples = collision.sample(0.5 * collision.contact_time * (1 + nodes))
    total = 0.5 * collision.contact_time * weights @ samples.force
    agrees(total, collision.impulse, 1e-3)  # there is a kink between nodes
    agrees(collision.sample(collision.contact_time).impulse, collision.impulse, closed_form())
    sizes = np.linalg.norm(samples.force, axis=1)
    for largest, sampled in (
        (collision.peak_force, sizes), (collision.deflection, samples.deflection),
    ):  # fmt: skip
        assert sampled.max() <= largest * (1 + closed_form(1e4))
        assert sampled.max() == pytest.approx(largest, rel=1e-2)  # of 100 samples
    assert collision.flattening == collision.deflection


@pytest.mark.parametrize("tol", [1e-6, 1e-9])
def test_the_error_is_no_less_than_estimated(tol):
    exact, rough = human(tol=1e-13), human(tol=tol)
    difference = np.linalg.norm(rough.impulse - exact.impulse)
    assert difference <= rough.error <= integrated(tol, 1000) * np.linalg.norm(exact.impulse)
    assert rough.energy_residual < integrated(tol)


@pytest.mark.parametrize(("speed", "pull"), [(2e-6, 0), (2e-6, 9), (3e-4, 900), (0.03, 30)])
def test_a_foot_that_grazes_the_ball(speed, pull):
    """It slides at 10 m/s and is pulled back: a linear spring has d'' = -w^2 d - a."""
    ball, leg, contact = kd.Ball(pressure=80e3), chains.rails("xy"), kd.Contact(AHEAD, 0.1, 0.3)
    w, x = math.sqrt(ball.stiffness * (0.5 + 1 / ball.mass)), 2.0 * math.atan2(1.0, pull)
    exact = 2.0 * math.sin(x / 2) ** 2 - pull * (x - math.sin(x))  # x: w T, where e is 1
    kick = leg.posture([0.0, 0.0]), [speed, 10.0], ball, contact
    linear = {"stiffness": "pressure", "torque": [-2.0 * pull * w * speed, 0.0]}
    hertz = {"contact_time": 0.01, "torque": [-200.0 * pull * speed, 0.0]}
    fine = kd.collide(*kick, **hertz, tol=1e-12).impulse[0]
    for options, right in ((linear, 0.55 * exact * ball.stiffness * speed / w**2), (hertz, fine)):
        one = kd.collide(*kick, **options)
        many = kd.collide_many(leg, [[0, 0]], [[speed, 10.0]], ball, contact, tol=1e-9, **options)
        bound = min(integrated(1e-9) + 1e-14 / one.deflection, 30.0 * one.error / right)
        assert [one.impulse[0], many.impulse[0, 0]] == pytest.approx([right] * 2, rel=bound)
        assert one.impulse[1] == pytest.approx(0.3 * right, rel=bound)  # it slides to the end


def test_a_foot_that_turns_turns_the_force():
    """The plane of contact goes with the foot, by the angle that it turns in the meantime."""
    collision = human()
    force = collision.sample([1e-6, collision.contact_time * (1 - 1e-6)]).force
    angles = np.arctan2(force[:, 2], force[:, 0])
    turn = np.array([-1, 1, 1]) @ (collision.q_after - collision.posture.q)  # of the foot about y
    assert angles[1] - angles[0] == pytest.approx(-turn, rel=1e-3)
    assert abs(turn) > 0.07


def test_a_base_that_moves_is_another_frame_of_reference():
    hip, velocity = np.array([4.0, 0.5, -0.3]), np.array([1.0, 0.3, 0.2])
    kick = [8.25, -18.15, 2.48], kd.Ball(), kd.Contact((2, 0.3, 1), 0.7, 0.4)
    q = np.radians([40, 30, -20])
    seen = kd.collide(LEG.posture(q), *kick, ball_velocity=velocity - hip)
    moving = LEG.with_base_velocity(hip).posture(q)
    collision = kd.collide(moving, *kick, ball_velocity=velocity)
    agrees(collision.ball_after.velocity, seen.ball_after.velocity + hip, closed_form(10))
    position = seen.ball_after.position + hip * seen.contact_time
    agrees(collision.ball_after.position, position, closed_form(10))
    agrees(collision.impulse, seen.impulse, closed_form(10))
    with pytest.raises(kd.InvalidInput, match="base"):
        kd.collide(LEG.with_base_velocity(hip, (0, 1, 0)).posture(q), *kick)


@pytest.mark.parametrize("options", [{}, {"torque": [50.0, 0.0, 0.0]}, {"stiffness": "pressure"}])
def test_a_copy_runs_again_to_the_same_digits(options):
    torque = options.get("torque") and np.array(options["torque"])
    ball, contact = kd.Ball(pressure=80e3), kd.Contact((1, 0, 0.3), 0.5, 0.3)
    motion = {"ball_velocity": (-2, 1, 0), "ball_spin": (0, 300, 50)}
    collision = human(contact, ball, tol=1e-6, **(options | {"torque": torque}), **motion)
    if torque is not None:
        torque[:] = -500.0
    again = pickle.loads(pickle.dumps(collision))
    assert again.impulse.tolist() == collision.impulse.tolist()
    assert (again.force_model, again.tol) == (collision.force_model, 1e-6)
    assert again.ball_before == collision.ball_before
    assert collision.error < integrated(1e-6, 1000) * np.linalg.norm(collision.impulse)
    damped = human(torque=lambda t, q, v: -0.5 * v, tol=1e-6)
    assert copy.deepcopy(damped).impulse.tolist() == damped.impulse.tolist()


@pytest.mark.parametrize(("options", "words"), [
    ({"contact_time": 10}, r"contact time is 10.* at most 0\.1"),
    ({"contact_time": 1e-12}, "contact time is 1e-12.*at least 1e-09"),
    ({"stiffness": 1e30}, "stiffness is 1e.30 .*too high"),
    ({"ball_velocity": (-1e13, 0, 0)}, "stiffness is .*radius.*speed of"),
    ({"contact_time": 0.01, "stiffness": 1e5}, "only one"), ({"contact_time": 0.0}, "time is 0"),
    ({"stiffness": -1.0}, "stiffness is -1"), ({"stiffness": 1e3}, "stiffness is 1000 .*radius"),
    ({"stiffness": "pressure", "ball": kd.Ball(pressure=2e3)}, "pressure is 2000 .*radius"),
    ({"stiffness": "air"}, "'air': .*'pressure'"), ({"torque": lambda: None}, "torque .*t, q, v"),
    ({"stiffness": "pressure"}, "ball pressure is None"), ({"torque": [1.0]}, r"shape \(1,\)"),
    ({"stiffness": "inflated"}, "restitution 'inflated'"), ({"tol": 0.1}, r"tol is 0\.1"),
    ({"torque": lambda t, q, v: math.nan * v}, "torque is .*finite"),
    ({"contact": kd.Contact((1, 0, 0.3), 0.0)}, r"restitution is 0\.0: .*0\.01"),
    ({"ball_velocity": (14 - 1e-7, 0, 4)}, "approach speed is .*at least 1e-06"),
    ({"ball": kd.Ball(math.inf)}, "mass is inf"), ({"model": "disc"}, "model is 'disc'")
])  # fmt: skip
def test_bad_input(options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        human(**options)


def test_contacts_that_cannot_be_integrated_are_refused(monkeypatch):
    monkeypatch.setattr(contact_phases, "MAX_EVALUATIONS", 100)
    for torque in ([1e300] * 3, lambda t, q, v: [1e308] * 3):
        with pytest.raises(kd.KickdynError, match=r"precision|integrator failed"):
            human(torque=torque)
    with pytest.raises(kd.KickdynError, match=r"100 evaluations.*friction 70"):
        human(kd.Contact((1, 0, 0.3), 0.5, 70.0), torque=lambda t, q, v: np.zeros(3))
    leg = HELD["sole"]
    with pytest.raises(kd.InvalidInput, match="v moves FL_FOOT"):
        kd.collide(leg.posture(leg.configuration()), np.ones(leg.nv), kd.Ball(), TOUCH)


@pytest.mark.parametrize("times", [1.0, [[0.0]]])
def test_a_sample_outside_the_contact_is_refused(times):
    with pytest.raises(kd.InvalidInput, match=r"contact lasts|number or"):
        human(tol=1e-6).sample(times)
