"""What a flight tells: arrival at x, orientation, estimate of its error, warnings."""

import itertools
import math
import re

import numpy as np
import pinocchio as pin
import pytest
from flight_methods import LANDINGS, kicks
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from tolerances import EPSILON, agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.flight.flight_result import outside_ranges

BALL = kd.Ball()


def launch(velocity, spin=(0, 0, 0), at=(0, 0, 0)):
    return kd.BallState(at, velocity, spin)


def test_arrival_is_on_the_path():
    path = kd.fly(launch((25, 3, 10), (0, -20, 10)), BALL, kd.Air(), tol=1e-12)
    there = path.arrival(20.0)
    assert there.position[0] == pytest.approx(20.0, abs=closed_form(10))
    agrees(there.position, path.sample(there.time).position, integrated(1e-12))
    assert path.arrival(0.0).time == 0.0
    assert path.arrival(-1.0) is None
    assert path.arrival(path.landing.position[0] + 1) is None
    # within the tolerance of the landing
    path = kd.fly(launch((25, 3, 10)), BALL, kd.Air(), tol=1e-6)
    end = path.landing.position
    agrees(path.arrival(end[0] * (1 + 1e-6)).position, end, integrated(1e-6))
    assert path.arrival(end[0] * (1 + 1e-4)) is None
    wall = kd.Plane((10, 0, 0), (-1, 0, 0))
    for limit, reached, missed in (({"plane": wall}, 9.5, 10.5), ({"time_limit": 0.2}, 4.0, 6.0)):
        path = kd.fly(launch((25, 0, 10)), BALL, kd.Air(), **limit)
        assert path.arrival(reached) is not None
        assert path.arrival(missed) is None


@pytest.mark.parametrize("air", [None, kd.Air(torque=None)], ids=["vacuum", "air"])
@pytest.mark.parametrize("spin", [(0, 0, 0), (0, -40, 0), (10, -40, 25)])
def test_a_constant_spin_turns_at_a_constant_rate(air, spin):
    path = kd.fly(launch((25, 0, 10), spin), BALL, air)
    times = np.array([0.0, 0.1, path.duration])
    right = Rotation.from_rotvec(times[:, None] * np.array(spin)).as_matrix()
    assert path.orientation(times).as_matrix() == pytest.approx(right, abs=closed_form(100))
    assert path.orientation(0.1).as_matrix() == pytest.approx(right[1], abs=closed_form(10))


def test_a_decaying_spin_turns_as_the_equation_of_quaternions_says():
    r"""q' = omega q / 2, by `solve_ivp` in the quaternions (x, y, z, w) of Pinocchio."""
    path = kd.fly(launch((25, 0, 12), (10, -40, 25)), BALL, kd.Air(torque=0.2), tol=1e-12)

    def rate(t, q):
        w = pin.Quaternion(np.array([*path.sample(min(t, path.duration)).spin, 0.0]))
        return 0.5 * (w * pin.Quaternion(q)).coeffs()

    q = solve_ivp(rate, (0, path.duration), [0, 0, 0, 1.0], "DOP853", rtol=1e-9, atol=1e-9).y[:, -1]
    turned = path.orientation(path.duration)
    assert np.linalg.norm(path.landing.spin) < 0.8 * np.linalg.norm(path.launch.spin)
    agrees(turned.as_matrix(), Rotation.from_quat(q).as_matrix(), integrated(1e-9))
    assert pin.Quaternion(turned.as_quat()).matrix() == pytest.approx(turned.as_matrix())


@pytest.mark.parametrize("tol", [1e-6, 1e-10, 1e-12])
def test_the_error_is_within_ten_times_the_truth_in_the_median(tol):
    """Against landings with 20 digits; of `fly` and of `fly_many`."""
    states, air = kicks(), kd.Air(drag="brazuca")
    paths = [kd.fly(state, BALL, air, tol=tol) for state in states]
    launches = [[getattr(s, n) for s in states] for n in ("position", "velocity", "spin")]
    many = kd.fly_many(kd.BallState(*launches), BALL, air, tol=tol, error=True)
    for ends, errors in (
        (np.array([path.landing.position for path in paths]), [path.error for path in paths]),
        (many.landing_position.values, many.error.values),
    ):
        true = np.linalg.norm(ends[:, :2] - LANDINGS["full"], axis=1)
        assert 1.0 < np.median(np.array(errors) / true) < 10.0


