"""Functions compiled by numba: their exponential, their names, and where they are kept."""

import math
import os
import subprocess
import sys
import types

import mpmath
import numba
import numpy as np
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.aerodynamics import drag
from kickdyn.flight import compiling
from kickdyn.flight.compiling import (
    HEIGHT,
    LANES,
    SIZE,
    X,
    compiled_ends,
    compiled_rates,
    compiled_rolling,
    fingerprint,
    mathematics,
)
from kickdyn.flight.equations import FlightEquations
from kickdyn.flight.forces import acceleration_function
from kickdyn.flight.ground_motion import rolling_share

BALL = kd.Ball()


# --- the compiled functions are the plain ones ----------------------------------------------------


def lanes(fast):
    """Return scene and state of `LANES` balls; if fast, all beyond Reynolds number 7e4."""
    draw = np.random.default_rng(4)
    scene = np.vstack([draw.uniform(0, 9, LANES), draw.normal(0, 40, (3, LANES)),
                       np.arange(LANES) % 2])  # fmt: skip
    velocity = draw.normal(size=(3, LANES))
    speed = draw.uniform(*((8, 30) if fast else (0.1, 9)), LANES)
    velocity *= speed / np.linalg.norm(velocity, axis=0)
    return scene, np.vstack([draw.normal(size=(3, LANES)), velocity, draw.uniform(0.5, 1, LANES)])


@pytest.mark.parametrize("fast", [True, False])
def test_rates_side_by_side_are_those_of_each_flight(fast):
    """Without branches above the drag crisis, and with them for balls that are slower."""
    air = kd.Air(drag="brazuca", wind=(0.5, -0.3, 0.1))
    scene, state = lanes(fast)
    result = np.zeros(SIZE)
    compiled_rates(BALL, air)(scene.ravel(), state.ravel(), result)
    for i in range(LANES):
        height, *spin, decays = scene[:, i].tolist()
        launch = kd.BallState((0, 0, height), (1, 2, 3), spin)
        right = np.array(FlightEquations(launch, BALL, air).rates(0.0, state[:, i]))
        right[6] *= decays
        assert result[i::LANES] == pytest.approx(right, rel=closed_form(1e3), abs=1e-13), i


def test_rates_of_rolling_are_share_of_the_air_and_resistance():
    air, resistance = kd.Air(drag=0.3, wind=(2, -1, 0)), 0.7
    scene, state = lanes(False)
    result = np.zeros(SIZE)
    compiled_rolling(BALL, air, resistance)(scene.ravel(), state.ravel(), result)
    acting, share = acceleration_function(BALL, air), rolling_share(BALL)
    for i in range(LANES):
        u, v = state[3:5, i]
        ax, ay, _, _ = acting(scene.ravel()[HEIGHT + i], u, v, 0, 0, 0, 0)
        braking = resistance * np.array([u, v]) / math.hypot(u, v)
        right = [u, v, 0, *(share * np.array([ax, ay]) - braking), 0, 0]
        assert result[X + i :: LANES] == pytest.approx(right, rel=closed_form(1e3), abs=1e-15), i


def test_values_of_events_side_by_side_are_those_of_each():
    def mixed(state, numbers):
        return numbers[1] * state[6] + numbers[3] - state[0] * state[4]

    def other(state, numbers):
        return state[2] - numbers[0] + numbers[2] * state[5]

    _, state = lanes(True)
    numbers, result = np.random.default_rng(5).normal(size=(8, LANES)), np.zeros(2 * LANES)
    compiled_ends((mixed, other), ("mixed", "other"))(numbers.ravel(), state.ravel(), result)
    right = [*mixed(state, numbers[:4]), *other(state, numbers[4:])]
    assert result == pytest.approx(right, rel=closed_form(100), abs=1e-13)


@numba.njit
def exp(x):
    return compiling.exp(x)


def test_exp_is_right_to_the_last_digits():
    for x in np.concatenate([np.linspace(-707, 708, 700), np.linspace(-1, 1, 200), [0.0, -0.0]]):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(float(mpmath.mpf(exp(float(x))) / exact - 1)) < 4e-16, x
    ends = [exp(x) for x in (-709.0, -math.inf, 709.5, math.inf)]
    assert ends == [0, 0, math.inf, math.inf]
    assert math.isnan(exp(math.nan))
    assert mathematics.sin is math.sin


# --- names of functions ---------------------------------------------------------------------------

LEVEL = 0.2


def made(level, spare=0.0):
    def coefficient(reynolds, spin_parameter, power=1.0):
        return level + math.pow(spin_parameter, power) + abs(spare)

    return coefficient


def outer(level):
    inner = made(level)

    def coefficient(reynolds, spin_parameter):
        return inner(reynolds, spin_parameter)

    return coefficient


def by_name(reynolds, spin_parameter):
    return LEVEL


