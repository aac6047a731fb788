"""Errors of the launch are less than what is said of them, and so is what they do at the end."""

import math
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from random_scenes import random_scene, wide_scene

import kickdyn as kd
from kickdyn.scene.launch_and_end import (
    COLLIDE_SAFETY,
    END_SAFETY,
    EndSlopes,
    LaunchError,
    collide_scene,
    collision_error,
    contact_time_error,
    contact_time_size,
    end_error,
    end_of,
    end_slopes,
    fly_scene,
    path_error,
    strike_scene,
    with_law,
)


def size(array):
    return float(np.linalg.norm(array))


def test_the_deviation_of_an_end_is_that_of_sources_that_act_together():
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    by, size = rng.normal(size=3), rng.normal(size=4000)
    velocity, spin = np.outer(size, by), np.outer(0.3 * size, turn @ by)  # of one source
    slopes = EndSlopes(2.0 * turn, 0.7 * np.eye(3))
    launch = SimpleNamespace(velocity=np.cov(velocity.T), spin=np.cov(spin.T))
    ends = velocity @ slopes.velocity.T + spin @ slopes.spin.T
    expected = math.sqrt(np.trace(np.cov(ends.T)))
    assert slopes.deviation(launch) == pytest.approx(expected, rel=1e-9)


def test_the_deviation_of_an_end_without_slopes_is_infinite():
    unknown = np.full((3, 3), math.inf)
    launch = SimpleNamespace(velocity=np.eye(3), spin=np.eye(3))
    assert EndSlopes(unknown, unknown).deviation(launch) == math.inf


def test_it_bounds_the_contact_that_takes_time():
    rng, done, used = np.random.default_rng(3), 0, 0.0
    while done < 8:
        scene = random_scene(rng, contact_time=0.01)
        try:
            hit = strike_scene(scene)
        except kd.NoImpact:
            continue
        done += 1
        jump = with_law(scene, hit, contact_time_error(scene, hit))
        fine, rough = (collide_scene(scene, tol) for tol in (1e-7, 1e-4))
        moved = size(fine.ball_after.velocity - hit.ball_after.velocity)
        assert moved <= jump.velocity
        assert size(fine.ball_after.spin - hit.ball_after.spin) <= jump.spin
        assert size(fine.ball_after.position - hit.ball_after.position) <= jump.position
        used = max(used, moved / jump.velocity)
        off = size(fine.ball_after.velocity - rough.ball_after.velocity) / fine.ball_after.speed
        assert off <= COLLIDE_SAFETY * 1e-4
    assert used > 0.2


def test_a_flight_shows_that_the_contact_time_matters_less_than_its_bound():
    rng, shares = np.random.default_rng(6), []
    while len(shares) < 8:
        scene = random_scene(rng, contact_time=0.01)
        with suppress(kd.NoImpact):
            hit = strike_scene(scene)
            error, path = contact_time_error(scene, hit), fly_scene(scene, hit.ball_after)
            bound = end_error(scene, path, with_law(scene, hit, error))
            if not (bound < math.inf and isinstance(path, kd.Flight) and path.duration > 0.0):
                continue
            measured = contact_time_size(scene, hit, path, error, 0.5 * bound)
            exact = fly_scene(scene, collide_scene(scene, 1e-7).ball_after)
            if exact.status == path.status:
                assert math.dist(exact.landing.position, path.landing.position) <= measured <= bound
            assert contact_time_size(scene, hit, path, error, 2.0 * bound) == bound
            assert 0.4 * bound < contact_time_size(scene, hit, path, error, 0.1 * bound) <= bound
            shares.append(measured / bound)
    assert min(shares) < 0.7


def test_it_bounds_the_contact_of_an_inflated_ball():
    rng, done, known = np.random.default_rng(5), 0, 0
    while done < 4:
        options = {"ball": kd.Ball(pressure=80e3), "law": kd.Compliance(None, "pressure")}
        scene = random_scene(rng, contact_time=None, **options)
        try:
            hit = strike_scene(scene)
        except kd.NoImpact:
            continue
        done += 1
        jump = with_law(scene, hit, contact_time_error(scene, hit))
        moved = size(collide_scene(scene, 1e-6).ball_after.velocity - hit.ball_after.velocity)
        assert 0.0 < moved <= jump.velocity
        known += jump.velocity < math.inf
    assert known > 2


