import math
import types

import numba
import numpy as np
import pytest

from kickdyn.aerodynamics import drag
from kickdyn.flight.fingerprint import fingerprint

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
