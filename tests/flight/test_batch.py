"""Many flights at once are the flights of `fly`, row by row."""

import math

import numpy as np
import pytest
from tolerances import agrees, integrated

import kickdyn as kd
from kickdyn.flight import batch
from kickdyn.flight.batch import fly_many
from kickdyn.flight.derivatives import fly_with_launch_slopes
from kickdyn.flight.flight_result import outside_ranges

BALL = kd.Ball()
AIR = kd.Air()
FLAGS = {"landed": 0, "aloft": 1, "failed": 2}


@pytest.fixture(autouse=True, params=[False, True], ids=["Python", "machine code"])
def way(request, monkeypatch):
    """Flights in Python or in machine code, and not the other way."""
    monkeypatch.setattr(batch.MARCH, "pays", lambda _: request.param)
    other = "_in_python" if request.param else "integrate_many"
    monkeypatch.setattr(batch, other, lambda *_: pytest.fail(f"{other} is not to be called"))


def launches(n, seed, height=0.0, slowest=5.0):
    """Return kicks in every direction, some of them level, straight up, planar or without spin."""
    draw = np.random.default_rng(seed)
    velocity = draw.normal(size=(n, 3))
    velocity *= draw.uniform(slowest, 35, (n, 1)) / np.linalg.norm(velocity, axis=1)[:, None]
    spin = draw.normal(0, 40, (n, 3))
    velocity[0::10, 2] = 0.0
    velocity[1::10, :2] = 0.0
    velocity[2::10, 1] = 0.0
    spin[2::10, ::2] = 0.0
    spin[3::10] = 0.0
    return kd.BallState(np.column_stack([draw.normal(size=(n, 2)), np.broadcast_to(height, n)]),
                        velocity, spin)  # fmt: skip


def row_of(states, i):
    return kd.BallState(states.position[i], states.velocity[i], states.spin[i])


def assert_as_fly(states, ball, air, ground=None, tol=1e-12, rows=None, **options):
    """Assert that the rows are what `fly` returns, to the tolerance; return them."""
    many = fly_many(states, ball, air, ground, tol, **options)
    names = many.status.attrs["flag_meanings"].split()
    for i in range(len(states.position)) if rows is None else rows:
        one, row = kd.fly(row_of(states, i), ball, air, ground, tol, **options), many.isel(flight=i)
        length = np.abs([one.landing.position - one.launch.position, [0, 0, one.height]]).max()
        near, speed = integrated(tol, 1000), max(one.launch.speed, one.landing.speed)
        assert names[int(row.status)] == one.status, i
        for name, right, size in (
            ("duration", one.duration, one.duration), ("range", one.range, length),
            ("height", one.height, length), ("landing_velocity", one.landing.velocity, speed),
            ("landing_position", one.landing.position, length + 1.0),
            ("landing_spin", one.landing.spin, np.abs(one.launch.spin).max()),
            ("apex_position", one.apex.position, length + 1.0),
        ):  # fmt: skip
            values = row[name].values
            assert values == pytest.approx(right, abs=near * size + 1e-300), (name, i)
        assert float(row.apex_time) == pytest.approx(one.apex.time, abs=near * 10.0), i
    return many


@pytest.mark.parametrize(("air", "ground", "height"), [(AIR, None, 0.0),
    (kd.Air(wind=(-6, 3, 0.5)), kd.Ground(0.0), np.linspace(0.2, 5, 40)),
    (kd.Air(wind=(-6, 3, 0.5)), kd.Ground(-40.0), 0.0),
    (kd.Air(drag="brazuca", torque=None), None, 0.0)],
    ids=["still", "wind and ground", "deep fall", "brazuca"])  # fmt: skip
def test_random_launches(air, ground, height):
    assert (assert_as_fly(launches(40, 5, height), BALL, air, ground).status == 0).all()


def helper(spin_parameter, slope=0.1):
    return slope * math.tanh(spin_parameter)


def test_functions_of_a_user():
    """With defaults, closures, functions that they call, and a wind that grows with the height."""
    gain = 0.3

    def bent(reynolds, spin_parameter):
        return 0.2 + helper(spin_parameter) if reynolds > 1e5 else 0.25

    def rising(reynolds, spin_parameter, most=1, least=0.0):
        return gain * max(min(spin_parameter, most), least)

    air = kd.Air(drag=bent, lift=rising, torque=lambda re, sp, gain=0.02: gain,
                 wind=lambda height, growth=0.3: (growth * height, -1, 0))  # fmt: skip
    assert_as_fly(launches(20, 3, slowest=15.0), BALL, air, tol=1e-6)


