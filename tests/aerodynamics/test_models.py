"""Drag, lift and spin decay against published values; models found by name, copied, joined."""

import copy
import math
import pickle

import numpy as np
import pytest
from fluids.drag import Barati, Clift, Clift_Gauvin

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift, spin_decay
from kickdyn.aerodynamics.coefficient_model import CoefficientModel, ScaledCoefficient
from kickdyn.aerodynamics.drag import (
    BALLS,
    MODELS,
    REYNOLDS_PER_SPEED,
    brown_lawler,
    sphere,
    without_spin,
)

# Kiratidis & Leinweber 2018, evaluated by others from their Eq. 5 and Table 1
SPEEDS = (5, 10, 12, 14, 16, 18, 20, 25, 30, 35)
TABLE = {"tango12": (0.544, 0.507, 0.416, 0.277, 0.197, 0.175, 0.173, 0.180, 0.187, 0.195),
    "teamgeist": (0.492, 0.464, 0.364, 0.217, 0.158, 0.146, 0.144, 0.145, 0.150, 0.154),
    "jabulani": (0.484, 0.483, 0.481, 0.473, 0.441, 0.354, 0.236, 0.149, 0.162, 0.178),
    "brazuca": (0.474, 0.458, 0.386, 0.243, 0.182, 0.175, 0.178, 0.189, 0.200, 0.211)}  # fmt: skip


@pytest.mark.parametrize("ball", TABLE)
def test_balls_without_spin_have_the_published_drag(ball):
    cd = [MODELS[ball](v * REYNOLDS_PER_SPEED) for v in SPEEDS]
    assert cd == pytest.approx(TABLE[ball], abs=0.0005)


def test_reynolds_per_speed_is_that_of_the_tunnel():
    """Re 333,793 at 22.97 m/s, which a ball in air of 20 degC has, too."""
    assert pytest.approx(333_793) == 22.97 * REYNOLDS_PER_SPEED
    air, diameter = kd.Air(), 2 * kd.Ball().radius
    assert air.density * diameter / air.viscosity == pytest.approx(REYNOLDS_PER_SPEED, rel=0.01)


# Brown & Lawler 2003: their correlation at round Reynolds numbers
@pytest.mark.parametrize(("reynolds", "cd"),
    [(0.1, 247.5), (1, 27.60), (10, 4.13), (100, 1.073), (1e3, 0.463), (1e4, 0.411)])  # fmt: skip
def test_brown_lawler_has_the_published_values(reynolds, cd):
    assert brown_lawler(reynolds) == pytest.approx(cd, rel=1.2e-3)


@pytest.mark.parametrize(
    ("other", "difference"), [(Clift_Gauvin, 0.01), (Barati, 0.06), (Clift, 0.08)])  # fmt: skip
def test_sphere_agrees_with_other_correlations(other, difference):
    high, low = np.geomspace(10, 2e5, 100), np.geomspace(1, 10, 30)  # the correction fades in
    assert [sphere(x) for x in high] == pytest.approx([other(x) for x in high], rel=difference)
    assert [sphere(x) for x in low] == pytest.approx([other(x) for x in low], rel=0.172)


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
    model = lift.MODELS["saturating"]
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
    assert lift.MODELS[name](2.5e5, spin) == pytest.approx(cl, abs=1e-4)


# golf balls: Smits & Smith 1994, Tavares et al. 1999, as read by Nathan
@pytest.mark.parametrize(("name", "beta"), [("smits-smith", 0.010), ("tavares", 0.012)])
def test_spin_decay_has_the_published_coefficient(name, beta):
    assert spin_decay.MODELS[name](2e5, 0.1) == beta


HALF = CoefficientModel("drag", "half", lambda reynolds, spin: 0.5 + spin, (1, 9), (0, 1), "here")
SHIPPED = [m for package in (drag, lift, spin_decay) for m in package.MODELS.values()]


def test_a_model_is_its_function_and_knows_its_range():
    assert HALF(3.0) == 0.5  # without spin
    assert HALF(3.0, 0.25) == 0.75
    assert ScaledCoefficient(HALF, 3.0)(3.0, 0.25) == 2.25
    reynolds, spin = np.array([0.5, 5.0, 9.5, 5.0, 5.0]), np.array([0.5, 0.0, 1.0, -0.1, 1.1])
    outside = HALF.beyond(reynolds, spin)
    assert outside.astype(int).tolist() == [[1, 0, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0],
        [0, 0, 0, 0, 1]]  # fmt: skip


@pytest.mark.parametrize(("reynolds", "spin"), [
    (0.0, 0.0), (math.nan, 0), (math.inf, 0), (1.0, -0.1), (1.0, math.inf)])  # fmt: skip
def test_a_model_refuses_what_is_no_flow(reynolds, spin):
    with pytest.raises(kd.InvalidInput, match=f"half at Re {reynolds!r}.*above 0"):
        HALF(reynolds, spin)


def nearly_one(reynolds, spin_parameter):
    return 0.99


@pytest.mark.parametrize("again", [
    copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])  # fmt: skip
def test_a_model_keeps_its_own_function_in_copies_and_pickles(again):
    """Also one that has the name of a shipped model; shipped models stay the same objects."""
    mine = CoefficientModel("drag", "brazuca", nearly_one, (0, 1e6), (0, 1), "here")
    air = again(kd.Air(drag=mine))
    assert air.drag(1e5) == 0.99
    assert air == kd.Air(drag=mine) != kd.Air(drag="brazuca")
    assert again(kd.Air(drag=0.25)).drag(1e5, 0.0) == 0.25
    twice = again(kd.Air(drag=ScaledCoefficient(mine, 2.0)))
    assert (twice.drag(1e5), repr(twice).count("'2 x brazuca'")) == (1.98, 1)
    assert all(again(model) is model for model in SHIPPED)
