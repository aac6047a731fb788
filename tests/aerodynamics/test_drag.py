"""Drag against published tables, other correlations, and the smoothness that integrators need."""

import math
from pathlib import Path

import numpy as np
import pytest
from fluids.drag import Barati, Clift, Clift_Gauvin
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import closed_form

import kickdyn as kd
from kickdyn.aerodynamics.drag import (
    BALLS,
    MODELS,
    REYNOLDS_PER_SPEED,
    SPIN_DRAG_LIMIT,
    brown_lawler,
    sphere,
)

# Kiratidis & Leinweber 2018, evaluated by others from their Eq. 5 and Table 1
SPEEDS = (5, 10, 12, 14, 16, 18, 20, 25, 30, 35)
TABLE = {
    "tango12": (0.544, 0.507, 0.416, 0.277, 0.197, 0.175, 0.173, 0.180, 0.187, 0.195),
    "teamgeist": (0.492, 0.464, 0.364, 0.217, 0.158, 0.146, 0.144, 0.145, 0.150, 0.154),
    "jabulani": (0.484, 0.483, 0.481, 0.473, 0.441, 0.354, 0.236, 0.149, 0.162, 0.178),
    "brazuca": (0.474, 0.458, 0.386, 0.243, 0.182, 0.175, 0.178, 0.189, 0.200, 0.211),
}


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
@pytest.mark.parametrize(
    ("reynolds", "cd"),
    [(0.1, 247.5), (1, 27.60), (10, 4.13), (100, 1.073), (1e3, 0.463), (1e4, 0.411)],
)
def test_brown_lawler_has_the_published_values(reynolds, cd):
    assert brown_lawler(reynolds) == pytest.approx(cd, rel=1.2e-3)


@pytest.mark.parametrize(
    ("other", "difference"), [(Clift_Gauvin, 0.01), (Barati, 0.06), (Clift, 0.08)]
)
def test_sphere_agrees_with_other_correlations(other, difference):
    high, low = np.geomspace(10, 2e5, 100), np.geomspace(1, 10, 30)  # the correction fades in
    assert [sphere(x) for x in high] == pytest.approx([other(x) for x in high], rel=difference)
    assert [sphere(x) for x in low] == pytest.approx([other(x) for x in low], rel=0.172)


@pytest.mark.parametrize("model", ["stokes", "sphere", "supercritical", *BALLS])
@settings(max_examples=20)
@given(reynolds=st.floats(1e-300, 1.0), spin=st.floats(0, 10))
def test_creeping_flow_is_stokes(model, reynolds, spin):
    assert MODELS[model](reynolds, spin) == pytest.approx(24 / reynolds, rel=closed_form())


@pytest.mark.parametrize("reynolds", [7e4, 2e5, 1e7])
@pytest.mark.parametrize("spin", [0.0, 0.3])
def test_supercritical_is_one_fifth_beyond_the_crisis(reynolds, spin):
    """Goff & Carre 2009, from trajectories."""
    assert MODELS["supercritical"](reynolds, spin) == 0.2


JOINS = [
    *((model, x) for model in ("sphere", "supercritical", *BALLS) for x in (1.0, 10.0)),
    *((model, x) for model in ("supercritical", *BALLS) for x in (2e4, 7e4)),
    *((model, 35 * REYNOLDS_PER_SPEED) for model in BALLS),
    *(("goff-carre", share * 12.19 * REYNOLDS_PER_SPEED) for share in (0.9, 1.1)),
]


@pytest.mark.parametrize("spin", [0.0, 0.05, 0.3])
@pytest.mark.parametrize(("model", "join"), JOINS)
def test_value_and_slope_are_continuous_where_formulas_join(model, join, spin):
    """A jump of the slope over a step does not shrink with the step."""

    def slope_jump(h):
        up, here, down = (MODELS[model](join * math.exp(x), spin) for x in (h, 0.0, -h))
        return abs((up - here) - (here - down)) / h

    assert slope_jump(1e-4) < 0.12 * slope_jump(1e-3) + 1e-9


