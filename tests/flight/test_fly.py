"""Flights against an independent integration, their ends, samples and refusals."""

import math

import numpy as np
import pytest
from references.vector_flight import landing
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant

BALL = kd.Ball()
KICK = (25, 3, 12)


def launch(velocity=KICK, spin=(0, 0, 0), height=0.0, at=(0, 0)):
    return kd.BallState((*at, height), velocity, spin)


SHOTS = {"kick": (launch((25, 2, 12), (5, -30, 15)), BALL, kd.Air()),
    "wind": (launch((22, 3, 15), (10, 20, -30)), BALL, kd.Air(wind=(-3, 2, 1))),
    "shear": (launch((22, 3, 15), (10, 20, -30), 0.5), BALL,
    kd.Air(wind=lambda z: (-z, 0.2 * z, 0))),
    "smooth sphere": (launch((15, 0, 15), (0, 0, 20)), BALL, kd.Air(drag="sphere", lift="wang")),
    "drag crisis": (launch((9, 0, 24), (0, -25, 0)), BALL, kd.Air(drag="jabulani")),
    "1000 m/s": (launch((800, 100, 600), (5, -40, 20)), BALL, kd.Air(drag="brazuca")),
    "10,000 rad/s": (launch((25, 2, 10), (2e3, -9e3, 4e3)), BALL, kd.Air(drag="brazuca")),
    "straight up": (launch((0, 0, 25), (30, -50, 0)), BALL, kd.Air(drag="brazuca")),
    "storm": (launch((5, 0, 5), (0, -20, 9)), BALL, kd.Air(drag="brazuca", wind=(-60, 10, 0))),
    "updraft": (launch((5, 1, 8)), BALL, kd.Air(drag="brazuca", wind=(2, 0, 9))),
    "a milligram": (launch((3, 0.5, 4), (5, -40, 20)), kd.Ball(1e-6, 1e-3), kd.Air()),
    "a tonne": (launch((3, 0.5, 4), (5, -40, 20)), kd.Ball(1e3, 1e-3), kd.Air()),
    **{f"Re {re:g}": (launch((8, 1, 9), (5, -20, 10)), BALL,
    kd.Air(1.2, 1.2 * 2 * BALL.radius * 12 / re, drag="brazuca")) for re in (1e2, 3e4, 1e7)},
    **{f"fall {v}": (launch(v, spin, 40 + BALL.radius), BALL, kd.Air(), kd.Ground())
    for v, *spin in (((25, 0, 0), 4, -30, 9), ((20, 3, -15), 4, -30, 9), ((0, 0, -30), 4, -30, 9),
    ((0, 0, 0), 0, 0, 0))},
    }  # fmt: skip


@pytest.mark.parametrize("name", SHOTS)
def test_a_flight_lands_where_scipy_lands_it(name):
    state, ball, air, *ground = SHOTS[name]
    drop = 40.0 if ground else 0.0
    path, (t, y) = kd.fly(state, ball, air, *ground, tol=1e-11), landing(state, ball, air, drop)
    length, near = max(np.abs(y[:3]).max(), path.height), integrated(1e-11, 1000)  # through joins
    assert path.status == "landed"
    assert path.duration == pytest.approx(t, rel=near)
    assert path.landing.position - state.position == pytest.approx(y[:3], abs=near * length)
    assert path.landing.velocity == pytest.approx(y[3:6], abs=near * np.abs(y[3:6]).max())
    assert path.landing.spin == pytest.approx(y[6:], rel=near, abs=1e-300)
    assert not ground or (path.height, path.apex.time) == (0, 0)


AIRS = {"vacuum": None, "air": kd.Air(), "wind": kd.Air(wind=(2, 3, 0))}
every_air = pytest.mark.parametrize("air", AIRS.values(), ids=AIRS)


@every_air
@pytest.mark.parametrize("velocity", [(20, 0, 0), (20, 0, -5), (0, 0, 0)])
def test_a_ball_on_the_ground_that_does_not_rise_has_landed(air, velocity):
    for ground, height in ((None, 3.0), (kd.Ground(), BALL.radius)):
        path = kd.fly(launch(velocity, height=height), BALL, air, ground)
        assert (path.status, path.duration, path.range, path.height) == ("landed", 0, 0, 0)
        assert path.sample(0.0).velocity.tolist() == list(velocity)


@pytest.mark.parametrize("air", [None, kd.Air()], ids=["vacuum", "air"])
@pytest.mark.parametrize("end", ["plane", "time_limit"])
@pytest.mark.parametrize("early", [0.1, 1e-4])
def test_the_apex_of_a_flight_that_ends_as_it_rises_is_its_end(air, end, early):
    """The last step of the integration goes beyond the crest, the flight does not."""
    start, free = launch(height=1.0), kd.fly(launch(height=1.0), BALL, air)
    time = free.apex.time - early
    point = free.sample(time).position
    limit = {end: time if end == "time_limit" else kd.Plane(point, (-1, 0, 0), "centre")}
    path = kd.fly(start, BALL, air, **limit)
    many = kd.fly_many(kd.BallState(start.position, [start.velocity]), BALL, air, **limit)
    near = integrated(1e-9)
    assert path.apex.time == path.duration == pytest.approx(time, rel=near)
    assert path.height == path.landing.position[2] - 1.0 == pytest.approx(point[2] - 1.0, rel=near)
    assert many.apex_time.values[0] == many.duration.values[0] == pytest.approx(time, rel=near)
    assert many.height.values[0] == pytest.approx(path.height, rel=near)


