"""Errors of the launch are below their bounds, and so are the errors that they cause at the end."""

import math
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from random_scenes import random_scene
from tolerances import agrees, closed_form, differenced, integrated

import kickdyn as kd
from kickdyn.core.mechanics import GRAVITY
from kickdyn.flight.forces import acceleration_function
from kickdyn.scene import launch_and_end as module

LAUNCH = kd.BallState((0, 0, 1), (12, 1, 5), (10, -40, 15))
WIND = kd.Air(drag="brazuca", wind=(1, 2, 0))
LEVEL = kd.Ground(1.0 - kd.Ball().radius)


def scene_of(ball=None, **parts):
    """Return a scene for the sake of its ball, air, ground and plane."""
    posture = kd.Leg.human().posture([0.1, 0.2, 0.0])
    return kd.Scene(posture, [3, 0, 0], ball or kd.Ball(), kd.Contact((1, 0, 0), 0.8), **parts)


def struck(seed, count, **parts):
    """Return random scenes whose foot strikes the ball, with their impacts."""
    rng, pairs = np.random.default_rng(seed), []
    while len(pairs) < count:
        scene = random_scene(rng, **parts)
        with suppress(kd.NoImpact):
            pairs.append((scene, module.strike_scene(scene)))
    return pairs


def test_the_error_of_a_contact_time_is_unknown_with_constraints_or_soft_drives():
    (scene, hit), drive = struck(3, 1, contact_time=0.01)[0], kd.Drive(0.01, 1.0, stiffness=30.0)
    for leg in (scene.leg.with_stiff_joints("ankle"), scene.leg.with_drives({"ankle": drive})):
        held = replace(scene, posture=leg.posture(scene.q))
        assert module.contact_time_error(held, hit) == module.UNKNOWN


@pytest.mark.parametrize(("q", "normal", "velocity", "time", "below"), [
    ([0.5, 0.1, 0.0], (0, 0, 1), [3.0, 0.0, 0.5], 0.05, None),
    ([0.5, 0.1, 0.0], (0.94, 0, -0.34), [5, 0, -2], 0.01, 0.001),
], ids=["no contact on the way", "pressed into the ground"])  # fmt: skip
def test_an_error_that_cannot_be_estimated_is_infinite(q, normal, velocity, time, below):
    posture, ball = kd.Leg.human().posture(q), kd.Ball()
    level = float(posture.contact_point[2]) - 1.34 * ball.radius - (below or 1.0)
    scene = kd.Scene(
        posture, posture.joint_velocity(velocity), ball, kd.Contact(normal, 0.7),
        kd.Compliance(contact_time=time), ground=None if below is None else kd.Ground(level),
    )  # fmt: skip
    assert module.contact_time_error(scene, module.strike_scene(scene)).velocity == math.inf


@pytest.mark.parametrize("parts", [
    {"air": WIND}, {"air": WIND, "ground": kd.Ground(-0.5)},
    {"air": WIND, "plane": kd.Plane((6, 0, 0), (-1, -0.3, 0))}, {"ground": kd.Ground(-0.5)},
    {"air": WIND, "ground": kd.Ground(-0.5, "turf")},
], ids=["level", "ground", "plane", "vacuum", "bounces"])  # fmt: skip
def test_slopes_are_those_of_central_differences(parts):
    scene = scene_of(**parts)
    slopes = module.end_slopes(scene, module.fly_scene(scene, LAUNCH))
    tolerance = 1e-2 if "turf" in repr(parts) else 1e3 * differenced(2)
    for name, step in (("velocity", 1e-4), ("spin", 1e-3)):

        def end(change, name=name):
            launch = replace(LAUNCH, **{name: getattr(LAUNCH, name) + change})
            return module.end_of(module.fly_scene(scene, launch, 1e-12)).position

        right = [(end(way) - end(-way)) / (2 * step) for way in step * np.eye(3)]
        agrees(getattr(slopes, name), np.transpose(right), tolerance)


def test_the_deviation_of_an_end_adds_those_of_velocity_and_spin():
    """Both follow from the same sources, here from one."""
    by_velocity, by_spin = np.random.default_rng(2).normal(size=(2, 3, 3))
    v, w = np.array([0.3, -0.2, 0.1]), np.array([4.0, 1.0, -2.0])
    launch = SimpleNamespace(velocity=np.outer(v, v), spin=np.outer(w, w))
    right = np.linalg.norm(by_velocity @ v) + np.linalg.norm(by_spin @ w)
    slopes = module.EndSlopes(by_velocity, by_spin)
    assert slopes.deviation(launch) == pytest.approx(right, rel=closed_form(100))
    unknown = module.EndSlopes(np.full((3, 3), math.inf), np.full((3, 3), math.inf))
    assert unknown.deviation(launch) == math.inf


