"""The contact of an inflated ball with a strip of a foot."""

import math
import pickle

import numpy as np
import pytest
from chains import fourbar, free_body, momentum, rails
from scipy.integrate import dblquad
from tolerances import agrees, closed_form, differenced, integrated

import kickdyn as kd
from kickdyn.impact.force_model import GAS_EXPONENT, gauge_pressure
from kickdyn.impact.patch_contact import FootPatch, _across, overlap
from kickdyn.restitution import SHELL_RESTITUTION

BALL = kd.Ball(pressure=80e3)
R = BALL.radius


FOOT, FREE = rails("xyz", 1.95).posture(np.zeros(3)), free_body()


def kick(patch, friction=0.0, e="inflated", v=(14.0, 0.0, 0.0), foot=FOOT, ball=BALL, **options):
    contact = kd.Contact((1, 0, 0), e, friction)
    return kd.collide(foot, v, ball, contact, model=patch, **{"tol": 1e-8, **options})


@pytest.mark.parametrize(("deflection", "centre", "half"), [
    (0.02, 0.01, math.inf), (0.02, 0.01, 0.03), (0.04, 0.05, 0.03), (0.05, -0.02, 0.04)
])  # fmt: skip
def test_the_overlap_is_an_integral_and_has_these_slopes(deflection, centre, half):
    a, height = math.sqrt(deflection * (2 * R - deflection)), R - deflection
    low, high = max(-a, -half - centre), min(a, half - centre)

    def edge(x):
        return math.sqrt(max(a * a - x * x, 0.0))

    def over(f):
        return dblquad(f, low, high, lambda x: -edge(x), edge, epsabs=1e-12, epsrel=1e-9)[0]

    def slope(name, along, across, h=1e-6):
        ends = [
            np.array(getattr(overlap(deflection + s * along, centre + s * across, R, half), name))
            for s in (h, -h)
        ]
        return (ends[0] - ends[1]) / (2 * h)

    shape = overlap(deflection, centre, R, half)
    depth = over(lambda y, x: math.sqrt(R * R - x * x - y * y) - height)
    assert shape.volume == pytest.approx(depth, rel=integrated(1e-9))
    assert shape.area == pytest.approx(over(lambda y, x: 1.0), rel=integrated(1e-9))
    slopes = [slope(name, *way) for name in ("volume", "area") for way in ((1, 0), (0, 1))]
    right = [shape.area, shape.across, *shape.area_slopes]
    assert slopes == pytest.approx(right, rel=differenced(1), abs=differenced())


@pytest.mark.parametrize("speed", [2.0, 14.0])
def test_a_wide_strip_is_the_point(speed):
    """The force of the plane, up to the second order of the deflection, and no spin."""
    wide = kick(FootPatch(0.3, 0.01), v=(speed, 0, 0))
    point = kd.collide(FOOT, (speed, 0, 0), BALL, wide.contact, tol=1e-8)
    second = 0.25 * (point.deflection / R) ** 2
    velocity = point.ball_after.velocity
    np.testing.assert_allclose(wide.ball_after.velocity, velocity, atol=second * speed)
    np.testing.assert_allclose(wide.ball_after.spin, 0.0, atol=integrated(1e-8, 10))


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize(("offset", "e"), [(0.0, "inflated"), (0.025, "inflated"), (0.025, 0.7)])
def test_energy_and_momentum_are_balanced(friction, offset, e):
    v, spin = np.array([14.0, 3.0, 1.0, 1.0, -4.0, 3.0]), (5.0, -10.0, 20.0)
    collision = kick(FootPatch(0.08, offset), friction, e, v, FREE, ball_spin=spin, tol=1e-10)
    before = momentum(FREE.leg, FREE.q, v, BALL, collision.ball_before)
    after = momentum(FREE.leg, collision.q_after, collision.v_after, BALL, collision.ball_after)
    agrees(after, before, integrated(1e-10))
    assert collision.energy_residual < integrated(1e-10)
    assert collision.energy_lost > 0.0
    motion, totals = collision._motion, []  # of air and bristles, too, while they store some
    for t in np.linspace(0.0, 0.9 * collision.contact_time, 5):
        now = motion.equations.state(motion.column(t))
        totals.append(motion.equations.energy(motion.column(t), 0.0) + now.lost - now.work)
    agrees(totals, np.full(5, totals[0]), integrated(1e-10))