@pytest.mark.parametrize("air", [None, kd.Air(density=0), kd.Air(drag=None)], ids=str)
def test_only_flights_with_more_than_weight_are_integrated(air):
    """Lift without drag acts on balls that spin."""
    states = launches(20, 6, np.linspace(0, 3, 20))
    many = assert_as_fly(states, BALL, air, kd.Ground(-1.0))
    integrated_rows = states.spin.any(axis=1) & (air is not None and air.density > 0)
    assert (many.evaluations.values > 0).tolist() == integrated_rows.tolist()


def test_the_highest_of_several_crests_counts():
    """A light ball with strong lift flies loops."""
    states, ball = kd.BallState((0, 0, 1), [(20, 0, 6)], (0, -80, 0)), kd.Ball(0.05, 0.11)
    loop = kd.Air(drag=0.05, lift=1.0, torque="tavares")
    assert_as_fly(states, ball, loop, kd.Ground(-20))
    path = kd.fly(row_of(states, 0), ball, loop, kd.Ground(-20))
    z = path.sample(np.linspace(0, path.duration, 1000)).position[:, 2]
    assert ((z[1:-1] > z[:-2]) & (z[1:-1] > z[2:])).sum() > 1


@pytest.mark.parametrize(("ball", "air", "limit", "status"), [
    (kd.Ball(0.002, 0.11), AIR, 20.0, [1, 1]),  # a balloon
    (BALL, kd.Air(wind=(0, 0, 60)), 20.0, [1, 1]),
    (BALL, None, 3.0, [1, 0]),
    (BALL, AIR, 1.0, [1, 0]),
])  # fmt: skip
def test_a_flight_is_aloft_at_the_time_limit(ball, air, limit, status):
    states = kd.BallState(velocity=[(5, 1, 50), (1, 0, 1)])
    many = assert_as_fly(states, ball, air, tol=1e-9, time_limit=limit)
    assert many.status.values.tolist() == status
    assert many.duration.values[0] == limit


PLANE = kd.Plane((21, 0, 0), (-1, 0.2, 0))
FAR = kd.Event("far", lambda state, numbers: 21.5**2 - state[0] ** 2 - state[1] ** 2)


@pytest.mark.parametrize("air", [AIR, None], ids=["air", "vacuum"])
@pytest.mark.parametrize("ends", [[], [FAR]], ids=["plane", "plane and event"])
def test_many_flights_end_at_the_events_of_one(air, ends):
    draw = np.random.default_rng(2)
    states = kd.BallState(draw.normal((0, 0, 4), 0.3, (40, 3)), draw.normal((18, 0, 7), 3, (40, 3)),
                          draw.normal(0, 30, (40, 3)))  # fmt: skip
    many = assert_as_fly(states, BALL, air, kd.Ground(), plane=PLANE, ends=ends)
    assert len(set(many.status.values)) == 2 + len(ends)
    assert many.status.attrs["flag_meanings"].split() == [*FLAGS, "at-plane",
        *(e.name for e in ends)]  # fmt: skip


def spoilt_above_30(reynolds, spin_parameter):
    return math.nan if reynolds > 4e5 else 0.2


def raising_above_30(reynolds, spin_parameter):
    if reynolds > 4e5:
        raise ValueError("no data")
    return 0.2


@pytest.mark.parametrize("coefficient", [spoilt_above_30, raising_above_30])
@pytest.mark.parametrize("too_fast", [True, False])
def test_a_row_without_a_coefficient_fails_and_the_others_do_not(coefficient, too_fast):
    velocity = [(20, 0, 8), (60, 0, 8), (25, 1, 5), *[(1e200, 0, 1e200)] * too_fast]
    states = kd.BallState(velocity=velocity, spin=(0, -30, 0))
    many = assert_as_fly(states, BALL, kd.Air(drag=coefficient), rows=[0, 2])
    assert many.status.values.tolist() == [0, 2, 0, 2][: len(velocity)]
    for name in ("range", "duration", "height", "apex_time", "landing_position", "landing_spin"):
        values = many[name].values.reshape(len(velocity), -1)
        assert np.isnan(values).all(axis=1).tolist() == [False, True, False, True][: len(velocity)]
    assert not many.outside[1]
    beyond = kd.BallState(velocity=[(1, 0, 1e200), (1, 0, 5)])  # of float64, without air
    assert fly_many(beyond, BALL, time_limit=1e300).status.values.tolist() == [2, 0]


