"""Functions compiled by numba: their exponential and logarithm, and where they are kept."""

import math
import subprocess
import sys

import mpmath
import numba
import numpy as np
import pytest
from tolerances import EPSILON, integrated

import kickdyn as kd
from kickdyn.aerodynamics import drag
from kickdyn.flight import batch, compiling
from kickdyn.flight.compiling import mathematics


@numba.njit
def exp(x):
    return compiling.exp(x)


@numba.njit
def log(x):
    return compiling.log(x)


def test_exp_is_right_to_the_last_digits():
    for x in np.concatenate([np.linspace(-707, 708, 700), np.linspace(-1, 1, 200), [0.0, -0.0]]):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(float(mpmath.mpf(exp(float(x))) / exact - 1)) < 2 * EPSILON, x
    ends = [exp(x) for x in (-709.0, -math.inf, 709.5, math.inf)]
    assert ends == [0, 0, math.inf, math.inf]
    assert math.isnan(exp(math.nan))
    assert mathematics.sin is math.sin


def test_log_is_right_to_the_last_digits():
    for x in np.concatenate([10.0 ** np.linspace(-320, 308, 701), np.linspace(0.5, 2, 200)]):
        exact = mpmath.log(mpmath.mpf(float(x)))
        assert abs(float(mpmath.mpf(log(float(x))) / exact - 1)) < 2 * EPSILON, x
    assert [log(x) for x in (0.0, 1.0, math.inf)] == [-math.inf, 0, math.inf]
    assert np.isnan([log(-1.0), log(math.nan)]).all()


MODELS = drag.MODELS


def made(level, power=1.0):
    inner = MODELS["brazuca"]

    def coefficient(reynolds, spin_parameter, share=0.5):
        return level + share * math.pow(inner(reynolds, spin_parameter), power)

    return coefficient


FLIGHTS = """
import sys
import numba
import kickdyn as kd
from kickdyn.flight.batch import MARCH
from kickdyn.flight.compiling import compiled_rates

MARCH()  # kept where it always is
MARCH.pays = lambda in_python: True
numba.config.CACHE_DIR = sys.argv[1]

launch = kd.BallState([[0, 0, 0]], [[20, 1, 9]], [[0, -30, 0]], [0])
for level in map(float, sys.argv[2:]):
    air = kd.Air(drag=level, lift=None)
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


def test_functions_of_one_name_are_compiled_with_what_each_calls(monkeypatch):
    monkeypatch.setattr(batch.MARCH, "pays", lambda _: True)
    launch = kd.BallState(velocity=[(20, 1, 9)])
    for level in (0.1, 0.3):
        many = kd.fly_many(launch, kd.Ball(), kd.Air(drag=made(level)))
        one = kd.fly(kd.BallState(velocity=(20, 1, 9)), kd.Ball(), kd.Air(drag=made(level)))
        assert float(many.range[0]) == pytest.approx(one.range, rel=integrated(1e-9))