def test_what_holds_a_spin_or_a_loop_is_accounted_for():
    """A particle keeps its spin whatever turns it; a loop that is closed does no work."""
    particle = kd.Ball(inertia_factor=math.inf, pressure=80e3)
    loop = fourbar()
    bent = loop.posture(loop.close_loops(loop.configuration({"rocker_b": 0.6}), ["rocker_b"]))
    for foot, v, ball in (
        (FREE, (14.0, 3.0, 1.0, 1.0, -4.0, 3.0), particle),
        (bent, bent.joint_velocity((8.0, 0.0, 1.0)), BALL),
    ):
        options = {"foot": foot, "ball": ball, "ball_spin": (5.0, -10.0, 20.0), "tol": 1e-10}
        collision = kick(FootPatch(0.08, 0.025), 0.5, v=v, **options)
        assert collision.energy_residual < integrated(1e-10)
        assert (collision.ball_after.spin.tolist() == [5, -10, 20]) is (ball is particle)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize(("share", "offset", "e"), [
    (0.15, 0.025, "inflated"), (0.35, -0.01, "inflated"), (0.85, 0.025, "inflated"),
    (0.3, -0.025, 0.7), (0.85, 0.025, 0.7), (0.1, 0.05, "inflated")])  # fmt: skip
def test_pressure_stopped_shell_and_bristles_push_and_turn_the_ball(share, offset, e, friction):
    """On a foot that does not turn. In restitution the pressure pushes with e^2 of its force.

    Of the shell's mass s m, s m / (4 pi R) flows through each radian of the rim and metre of
    approach, and loses the velocity towards the foot that it has there. The bristles of the disc
    A have the shear xi, the stiffness k A and f = -k A xi, with
    xi' = w - k A |w| xi / (mu N) - max(A', 0) xi / A for the sliding w.
    """
    motion = {"v": (14.0, 3.0, 1.0), "ball_spin": (5.0, -10.0, 60.0 if offset < 0.05 else 900.0)}
    collision = kick(FootPatch(0.08, offset), friction, e, tol=1e-10, **motion)
    motion, times = collision._motion, np.linspace(0.0, collision.contact_time, 200)
    largest = times[np.argmax(collision.sample(times).deflection)]
    t, h = share * collision.contact_time, 1e-6 * collision.contact_time
    assert (share > 0.5) == (t > largest)
    columns = [motion.column(x) for x in (t - h, t, t + h)]
    states = [motion.equations.state(y) for y in columns]
    heights = [R + x.moved[0] - x.q[0] for x in states]
    sides = [offset + x.moved[1] - x.q[1] for x in states]
    shapes = [overlap(R - x, side, R, 0.04) for x, side in zip(heights, sides, strict=True)]
    (ball, omega), foot, height, shape = states[1].motion, states[1].v, heights[1], shapes[1]
    turns = 2.0 * math.pi * (np.arange(400_000) + 0.5) / 400_000
    rim = math.sqrt(R * R - height * height) * np.array([np.cos(turns), np.sin(turns)])
    y, z = rim[:, np.abs(sides[1] + rim[0]) < 0.04]
    towards = foot[0] - ball[0] - omega[1] * z + omega[2] * y
    shell, e = (BALL.shell_share, SHELL_RESTITUTION) if e == "inflated" else (0.0, e)
    flow = shell * BALL.mass / (4.0 * math.pi * R) * max(foot[0] - ball[0], 0.0)
    stopped = flow * towards * 2.0 * math.pi / 400_000
    stopped *= stopped.sum() > 0.0  # else the shell recedes
    pressure = gauge_pressure(shape.volume / BALL.volume, 80e3, GAS_EXPONENT)
    pressure *= e**2 if share > 0.5 else 1.0
    normal, shear = pressure * shape.area + stopped.sum(), columns[1][-2:] * (friction > 0.0)
    mass = 1.0 / (1.0 / 1.95 + 1.0 / BALL.mass)
    stiffness = 2.0 / 3.0 * 80e3 / (14.0 * math.sqrt(mass / BALL.stiffness)) * shape.area
    f = -stiffness * shear
    force = np.array([normal, f[0] - pressure * shape.across, f[1]])
    agrees(collision.sample(t).force, force, 1e-4)  # a sum of 400,000 points
    turned = BALL.inertia * (states[2].motion[1] - states[0].motion[1]) / (2.0 * h)
    torque = [0.0, z @ stopped + height * f[1], -y @ stopped - height * f[0]]
    np.testing.assert_allclose(turned, torque, atol=1e-4 * R * normal)
    if friction > 0.0:
        sliding = ball + np.cross(omega, [-height, 0.0, 0.0]) - foot
        growth = max(shapes[2].area - shapes[0].area, 0.0) / (2.0 * h)
        fading = stiffness * math.hypot(*sliding[1:]) / (friction * normal) + growth / shape.area
        rate = (columns[2][-2:] - columns[0][-2:]) / (2.0 * h)
        agrees(rate, sliding[1:] - fading * shear, 1e-3)


