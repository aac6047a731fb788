"""The force of an inflated ball in `collide`: limits, balances, and another integrator."""

import math
import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from chains import random_kick, random_leg
from scipy.integrate import quad, solve_ivp

import kickdyn as kd
from kickdyn.impact import collide as collide_module
from kickdyn.impact.inflated_force import InflatedForce
from kickdyn.restitution import SHELL_RESTITUTION

BALL = kd.Ball(pressure=80e3)
CONTACT = kd.Contact((1, 0, 0), "inflated")
WALL = 1e5
"""Mass of a foot that hardly gives way [kg]."""


@pytest.fixture
def force_of(monkeypatch):
    """Let `collide` take changed values of the force."""

    def change(**values):
        law = partial(replace, **values)
        of = classmethod(
            lambda cls, ball: law(InflatedForce(ball.mass, ball.radius, ball.pressure))
        )
        monkeypatch.setattr(collide_module.InflatedForce, "of", of)

    return change


def slider(mass):
    """A mass on a rail along x, without gravity."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    body = pin.Inertia(mass, np.zeros(3), 0.01 * np.eye(3))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity = pin.Motion.Zero()
    return kd.Leg.from_model(model, "toe")


def head_on(speed, mass=1.95, ball=BALL, contact=CONTACT, tol=1e-12, **options):
    return kd.collide(slider(mass).posture([0.0]), [speed], ball, contact, tol=tol, **options)


def ratio(hit):
    """Speed of separation over speed of approach."""
    return (hit.ball_after.velocity[0] - hit.v_after[0]) / hit.approach_speed


@pytest.mark.parametrize("share", [1.0, 0.6])
@pytest.mark.parametrize("speed", [4.0, 21.0])
def test_with_constant_pressure_a_wall_gives_the_restitution_of_strike(force_of, share, speed):
    force_of(gas_exponent=0.0, shell_share=share)
    ball = replace(BALL, shell_share=share)
    hit = head_on(speed, WALL, ball)
    assert ratio(hit) == pytest.approx(CONTACT.restitution_at(speed, ball), abs=3e-6)
    if share == 1.0:
        u = speed / ball.radius * math.sqrt(ball.mass / ball.stiffness)
        exact = SHELL_RESTITUTION * math.sqrt(1 - 2 * u / 3 + u * u / 8)
        share_of_ball = ball.mass / WALL  # what the wall gives way
        assert ratio(hit) == pytest.approx(exact, rel=share_of_ball)
        assert hit.deflection == pytest.approx(u * ball.radius, rel=share_of_ball)


@pytest.mark.parametrize("mass", [0.86, 1.95, WALL])
def test_with_compressed_air_it_stays_near(mass):
    for speed in (5.0, 20.0):
        assert ratio(head_on(speed, mass)) == pytest.approx(
            CONTACT.restitution_at(speed, BALL), rel=0.014
        )


@pytest.mark.parametrize(("mass", "speed"), [(0.86, 6.3), (1.95, 18.0)])
def test_ball_and_foot_by_another_method(mass, speed):
    """Radau, for the foot with the flat part and the rest of the ball, each with its momentum."""
    m, radius, outside = BALL.mass, BALL.radius, 101_325.0

    def push(u):
        left = 1 - u * u * (3 - u) / 4
        return ((80e3 + outside) * left**-1.4 - outside) * math.pi * radius**2 * u * (2 - u)

    def closing(_, y):
        u, foot, rest = y
        w = foot - rest
        return (
            w / radius,
            -(push(u) + m * w * w / (2 * radius)) / (mass + m * u / 2),
            (push(u) / (m * (1 - u / 2))),
        )

    def opening(_, y):
        u, foot, rest = y
        w, back = foot - rest, SHELL_RESTITUTION**2 * push(u)
        return (
            w / radius,
            -back / (mass + m * u / 2),
            ((back - m * w * w / (2 * radius)) / (m * (1 - u / 2))),
        )

    def at_rest(_, y):
        return y[1] - y[2]

    def apart(_, y):
        return y[0]

    at_rest.terminal = apart.terminal = True
    at_rest.direction = apart.direction = -1
    tol = {"method": "Radau", "rtol": 1e-11, "atol": 1e-12, "first_step": 1e-6}
    one = solve_ivp(closing, (0, 0.1), (0, speed, 0), events=at_rest, **tol)
    u, foot, rest = one.y[:, -1]
    other = solve_ivp(opening, (0, 0.1), (u, foot, rest), events=apart, **tol)
    _, foot, rest = other.y[:, -1]
    hit = head_on(speed, mass)
    assert ratio(hit) == pytest.approx((rest - foot) / speed, rel=1e-8)
    assert hit.ball_after.velocity[0] == pytest.approx(rest, rel=1e-8)
    assert hit.deflection == pytest.approx(u * radius, rel=1e-8)
    assert hit.contact_time == pytest.approx(one.t[-1] + other.t[-1], rel=1e-7)


@pytest.mark.parametrize("seed", [0, 1, 2, 4, 5])
@pytest.mark.parametrize("friction", [0.0, 0.3, 1.5])
def test_energy_and_momentum_are_balanced(seed, friction):
    rng = np.random.default_rng(seed)
    (posture, v, _, contact), options = random_kick(rng, random_leg(rng))
    contact = kd.Contact(contact.normal, "inflated", friction)
    hit = kd.collide(posture, v, kd.Ball(pressure=9e5), contact, tol=1e-12, **options)
    assert hit.energy_residual < 1e-10
    assert hit.energy_lost > 0.0
    times, weights = np.polynomial.legendre.leggauss(12)
    total, motion = np.zeros(3), hit._motion
    for begin, step in zip(motion.times, np.diff(motion.times), strict=False):
        samples = hit.sample(begin + 0.5 * step * (1 + times)).force
        total += 0.5 * step * weights @ samples
    assert total == pytest.approx(hit.impulse, abs=2e-7 * np.linalg.norm(hit.impulse))


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_free_foot_and_the_ball_keep_their_momentum(friction):
    """A body without any support, which turns; the flat part of the shell moves along."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    body = pin.Inertia(2.0, np.array([0.1, 0.02, -0.05]), np.diag([0.02, 0.03, 0.025]))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    frame = pin.SE3(np.eye(3), np.array([0.2, 0.03, 0.04]))
    model.addFrame(pin.Frame("toe", joint, 0, frame, pin.FrameType.OP_FRAME))
    model.gravity = pin.Motion.Zero()
    leg = kd.Leg.from_model(model, "toe")
    posture = leg.posture([0, 0, 0, 0, 0, 0, 1])
    v = np.array([14.0, 3.0, 1.0, 2.0, -6.0, 9.0])
    contact = kd.Contact((1, 0.2, 0.1), "inflated", friction)
    hit = kd.collide(posture, v, BALL, contact, tol=1e-12)

    def momentum(q, v, ball):
        data = model.createData()
        foot = pin.computeCentroidalMomentum(model, data, q, v)
        linear, about = foot.linear, foot.angular + np.cross(data.com[0], foot.linear)
        ball_linear = BALL.mass * ball.velocity
        spin = BALL.inertia * ball.spin + np.cross(ball.position, ball_linear)
        return np.concatenate([linear + ball_linear, about + spin])

    before = momentum(posture.q, v, hit.ball_before)
    after = momentum(hit.q_after, hit.v_after, hit.ball_after)
    assert after == pytest.approx(before, abs=1e-10 * np.abs(before).max())
    assert hit.energy_residual < 1e-10
    assert (np.abs(hit.ball_after.spin).max() > 1.0) == (friction > 0.0)