def test_the_error_counts_the_rounding_of_a_far_launch():
    """One along an axis, whose other coordinates are 0."""
    far = [(1e9, 0, 0), (0, 1e9, 0)]
    errors = kd.fly_many(kd.BallState(far, (1, 2, 3)), BALL, kd.Air(), error=True).error
    for position, many in zip(far, errors.values, strict=True):
        error = kd.fly(kd.BallState(position, (1, 2, 3)), BALL, kd.Air()).error
        assert min(error, many) > EPSILON * 1e9


@pytest.mark.parametrize("seed", range(24))
def test_the_error_is_not_below_the_true_one(seed):
    """Speeds of 1e-3 to 1e4 m/s, in wind, with and without a wall, against tol 1e-13."""
    draw = np.random.default_rng(seed)
    ahead = draw.normal(size=3) * [1, 1, 0] + [0, 0, draw.uniform(0.2, 2)]
    velocity = 10 ** draw.uniform(-3, 4) * ahead / np.linalg.norm(ahead)
    state = launch(velocity, draw.normal(size=3) * [0, 30, 3000][seed % 3],
                   (0, 0, BALL.radius + draw.uniform(0.1, 30)))  # fmt: skip
    air, tol = kd.Air(wind=draw.normal(size=3) * 10 * (seed % 2)), 10 ** draw.uniform(-10, -4)
    plane = kd.Plane((0.5, 0, 0), (-1, 0.2, 0.1)) if seed % 4 == 3 else None
    path, exact = (kd.fly(state, BALL, air, kd.Ground(), t, plane=plane) for t in (tol, 1e-13))
    true = float(np.linalg.norm(path.landing.position - exact.landing.position))
    moved = np.abs(exact.landing.position - state.position).max()
    assert true <= path.error + exact.error
    assert true <= 300 * tol * max(moved, exact.height)


def peak(reynolds, spin_parameter):
    """500 wide in Re, 0.03 m/s: no step of a flight that is 1.5 s long sees it."""
    return 0.2 + 0.5 * math.exp(-(((reynolds - 2.5e5) / 250) ** 2))


def braking(reynolds, spin_parameter):
    return 1e-3 + 10.0 * math.exp(-(((reynolds - 2.5e5) / 100) ** 2))


@pytest.mark.parametrize(("air", "least"),
    [(kd.Air(drag=peak), 1e-3), (kd.Air(drag=0.2, lift="wang", torque=braking), 0.1)],
    ids=["drag", "torque"])  # fmt: skip
def test_the_error_counts_narrow_features_of_a_coefficient_of_a_user(air, least):
    start = launch((20, 0, 6), (0, -30, 10))
    path = kd.fly(start, BALL, air, tol=1e-6)
    exact = kd.fly(start, BALL, air, tol=1e-10, max_step=path.duration / 1000)
    launches = kd.BallState(velocity=[start.velocity], spin=start.spin)
    row = kd.fly_many(launches, BALL, air, tol=1e-6, error=True).isel(flight=0)
    for end, error in ((path.landing.position, path.error), (row.landing_position, row.error)):
        true = np.linalg.norm(end - exact.landing.position)
        assert true <= float(error) < 10 * (true + 1e-6)
    assert np.linalg.norm(path.landing.position - exact.landing.position) > least


def test_the_error_is_infinite_where_no_finer_flight_can_be_integrated():
    calls = itertools.count()
    air = kd.Air(drag=lambda reynolds, spin: 0.2 if next(calls) < 1000 else math.nan)
    assert kd.fly(launch((20, 0, 9)), BALL, air, tol=1e-4).error == math.inf


