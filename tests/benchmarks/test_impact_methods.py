"""Impulses by several methods: the reference is right, and each method approaches it."""

import impact_methods
import measurement
import pytest
from references.exact_impact import exact_impact, given
from tolerances import closed_form

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
