"""Bounds hold: neglecting an effect moves the end by less, on random scenes flown exactly."""

import math

import numpy as np
import pytest
from random_scenes import random_scene

import kickdyn as kd
from kickdyn.scene.effects import EFFECTS
from kickdyn.scene.envelope import Envelope, LaunchError
from kickdyn.scene.scene import FlightEnvironment

FLOWN = [
    effect for effect in EFFECTS if effect.change is not None and effect.name != "contact time"
]


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
            bound = around.shift(*effect.change(around))
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


def test_lift_changes_with_the_wind_more_where_the_spin_is_along_the_flight():
    air = kd.Air(wind=(5.7, -4.7, 0), drag=None, torque=None)
    launch = kd.BallState((0.3, 0, -0.8), (10, -0.7, -2.8), (-0.5, -2.2, 4.4))
    around = Envelope(launch, FlightEnvironment(kd.Ball(), air, kd.Ground(-1.1), None))
    wind = next(effect for effect in EFFECTS if effect.name == "wind")
    ends = [
        kd.fly(launch, kd.Ball(), each, kd.Ground(-1.1)).landing.position
        for each in (air, kd.Air(drag=None, torque=None))
    ]
    moved = np.linalg.norm(ends[1] - ends[0])
    assert moved == pytest.approx(2.0e-4, rel=0.05)
    assert moved <= around.shift(*wind.change(around)) <= 4 * moved


def test_spin_that_decays_where_lift_does_not_depend_on_it():
    """At the nodes: between these, the spin parameter is below where lift saturates."""
    ground, air = kd.Ground(-1.19249), kd.Air(drag="brazuca")
    launch = kd.BallState(
        (0.5664, -0.003269, -0.6735), (1.485, -1.253, 2.172), (20.74, -25.27, 23.69)
    )
    ends = [
        kd.fly(launch, kd.Ball(), each, ground, tol=1e-12).landing.position
        for each in (air, kd.Air(drag="brazuca", torque=None))
    ]
    around = Envelope(launch, FlightEnvironment(kd.Ball(), air, ground, None))
    decay = next(effect for effect in EFFECTS if effect.name == "spin decay")
    moved = np.linalg.norm(ends[1] - ends[0])
    assert moved == pytest.approx(2.93e-7, rel=0.01)
    assert moved <= around.shift(*decay.change(around)) <= 1e-3


@pytest.mark.parametrize(
    ("name", "air", "velocity", "spin"),
    [
        ("drag crisis", kd.Air(), (3.23, 0, 22.8), (0, 0, 0)),
        (
            "spin decay",
            kd.Air(drag="brazuca", wind=(5.348, 0.594, 0)),
            (4.1, 0, 19.17),
            (-9.93, 16, 8.86),
        ),
    ],
)
def test_a_ball_that_is_slow_between_two_nodes(name, air, velocity, spin):
    """At the apex of a steep flight, the only place where the effect acts."""
    launch, ball, ground = kd.BallState((0, 0, 0.11), velocity, spin), kd.Ball(), kd.Ground()
    around = Envelope(launch, FlightEnvironment(ball, air, ground, None))
    effect = next(effect for effect in EFFECTS if effect.name == name)
    scene = kd.load_scene("free_kick").replace(ball=ball, air=air, ground=ground)
    ends = [
        kd.fly(launch, ball, each, ground, tol=1e-11).landing.position
        for each in (air, effect.without(scene, launch).air)
    ]
    moved = np.linalg.norm(ends[1] - ends[0])
    assert moved > 1e-3
    assert moved <= around.shift(*effect.change(around)) < math.inf


def test_the_shift_in_a_vacuum_is_that_of_the_formula():
    """Of a ball that falls at 4 m/s when it lands after 0.8 s, at a speed of 5 m/s."""
    launch = kd.BallState((0, 0, 1), (3, 0, 4))
    around = Envelope(launch, FlightEnvironment(kd.Ball(), None, None, None))
    t = 2 * 4 / 9.81
    assert around.time == pytest.approx(t, rel=1e-12)
    apart = 0.03 + 0.2 * t + 0.5 * 0.1 * t**2
    faster = 0.2 + 0.1 * t
    late = apart / (4 - faster)
    shift = late * (5 + faster + (1.25 * 9.81 + 0.1) * late)
    assert around.shift(0.1, LaunchError(0.2, 0.0, 0.03)) == pytest.approx(shift, rel=1e-12)


def test_buoyancy_is_bounded_by_five_fourths_of_it():
    air = kd.Air(drag=None, lift=None, torque=None)
    around = Envelope(LAUNCH, FlightEnvironment(kd.Ball(), air, kd.Ground(), None))
    volume = 4 / 3 * np.pi * kd.Ball().radius ** 3
    buoyancy = 9.81 * air.density * volume / kd.Ball().mass
    assert around.difference(kd.Air(drag=None, lift=None, torque=None, buoyancy=False)) == (
        pytest.approx(1.25 * buoyancy, rel=1e-12)
    )


def test_a_coefficient_of_the_users_own_is_not_bounded():
    """It may change within a narrow range of speeds, between those that are evaluated."""
    air = kd.Air(drag=lambda reynolds, spin: 0.25)
    around = Envelope(LAUNCH, FlightEnvironment(kd.Ball(), air, kd.Ground(), None))
    assert around.shift(1e-9) == math.inf
    constant = kd.Air(drag=kd.aerodynamics.drag.constant(0.25))
    around = Envelope(LAUNCH, FlightEnvironment(kd.Ball(), constant, kd.Ground(), None))
    assert around.shift(1e-9) < 1e-6


def test_lift_that_pulls_down_drives_flights_apart_as_much_as_lift_that_carries():
    up, down = (
        Envelope(LAUNCH, FlightEnvironment(kd.Ball(), kd.Air(lift=lift), kd.Ground(), None))
        for lift in (0.3, -0.3)
    )
    assert down._growth == pytest.approx(up._growth, rel=0.2)


def test_how_high_above_the_ground_the_ball_meets_a_wall():
    ball, launch = kd.Ball(), kd.BallState((0, 0, 5), (10, 0, 5))
    wall = kd.Plane((4, 0, 0), (-1, 0, 0), reached_by="centre")
    around = Envelope(launch, FlightEnvironment(ball, None, kd.Ground(3.0), wall))
    height = around._other_end()[0]
    assert height == pytest.approx(5 + 5 * 0.4 - 9.81 / 2 * 0.4**2 - 3.0 - ball.radius)