def test_what_does_not_strike_on_the_way_is_not_known():
    leg = kd.Leg.human()
    posture = leg.posture([0.5, 0.1, 0.0])
    v = posture.joint_velocity([3.0, 0.0, 0.5])
    law = kd.Compliance(contact_time=0.05)
    scene = kd.Scene(posture, v, kd.Ball(), kd.Contact((0, 0, 1), 0.7), law)
    assert contact_time_error(scene, strike_scene(scene)).velocity == math.inf


def test_the_estimate_of_a_kick():
    """From which a factor of safety, or the weight's share cannot change unnoticed."""
    leg = kd.Leg.human()
    posture = leg.posture(np.radians([5, 10, -5]))
    v, contact = posture.joint_velocity([9, 0, 4]), kd.Contact((2, 0, 1), 0.8, 0.4)
    scene = kd.Scene(posture, v, kd.Ball(), contact, kd.Compliance(contact_time=0.01))
    hit = strike_scene(scene)
    drift = with_law(scene, hit, contact_time_error(scene, hit))
    assert drift.velocity == pytest.approx(3.851724976, rel=1e-8)
    assert drift.spin == pytest.approx(102.7683567, rel=1e-8)
    assert drift.position == pytest.approx(0.2205274235, rel=1e-8)


def test_the_estimate_counts_the_middle_of_the_contact():
    """Where the contact sticks half way through it only; at its end the spin changes by a third."""
    rng = np.random.default_rng(1)
    for _ in range(349):
        scene = random_scene(rng, contact_time=rng.uniform(0.004, 0.015))
    hit = strike_scene(scene)
    error = with_law(scene, hit, contact_time_error(scene, hit))
    assert error.spin == pytest.approx(107.4799626, rel=1e-6)


def scene_of(ball=None, **parts):
    """Return a scene for the sake of its ball, air, ground and plane."""
    posture = kd.Leg.human().posture([0.1, 0.2, 0.0])
    return kd.Scene(posture, [3, 0, 0], ball or kd.Ball(), kd.Contact((1, 0, 0), 0.8), **parts)


LAUNCH = kd.BallState((0, 0, 1), (12, 1, 5), (10, -40, 15))
WIND = kd.Air(drag="brazuca", wind=(1, 2, 0))


@pytest.mark.parametrize(
    "parts",
    [
        {"air": WIND},
        {"air": WIND, "ground": kd.Ground(-0.5)},
        {"air": WIND, "plane": kd.Plane((6, 0, 0), (-1, -0.3, 0))},
        {"ground": kd.Ground(-0.5)},
        {"air": WIND, "ground": kd.Ground(-0.5, "turf")},
    ],
    ids=["level", "ground", "plane", "vacuum", "bounces"],
)
def test_slopes_are_those_of_central_differences(parts):
    scene = scene_of(**parts)
    slopes = end_slopes(scene, fly_scene(scene, LAUNCH))
    for name, step in (("velocity", 1e-4), ("spin", 1e-3)):
        expected = np.zeros((3, 3))
        for axis in range(3):
            ends = []
            for sign in (1, -1):
                state = {"velocity": LAUNCH.velocity.copy(), "spin": LAUNCH.spin.copy()}
                state[name][axis] += sign * step
                launch = kd.BallState(LAUNCH.position, **state)
                ends.append(end_of(fly_scene(scene, launch, 1e-12)).position)
            expected[:, axis] = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(getattr(slopes, name), expected, rtol=0.02, atol=2e-4)


