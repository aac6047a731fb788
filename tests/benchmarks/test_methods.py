"""Impulses and flights by several methods: references are right."""

from timeit import timeit

import flight_methods
import impact_methods
import measurement
import pytest
from flight_methods import kicks, measure_flights
from references.exact_flight import landing
from references.exact_impact import exact_impact, given
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


by_kick = pytest.mark.parametrize("kick", impact_methods.KICKS)


@pytest.fixture(scope="module")
def errors():
    """Relative errors by kick and method."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(impact_methods, "CONTACT_TIMES", (1e-2, 1e-4))
        patch.setattr(impact_methods, "MUJOCO", {1e5: (1e-4,), 1e7: (1e-5,)})
        patch.setattr(measurement, "BRIEFEST_TIMING", 1e-3)
        table = {}
        for row in impact_methods.measure_impacts():
            table.setdefault((row.scene, row.method), []).append(row.error)
        return table


@by_kick
def test_the_reference_is_the_impulse_with_50_digits(kick):
    """Within rounding of the joint velocity, which differs between processors."""
    friction, stored = impact_methods.KICKS[kick]
    exact = exact_impact(*given(impact_methods.kick(friction)))["impulse"]
    right = [float(component) for component in exact.exact]
    assert stored == pytest.approx(right, rel=closed_form(), abs=0)


@pytest.mark.slow
@by_kick
def test_methods_for_the_same_equations_agree(errors, kick):
    assert errors[kick, "closed form"][0] < closed_form()
    assert errors[kick, "dense KKT system"][0] < closed_form()
    alone = errors.get((kick, "Pinocchio impulseDynamics"), [])
    assert len(alone) == (kick == "frictionless")  # it has no friction
    assert all(error < closed_form() for error in alone)


@pytest.mark.slow
def test_contacts_that_take_time_approach_the_instant(errors):
    """A contact a hundredth as long has a hundredth of the error; MuJoCo's is the root of k."""
    long, short = errors["frictionless", "compliant contact"]
    assert 1e-2 < long < 0.2
    assert short < long / 30
    for kick in impact_methods.KICKS:
        soft, stiff = errors.get((kick, "MuJoCo"), (0.1, 0.01))
        assert 1e-2 < soft < 0.2
        assert stiff < soft / 4
