"""The contact of an inflated ball with a strip of a foot."""

import math
import pickle

import numpy as np
import pytest
from chains import free_body, momentum, rails
from scipy.integrate import dblquad
from tolerances import agrees, closed_form, differenced, integrated

import kickdyn as kd
from kickdyn.impact.patch_contact import FootPatch, overlap

BALL = kd.Ball(pressure=80e3)
R = BALL.radius


FOOT, FREE = rails("xyz", 1.95).posture(np.zeros(3)), free_body()


def kick(patch, friction=0.0, e="inflated", v=(14.0, 0.0, 0.0), foot=FOOT, **options):
    contact = kd.Contact((1, 0, 0), e, friction)
    return kd.collide(foot, v, BALL, contact, model=patch, **{"tol": 1e-8, **options})


@pytest.mark.parametrize(
    ("deflection", "centre", "half"),
    [(0.02, 0.01, math.inf), (0.02, 0.01, 0.03), (0.04, 0.05, 0.03), (0.05, -0.02, 0.04)],
)
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
    turns = np.linspace(-math.pi, math.pi, 400_001)[:-1]
    x, y = a * np.sin(turns), a * np.cos(turns)
    inside = (x >= low) & (x <= high)
    rim = [f[inside].sum() * 2 * math.pi / 400_000 for f in (np.ones_like(x), x, x * x, y * y)]
    assert shape.rim == pytest.approx(rim, rel=1e-4, abs=1e-6)  # sums of 400,000 points


@pytest.mark.parametrize("speed", [2.0, 14.0])
def test_a_wide_strip_is_the_point(speed):
    """The force of the plane, up to the second order of the deflection, and no spin."""
    wide = kick(FootPatch(0.3, 0.01), v=(speed, 0, 0))
    point = kd.collide(FOOT, (speed, 0, 0), BALL, wide.contact, tol=1e-8)
    second = 0.25 * (point.deflection / R) ** 2
    velocity = point.ball_after.velocity
    np.testing.assert_allclose(wide.ball_after.velocity, velocity, atol=second * speed)
    np.testing.assert_allclose(wide.ball_after.spin, 0.0, atol=integrated(1e-8, 10))
    elastic = kick(FootPatch(math.inf), e=0.7)
    parting = elastic.ball_after.velocity[0] - elastic.v_after[0]
    assert parting == pytest.approx(14.0 * 0.7, rel=integrated(1e-8))


def test_spin_from_the_edge_of_a_strip():
    """None from its middle, the opposite from the other edge, none without loss and friction."""
    spins = {x: kick(FootPatch(0.08, x)).ball_after.spin[2] for x in (0.0, 0.03, -0.03)}
    assert abs(spins[0.0]) < integrated(1e-8, 10)
    assert 1.0 < spins[0.03] < 15.0
    assert spins[-0.03] == pytest.approx(-spins[0.03], rel=integrated(1e-8))
    # The pressure acts through the centre, because a turned sphere has the same overlap.
    elastic = kick(FootPatch(0.08, 0.03), e=1.0)
    np.testing.assert_allclose(elastic.ball_after.spin, 0.0, atol=closed_form(100))
    assert elastic.energy_lost == pytest.approx(0.0, abs=closed_form(100))
    assert elastic.ball_after.velocity[1] > 1.0  # the edge pushes it aside


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


def bounce(grip, friction=0.8):
    """A ball at 10 m/s that meets a level, wide and heavy foot, 45 degrees from above."""
    contact = kd.Contact((0, 0, 1), "inflated", friction)
    velocity = 10.0 * np.array([1, 0, -1]) / math.sqrt(2)
    foot, patch = rails("xyz", 1e4), FootPatch(math.inf, across=(1, 0, 0), grip=grip)
    kick = foot.posture(np.zeros(3)), np.zeros(3), BALL, contact
    return (
        kd.collide(*kick, model=patch, ball_velocity=velocity, tol=1e-7),
        kd.strike(*kick, law="stronge", ball_velocity=velocity).ball_after,
    )


def test_a_patch_that_grips_turns_the_ball_faster_than_rolling():
    """A rigid contact that sticks ends in rolling; the shear of the patch gives some of it back."""
    collision, rolling = bounce(2 / 3)
    after = collision.ball_after
    assert after.velocity[0] - R * after.spin[1] < -0.1
    assert rolling.velocity[0] == pytest.approx(R * rolling.spin[1], rel=1e-3)
    assert after.spin[1] > rolling.spin[1]


def test_a_patch_that_slides_has_coulombs_friction():
    along, _, up = bounce(30.0, 0.05)[0].impulse
    assert along == pytest.approx(-0.05 * up, rel=0.02)


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


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: FootPatch(0.0), "width is 0.*above 0"),
        (lambda: FootPatch(0.1, math.nan), "offset is nan"),
        (lambda: FootPatch(0.1, grip=0), "grip is 0"),
        (lambda: kick(FootPatch(0.1, across=(1, 0, 0))), "direction .*normal"),
        (lambda: kick("patch"), "toe"),
        (lambda: kick(FootPatch(0.1), stiffness=1e5), "100000.*pressure"),
        (lambda: kick(FootPatch(0.04, 0.08), tol=1e-6), "14 m/s.*radius"),
        (lambda: kick(FootPatch(0.08, 30.0)), "offset is 30 m: .*less than 0.149"),
        (
            lambda: kd.collide(FOOT, (9, 0, 0), kd.Ball(), kd.Contact((1, 0, 0)),
                               model=FootPatch(0.1)),
            "pressure is None",
        ),
        (lambda: kick(FootPatch(0.1), tol=1e-5).joint_impulses, "'patch'.*'point'"),
    ],
)  # fmt: skip
def test_bad_input(call, words):
    with pytest.raises(kd.InvalidInput, match=words):
        call()
