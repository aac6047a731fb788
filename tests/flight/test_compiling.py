"""Functions compiled by numba: their exponential, their names, and where they are kept."""

import math
import subprocess
import sys
import types

import mpmath
import numba
import numpy as np
import pytest
from tolerances import EPSILON

from kickdyn.aerodynamics import drag
from kickdyn.flight import compiling
from kickdyn.flight.compiling import fingerprint, mathematics


@numba.njit
def exp(x):
    return compiling.exp(x)


def test_exp_is_right_to_the_last_digits():
    for x in np.concatenate([np.linspace(-707, 708, 700), np.linspace(-1, 1, 200), [0.0, -0.0]]):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(float(mpmath.mpf(exp(float(x))) / exact - 1)) < 2 * EPSILON, x
    ends = [exp(x) for x in (-709.0, -math.inf, 709.5, math.inf)]
    assert ends == [0, 0, math.inf, math.inf]
    assert math.isnan(exp(math.nan))
    assert mathematics.sin is math.sin


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


@pytest.mark.parametrize("value", [
    np.zeros(2), types.ModuleType("settings"), numba.njit(made(0.2)), object(), [1.0]])  # fmt: skip
def test_a_function_of_a_value_that_may_change_has_no_name(value):
    assert fingerprint(made(value)) is None
    assert fingerprint(with_globals(by_name, LEVEL=value)) is None


FLIGHTS = """
import sys
import numba
import kickdyn as kd
from kickdyn.flight.batch import MARCH
from kickdyn.flight.compiling import compiled_rates

MARCH()  # kept where it always is
MARCH.pays = lambda in_python: True
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
        level: carry for level, (_, carry) in compiled.items()}  # fmt: skip
    assert read["0.1"][1] != read["0.3"][1]
