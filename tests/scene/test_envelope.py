"""Bounds hold: neglecting an effect moves the end by less, on random scenes flown exactly."""

import math

import numpy as np
import pytest
from random_scenes import random_scene

import kickdyn as kd
from kickdyn.scene.effects import EFFECTS
from kickdyn.scene.envelope import Envelope, LaunchError
from kickdyn.scene.scene import FlightEnvironment

FLOWN = [effect for effect in EFFECTS if effect.bound is not None and effect.name != "compliance"]


def way_of(scene):
    return FlightEnvironment(scene.ball, scene.air, scene.ground, scene.plane)


def end_of(scene, launch):
    return kd.fly(launch, *way_of(scene)[:3], plane=scene.plane).landing.position


def launched(rng):
    """A scene without bounces, and a launch from where the ball lies."""
    while True:
        scene = random_scene(rng, contact_time=None)
        if scene.ground is not None and scene.ground.surface is not None:
            continue
        speed, up = math.exp(rng.uniform(0, 3.3)), rng.uniform(0.05, 1.2)
        velocity = speed * np.array([math.cos(up), 0.1 * rng.normal(), math.sin(up)])
        return scene, kd.BallState(scene.ball_position, velocity, rng.normal(size=3) * 15)


def test_bounds_hold():
    rng, tightest, tried = np.random.default_rng(12), {}, 0
    for _ in range(60):
        scene, launch = launched(rng)
        around = Envelope(launch, way_of(scene))
        end = end_of(scene, launch)
        for effect in FLOWN:
            if not effect.is_in(scene):
                continue
            bound = effect.bound(around)
            if bound == math.inf:
                continue
            moved = float(np.linalg.norm(end_of(effect.without(scene, launch), launch) - end))
            assert moved <= bound + 1e-7, (effect.name, scene)
            tightest[effect.name] = max(tightest.get(effect.name, 0), moved / (bound + 1e-9))
            tried += 1
    assert tried > 100
    assert min(tightest.values()) > 0.03  # and are no empty words


def test_jumps_hold():
    rng, tried = np.random.default_rng(13), 0
    for _ in range(60):
        scene, launch = launched(rng)
        jump = LaunchError(0.02 * float(launch.speed), 0.5, 0.0)
        bound = Envelope(launch, way_of(scene), jump).shift(launch_error=jump)
        if bound == math.inf:
            continue
        tried += 1
        off = rng.normal(size=(2, 3))
        off /= np.linalg.norm(off, axis=1)[:, None]
        other = kd.BallState(
            launch.position,
            launch.velocity + jump.velocity * off[0],
            launch.spin + jump.spin * off[1],
        )
        moved = float(np.linalg.norm(end_of(scene, other) - end_of(scene, launch)))
        assert moved <= bound
    assert tried > 30


LAUNCH = kd.BallState((0, 0, 0.2), (8, 0, 4), (0, -30, 0))


@pytest.mark.parametrize(
    "way",
    [
        FlightEnvironment(kd.Ball(), kd.Air(), kd.Ground(surface="turf"), None),
        FlightEnvironment(kd.Ball(), kd.Air(wind=lambda z: (z, 0, 0)), kd.Ground(), None),
    ],
    ids=["bounces", "wind by height"],
)
def test_what_is_not_known_is_infinite(way):
    around = Envelope(LAUNCH, way)
    assert around.shift(0.0) == math.inf
    assert around.shift(1e-9) == math.inf


def test_a_ball_that_just_grazes_the_ground_is_not_bounded():
    level = kd.BallState((0, 0, kd.Ball().radius), (8, 0, 1e-3))
    assert (
        Envelope(level, FlightEnvironment(kd.Ball(), None, kd.Ground(), None)).shift(20.0)
        == math.inf
    )
