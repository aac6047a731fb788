"""The air against the U.S. Standard Atmosphere 1976; planes and grounds where flights end."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift, spin_decay
from kickdyn.air import AIRS, viscosity_of
from kickdyn.flight.ground_motion import bounce
from kickdyn.ground import SURFACES, Surface

MODELS = {"drag": drag.MODELS, "lift": lift.MODELS, "torque": spin_decay.MODELS}

# U.S. Standard Atmosphere 1976, tables by altitude: temperature, pressure, density and viscosity
ATMOSPHERE = [
    (0, 288.15, 101_325, 1.2250, 1.7894e-5), (2000, 275.154, 79_501, 1.0066, 1.7260e-5),
    (10_000, 223.252, 26_500, 0.41351, 1.4577e-5)]  # fmt: skip


@pytest.mark.parametrize(("altitude", "kelvin", "pressure", "density", "viscosity"), ATMOSPHERE)
def test_air_at_an_altitude(altitude, kelvin, pressure, density, viscosity):
    air = kd.Air.at(altitude)
    assert air.density == pytest.approx(density, rel=1e-4)  # digits of the tables
    assert air.viscosity == pytest.approx(viscosity_of(kelvin), rel=1e-5)
    assert air.viscosity == pytest.approx(viscosity, rel=1e-4)
    same = kd.Air.at(0, kelvin - 273.15, pressure)
    assert same.density == pytest.approx(density, rel=1e-4)
    assert same.viscosity == pytest.approx(air.viscosity, rel=1e-5)


def test_the_default_is_at_20_degrees_and_sea_level():
    air = kd.Air()
    assert air == kd.Air.at(0, 20, 101_325)
    assert kd.Air.at() == kd.Air.at(0.0)
    assert air.density == pytest.approx(1.2250 * 288.15 / 293.15, rel=1e-4)  # p / (R T)
    assert air.buoyancy is True
    assert (air.drag, air.lift, air.torque) == (drag.MODELS["supercritical"],
        lift.MODELS["saturating"], spin_decay.MODELS["smits-smith"])  # fmt: skip


def test_the_paper_s_air_is_of_table_3():
    air = kd.Air.paper()
    assert (air.density, air.viscosity, air.wind.tolist()) == (1.220, 1.8e-5, [0, 0, 0])
    assert (air.torque, air.buoyancy) == (None, False)
    assert {"standard": kd.Air(), "paper": air, "none": None} == AIRS


@pytest.mark.parametrize("number", [0.25, 1, np.float32(0.5)])
@pytest.mark.parametrize("kind", MODELS)
def test_a_number_is_a_constant_coefficient(kind, number):
    coefficient = getattr(kd.Air(**{kind: number}), kind)
    assert coefficient(1e-9, 3.0) == coefficient(1e9, 0.0) == number


def test_a_function_is_taken_as_it_is():
    def model(reynolds, spin_parameter):
        return 0.3

    air = kd.Air(drag=model, lift=None, wind=lambda height: (height, 0, 1))
    assert (air.drag, air.lift) == (model, None)
    assert air.wind_at(5.0) == (5.0, 0, 1)
    assert kd.Air(wind=(1, 2, 3)).wind_at(5.0) == (1, 2, 3)
    assert "model" in repr(air)


@pytest.mark.parametrize(("name", "value", "words"), [
    *(("density", rho, "air density .*at least 0") for rho in (-1, math.nan, math.inf, "1")),
    *(("viscosity", mu, "air viscosity .*above 0") for mu in (0, -1, math.nan, True)),
    ("wind", (1, 2), r"wind .*\(2,\)"), ("wind", (0, math.nan, 0), "wind .*finite"),
    ("wind", lambda h: (1, 2), r"wind at height 0 .*\(2,\)"),
    ("wind", lambda h: (1, math.nan, 0), "wind at height 0 .*finite"),
    ("wind", lambda: (1, 2, 3), "wind .*TypeError"),
    *(("buoyancy", value, "buoyancy is .*True") for value in (1, None, "no")),
    *(("drag", value, "drag coefficient .*at least 0") for value in (-0.2, 1e300, 10**400)),
    ("torque", -0.2, "torque coefficient .*at least 0"),
    *(("lift", value, "lift coefficient .*-1000") for value in (math.nan, -1e300)),
    *(("drag", value, "drag model .*choose stokes") for value in ("brazooka", "0.25", True)),
    ("lift", "", "lift model .*choose saturating")])  # fmt: skip
def test_refusals(name, value, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Air(**{name: value})


@pytest.mark.parametrize(("arguments", "words"), [
    ({"altitude": 12_000}, "altitude is 12000.*11000"),
    ({"temperature_c": 293.15}, "temperature is 293.15.*degC"),
    ({"pressure": 1013.25}, "pressure is 1013.25.*10000"),
    ({"temperature": 20}, "'temperature'.*temperature_c")])  # fmt: skip
def test_refusals_of_air_at(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Air.at(**arguments)


BALL = kd.Ball()
R = BALL.radius
IN_VACUUM_AND_AIR = {"vacuum": None, "air": kd.Air()}
every_air = pytest.mark.parametrize("air", IN_VACUUM_AND_AIR.values(), ids=IN_VACUUM_AND_AIR)


def launch(velocity, at=(0, 0, 0), spin=(0, 0, 0)):
    return kd.BallState(at, velocity, spin)


@settings(max_examples=25)
@given(point=st.tuples(*[st.floats(-9, 9)] * 3), normal=st.tuples(*[st.floats(-9, 9)] * 3),
    metre=st.sampled_from([1e-6, 1.0, 1e6]), depth=st.floats(0.5, 9),
    part=st.sampled_from(["front", "centre", "back"]))  # fmt: skip
def test_gap_is_the_distance_of_the_part_of_the_ball_along_the_normal(
    point, metre, normal, depth, part
):
    """In any unit of length; a billionth beyond the plane is rounding."""
    size = math.hypot(*normal)
    assume(size > 0.1)
    unit, point = np.array(normal) / size, metre * np.array(point)
    ball, plane = kd.Ball(radius=0.3 * metre), kd.Plane(point, normal, part)
    centre = point + metre * (depth * unit + 3.0 * np.cross(unit, (1, 2, 3)))
    right = metre * (depth + {"front": -0.3, "centre": 0.0, "back": 0.3}[part])
    assert plane.gap(ball, centre) == pytest.approx(right, rel=closed_form(100))
    assert plane.normal == pytest.approx(unit, rel=closed_form())
    assert plane.gap(ball, centre - (right + 2e-10 * metre) * unit) == 0.0
    for beyond in (1.0, 1e-6):
        with pytest.raises(kd.InvalidInput, match=f"{part} .*beyond the plane"):
            plane.gap(ball, centre - (right + beyond * metre) * unit)


@pytest.mark.parametrize(("normal", "part", "answer"),
    [((1, 0, 0), "back", True), ((1, 2, 0), "centre", True), ((1, 0, 0), "front", False),
    ((1, 0, 0.01), "back", False)])  # fmt: skip
def test_a_goal_line_is_upright_and_not_reached_by_the_front(normal, part, answer):
    assert kd.Plane((0, 0, 0), normal, part).is_goal_line is answer


@pytest.mark.parametrize(("arguments", "words"), [(((0, 0), (1, 0, 0)), r"point .*\(2,\)"),
    (((0, 0, math.nan), (1, 0, 0)), "point .*finite"),
    (((0, 0, 0), (0, 0, 0)), "normal .*direction"),
    (((0, 0, 0), (1, 0, 0), "middle"), "'middle'.*front, centre, back")])  # fmt: skip
def test_refusals_of_a_plane(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Plane(*arguments)


@settings(max_examples=25)
@given(velocity=st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(1, 20)),
    normal=st.tuples(*[st.floats(-1, 1)] * 3), gap=st.floats(0.1, 20))  # fmt: skip
def test_in_a_vacuum_the_ball_is_on_the_plane_at_the_first_root(velocity, normal, gap):
    """The distance to the plane is d + n.v t - n.g t^2/2; it ends at its least positive root."""
    size = math.hypot(*normal)
    assume(size > 0.1)
    n = np.array(normal) / size
    path = kd.fly(launch(velocity), BALL, plane=kd.Plane(-gap * n, normal, "centre"))
    approach, spread = n @ velocity, (n @ velocity) ** 2 + 2 * 9.81 * n[2] * gap
    assume(abs(spread) > 0.01 * (n @ velocity) ** 2)  # it does not graze the plane
    sums = [-approach + sign * math.sqrt(spread) for sign in (1, -1)] if spread > 0 else []
    times = [2 * gap / total for total in sums if total > 1e-6]
    ground = 2 * velocity[2] / 9.81
    assume(all(abs(t - ground) > 1e-6 for t in times))
    first = min([*times, ground])
    assert path.status == ("landed" if first == ground else "at-plane")
    assert path.duration == pytest.approx(first, rel=closed_form(1e4))
    right = np.array(velocity) * first - [0, 0, 9.81 / 2 * first**2]
    length = math.hypot(*velocity) * first + 9.81 / 2 * first**2
    assert path.landing.position == pytest.approx(right, abs=closed_form(1e4) * length)
    assert path.evaluations == 0


@every_air
@pytest.mark.parametrize(("plane", "limit", "status"), [
    (kd.Plane((5, 0, 0), (-1, 0, 0)), 9.0, "at-plane"),
    (kd.Plane((500, 0, 0), (-1, 0, 0)), 9.0, "landed"),
    (kd.Plane((500, 0, 0), (-1, 0, 0)), 0.1, "aloft"),
    (kd.Plane((-5, 0, 0), (1, 0, 0)), 9.0, "landed"),
    (kd.Plane((0, 0, 9), (0, 0.1, -1)), 9.0, "landed")])  # a ceiling above it  # fmt: skip
def test_a_flight_ends_at_the_first_of_plane_ground_and_time_limit(air, plane, limit, status):
    path = kd.fly(launch((25, 0, 8)), BALL, air, plane=plane, time_limit=limit)
    assert path.status == status


@every_air
@pytest.mark.parametrize(("velocity", "normal", "status"), [
    ((5, 0, 9), (-1, 0, 0), "at-plane"),  # into a wall
    ((-5, 0, 9), (-1, 0, 0), "landed"),  # away from it
    ((5, 0, 9), (0, 1, 0), "landed"),  # along it
    ((5, 0, 0), (0, 0, -1), "landed"),  # below a ceiling, from which weight pulls it
    ((5, 0, 0), (0, 0, 1), "at-plane"),  # on a floor, onto which weight pulls it
])  # fmt: skip
def test_a_ball_that_starts_on_a_plane_flies_only_away_from_it(air, velocity, normal, status):
    plane = kd.Plane((0, 0, 0), normal, "centre")
    path = kd.fly(launch(velocity), BALL, air, kd.Ground(-3), plane=plane)
    assert path.status == status
    assert (path.duration > 0) == (status == "landed")


def test_rolling_to_a_wall_has_a_closed_form():
    lane = kd.Ground(surface=Surface("lane", 0.0, 1.0, 0.8))
    rolling = launch((5, 2, 0), (0, 0, R), (-2 / R, 5 / R, 0))
    course = kd.follow(rolling, BALL, None, lane, plane=kd.Plane((4 + R, 0, 0), (-1, 0, 0)))
    speed = math.hypot(5, 2)
    last = math.sqrt(speed**2 - 2 * 0.8 * 4 * speed / 5)
    velocity = last / speed * np.array([5, 2, 0])
    assert (course.status, course.ground_phases[-1].kind) == ("at-plane", "roll")
    assert course.duration == pytest.approx((speed - last) / 0.8, rel=integrated(1e-9))
    agrees(course.rest.position, [4, 4 * 2 / 5, R], integrated(1e-9))
    agrees(course.rest.velocity, velocity, integrated(1e-9))
    agrees(course.rest.spin, np.array([-velocity[1], velocity[0], 0]) / R, integrated(1e-9))


RAMP = math.sqrt(2 * 9.81 * 1.0 * 3 / 5)
"""Speed of a ball that rolled down 1 m [m/s]; 2/5 of the energy of a thin shell is in its spin."""

# least and largest rebound height over drop height; speed [m/s], least and largest roll [m]
MEASURED = {
    # FIFA Quality: a ball dropped from 2 m rebounds 0.60 to 0.85 m, and rolls 4 to 10 m
    "turf": ((0.60 / 2, 0.85 / 2), (RAMP, 4.0, 10.0)),
    "wet-grass": ((0.60 / 2, 0.85 / 2), (RAMP, 4.0, 10.0)),
    # FIFA Quality Pro: 1.35 to 1.55 m from 2 m on steel; EN 12234: a roll of 12 m
    "hard-floor": ((1.35 / 2, 1.55 / 2), (RAMP, 11.8, 12.2)),
    # RoboCup: from 2 m to 0.5 m; Webots: from 0.841 m/s, a ball rolls 0.621 m
    "carpet": ((0.5 / 2, 0.5 / 2), (0.841, 0.615, 0.63)),
}


@pytest.mark.parametrize("name", MEASURED)
def test_a_surface_bounces_and_rolls_as_measured(name):
    surface, ((low, high), (speed, near, far)) = SURFACES[name], MEASURED[name]
    assert low - 0.005 <= surface.restitution**2 <= high + 0.005
    assert near <= speed**2 / (2 * surface.rolling_deceleration) <= far


def test_turf_rebounds_in_the_middle_of_fifas_range_and_keeps_its_share_of_the_speed():
    """0.60 to 0.85 m from 2 m; of 50 km/h at 15 degrees to the ground, 45 to 70 % are left."""
    turf, angle = SURFACES["turf"], math.radians(15)
    middle = (math.sqrt(0.60 / 2) + math.sqrt(0.85 / 2)) / 2
    assert turf.restitution == pytest.approx(middle, abs=5e-3)
    before = kd.BallState(velocity=(50 / 3.6 * math.cos(angle), 0, -50 / 3.6 * math.sin(angle)))
    assert 0.45 <= bounce(before, kd.Ball(), turf).speed / before.speed <= 0.70


def test_surfaces_are_found_by_name_and_have_a_source():
    for name, surface in SURFACES.items():
        assert surface.name == name
        assert surface.source
        assert kd.Ground(surface=name).surface is surface
    assert kd.Ground() == kd.Ground(0.0, None)


def test_friction_is_that_of_leather_or_of_turf():
    """0.37 to 0.45 on most match balls (Proceedings 2020, 49(1):92); steel rolls as a floor."""
    for name in ("wet-grass", "hard-floor", "steel"):
        assert 0.40 - 0.005 < SURFACES[name].friction < 0.42
    steel, floor = SURFACES["steel"], SURFACES["hard-floor"]
    assert steel.rolling_deceleration == floor.rolling_deceleration
    assert SURFACES["carpet"].friction == SURFACES["turf"].friction


@pytest.mark.parametrize(("make", "words"), [
    *((lambda v=v: kd.Ground(v), "ground height is") for v in (math.nan, math.inf, "0", True)),
    (lambda: kd.Ground(surface="ice"), "'ice'.*choose turf"),
    (lambda: kd.Ground(surface=3), "surface is 3"),
    (lambda: Surface("bad", 1.1, 0.5, 1), r"restitution is 1\.1"),
    (lambda: Surface("bad", "air", 0.5, 1), "restitution is 'air'.*inflated"),
    (lambda: Surface("bad", 0.5, -1, 1), "friction is -1"),
    (lambda: Surface("bad", 0.5, 0.5, 0), "rolling deceleration is 0"),
    (lambda: Surface("bad", 0.5, 0.5, 1, 2), "tangential restitution is 2"),
    (lambda: Surface("bad", 0.5, 0.5, 1, -1.1), r"tangential restitution is -1\.1"),
    (lambda: Surface("bad", 0.6, 0.5, 0.7, deviations={"bounce": 0.1}), "'bounce'.*friction"),
    (lambda: Surface("bad", 0.6, 0.5, 0.7, deviations={"friction": -1}), "friction is -1")
])  # fmt: skip
def test_refusals_of_a_ground(make, words):
    with pytest.raises(kd.InvalidInput, match=words):
        make()
