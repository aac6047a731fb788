"""Drag against published tables, other correlations, and the smoothness that integrators need."""

import math

import numpy as np
import pytest
from fluids.drag import Barati, Clift, Clift_Gauvin
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import closed_form

import kickdyn as kd
from kickdyn.aerodynamics.drag import BALLS, MODELS, REYNOLDS_PER_SPEED, brown_lawler, sphere

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


@pytest.mark.parametrize("model", ["stokes", "sphere", "supercritical", *BALLS])
@settings(max_examples=20)
@given(reynolds=st.floats(1e-300, 1.0), spin=st.floats(0, 10))
def test_creeping_flow_is_stokes(model, reynolds, spin):
    assert MODELS[model](reynolds, spin) == pytest.approx(24 / reynolds, rel=closed_form())


JOINS = [*((model, x) for model in ("sphere", "supercritical", *BALLS) for x in (1.0, 10.0)),
    *((model, x) for model in ("supercritical", *BALLS) for x in (2e4, 7e4)),
    *((model, 35 * REYNOLDS_PER_SPEED) for model in BALLS),
    *(("goff-carre", share * 12.19 * REYNOLDS_PER_SPEED) for share in (0.9, 1.1))]  # fmt: skip


@pytest.mark.parametrize("spin", [0.0, 0.05, 0.3])
@pytest.mark.parametrize(("model", "join"), JOINS)
def test_value_and_slope_are_continuous_where_formulas_join(model, join, spin):
    """A jump of the slope over a step does not shrink with the step."""

    def slope_jump(h):
        up, here, down = (MODELS[model](join * math.exp(x), spin) for x in (h, 0.0, -h))
        return abs((up - here) - (here - down)) / h

    assert slope_jump(1e-4) < 0.12 * slope_jump(1e-3) + closed_form() / 1e-4
