import math
import os
import subprocess
import sys
import types

import mpmath
import numba
import numpy as np
import pytest

from kickdyn.aerodynamics import drag
from kickdyn.flight import compiling
from kickdyn.flight.compiling import fingerprint, mathematics

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


@pytest.fixture
def flights(tmp_path):
    def run(*levels):
        command = [sys.executable, "-W", "error", "-c", FLIGHTS, str(tmp_path), *levels]
        told = subprocess.run(command, check=True, capture_output=True, text=True)
        return {line.split()[0]: line.split()[1:] for line in told.stdout.splitlines()}

    return run


def test_equations_from_the_disk_are_their_own(flights):
    # compiled in two processes, read in a third: the linker must not take one for the other
    made = {**flights("0.1"), **flights("0.3")}
    assert [hits for hits, _ in made.values()] == ["0", "0"]
    read = flights("0.3", "0.1")
    assert [hits for hits, _ in read.values()] == ["1", "1"]
    assert {level: carry for level, (_, carry) in read.items()} == {
        level: carry for level, (_, carry) in made.items()
    }
    assert read["0.1"][1] != read["0.3"][1]


def test_the_oldest_equations_go(tmp_path, monkeypatch):
    monkeypatch.setattr(compiling, "_ON_DISK", 3)
    for age in range(6):
        file = tmp_path / f"compiling.equations_{age}.nbi"
        file.write_bytes(b"")
        os.utime(file, (1e9 - age, 1e9 - age))
    (tmp_path / "march.nbi").write_bytes(b"")
    compiling._forget(tmp_path)
    left = sorted(file.name for file in tmp_path.iterdir())
    assert left == [*(f"compiling.equations_{age}.nbi" for age in range(3)), "march.nbi"]


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
    told = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment,
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert told.stdout == "['']\n"
    assert not (tmp_path / "planted").exists()


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


def test_what_does_the_same_has_one_name():
    for make in (made, outer):
        assert fingerprint(make(0.2)) == fingerprint(make(0.2)) != fingerprint(make(0.3))
    assert fingerprint(itself) == fingerprint(itself)
    for model in drag.MODELS.values():
        assert fingerprint(model) is not None


def test_all_a_function_uses_counts():
    nearly = made(0.2)
    nearly.__defaults__ = (1.5,)
    quick = made(0.2)
    quick.__kwdefaults__ = {"power": 2.0}
    whole = made(1), made(1.0), made(True)
    others = [made(0.2), made(0.2, 1.0), outer(0.2), outer(0.3), nearly, quick, by_name, itself]
    others += [with_globals(by_name, LEVEL=0.3), *whole, drag.MODELS["sphere"]]
    names = [fingerprint(each) for each in others] + [fingerprint(by_name, b"other numba")]
    assert len(set(names)) == len(names)
    assert fingerprint(by_name) == fingerprint(with_globals(by_name))


@pytest.mark.parametrize(
    "value", [np.zeros(2), types.ModuleType("settings"), numba.njit(made(0.2)), object(), [1.0]]
)
def test_what_may_be_another_tomorrow_has_no_name(value):
    assert fingerprint(made(value)) is None


@numba.njit
def exp(x):
    return compiling.exp(x)


def test_exp_is_right_to_the_last_digits():
    for x in np.concatenate([np.linspace(-708, 709, 2001), np.linspace(-1, 1, 500), [0.0, -0.0]]):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(mpmath.mpf(exp(float(x))) / exact - 1) < 4e-16
    assert exp(0.0) == 1.0
    assert (exp(-709.0), exp(-math.inf), exp(709.5), exp(math.inf)) == (0, 0, math.inf, math.inf)
    assert math.isnan(exp(math.nan))
    assert mathematics.sin is math.sin


@pytest.mark.parametrize(
    "used",
    [np.array([0.2]), np.array([0.3]), types, object(), [0.2]],
    ids=["array", "other array", "module", "object", "list"],
)
def test_what_uses_a_value_that_cannot_be_compared_has_no_name(used):
    """Nothing that was compiled of it may serve another function."""
    assert fingerprint(with_globals(by_name, LEVEL=used)) is None
    assert fingerprint(with_globals(by_name, LEVEL=0.2)) is not None