def test_the_dataset_has_units_flags_and_arguments(tmp_path):
    many = fly_many(launches(5, 1), BALL, AIR, tol=1e-8)
    assert all("long_name" in many[name].attrs for name in many.data_vars)
    assert many.status.attrs["flag_meanings"].split() == list(FLAGS)
    assert many.attrs["ball_mass_kg"] == BALL.mass
    assert many.attrs["tol"] == 1e-8
    many.to_netcdf(tmp_path / "flights.nc", engine="h5netcdf")
    none = fly_many(
        kd.BallState(np.empty((0, 3))), BALL, kd.Air(wind=lambda z: (0.1 * z, 0, 0)), kd.Ground()
    )
    assert dict(none.sizes) == {"axis": 3, "flight": 0}


@pytest.mark.parametrize("air", [AIR, kd.Air(wind=lambda z: (2 * z, 0, 0)), kd.Air(0.0)], ids=str)
def test_outside_are_flights_that_leave_the_data_at_launch_apex_or_landing(air):
    states = launches(60, 3)
    many = fly_many(states, BALL, air)
    for i in range(60):
        path = kd.fly(row_of(states, i), BALL, air)
        nodes = path.launch, path.apex, path.landing
        place, velocity, spin = (np.array([getattr(node, name) for node in nodes])
                                 for name in ("position", "velocity", "spin"))  # fmt: skip
        left = path.duration > 0 and path.evaluations > 0 and any(
            out.any() for _, out in outside_ranges(place[:, 2], velocity, spin, BALL, air)
        )  # fmt: skip
        assert bool(many.outside[i]) == left, i
    assert many.outside.values.any() == (air.density > 0)


@pytest.mark.parametrize("way", [False], indirect=True)
def test_in_python_the_error_is_that_of_each_flight():
    states = launches(12, seed=7, height=0.5)
    for air in (AIR, None):
        many = fly_many(states, BALL, air, kd.Ground(), 1e-5, error=True)
        for i, error in enumerate(many.error.values):
            one = kd.fly(row_of(states, i), BALL, air, kd.Ground(), 1e-5)
            assert error == pytest.approx(one.error, rel=integrated(1e-5), abs=0), i


@pytest.mark.parametrize("plane", [None, kd.Plane((9, 0, 0), (-1, 0, 0.1))], ids=["ground", "wall"])
def test_slopes_of_landings_are_those_of_flights_side_by_side(plane):
    velocity = np.array([[18.0, 2.0, 9.0], [25.0, -1.0, 6.0], [12.0, 0.0, 12.0]])
    states = kd.BallState((0, 0, 0.5), velocity, (5.0, -30.0, 12.0))
    air = kd.Air(wind=(1, 2, 0))
    many = fly_many(states, BALL, air, kd.Ground(), plane=plane, slopes=True)
    normal = np.array([0.0, 0.0, 1.0]) if plane is None else plane.normal
    for i in range(3):
        time = float(many.duration[i])
        flight = fly_with_launch_slopes(row_of(states, i), BALL, air, time, 1e-12)
        right, _ = flight.slopes_at_plane(normal, time)
        agrees(many.landing_by_velocity.values[i], right[:, :3], integrated(1e-9))
        agrees(many.landing_by_spin.values[i], right[:, 3:6], integrated(1e-9))


class Table:
    def __call__(self, reynolds, spin_parameter):
        return 0.2


def reads_a_file(reynolds, spin_parameter):
    with open("table.csv") as file:  # noqa: PTH123
        return float(file.read())


STATES = launches(4, 2, [1.0, 0.2, 0.05, 0.0])
ODD = kd.Event("odd", lambda state, _: float(str(state[0])))


@pytest.mark.parametrize("way", [True], indirect=True)
@pytest.mark.parametrize(("arguments", "options", "words"), [
    ((row_of(STATES, 0), BALL), {}, r"\(3,\).*fly_many"), ((STATES, 0.43), {}, "kickdyn.Ball"),
    ((STATES, BALL, AIR, kd.Ground()), {}, "flight 2 .*0.0598.* m inside the ground"),
    ((STATES, BALL), {"tol": 0.1}, "tol is 0.1"), ((STATES, BALL), {"time_limit": 0}, "limit is 0"),
    ((STATES, BALL), {"error": 1}, "error is 1.*True"),
    ((STATES, BALL, kd.Air(drag=Table())), {}, "drag .*Table.*numba.*fly"),
    ((STATES, BALL, kd.Air(drag=reads_a_file)), {}, "drag 'reads_a_file'.*numba.*fly"),
    ((STATES, BALL, AIR), {"ends": [ODD]}, "'odd'.*numba.*fly")])  # fmt: skip
def test_refusals(arguments, options, words):
    with pytest.raises(kd.InvalidInput, match=words) as refusal:
        fly_many(*arguments, **options)
    assert "\n" not in str(refusal.value)
