import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.scatter import UNITS, landing_slopes, scatter
from kickdyn.planning.scatter import _launch_slopes as launch_slopes

LEG, BALL, AIR = kd.Leg.from_robot("g1", legs_only=True), kd.Ball(), kd.Air(drag="brazuca")
HIT = kd.plan_kick(LEG, kd.Goal((6, 1, 0), time=0.9, spin=(0, -12, 6)), BALL, AIR).impact
SMALL = {"speed": 2e-3, "angle": 1e-3, "contact": 1e-4, "restitution": 2e-3, "drag": 0.02}
LAUNCH = [name for name in UNITS if name != "drag"]


def across(direction):
    along = direction / np.linalg.norm(direction)
    left = np.cross((0, 0, 1.0), along) / np.linalg.norm(along[:2])
    return np.array([np.cross(along, left), left])


def drawn_landings(air, kicks, **spread):
    """Strike with normal errors of the sources but the drag, and fly. Shape `(kicks, 2)` [m]."""
    draw, states = np.random.default_rng(0), []
    foot, normal, contact = HIT.foot_velocity, HIT.contact.normal, HIT.contact
    for _ in range(kicks):
        error = {name: size * draw.normal(size=2) for name, size in spread.items()}
        zero = np.zeros(2)
        change = foot * error.get("speed", zero)[0]
        change = change + np.linalg.norm(foot) * error.get("angle", zero) @ across(foot)
        turned = normal - error.get("contact", zero) @ across(normal) / BALL.radius
        e = contact.restitution + error.get("restitution", zero)[0]
        v = HIT.v_before + HIT.posture.joint_velocity(change)
        struck = kd.strike(HIT.posture, v, BALL, kd.Contact(turned, e, contact.friction))
        states.append([struck.ball_after.velocity, struck.ball_after.spin])
    velocity, spin = np.swapaxes(states, 0, 1)
    zeros = np.zeros(kicks)
    many = kd.BallState(np.zeros((kicks, 3)), velocity, spin, zeros)
    return kd.fly_many(many, BALL, air).landing_position.values[:, :2]


@pytest.mark.parametrize("sources", [["speed", "angle", "contact", "restitution"], *LAUNCH])
def test_first_order_and_drawn_kicks_agree(sources):
    spread = {name: SMALL[name] for name in np.atleast_1d(sources)}
    linear, landed = scatter(HIT, AIR, **spread), drawn_landings(AIR, 2000, **spread)
    assert landed.mean(axis=0) == pytest.approx(linear.mean, abs=0.1 * linear.radius)
    covariance = np.cov(landed.T)
    assert np.sqrt(np.trace(covariance)) == pytest.approx(linear.radius, rel=0.05)
    assert np.linalg.norm(covariance - linear.covariance) < 0.1 * linear.radius**2
    assert sum(linear.by_source.values()) == pytest.approx(linear.covariance)


def test_the_spin_changes_with_restitution_and_normal():
    """By central differences of strikes whose foot slips, so that the spin follows the impulse."""
    normal, left, size = HIT.contact.normal, across(HIT.contact.normal), 1e-5

    def spin(e=0.6, turned=normal):
        struck = kd.strike(HIT.posture, HIT.v_before, BALL, kd.Contact(turned, e, 0.05))
        assert not struck.sticking
        return struck.ball_after.spin, struck

    slopes = launch_slopes(spin()[1])
    by_e = (spin(0.6 + size)[0] - spin(0.6 - size)[0]) / (2 * size)
    assert np.abs(by_e).max() > 1.0
    assert slopes["restitution"][3:, 0] == pytest.approx(by_e, rel=1e-5, abs=1e-5)
    for column, way in zip(slopes["contact"][3:].T, left, strict=True):
        ends = [spin(turned=normal + sign * size * way)[0] for sign in (1, -1)]
        expected = -(ends[0] - ends[1]) / (2 * size * BALL.radius)
        assert column == pytest.approx(expected, rel=1e-4, abs=1e-3)


def test_drag_alone_is_a_difference_of_flights():
    thin, thick = (
        kd.Air(drag=lambda re, s, k=k: k * kd.Air(drag="brazuca").drag.function(re, s))
        for k in (0.98, 1.02)
    )
    ends = [kd.fly(HIT.ball_after, BALL, air).landing.position for air in (thin, thick)]
    expected = np.linalg.norm((ends[0] - ends[1])[:2]) / 2
    assert scatter(HIT, AIR, drag=0.02).radius == pytest.approx(expected, rel=1e-3)


def test_landing_slopes_are_those_of_the_parabola():
    state = kd.BallState(velocity=(8, 1, 5))
    landing, slopes = landing_slopes(state, BALL, None)
    time = 10 / 9.81
    assert landing == pytest.approx([8 * time, time])
    expected = [[time, 0, 2 * 8 / 9.81], [0, time, 2 / 9.81]]
    assert slopes[:, :3] == pytest.approx(np.array(expected), rel=1e-9)
    assert not slopes[:, 3:].any()


@pytest.mark.parametrize("air", [None, AIR])
@pytest.mark.parametrize("spin", [(0, 0, 0), (0, 9, 0)])
def test_a_ball_that_does_not_come_down_has_no_landing(air, spin):
    for velocity in ((8, 0, -1), (8, 0, 0)):
        with pytest.raises(kd.InvalidInput, match="no landing to scatter"):
            landing_slopes(kd.BallState(velocity=velocity, spin=spin), BALL, air)
    light = kd.Ball(mass=0.001)  # rises for ever
    rising = kd.Air(drag="brazuca", buoyancy=True)
    with pytest.raises(kd.InvalidInput, match="no landing to scatter"):
        landing_slopes(kd.BallState(velocity=(1, 0, 1)), light, rising)


@pytest.mark.parametrize(
    ("spread", "words"),
    [
        ({}, "no source is named"),
        ({"luck": 1}, "source 'luck' is unknown: choose among speed, angle"),
        ({"angle": -1}, "spread of angle is -1"),
        ({"angle": math.nan}, "spread of angle is nan"),
    ],
)
def test_bad_input(spread, words):
    with pytest.raises(kd.InvalidInput, match=words):
        scatter(HIT, AIR, **spread)