def test_the_strip_is_measured_across_the_normal():
    """Along a given direction, else level; the stiffness is that of incompressible bodies."""
    for n, given in np.random.default_rng(1).normal(size=(5, 2, 3)):
        n /= np.linalg.norm(n)
        level, across = _across(n, None), _across(n, given)
        agrees([level @ n, level[2], across @ n], np.zeros(3), closed_form())
        agrees([level @ level, across @ across], np.ones(2), closed_form())
        assert np.cross(across, n) @ given == pytest.approx(0.0, abs=closed_form())
        assert across @ given > 0.0
    assert _across(np.array([0.0, 0.0, 1.0]), None).tolist() == [0.0, 1.0, 0.0]
    assert FootPatch(0.1).grip == pytest.approx(2 * (1 - 0.5) / (2 - 0.5))  # Mindlin (1949)


def test_the_surface_of_a_foot():
    """`patch` has the width of the surface, and the offset of the contact across it."""
    leg = kd.kick_with(kd.Leg.from_robot("g1"), "instep")
    posture = leg.posture(leg.configuration())
    v, width = posture.joint_velocity([8.0, 0, 0]), kd.foot_surfaces(leg)["instep"].size[0]
    contact = kd.Contact((1, 0, 0), "inflated", 0.4, offset=(0, 0.01, 0))
    named, explicit = (
        kd.collide(posture, v, BALL, contact, model=model, tol=1e-5)
        for model in ("patch", FootPatch(float(width), 0.01))
    )
    agrees(named.impulse, explicit.impulse, integrated(1e-6))
    assert pickle.loads(pickle.dumps(named)).impulse.tolist() == named.impulse.tolist()


@pytest.mark.parametrize(("call", "words"), [
    (lambda: FootPatch(0.0), "width is 0.*above 0"),
    (lambda: FootPatch(0.1, math.nan), "offset is nan"),
    (lambda: FootPatch(0.1, grip=0), "grip is 0"),
    (lambda: kick(FootPatch(0.1, across=(1, 0, 0))), "direction .*normal"),
    (lambda: kick("patch"), "toe"),
    (lambda: kick(FootPatch(0.1), stiffness=1e5), "100000.*pressure"),
    (lambda: kick(FootPatch(0.04, 0.08), tol=1e-6), "14 m/s.*radius"),
    (lambda: kick(FootPatch(0.08, 30.0)), "offset is 30 m: .*less than 0.149"),
    (lambda: kick(FootPatch(0.1), ball=kd.Ball()), "pressure is None"),
    (lambda: kick(FootPatch(0.1), tol=1e-5).joint_impulses, "'patch'.*'point'")])  # fmt: skip
def test_bad_input(call, words):
    with pytest.raises(kd.InvalidInput, match=words):
        call()