def test_small_deflections_give_the_spring_from_pressure(force_of):
    force_of(shell_restitution=1.0)
    for speed in (0.05, 0.1):
        hit, spring = head_on(speed), head_on(speed, contact=replace(CONTACT, restitution=1.0),
                                              stiffness="pressure")  # fmt: skip
        small = spring.deflection / BALL.radius
        assert abs(hit.peak_force / spring.peak_force - 1) < small
        assert abs(hit.contact_time / spring.contact_time - 1) < small
        assert 1 - ratio(hit) == pytest.approx(small / 3, rel=0.25)


def test_without_a_mass_of_the_shell_nothing_is_lost(force_of):
    force_of(shell_share=0.0, shell_restitution=1.0)
    hit = head_on(15.0)
    assert ratio(hit) == pytest.approx(1.0, rel=1e-9)
    assert hit.energy_lost == pytest.approx(0.0, abs=1e-10)
    rows = CONTACT.for_ball(replace(BALL, shell_share=0.0)).restitution.rows
    assert [e for _, e in rows] == pytest.approx([SHELL_RESTITUTION] * len(rows), rel=1e-14)


@pytest.mark.parametrize("share", [0.3, 0.97])
def test_the_restitution_of_a_lighter_shell(share):
    rows = CONTACT.for_ball(replace(BALL, shell_share=share)).restitution.rows
    scale = BALL.radius**2 * BALL.stiffness / BALL.mass
    for k in (7, 30):
        u = 0.02 * k
        work = quad(lambda x: x * (2 - x) / (1 - share * x / 2), 0, u, epsrel=1e-13)[0]
        gained = quad(lambda x: x * (2 - x) * (1 - share * x / 2), 0, u, epsrel=1e-13)[0]
        speed, e = rows[k]
        assert speed == pytest.approx(math.sqrt(scale * work), rel=1e-12)
        assert e == pytest.approx(SHELL_RESTITUTION * math.sqrt(gained / work), rel=1e-12)