def itself(reynolds, spin_parameter):
    return itself(reynolds - 1.0, 0.0) if reynolds > 1.0 else 0.0


def with_globals(function, **values):
    return types.FunctionType(function.__code__, {**function.__globals__, **values}, "again")


def test_functions_that_do_the_same_share_a_name():
    assert fingerprint(made(0.2)) == fingerprint(made(0.2))
    assert fingerprint(outer(0.2)) == fingerprint(outer(0.2))
    assert fingerprint(itself) == fingerprint(itself)
    assert fingerprint(by_name) == fingerprint(with_globals(by_name))
    assert None not in map(fingerprint, drag.MODELS.values())


def test_code_defaults_closures_and_globals_count_in_a_name():
    nearly, quick = made(0.2), made(0.2)
    nearly.__defaults__, quick.__kwdefaults__ = (1.5,), {"power": 2.0}
    others = [made(0.2), made(0.2, 1.0), made(0.3), made(1), made(1.0), made(True), nearly, quick,
              outer(0.2), outer(0.3), by_name, with_globals(by_name, LEVEL=0.3), itself,
              drag.MODELS["sphere"]]  # fmt: skip
    names = [fingerprint(each) for each in others] + [fingerprint(by_name, b"other numba")]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    "value", [np.zeros(2), types.ModuleType("settings"), numba.njit(made(0.2)), object(), [1.0]]
)
def test_a_function_of_a_value_that_may_change_has_no_name(value):
    assert fingerprint(made(value)) is None
    assert fingerprint(with_globals(by_name, LEVEL=value)) is None


# --- on the disk ----------------------------------------------------------------------------------

FLIGHTS = """
import sys
import numba
import kickdyn as kd
from kickdyn.flight.march import compiled_march
from kickdyn.flight.compiling import compiled_rates

compiled_march()  # kept where it always is
numba.config.CACHE_DIR = sys.argv[1]

def model(level):
    def drag(reynolds, spin_parameter):
        return level
    return drag

launch = kd.BallState([[0, 0, 0]], [[20, 1, 9]], [[0, -30, 0]], [0])
for level in map(float, sys.argv[2:]):
    air = kd.Air(drag=model(level), lift=None)
    carry = kd.fly_many(launch, kd.Ball(), air).range.values[0]
    hits = sum(compiled_rates(kd.Ball(), air).stats.cache_hits.values())
    print(level, hits, float(carry).hex())
"""


@pytest.mark.slow
def test_equations_from_the_disk_are_their_own(tmp_path):
    """Compiled in two processes, read in a third: the linker must not take one for the other."""

    def flights(*levels):
        command = [sys.executable, "-W", "error", "-c", FLIGHTS, str(tmp_path), *levels]
        printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return {line.split()[0]: line.split()[1:] for line in printed.splitlines()}

    compiled = {**flights("0.1"), **flights("0.3")}
    read = flights("0.3", "0.1")
    assert [hits for hits, _ in compiled.values()] == ["0", "0"]
    assert [hits for hits, _ in read.values()] == ["1", "1"]
    assert {level: carry for level, (_, carry) in read.items()} == {
        level: carry for level, (_, carry) in compiled.items()
    }
    assert read["0.1"][1] != read["0.3"][1]


def test_a_changed_constant_is_compiled_anew():
    def constant(value):
        return kd.Air(drag=lambda reynolds, spin_parameter: value, lift=None)

    states = kd.BallState(velocity=[(20, 0, 10)])
    ranges = [float(kd.fly_many(states, BALL, constant(c)).range[0]) for c in (0.1, 0.4, 0.1)]
    assert ranges[0] == ranges[2] > ranges[1]


def test_the_oldest_equations_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(compiling, "_ON_DISK", 3)
    for age in range(6):
        file = tmp_path / f"compiling.equations_{age}.nbi"
        file.write_bytes(b"")
        os.utime(file, (1e9 - age, 1e9 - age))
    (tmp_path / "march.nbi").write_bytes(b"")
    compiling._forget(tmp_path)
    kept = sorted(file.name for file in tmp_path.iterdir())
    assert kept == [*(f"compiling.equations_{age}.nbi" for age in range(3)), "march.nbi"]


@pytest.mark.slow
def test_a_file_of_the_working_directory_does_not_say_where_code_is_kept(tmp_path):
    (tmp_path / ".numba_config.yaml").write_text("cache_dir: planted\n")
    script = (
        "import kickdyn, numba\n"
        "from kickdyn.flight.march import compiled_march\n"
        "compiled_march()\n"
        "numba.config.reload_config()\n"
        "print([numba.config.CACHE_DIR])\n"
    )
    environment = {name: v for name, v in os.environ.items() if not name.startswith("NUMBA_")}
    printed = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment,
        check=True, capture_output=True, text=True,
    ).stdout  # fmt: skip
    assert printed == "['']\n"
    assert not (tmp_path / "planted").exists()