@pytest.mark.parametrize("tol", [1e-8, 1e-12])
def test_the_error_of_a_shot_straight_up_covers_that_of_its_duration(tol):
    """v_t / g (atan(v / v_t) + atanh(v' / v_t)), with terminal speed v_t and landing speed v'."""
    air = kd.Air(drag=0.5, lift=None, torque=None, buoyancy=False)
    limit = math.sqrt(2 * BALL.mass * 9.81 / (air.density * BALL.cross_section * 0.5))
    speeds = np.geomspace(2.0, 200.0, 10)
    down = speeds / np.sqrt(1 + (speeds / limit) ** 2)
    exact = limit / 9.81 * (np.arctan(speeds / limit) + np.arctanh(down / limit))
    paths = [kd.fly(launch((0, 0, up)), BALL, air, tol=tol) for up in speeds]
    launches = kd.BallState(velocity=speeds[:, None] * [0, 0, 1])
    many = kd.fly_many(launches, BALL, air, tol=tol, error=True)
    times, errors = np.array([[path.duration, path.error] for path in paths]).T
    for time, error in ((times, errors), (many.duration.values, many.error.values)):
        assert (np.abs(time - exact) * down <= error).all()
        assert time == pytest.approx(exact, rel=integrated(tol))


@pytest.mark.parametrize(("air", "velocity", "spin", "words"), [(kd.Air(), (24, 0, 10), 0, None),
    (kd.Air(lift=None), (29, 0, 3), 10, "drag supercritical.*above 26.9 m/s"),
    (kd.Air(lift=None), (6, 0, 2), 5, "drag supercritical: 100 %.*below 7.97 m/s"),
    (kd.Air(lift=None), (20, 0, 3), 80, "drag supercritical.*parameter above 0.3"),
    (kd.Air(drag=None), (29, 0, 3), 10, None), (kd.Air(drag=None), (12, 0, 3), 0, None),
    (kd.Air(drag=None), (12, 0, 3), 10, "lift saturating: 100 %.*below 15.1 m/s"),
    (kd.Air(drag=None), (25, 0, 3), 120, "lift saturating: 100 %.*parameter above 0.3"),
    (kd.Air(drag=None), (12, 0, 3), 80, "below 15.1 m/s.*parameter above 0.3"),
    (kd.Air(drag=0.2, lift=None), (99, 0, 5), 0, None),
    (kd.Air(drag=0.2, lift=0.1), (101, 0, 5), 0, "101 m/s.*Mach 0.3"), (None, (859, 0, 5), 0, None),
])  # fmt: skip
def test_warnings_name_the_model_the_share_and_the_limit(air, velocity, spin, words):
    lines = kd.fly(launch(velocity, (0, -spin, 0)), BALL, air).warnings
    assert len(lines) == (words is not None)
    assert all(re.search(words, line) for line in lines), lines


def test_the_share_outside_the_data_is_of_the_time_in_the_air():
    air, ground = kd.Air(lift=None), kd.Ground(-BALL.radius, "turf")
    course, outside = kd.follow(launch((20, 0, 8)), BALL, air, ground), 0.0
    for flight in course.flights:
        at = flight.sample(np.linspace(0, flight.duration, 1000))
        ((_, rows),) = outside_ranges(at.position[:, 2], at.velocity, at.spin, BALL, air)
        outside += flight.duration * rows.any(axis=0).mean()
    right = 100 * outside / sum(flight.duration for flight in course.flights)
    (line,) = course.warnings
    assert float(re.search(r"(\d+) %", line)[1]) == pytest.approx(right, abs=2)


def test_ranges_are_left_where_the_flow_relative_to_the_air_leaves_them():
    """Re = 2 rho r u / mu and Sp = r |omega x u| / u^2, with the wind at the height of the ball."""
    air = kd.Air(wind=lambda z: (2.0 * z, 0.0, 0.0), drag="supercritical", lift="nathan")
    draw = np.random.default_rng(3)
    height, velocity = draw.uniform(0, 9, 60), draw.normal(size=(60, 3)) * 12
    spin = draw.normal(size=(60, 3)) * 60
    u = velocity - np.column_stack([2.0 * height, np.zeros(60), np.zeros(60)])
    speed = np.linalg.norm(u, axis=1)
    reynolds = 2 * BALL.radius * air.density / air.viscosity * speed
    parameter = BALL.radius * np.linalg.norm(np.cross(spin, u), axis=1) / speed**2
    for model, beyond in outside_ranges(height, velocity, spin, BALL, air):
        right = [reynolds < model.reynolds[0], reynolds > model.reynolds[1],
                 parameter < model.spin[0], parameter > model.spin[1]]  # fmt: skip
        assert 5 < beyond.any(axis=0).sum() < 60
        assert beyond.tolist() == np.array(right).tolist(), model.name
