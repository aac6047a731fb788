"""Ways to compute a kick: those that should agree do, those that approximate approach."""

import impact_methods as impact
import measurement
import numpy as np
import pytest
from references.exact_impact import exact_impact, given


@pytest.fixture(scope="module")
def rows():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(impact, "CONTACT_TIMES", (1e-2, 1e-4))
        patch.setattr(impact, "MUJOCO", {1e5: (1e-4,), 1e7: (1e-5,)})
        patch.setattr(measurement, "BRIEFEST_TIMING", 1e-3)
        return impact.measure_impacts()


def of(rows, kick, method):
    return [row.error for row in rows if (row.scene, row.method) == (kick, method)]


@pytest.mark.parametrize("kick", ["frictionless", "friction 0.4"])
def test_what_solves_the_same_equations_agrees(rows, kick):
    assert of(rows, kick, "closed form")[0] < 1e-15
    assert of(rows, kick, "dense KKT system")[0] < 1e-14
    bare = of(rows, kick, "Pinocchio impulseDynamics")
    assert len(bare) == (kick == "frictionless")
    assert all(error < 1e-14 for error in bare)


@pytest.mark.parametrize("solver", ["ADMM", "PGS"])
def test_cone_solvers_get_as_exact_as_they_are_asked(rows, solver):
    errors = of(rows, "friction 0.4", f"Pinocchio {solver}")
    assert errors == sorted(errors, reverse=True)
    assert all(error < tol for error, tol in zip(errors, impact.CONE_TOLERANCES, strict=True))
    assert of(rows, "frictionless", f"Pinocchio {solver}") == []


def test_compliant_contacts_approach_the_instant(rows):
    slow, fast = of(rows, "frictionless", "compliant contact")
    assert 1e-2 < slow < 0.2
    assert fast < slow / 30


@pytest.mark.parametrize("kick", ["frictionless", "friction 0.4"])
def test_mujoco_approaches_the_instant(rows, kick):
    pytest.importorskip("mujoco")
    soft, stiff = of(rows, kick, "MuJoCo")
    assert 1e-2 < soft < 0.2
    assert stiff < soft / 4


def test_the_kick_with_friction_sticks_and_turns_the_impulse():
    with_friction, without = impact.kick(0.4), impact.kick(0.0)
    assert with_friction.sticking
    gap = np.linalg.norm(with_friction.impulse - without.impulse)
    assert gap > 0.1 * np.linalg.norm(without.impulse)


@pytest.mark.parametrize("kick", impact.KICKS)
def test_the_reference_is_the_impulse_with_50_digits(kick):
    friction, stored = impact.KICKS[kick]
    exact = exact_impact(*given(impact.kick(friction)))["impulse"]
    # units in the last place: the BLAS of another processor rounds the joint velocity otherwise
    assert stored == pytest.approx([float(part) for part in exact.exact], rel=5e-16, abs=0)