@pytest.mark.parametrize("name", MODELS)
def test_drag_is_positive_continuous_and_grows_with_spin(name):
    model, spins = MODELS[name], (0.0, 0.1, 0.4, 1.0, 10.0)
    grid = np.geomspace(0.1, 1e7, 2001)  # steps of 0.9 %
    cd = np.array([[model(float(x), spin) for x in grid] for spin in spins])
    assert (cd > 0).all()
    assert np.abs(np.diff(np.log(cd), axis=1)).max() < 0.1
    if name != "goff-carre":  # which drops in the crisis
        assert (np.diff(cd, axis=0) >= 0).all()


def test_the_drag_force_of_a_sphere_grows_with_its_speed():
    reynolds = np.geomspace(1e-12, 1e7, 2000)
    assert (np.diff([sphere(x) * x**2 for x in reynolds]) > 0).all()


@pytest.mark.parametrize("ball", BALLS)
def test_drag_is_level_beyond_the_data(ball):
    """Table 1 ends at 35 m/s."""
    model = MODELS[ball]
    assert model(35 * REYNOLDS_PER_SPEED) == pytest.approx(TABLE[ball][-1], abs=5e-4)
    assert model(1e9) == model(1e7) == pytest.approx(TABLE[ball][-1], abs=0.004)


@pytest.mark.parametrize("ball", BALLS)
def test_spin_adds_a_straight_line_that_ends(ball):
    """Kiratidis & Leinweber 2018: 0.514 Sp, measured up to Sp 0.3."""
    reynolds = 25 * REYNOLDS_PER_SPEED
    still = MODELS[ball](reynolds)
    for spin, within in ((0.05, 1e-7), (0.2, 5e-4), (0.3, 0.0121)):
        assert MODELS[ball](reynolds, spin) - still == pytest.approx(0.514 * spin, rel=within)
    for spin in (10.0, 1e9, 1e300):
        most = still + 0.514 * SPIN_DRAG_LIMIT
        assert MODELS[ball](reynolds, spin) == pytest.approx(most, rel=1e-9)


@pytest.mark.parametrize("spin", [0.05, 0.1, 0.2, 0.3])
def test_spin_drag_agrees_with_the_law_of_goff_and_carre(spin):
    """0.4127 Sp^0.3056 of a spinning Teamgeist at 25 m/s."""
    cd = 0.4127 * spin**0.3056
    assert MODELS["teamgeist"](25 * REYNOLDS_PER_SPEED, spin) == pytest.approx(cd, abs=0.016)


@pytest.mark.parametrize("v", [5.0, 10.0, 12.19, 20.0, 30.0])
def test_goff_carre_has_its_published_formulas_and_joins_them(v):
    """Goff & Carre 2010: a crisis without spin, a power of Sp with it, joined from 0.04 to 0.06."""
    model, reynolds = MODELS["goff-carre"], v * REYNOLDS_PER_SPEED
    level = 0.155 + 0.346 / (1 + math.exp((v - 12.19) / 1.309))
    middle = 0.04 * math.sqrt(1.5)  # half way in the logarithm
    assert [model(reynolds, sp) for sp in (0, 0.04)] == pytest.approx([level] * 2, rel=1e-12)
    if v > 1.1 * 12.19:
        fast, half = (0.4127 * sp**0.3056 for sp in (0.06, middle))
        assert model(reynolds, 0.06) == pytest.approx(fast, rel=1e-12)
        assert model(reynolds, middle) == pytest.approx((level + half) / 2, rel=1e-12)


def test_the_range_of_the_default_is_that_of_flights_of_a_match():
    """The fastest ball of the measured minute; a second minute had 27.0 m/s."""
    track = kd.Track.from_csv(Path(__file__).resolve().parents[2] / "data" / "match_ball.csv")
    flights = kd.segments(track).flights
    speeds = [np.linalg.norm(np.diff(one.positions, axis=0), axis=1) * 50 for one in flights]
    least, most = (end / REYNOLDS_PER_SPEED for end in kd.Air().drag.reynolds)
    assert np.concatenate(speeds).max() == pytest.approx(most, abs=2.0)
    assert min(speed.min() for speed in speeds) < least