def test_a_ball_without_an_end_or_without_a_flight():
    resting, deep = kd.BallState((0, 0, 1)), scene_of(ground=kd.Ground(-1e7))
    for scene, launch in ((scene_of(ground=kd.Ground(0.0)), resting), (deep, LAUNCH)):
        path = module.fly_scene(scene, launch)
        assert np.isposinf(module.end_slopes(scene, path).velocity).all()
    path = module.fly_scene(deep, LAUNCH)
    assert path.status == "aloft"
    assert module.end_error(deep, path, module.LaunchError(1, 0, 0)) == math.inf
    scene = scene_of(air=WIND)
    path = module.fly_scene(scene, kd.BallState((0, 0, 1), (5, 0, -2)))
    assert path.duration == 0.0
    assert not module.end_slopes(scene, path).velocity.any()
    assert module.end_error(scene, path, module.LaunchError(1.0, 10.0, 0.05)) == 0.05


@pytest.mark.parametrize("surface", [None, "turf"])
@pytest.mark.parametrize("tol", [1e-4, 1e-6])
def test_the_error_of_a_path_is_about_its_distance_from_an_exact_one(surface, tol):
    scene = scene_of(air=WIND, ground=kd.Ground(-0.5, surface))
    path, exact = (module.fly_scene(scene, LAUNCH, share) for share in (tol, 1e-12))
    distance = math.dist(module.end_of(path).position, module.end_of(exact).position)
    assert 0.0 < distance <= module.path_error(scene, path) <= 50.0 * distance


def test_in_a_vacuum_the_error_of_an_end_is_that_of_the_parabola():
    scene, change = scene_of(ground=LEVEL), 1e-6
    path, v = module.fly_scene(scene, LAUNCH), LAUNCH.velocity
    slant = np.linalg.norm(v) / v[2]  # it arrives as steeply as it started
    right = module.END_SAFETY * slant * (0.02 + change * 2 * v[2] / GRAVITY)
    error = module.end_error(scene, path, module.LaunchError(change, 0, 0.02))
    assert error == pytest.approx(right)
    assert module.end_error(scene, path, module.LaunchError(math.inf, 0.0, 0.0)) == math.inf


def test_an_error_of_the_spin_moves_the_end_by_half_the_change_of_lift_times_the_time_squared():
    scene, change = scene_of(air=kd.Air(drag=None), ground=LEVEL), 1e-3
    path = module.fly_scene(scene, LAUNCH)
    acceleration = acceleration_function(scene.ball, scene.air)
    lifts = [acceleration(1.0, *LAUNCH.velocity, *(LAUNCH.spin + dw))[:3]
             for dw in (np.zeros(3), *(change * np.eye(3)))]  # fmt: skip
    lift = np.linalg.norm(np.subtract(lifts[1:], lifts[0]), axis=1).max()
    slant = np.linalg.norm(path.landing.velocity) / abs(path.landing.velocity[2])
    right = module.END_SAFETY * slant * 0.5 * lift * path.duration**2
    error = module.end_error(scene, path, module.LaunchError(0.0, change, 0.0))
    assert error == pytest.approx(right, rel=closed_form(1e6))


def test_the_error_of_an_end_after_bounces_is_that_of_the_first_flight_and_of_what_lasts():
    """Velocities after a bounce are wrong by the spin, too, in the air and on the ground."""
    scene = scene_of(ground=replace(LEVEL, surface="turf"))
    error = module.LaunchError(0.1, 2.0, 0.0)
    course = module.fly_scene(scene, LAUNCH)
    first, slant = course.flights[0], np.linalg.norm(LAUNCH.velocity) / LAUNCH.velocity[2]
    bounced = 0.1 * first.duration * slant
    in_air = sum(flight.duration for flight in course.flights)
    later = slant * (in_air - first.duration) + course.duration - in_air
    right = bounced + module.BOUNCE_SAFETY * (0.1 + scene.ball.radius * 2.0) * later
    found = module.end_error(scene, course, error)
    assert found == pytest.approx(module.END_SAFETY * right, rel=integrated(1e-8))
