"""Lift against published points and the formula that it was fitted to; spin decay."""

import numpy as np
import pytest

from kickdyn.aerodynamics import spin_decay
from kickdyn.aerodynamics.drag import BALLS, REYNOLDS_PER_SPEED, without_spin
from kickdyn.aerodynamics.lift import MODELS


def kiratidis_leinweber(ball, reynolds, spin):
    """Return C_L by Eqs. 8-9 of Kiratidis & Leinweber 2018, good for Sp up to 0.31."""
    level = without_spin(ball)
    reference, now = level(333_793) + 0.514 * 0.19, level(reynolds) + 0.514 * spin
    return 1.15 * spin**0.83 * (ball.a - min(now, ball.a)) / (ball.a - reference)


@pytest.mark.parametrize(("spin", "cl"), [(0.19, 0.290), (0.06, 0.141)])
def test_the_formula_gives_the_published_points(spin, cl):
    assert kiratidis_leinweber(BALLS["teamgeist"], 333_793, spin) == pytest.approx(cl, abs=5e-4)


@pytest.mark.parametrize("ball", ["brazuca", "tango12", "teamgeist"])
def test_saturating_is_within_20_percent_of_the_formula_in_its_range(ball):
    model = MODELS["saturating"]
    for reynolds in np.linspace(*model.reynolds, 12):
        for spin in np.linspace(0.05, model.spin[1], 11):
            exact = kiratidis_leinweber(BALLS[ball], reynolds, spin)
            assert model(reynolds, spin) == pytest.approx(exact, rel=0.2), (reynolds, spin)
            if reynolds > 20 * REYNOLDS_PER_SPEED and reynolds < 32 * REYNOLDS_PER_SPEED:
                assert model(reynolds, spin) == pytest.approx(exact, abs=0.04), (reynolds, spin)


# Wang 2015: Sp^0.4 / 2; Nathan's calculator: 1.12 Sp / (0.583 + 2.333 Sp), both by hand
@pytest.mark.parametrize(("name", "spin", "cl"), [
    *(("wang", sp, cl) for sp, cl in ((0.1, 0.1991), (0.2, 0.2627), (0.4, 0.3466))),
    *(("nathan", sp, cl) for sp, cl in ((0.1, 0.1372), (0.2, 0.2134), (0.4, 0.2955)))])  # fmt: skip
def test_other_models_have_their_published_values(name, spin, cl):
    assert MODELS[name](2.5e5, spin) == pytest.approx(cl, abs=1e-4)


# golf balls: Smits & Smith 1994, Tavares et al. 1999, as read by Nathan
@pytest.mark.parametrize(("name", "beta"), [("smits-smith", 0.010), ("tavares", 0.012)])
def test_spin_decay_has_the_published_coefficient(name, beta):
    assert spin_decay.MODELS[name](2e5, 0.1) == beta