@pytest.mark.parametrize("upward", [1e-6, 1e-12, 1e-30])
@pytest.mark.parametrize("height", [0.0, 100.0])
def test_a_small_hop_is_as_right_as_any(upward, height):
    """Drag and lift change it by less than a part in 10,000."""
    air = kd.Air(lift=None)
    g = 9.81 * (1 - air.density * BALL.volume / BALL.mass)
    path = kd.fly(launch((upward, 0, upward), height=height), BALL, air)
    assert path.status == "landed"
    assert path.duration == pytest.approx(2 * upward / g, rel=1e-4)
    assert path.height == pytest.approx(upward**2 / (2 * g), rel=1e-4, abs=closed_form() * height)


@pytest.mark.parametrize("speed", [1e-120, 1e-200, 1e-300])
def test_a_ball_too_slow_for_the_air_flies_without_it(speed):
    path = kd.fly(launch((speed, 0, speed), (0, 3, 0)), BALL, kd.Air(torque=None, buoyancy=False))
    assert path.duration == pytest.approx(2 * speed / 9.81, rel=closed_form())
    assert path.landing.velocity == pytest.approx([speed, 0, -speed], rel=closed_form(), abs=0)


@every_air
def test_samples_meet_launch_apex_and_landing_and_velocity_is_the_slope_of_position(air):
    path = kd.fly(launch(spin=(0, -40, 9), height=2.0), BALL, air, kd.Ground())
    for node in (path.launch, path.apex, path.landing):
        here = path.sample(node.time)
        for name in ("position", "velocity", "spin"):
            right = getattr(node, name)
            assert getattr(here, name) == pytest.approx(right, abs=integrated(1e-9)), name
        assert here.time == node.time
    t = np.linspace(0.01, path.duration - 0.01, 300)
    slope = (path.sample(t + 1e-4).position - path.sample(t - 1e-4).position) / 2e-4
    agrees(slope, path.sample(t).velocity, integrated(1e-8))


@pytest.mark.parametrize(("t", "words"),
    [(-1e-3, "t is -0.001 s.*0 to"), (99, "t is 99 s"), ([0, 1, 99], "t is 99 s"),
    (math.nan, "finite"), ("1", "numbers"), ([[0.0]], "shape")])  # fmt: skip
def test_times_outside_the_flight_are_refused(t, words):
    path = kd.fly(launch(), BALL, kd.Air())
    for sample in (path.sample, path.orientation):
        with pytest.raises(kd.InvalidInput, match=words):
            sample(t)


MANY = kd.BallState(np.zeros((2, 3)))


@pytest.mark.parametrize(("arguments", "options", "words"), [
    ((MANY, BALL), {}, r"\(2, 3\).*fly_many"), ((None, BALL), {}, "state is None.*BallState"),
    ((launch(), 0.43), {}, r"ball is 0\.43.*kickdyn.Ball"),
    *(((launch(), BALL), {"tol": tol}, "tol is") for tol in (0, 1e-14, 0.1, math.nan, "1")),
    *(((launch(), BALL), {"time_limit": x}, "time limit is") for x in (0, -1, math.inf, None)),
    *(((launch(), BALL), {"max_step": x}, "max_step is") for x in (0, -1, math.nan, "1")),
    ((launch(height=0.05), BALL, None, kd.Ground()), {}, "0.0598.* m inside the ground"),
    ((launch((3.1e8, 0, 1)), BALL, kd.Air()), {}, r"launch speed is 3\.1e\+08 m/s.*light"),
    ((launch(), BALL, kd.Air(wind=lambda z: (math.log(z), 0.0, 0.0))), {}, "wind.*ValueError"),
    ((launch(), BALL, None, kd.Ground(-1e308)), {"time_limit": 1e300}, "float64")])  # fmt: skip
def test_refusals(arguments, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.fly(*arguments, **options)


def broken(reynolds, spin_parameter):
    raise KeyError("no such ball")


@pytest.mark.parametrize("kind", ["drag", "lift", "torque"])
@pytest.mark.parametrize("coefficient", [
    broken, *(constant(value) for value in (math.nan, math.inf))
], ids=["raises", "nan", "inf"])  # fmt: skip
def test_a_coefficient_that_is_no_number_ends_in_an_error(kind, coefficient):
    words = "KeyError" if coefficient is broken else "not finite|could not be integrated"
    with pytest.raises(kd.KickdynError, match=words):
        kd.fly(launch(spin=(0, -50, 0)), BALL, kd.Air(**{kind: coefficient}))


@pytest.mark.parametrize(("spin", "air", "effects"), [
    ((0, 0, 0), kd.Air(), "drag"), ((0, 1, 0), kd.Air(), "drag, lift, spin decay"),
    ((0, 1, 0), kd.Air(lift=None), "drag, spin decay")])  # fmt: skip
def test_the_method_names_what_acts_on_the_ball(spin, air, effects):
    path = kd.fly(kd.BallState(velocity=(20, 0, 10), spin=spin), kd.Ball(), air)
    assert path.method.partition(", ")[2].removeprefix("rtol 1e-09, ") == effects


@pytest.mark.parametrize("tol", [1e-3, 1e-5])
def test_a_step_into_the_ground_where_the_wind_is_not_defined_is_taken_shorter(tol):
    start, flights = kd.BallState((0, 0, 3), (20, 0, 9)), []
    for wind in (lambda z: (3 * math.sqrt(z), 0, 0), lambda z: (3 * math.sqrt(max(z, 0)), 0, 0)):
        flights.append(kd.fly(start, BALL, kd.Air(wind=wind), kd.Ground(), tol=tol))
    agrees(flights[0].landing.position, flights[1].landing.position, integrated(tol))
    assert flights[0].evaluations < 2 * flights[1].evaluations
