"""Flights by several methods: the reference is right, and each method approaches it."""

from timeit import timeit

import flight_methods
import pytest
from flight_methods import kicks, measure_flights
from references.exact_flight import landing
from tolerances import EPSILON, closed_form

import kickdyn as kd

LONGEST = 40.0
"""Of the flights of three kicks [m]."""


@pytest.fixture(scope="module")
def rows():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flight_methods, "kicks", lambda: kicks(3))
        patch.setattr(flight_methods, "shortest_time", lambda run: timeit(run, number=1))
        return measure_flights((1e-4, 1e-8))


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["drag only", "full"])
def test_every_method_approaches_the_reference_with_its_tolerance(rows, scene):
    of_scene = [row for row in rows if row.scene == scene]
    methods = {row.method for row in of_scene}
    assert {"RK45", "DOP853", "LSODA", "Radau", "kd.fly", "kd.fly_many"} <= methods
    for method in methods:
        coarse, fine = (row for row in of_scene if row.method == method)
        assert 0 < fine.error < min(coarse.error / 10, 1e-3), method
        assert fine.calls > coarse.calls, method
        if method.startswith("kd."):
            assert coarse.error < 1e-4 * LONGEST
            assert fine.error < 1e-8 * LONGEST


@pytest.mark.slow
def test_the_closed_form_of_the_vacuum_is_right_to_rounding(rows):
    (row,) = (row for row in rows if row.scene == "vacuum")
    assert row.error < closed_form()


@pytest.mark.slow
@pytest.mark.parametrize("scene", flight_methods.LANDINGS)
def test_the_reference_is_the_landing_with_20_digits(scene):
    for state, stored in zip(kicks(), flight_methods.LANDINGS[scene], strict=True):
        launch = kd.BallState(velocity=state.velocity) if scene == "drag only" else state
        exact = landing(launch, kd.Ball(), kd.Air(drag="brazuca"))
        assert exact[:2] == pytest.approx(stored, rel=4 * EPSILON)