def test_pressed_again_in_the_rebound():
    """Below the largest deflection the ball pushes as in the rebound; beyond it, as before."""

    def push(t, q, v):
        return [9000.0 * math.exp(-(((t - 0.009) / 0.0015) ** 2))]

    hit = head_on(5.0, 2.0, torque=push)
    deflection = hit.sample(np.linspace(0, hit.contact_time, 400)).deflection
    assert len(np.flatnonzero(np.diff(np.sign(np.diff(deflection))) < 0)) == 2
    assert hit.energy_residual < 1e-9


def test_another_run_has_the_same_force():
    hit = head_on(12.0, tol=1e-7)
    again = pickle.loads(pickle.dumps(hit))
    assert again.force_model == hit.force_model == InflatedForce.of(BALL)
    assert (again.impulse == hit.impulse).all()
    assert hit.error < 1e-5 * hit.impulse[0]
    named = head_on(12.0, tol=1e-7, stiffness="inflated")
    assert (named.impulse == hit.impulse).all()
    assert hit.visible_contact_time == hit.contact_time


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: head_on(9.0, ball=kd.Ball()), "ball pressure is None: .*'inflated'"),
        (lambda: kd.Ball(pressure=0), r"ball pressure is 0(\.0)?: .*at least 2000"),
        (
            lambda: kd.Ball(shell_share=1.1),
            r"shell share is 1\.1: .*at most 1 \[of the mass of the ball\]",
        ),
        (
            lambda: head_on(90.0, ball=kd.Ball(pressure=2e3)),
            r"ball pressure is 2000 Pa: too low, .* beyond its radius .* speed of 90 m/s",
        ),
        (
            lambda: head_on(9.0, contact=kd.Contact((1, 0, 0), 0.8), stiffness="inflated"),
            "stiffness is 'inflated': it needs a contact with the restitution 'inflated'",
        ),
    ],
)
def test_bad_input(call, line):
    with pytest.raises(kd.InvalidInput, match=line) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_a_speed_beyond_the_model_is_named():
    assert not head_on(20.0, tol=1e-6).warnings
    fast = head_on(34.0, tol=1e-6)
    (line,) = fast.warnings
    share = fast.deflection / BALL.radius
    assert line == (
        f"the ball is flattened by {share:.3f} of its radius at an approach speed of 34 m/s: the "
        "model 'inflated' goes up to 0.6"
    )