def test_a_ball_that_leaves_at_rest_and_one_that_stays_aloft_have_no_slopes():
    still = kd.BallState((0, 0, 1))
    scene = scene_of(ground=kd.Ground(0.0))
    assert (end_slopes(scene, fly_scene(scene, still)).velocity == math.inf).all()
    deep = scene_of(ground=kd.Ground(-1e7))
    path = fly_scene(deep, LAUNCH)
    assert path.status == "aloft"
    assert (end_slopes(deep, path).velocity == math.inf).all()
    assert end_error(deep, path, LaunchError(1, 0, 0)) == math.inf


def test_a_path_that_ends_at_once_does_not_depend_on_its_launch():
    scene = scene_of(air=WIND)
    path = fly_scene(scene, kd.BallState((0, 0, 1), (5, 0, -2)))
    assert path.duration == 0.0
    assert not end_slopes(scene, path).velocity.any()
    assert end_error(scene, path, LaunchError(1.0, 10.0, 0.05)) == 0.05


@pytest.mark.parametrize("surface", [None, "turf"])
@pytest.mark.parametrize("tol", [1e-4, 1e-6])
def test_the_error_of_a_path_is_about_its_distance_from_an_exact_one(surface, tol):
    scene = scene_of(air=WIND, ground=kd.Ground(-0.5, surface))
    path, exact = fly_scene(scene, LAUNCH, tol), fly_scene(scene, LAUNCH, 1e-12)
    moved = math.dist(end_of(path).position, end_of(exact).position)
    assert 0.0 < moved <= path_error(scene, path) <= 20.0 * moved


def test_the_error_of_a_path_that_ends_otherwise_when_computed_finer_is_unknown(monkeypatch):
    scene = scene_of(air=WIND, ground=kd.Ground(-0.5, "turf"))
    path = fly_scene(scene, LAUNCH)
    other = replace(path, status="aloft")
    monkeypatch.setattr("kickdyn.scene.launch_and_end.fly_scene", lambda *_: other)
    assert path_error(scene, path) == math.inf


def test_the_error_of_an_end_covers_paths_from_launches_beside_it():
    rng, shares = np.random.default_rng(8), []
    while len(shares) < 100:
        scene = wide_scene(rng)
        with suppress(kd.KickdynError):
            launch = strike_scene(scene).ball_after
            speed = float(launch.speed)
            error = LaunchError(1e-3 * speed, 1e-3 * speed / scene.ball.radius, 1e-4)
            path, directions = fly_scene(scene, launch), rng.normal(size=(3, 3))
            if path.duration == 0.0:
                continue
            offset, change, turn = directions / np.linalg.norm(directions, axis=1)[:, None]
            other = kd.BallState(
                launch.position + error.position * offset,
                launch.velocity + error.velocity * change,
                launch.spin + error.spin * turn,
            )
            moved = size(end_of(fly_scene(scene, other)).position - end_of(path).position)
            shares.append(moved / end_error(scene, path, error))
    assert max(shares) <= 1.0
    assert np.quantile(shares, 0.8) > 0.3


def test_in_a_vacuum_the_error_of_an_end_is_that_of_the_closed_form():
    scene = scene_of(ground=kd.Ground(1.0 - kd.Ball().radius))
    path, change = fly_scene(scene, LAUNCH), 1e-6
    arrival = path.landing.velocity
    worst = np.array([0, 0, 1.0]) - arrival[2] * arrival / (arrival @ arrival)
    other = replace(LAUNCH, velocity=LAUNCH.velocity + change * worst / size(worst))
    moved = size(end_of(fly_scene(scene, other)).position - path.landing.position)
    assert end_error(scene, path, LaunchError(change, 0, 0)) == pytest.approx(
        END_SAFETY * moved, rel=1e-5
    )
    assert end_error(scene, path, LaunchError(math.inf, 0.0, 0.0)) == math.inf


def test_the_error_of_a_collision_is_relative_to_its_launch():
    launch = kd.BallState((0, 0, 0), (3, 0, 4), (0, 0, 6))
    error = collision_error(scene_of(ball=kd.Ball(radius=0.5)), launch, 1e-4)
    assert error == pytest.approx((10e-4 * 5, 10e-4 * 10, 10e-4 * 0.5), rel=1e-12)
