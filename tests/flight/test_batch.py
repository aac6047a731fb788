"""Many flights at once give the answers of `fly`, row by row."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift
from kickdyn.aerodynamics import spin_decay as torque
from kickdyn.flight import batch
from kickdyn.flight.batch import _outside, fly_many
from kickdyn.flight.derivatives import fly_with_launch_slopes

BALL = kd.Ball()
AIR = kd.Air()


def launches(n, seed, height=0.0, slowest=5.0):
    """Kicks in every direction, some of them downward, level, straight up or without spin."""
    draw = np.random.default_rng(seed)
    velocity = draw.normal(size=(n, 3))
    velocity *= draw.uniform(slowest, 35, (n, 1)) / np.linalg.norm(velocity, axis=1)[:, None]
    spin = draw.normal(0, 40, (n, 3))
    velocity[0::10, 2] = 0.0
    velocity[1::10, :2] = 0.0
    velocity[2::10, 1] = 0.0
    spin[2::10, ::2] = 0.0  # planar
    spin[3::10] = 0.0
    position = np.column_stack([draw.normal(size=(n, 2)), np.broadcast_to(height, n)])
    return kd.BallState(position, velocity, spin, np.zeros(n))


def of(states, i):
    return kd.BallState(states.position[i], states.velocity[i], states.spin[i])


def agree(states, ball, air, ground=None, tol=1e-13, rows=None, length=1e-8, **limit):
    """Assert that each row is what `fly` says."""
    many = fly_many(states, ball, air, ground, tol, **limit)
    for i in range(len(states.position)) if rows is None else rows:
        one, row = kd.fly(of(states, i), ball, air, ground, tol, **limit), many.isel(flight=i)
        assert ("landed", "aloft", "failed")[int(row.status)] == one.status
        assert float(row.duration) == pytest.approx(one.duration, abs=length / 10, rel=1e-12)
        assert float(row.range) == pytest.approx(one.range, abs=length, rel=1e-12)
        assert float(row.height) == pytest.approx(one.height, abs=length, rel=1e-12)
        assert float(row.apex_time) == pytest.approx(one.apex.time, abs=length, rel=1e-12)
        for name, expected in (
            ("landing_position", one.landing.position),
            ("landing_velocity", one.landing.velocity),
            ("apex_position", one.apex.position),
        ):
            assert row[name].values == pytest.approx(expected, abs=length, rel=1e-12), (name, i)
        assert row.landing_spin.values == pytest.approx(one.landing.spin, abs=1e-7)
    return many


# --- the answers of fly -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("air", "ground", "height"),
    [
        (AIR, None, 0.0),
        (kd.Air(wind=(-6, 3, 0.5)), kd.Ground(0.0), np.linspace(0.2, 5, 100)),
        (kd.Air(wind=(4, 0, 0), torque=None), kd.Ground(-40.0), 0.0),
    ],
    ids=["still", "wind and ground", "deep fall"],
)
def test_random_launches(air, ground, height):
    many = agree(launches(100, 5, height), BALL, air, ground)
    assert (many.status == 0).all()


def test_default_tolerance_keeps_what_fly_keeps():
    """Where a coefficient bends, both are off by more than tol: neither may be worse."""
    states = launches(60, 8, slowest=10.0)
    exact = fly_many(states, BALL, AIR, tol=1e-13).landing_position.values
    many = fly_many(states, BALL, AIR).landing_position.values
    each = np.array([kd.fly(of(states, i), BALL, AIR).landing.position for i in range(60)])
    ours, theirs = (np.abs(found - exact).max(axis=1) for found in (many, each))
    assert np.median(ours) < 2e-7
    assert ours.max() < max(2 * theirs.max(), 1e-7)


def test_smooth_coefficients_at_the_default_tolerance():
    air = kd.Air(drag=drag.constant(0.25), lift=drag.constant(0.1))
    states = kd.BallState(
        [(0, 0, 0)] * 3, [(25, 3, 9), (30, 0, 5), (15, -4, 12)], [(5, -40, 20)] * 3, [0] * 3
    )
    agree(states, BALL, air, tol=1e-9, length=2e-7)


@pytest.mark.parametrize("kind", ["drag", "lift", "torque"])
def test_every_model_by_name(kind):
    states = kd.BallState([(0, 0, 0)] * 2, [(26, 2, 8), (18, -1, 4)], [(10, -60, 30)] * 2, [0, 0])
    for name in {"drag": drag, "lift": lift, "torque": torque}[kind].MODELS:
        agree(states, BALL, kd.Air(**{kind: name}), tol=1e-12)


def bent(reynolds, spin_parameter):
    return 0.2 + helper(spin_parameter) if reynolds > 1e5 else 0.5


def helper(spin_parameter, slope=0.1):
    return slope * math.tanh(spin_parameter)


def test_ones_own_functions():
    gain = 0.3

    def rising(reynolds, spin_parameter, most=1, least=0.0):
        return gain * max(min(spin_parameter, most), least)

    def aloft(height, growth=0.3):
        return (growth * height, -1, 0)

    air = kd.Air(drag=helper, lift=rising, torque=lambda re, sp, gain=0.02: gain, wind=aloft)
    agree(launches(20, 3), BALL, air, tol=1e-12)
    again = kd.Air(drag=drag.MODELS["stokes"].function, lift=None, torque=None)
    agree(launches(6, 4), kd.Ball(0.001, 0.05), again, tol=1e-12)
    states = launches(6, 4)
    assert np.isfinite(fly_many(states, BALL, kd.Air(drag=bent)).range).all()


def test_a_changed_constant_is_not_the_old_one():
    def held(value):
        return kd.Air(drag=lambda reynolds, spin_parameter: value, lift=None)

    states = launches(10, 5)
    first, second = (fly_many(states, BALL, held(c)).range.values for c in (0.1, 0.4))
    far = first > 0.1
    assert far.sum() >= 2
    assert (first[far] > second[far]).all()
    assert (fly_many(states, BALL, held(0.1)).range.values == first).all()


def test_vacuum():
    states = launches(50, 6, np.linspace(0, 3, 50))
    for air in (None, kd.Air(density=0), kd.Air(drag=None, lift=None, torque=None)):
        many = agree(states, BALL, air, kd.Ground(-1.0), length=1e-12)
        assert (many.evaluations == 0).all()


def test_without_drag_only_the_spinning_are_integrated():
    air = kd.Air(drag=None)
    states = launches(20, 7)
    many = agree(states, BALL, air, tol=1e-12)
    assert ((many.evaluations.values > 0) == states.spin.any(axis=1)).all()


def test_launches_need_only_what_differs():
    velocity = launches(5, 4).velocity
    many = fly_many(kd.BallState(velocity=velocity, spin=(0, -30, 0)), BALL, AIR)
    for i in range(5):
        one = kd.fly(kd.BallState(velocity=velocity[i], spin=(0, -30, 0)), BALL, AIR)
        assert many.landing_position.values[i] == pytest.approx(one.landing.position, abs=1e-6)


# --- special cases ------------------------------------------------------------------------------


def test_special_launches():
    level_with_back_spin = ((30, 0, 0), (0, -100, 0))  # lift carries it up
    down_at_once = ((10, 0, -5), (0, 50, 0))
    level = ((10, 0, 0), (0, 0, 0))
    at_rest = ((0, 0, 0), (0, 0, 0))
    tiny_hop = ((1e-10, 0, 1e-10), (0, 0, 0))
    rows = [level_with_back_spin, down_at_once, level, at_rest, tiny_hop]
    velocity, spin = (np.array(part, float) for part in zip(*rows, strict=True))
    states = kd.BallState(np.full((5, 3), 100.0), velocity, spin, np.zeros(5))
    strong = kd.Air(lift=lambda reynolds, spin_parameter: 0.5)
    many = agree(states, BALL, strong, rows=range(4))
    assert float(many.height[0]) > 0.1
    assert many.duration.values[1:4].tolist() == [0, 0, 0]
    assert float(many.range[4]) == pytest.approx(2e-20 / 9.81, rel=0.02)


def test_several_crests_and_the_highest_counts():
    def gusts(height):
        return (0, 0, 12.0 if height < 2 else -12.0)

    states = kd.BallState([(0, 0, 1)], [(20, 0, 6)], [(0, -80, 0)], [0])
    loop = kd.Air(drag=drag.constant(0.05), lift=drag.constant(1.0), torque="tavares")
    ball = kd.Ball(0.05, 0.11)
    agree(states, ball, loop, kd.Ground(-20))
    one = kd.fly(of(states, 0), ball, loop, kd.Ground(-20), 1e-12)
    z = one.sample(np.linspace(0, one.duration, 4000)).position[:, 2]
    crests = ((z[1:-1] > z[:-2]) & (z[1:-1] > z[2:])).sum()
    assert crests > 1
    assert np.isfinite(fly_many(states, BALL, kd.Air(wind=gusts), time_limit=5.0).height).all()


@pytest.mark.parametrize(
    ("ball", "air"),
    [(kd.Ball(0.002, 0.11), AIR), (BALL, kd.Air(wind=(0, 0, 60)))],
    ids=["balloon", "updraft"],
)
def test_what_never_comes_down_is_aloft(ball, air):
    states = kd.BallState(np.zeros((2, 3)), [(5, 1, 5), (0, 0, 0)], np.zeros((2, 3)), [0, 0])
    many = agree(states, ball, air, tol=1e-9, length=1e-5, time_limit=20.0)
    assert (many.status == 1).all()
    assert (many.duration == 20).all()


def test_a_time_limit_cuts_closed_forms_too():
    states = kd.BallState(np.zeros((2, 3)), [(5, 1, 50), (1, 0, 1)], np.zeros((2, 3)), [0, 0])
    assert agree(states, BALL, None, time_limit=3.0).status.values.tolist() == [1, 0]
    assert agree(states, BALL, AIR, time_limit=1.0).status.values.tolist() == [1, 0]


# --- bad rows -----------------------------------------------------------------------------------


def spoilt_above_30(reynolds, spin_parameter):
    return math.nan if reynolds > 4e5 else 0.2


def raising_above_30(reynolds, spin_parameter):
    if reynolds > 4e5:
        raise ValueError("no data")
    return 0.2


@pytest.mark.parametrize("coefficient", [spoilt_above_30, raising_above_30])
def test_a_bad_row_is_flagged_and_the_others_stay(coefficient):
    velocity = [(20, 0, 8), (60, 0, 8), (25, 1, 5), (1e200, 0, 1e200)]
    states = kd.BallState(np.zeros((4, 3)), velocity, [(0, -30, 0)] * 4, np.zeros(4))
    many = agree(states, BALL, kd.Air(drag=coefficient), rows=[0, 2])
    assert many.status.values.tolist() == [0, 2, 0, 2]
    for name in ("range", "duration", "height", "apex_time", "landing_position", "landing_spin"):
        assert np.isnan(many[name].values[[1, 3]]).all()
        assert np.isfinite(many[name].values[[0, 2]]).all()


def test_a_coefficient_that_raises_spares_the_others_of_a_batch_that_is_all_integrated():
    velocity = [(20, 0, 8), (60, 0, 8), (25, 1, 5)]
    states = kd.BallState(velocity=velocity, spin=(0, -30, 0))
    many = agree(states, BALL, kd.Air(drag=raising_above_30), rows=[0, 2])
    assert many.status.values.tolist() == [0, 2, 0]


def test_a_ball_that_lands_and_would_rise_again_within_one_step():
    """Lift without a limit turns it around below the ground: the first landing counts."""
    state = kd.BallState(
        velocity=[(-5.40408608, 28.09163781, 4.4895844)],
        spin=[(3.95040567, -50.4790938, 24.44674464)],
    )
    air = kd.Air(drag=0.2, lift=0.15, torque=0.01)
    exact = kd.fly(of(state, 0), BALL, air)
    for tol in (1e-3, 1e-5, 1e-7):
        assert float(fly_many(state, BALL, air, tol=tol).duration[0]) == pytest.approx(
            exact.duration, abs=1e-2
        )


def test_a_ball_in_syrup_is_given_up():
    syrup = kd.Air(density=1400, viscosity=1e6, drag="stokes", lift=None, torque=None)
    states = kd.BallState([(0, 0, 1e4)], [(1, 0, 1)], [(0, 0, 0)], [0])
    many = fly_many(states, kd.Ball(50.0, 0.1), syrup, kd.Ground(), time_limit=1e9)
    assert many.status.values.tolist() == [2]


# --- the dataset --------------------------------------------------------------------------------


def test_no_launch_at_all():
    none = kd.BallState(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    for air in (None, AIR):
        many = fly_many(none, BALL, air, kd.Ground())
        assert dict(many.sizes) == {"axis": 3, "flight": 0}


def test_units_flags_and_provenance(tmp_path):
    many = fly_many(launches(5, 1), BALL, AIR)
    assert all("long_name" in many[name].attrs for name in many.data_vars)
    assert many.status.attrs["flag_meanings"] == "landed aloft failed"
    assert many.status.dtype == many.status.attrs["flag_values"].dtype == np.int8
    assert many.attrs["ball_mass_kg"] == BALL.mass
    assert many.attrs["air"] == repr(AIR)
    assert many.attrs["tol"] == 1e-9
    many.to_netcdf(tmp_path / "flights.nc", engine="h5netcdf")


def test_the_order_and_the_company_change_nothing():
    states = launches(30, 9)
    back = kd.BallState(
        states.position[::-1], states.velocity[::-1], states.spin[::-1], states.time
    )
    many, other = (fly_many(each, BALL, AIR).landing_position.values for each in (states, back))
    assert (many == other[::-1]).all()


# --- what is refused ----------------------------------------------------------------------------


def test_errors_name_the_value():
    states = launches(4, 2, [1.0, 0.2, 0.05, 0.0])
    for arguments, told in (
        ((of(states, 0), BALL), r"launches have shape \(3,\)"),
        ((states, 0.43), "must be a kickdyn.Ball"),
        ((states, BALL, AIR, kd.Ground()), "flight 2 starts 0.0598169 m inside the ground"),
        ((states, BALL, AIR, None, 1e-14), "tol is 1e-14"),
        ((states, BALL, AIR, None, 0.1), "tol is 0.1"),
    ):
        with pytest.raises(kd.InvalidInput, match=told):
            fly_many(*arguments)
    with pytest.raises(kd.InvalidInput, match="time limit"):
        fly_many(states, BALL, time_limit=0)


class Table:
    def __call__(self, reynolds, spin_parameter):
        return 0.2


def reads_a_file(reynolds, spin_parameter):
    with open("table.csv") as file:  # noqa: PTH123
        return float(file.read())


@pytest.mark.parametrize("coefficient", [Table(), reads_a_file], ids=["object", "file"])
def test_what_numba_cannot_compile_is_named(coefficient):
    with pytest.raises(kd.InvalidInput, match=r"the air's drag .* cannot be compiled") as caught:
        fly_many(launches(4, 2), BALL, kd.Air(drag=coefficient))
    assert len(str(caught.value)) < 400
    assert "\n" not in str(caught.value)


def test_importing_kickdyn_imports_neither_numba_nor_xarray():
    code = "import sys, kickdyn; print({'numba', 'xarray'} & set(sys.modules))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "set()"


def test_importing_compiles_nothing(tmp_path):
    code = (
        "from numba.core import event\n"
        "with event.install_recorder('numba:compile') as compiled:\n"
        "    import kickdyn.flight.batch\n"
        "print(len(compiled.buffer))\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert told.stdout == "0\n"


def test_any_speed_that_fly_takes_and_no_other():
    speeds = np.array([1e-6, 1e3, 1e6, 2.9e8, 3.1e8])
    velocity = speeds[:, None] * [0.8, 0.1, 0.6]
    states = kd.BallState(np.zeros((5, 3)), velocity, [(5, -40, 20)] * 5, np.zeros(5))
    many = agree(states, BALL, AIR, tol=1e-13, rows=range(4), length=1e-6)
    assert many.status.values.tolist() == [0, 0, 0, 0, 2]
    assert np.isnan(many.landing_position.values[4]).all()
    with pytest.raises(kd.InvalidInput, match=r"launch speed is 3.1\d*e\+08 m/s"):
        kd.fly(of(states, 4), BALL, AIR)
    level = kd.BallState([(0, 0, 0)], [(1e9, 0, 0)], [(0, 0, 0)], [0])  # never leaves
    assert int(fly_many(level, BALL, AIR).status[0]) == 2


# --- the error ----------------------------------------------------------------------------------


@pytest.mark.parametrize("tol", [1e-5, 1e-8, 1e-11])
def test_the_error_of_each_flight_is_at_or_above_the_truth(tol):
    """Against the finest flights that can be asked for, which have errors of their own."""
    states, ground = launches(400, seed=21, height=0.5), kd.Ground()
    many = fly_many(states, BALL, AIR, ground, tol, error=True)
    exact = fly_many(states, BALL, AIR, ground, 1e-13, error=True)
    moved = many.landing_position.values - exact.landing_position.values
    true, error = np.linalg.norm(moved, axis=1), many.error.values
    assert (error + exact.error.values >= true).all()
    off = true > 0.01 * tol * np.maximum(exact.range.values, exact.height.values)
    assert np.count_nonzero(off) > 60
    assert np.median(error[off] / true[off]) < 10
    assert many.error.attrs["units"] == "m"
    assert "error" not in fly_many(states, BALL, AIR, ground, tol)


def narrow(reynolds, spin_parameter):
    return 0.2 + 0.5 * math.exp(-(((reynolds - 2.5e5) / 250.0) ** 2))


def test_the_error_counts_narrow_features_of_ones_own_function():
    states = kd.BallState(velocity=[(18.0 + i, 0, 6) for i in range(6)], spin=np.zeros((6, 3)))
    air = kd.Air(drag=narrow, lift=None)
    many, truth = fly_many(states, BALL, air, tol=1e-4, error=True), []
    for i in range(6):
        path = kd.fly(of(states, i), BALL, air, tol=1e-9, max_step=1e-3)
        truth.append(np.linalg.norm(path.landing.position - many.landing_position.values[i]))
    assert (truth <= many.error.values).all()
    assert max(truth) > 1e-2
    assert (many.error.values < 10 * np.array(truth) + 1e-3).all()


def test_errors_of_what_is_not_integrated():
    ground = kd.Ground(-1.0)
    closed = fly_many(kd.BallState(velocity=[(10, 0, 5), (0, 0, 1e308)]), BALL, error=True)
    path = kd.fly(kd.BallState(velocity=(10, 0, 5)), BALL)
    assert closed.error.values[0] == pytest.approx(path.error, rel=0.5)
    assert np.isnan(closed.error.values[1])  # it failed
    broken = kd.Air(drag=lambda reynolds, spin_parameter: math.nan)
    failed = fly_many(kd.BallState(velocity=[(10, 0, 5)]), BALL, broken, ground, error=True)
    assert np.isnan(failed.error.values).all()
    with pytest.raises(kd.InvalidInput, match="error is 1: it must be True or False"):
        fly_many(kd.BallState(velocity=[(10, 0, 5)]), BALL, error=1)


def test_a_lifted_ball_is_not_ballistic():
    """Without drag, lift alone makes the difference between a ball that spins and one that not."""
    air = kd.Air(drag=None, torque=None, lift=drag.constant(0.2))
    states = kd.BallState(velocity=(20, 0, 8), spin=[(0, -30, 0), (0, 0, 0)])
    many = fly_many(states, BALL, air)
    assert (many.evaluations.values > 0).tolist() == [True, False]
    assert many.duration.values[0] > 1.2 * many.duration.values[1]


@pytest.mark.parametrize(
    ("speeds", "left", "outside"),
    [
        ((20, 20, 20), (1.0, 1.0), False),
        ((17, 20, 20), (1.0, 1.0), True),
        ((20, 17, 20), (1.0, 1.0), True),
        ((20, 20, 17), (1.0, 1.0), True),
        ((20, 17, 17), (0.8, 0.7), False),  # the spin has decayed until then
        ((20, 17, 17), (0.8, 0.95), True),
        ((20, 17, 17), (0.95, 0.7), True),
    ],
)
def test_outside_are_flights_that_leave_the_data_at_launch_apex_or_landing(speeds, left, outside):
    """The lift is known to a spin parameter of 0.3, which this spin has at 19 m/s."""
    air, nodes = kd.Air(drag=None), np.zeros((1, 16))
    at_launch, at_apex, at_landing = (np.array([[float(speed), 0, 0]]) for speed in speeds)
    states = kd.BallState([(0, 0, 0)], at_launch, [(0, -0.3 * 19 / BALL.radius, 0)], [0.0])
    nodes[:, 0], nodes[:, 4:7], nodes[:, 12:15] = 1.0, at_landing, at_apex
    nodes[:, 15], nodes[:, 7] = left
    assert _outside(states, nodes, np.array([0]), BALL, air).tolist() == [outside]


def test_the_spin_that_is_left_at_apex_and_landing_is_that_of_fly(monkeypatch):
    nodes = []
    monkeypatch.setattr(batch, "_outside", lambda _, at, *more: nodes.append(at) or at[:, 0] > 0)
    states = launches(20, 5)
    fly_many(states, BALL, AIR, tol=1e-10)
    for i, row in enumerate(nodes[0]):
        flight = kd.fly(of(states, i), BALL, AIR, tol=1e-10)
        for left, at in ((row[7], flight.landing), (row[15], flight.apex)):
            spin = np.linalg.norm(flight.launch.spin)
            assert left * spin == pytest.approx(np.linalg.norm(at.spin), rel=1e-6)


def test_slopes_of_landings_are_those_of_the_variational_equations():
    """At a ground and at a wall, against equations that are integrated beside the flight."""
    velocity = np.array([[18.0, 2.0, 9.0], [25.0, -1.0, 6.0], [12.0, 0.0, 12.0]])
    states = kd.BallState((0, 0, 0.5), velocity, (5.0, -30.0, 12.0))
    air, ground, wall = kd.Air(wind=(1, 2, 0)), kd.Ground(0.0), kd.Plane((9, 0, 0), (-1, 0, 0.1))
    for plane, normal in ((None, np.array([0.0, 0.0, 1.0])), (wall, wall.normal)):
        many = fly_many(states, BALL, air, ground, plane=plane, slopes=True)
        for i in range(3):
            launch = kd.BallState((0, 0, 0.5), velocity[i], (5.0, -30.0, 12.0))
            time = float(many.duration[i])
            flight = fly_with_launch_slopes(launch, BALL, air, time, 1e-12)
            exact, _ = flight.slopes_at_plane(normal, time)
            assert many.landing_by_velocity.values[i] == pytest.approx(exact[:, :3], abs=2e-7)
            assert many.landing_by_spin.values[i] == pytest.approx(exact[:, 3:6], abs=2e-8)
    assert "landing_by_spin" not in fly_many(states, BALL, air, ground)
