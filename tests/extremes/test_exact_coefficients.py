"""The formulas written anew agree with round numbers of their sources, and can be changed."""

import pytest
from references.exact_leg import mp

from extremes.exact_coefficients import FORMULAS, MODELS, Constants


def test_every_shipped_model_has_a_formula():
    assert set(FORMULAS) == {(kind, name) for kind, models in MODELS.items() for name in models}


def test_round_numbers():
    formula = FORMULAS["drag", "stokes"]
    assert formula(Constants(), 0.5, 0.0) == 48
    assert FORMULAS["lift", "wang"](Constants(), 1.0, 0.0) == 0
    assert FORMULAS["drag", "sphere"](Constants(), 0.5, 0.0) == 48
    low = FORMULAS["drag", "brazuca"](Constants(), 1e5, 0.0)
    assert float(low) == pytest.approx(0.474, abs=0.01)  # the plateau


def test_numbers_are_what_the_floats_are_and_changed_if_asked():
    assert Constants()(0.1) == mp.mpf(0.1)
    changed = Constants(seed=0)
    assert changed(0.1) != mp.mpf(0.1)
    assert (changed(0.0), changed.count) == (0, 1)
