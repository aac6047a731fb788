import pytest

from kickdyn.accuracy import flight_methods as flight
from kickdyn.accuracy.flight_methods import kicks, measure_flights


@pytest.fixture(scope="module")
def rows():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flight, "kicks", lambda: kicks(3))
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


def test_fly_and_fly_many_are_right_to_their_tolerance(rows):
    """Both of six kicks of up to 60 m; a flight that is compared with itself has no error."""
    finest = "tol 1e-08"
    fly, many = (
        next(row for row in scene_rows(rows, "full") if (row.method, row.setting) == (name, finest))
        for name in ("kd.fly", "kd.fly_many")
    )
    for row in (fly, many):
        assert 1e-11 < row.error < 1e-8 * 60


def test_the_front_is_what_nothing_beats(rows):
    for scene in ("drag only", "full"):
        mine = scene_rows(rows, scene)
        assert any(row.pareto for row in mine)
        for row in mine:
            beaten = any(o.seconds < row.seconds and o.error < row.error for o in mine)
            assert row.pareto is not beaten
