from timeit import timeit

import flight_methods as flight
import pytest
from flight_methods import kicks, measure_flights
from references.exact_flight import landing

import kickdyn as kd


@pytest.fixture(scope="module")
def rows():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flight, "kicks", lambda: kicks(3))
        patch.setattr(flight, "shortest_time", lambda run: timeit(run, number=1))
        return measure_flights((1e-4, 1e-8))


def scene_rows(rows, scene):
    return [row for row in rows if row.scene == scene]


@pytest.mark.parametrize("scene", ["drag only", "full"])
def test_every_method_gets_more_exact_with_its_tolerance(rows, scene):
    mine = scene_rows(rows, scene)
    methods = dict.fromkeys(row.method for row in mine)
    assert list(methods)[:6] == ["RK45", "DOP853", "LSODA", "Radau", "kd.fly", "kd.fly_many"]
    for method in methods:
        coarse, fine = (row for row in mine if row.method == method)
        assert fine.error < coarse.error / 10
        assert fine.error < 1e-3
        assert fine.calls > coarse.calls
        assert coarse.seconds > 0


def test_the_closed_form_is_right_to_rounding(rows):
    (row,) = scene_rows(rows, "vacuum")
    assert row.error < 1e-13
    assert row.seconds > 0


@pytest.mark.parametrize("scene", ["drag only", "full"])
@pytest.mark.parametrize("method", ["kd.fly", "kd.fly_many"])
def test_flights_land_within_the_tolerance_of_their_length(rows, scene, method):
    longest = 40.0  # m, of the three kicks
    coarse, fine = (row for row in scene_rows(rows, scene) if row.method == method)
    assert 1e-7 < coarse.error < 1e-4 * longest  # one compared with itself has no error
    assert 1e-11 < fine.error < 1e-8 * longest


@pytest.mark.parametrize("scene", flight.LANDINGS)
def test_the_reference_is_the_landing_with_20_digits(scene):
    for state, stored in zip(kicks(), flight.LANDINGS[scene], strict=True):
        launch = kd.BallState(velocity=state.velocity) if scene == "drag only" else state
        exact = landing(launch, kd.Ball(), kd.Air(drag="brazuca"))
        assert exact[:2] == pytest.approx(stored, rel=1e-15)
