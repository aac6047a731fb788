import copy
import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from fluids.drag import Barati, Clift, Clift_Gauvin, Morrison
from hypothesis import given
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.aerodynamics.drag import (
    BALLS,
    MODELS,
    REYNOLDS_PER_SPEED,
    SPIN_DRAG_LIMIT,
    brown_lawler,
    constant,
    sphere,
    stokes,
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
def test_balls_without_spin(ball):
    cd = [MODELS[ball](v * REYNOLDS_PER_SPEED) for v in SPEEDS]
    assert cd == pytest.approx(TABLE[ball], abs=0.0005)


@pytest.mark.parametrize(("ball", "cd"), [("brazuca", 0.2000425746), ("teamgeist", 0.1497636901)])
def test_balls_at_30_metres_per_second_to_all_digits(ball, cd):
    assert MODELS[ball](30 * REYNOLDS_PER_SPEED) == pytest.approx(cd, abs=5e-11)


def test_reynolds_per_speed_is_that_of_the_tunnel():
    assert pytest.approx(333_793) == 22.97 * REYNOLDS_PER_SPEED
    diameter = 2 * kd.Ball().radius  # in air of 20 degC
    air = kd.Air()
    assert pytest.approx(air.density * diameter / air.viscosity, rel=0.01) == REYNOLDS_PER_SPEED


@pytest.mark.parametrize(
    ("reynolds", "cd"),
    [(0.1, 247.5), (1, 27.60), (10, 4.13), (100, 1.073), (1e3, 0.463), (1e4, 0.411)],
)
def test_brown_lawler(reynolds, cd):
    assert brown_lawler(reynolds) == pytest.approx(cd, rel=1.2e-3)


def test_brown_lawler_to_all_digits():
    assert brown_lawler(1e5) == pytest.approx(0.4661, abs=5e-5)
    at_8710 = 24 / 8710 * (1 + 0.150 * math.exp(0.681 * math.log(8710))) + 0.407 / 2
    assert brown_lawler(8710) == pytest.approx(at_8710, rel=1e-14)


@pytest.mark.parametrize(
    ("oracle", "tolerance"), [(Clift_Gauvin, 0.01), (Barati, 0.06), (Clift, 0.08)]
)
def test_sphere_agrees_with_others_measurements(oracle, tolerance):
    for reynolds in np.geomspace(10, 2e5, 300):  # no drag crisis yet
        assert sphere(reynolds) == pytest.approx(oracle(reynolds), rel=tolerance)
    for reynolds in np.geomspace(1, 10, 100):  # where the correction fades in
        assert sphere(reynolds) == pytest.approx(oracle(reynolds), rel=0.172)


PUBLISHED = {Clift_Gauvin: 0.7905400398, Morrison: 0.7677315600, Barati: 0.7682237950}


@pytest.mark.parametrize(("oracle", "cd"), PUBLISHED.items())
def test_the_oracles_are_those_that_were_read(oracle, cd):
    assert oracle(200.0) == pytest.approx(cd, abs=5e-11)
    assert sphere(200.0) == pytest.approx(cd, rel=0.04)


@pytest.mark.parametrize("model", ["stokes", "sphere", *BALLS])
@given(reynolds=st.floats(1e-300, 1.0), spin=st.floats(0, 10))
def test_creeping_flow_is_exactly_stokes(model, reynolds, spin):
    assert MODELS[model](reynolds, spin) == pytest.approx(24 / reynolds, rel=1e-15)


def slope_jump(f, x, h):
    up, here, down = f(x * math.exp(h)), f(x), f(x * math.exp(-h))
    return abs((up - here) - (here - down)) / h


JOINS = [
    *[(model, 0.0, x) for model in ("sphere", *BALLS) for x in (1.0, 10.0)],
    *[(model, spin, x) for model in BALLS for spin in (0.0, 0.3) for x in (2e4, 7e4)],
]


@pytest.mark.parametrize(("model", "spin", "join"), JOINS)
def test_joins_are_smooth(model, spin, join):
    def cd(reynolds):
        return MODELS[model](reynolds, spin)

    assert cd(join * (1 + 1e-12)) == pytest.approx(cd(join * (1 - 1e-12)), rel=1e-10)
    # where the slope is continuous, its jump over a step shrinks with the step
    assert slope_jump(cd, join, 1e-4) < 0.12 * slope_jump(cd, join, 1e-3) + 1e-9


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("spin", [0.0, 0.3])
def test_nothing_jumps(name, spin):
    grid = np.geomspace(0.1, 1e7, 40_001)  # steps of 0.05 %
    cd = np.array([MODELS[name](float(x), spin) for x in grid])
    assert np.abs(np.diff(np.log(cd))).max() < 0.004


def test_slope_jump_tells_a_kink():
    def kinked(x):
        return max(x, 1.0)

    assert slope_jump(kinked, 1.0, 1e-4) > 0.9 * slope_jump(kinked, 1.0, 1e-3)


@pytest.mark.parametrize("ball", BALLS)
def test_drag_is_held_beyond_the_data(ball):
    model, top = MODELS[ball], 35 * REYNOLDS_PER_SPEED
    assert model(top) == pytest.approx(BALLS[ball].b_max, abs=1e-4)
    assert model(1e9) == model(1e7) == pytest.approx(model(top), abs=0.0035)
    assert slope_jump(model, top, 1e-4) < 0.12 * slope_jump(model, top, 1e-3) + 1e-9


@pytest.mark.parametrize("name", MODELS)
def test_drag_is_positive_finite_and_grows_with_spin(name):
    model = MODELS[name]
    for reynolds in np.geomspace(1e-12, 1e7, 400):
        cds = [model(float(reynolds), spin) for spin in (0.0, 0.1, 0.4, 1.0, 10.0)]
        assert all(0 < cd < math.inf for cd in cds)
        assert cds == sorted(cds) or name == "goff-carre"  # which drops in the crisis


def test_sphere_slows_down_more_the_faster_it_is():
    reynolds = np.geomspace(1e-12, 1e7, 20_000)
    cd = np.array([sphere(x) for x in reynolds])
    assert (np.diff(cd * reynolds**2) > 0).all()
    below = reynolds < 3900  # C_D itself falls to its minimum near 4000
    assert (np.diff(cd[below]) < 0).all()


@pytest.mark.parametrize("ball", BALLS)
def test_spin_adds_a_straight_line_that_ends(ball):
    reynolds = 25 * REYNOLDS_PER_SPEED
    still = MODELS[ball](reynolds)
    for spin, within in ((0.05, 1e-7), (0.2, 5e-4), (0.3, 0.0121)):
        assert MODELS[ball](reynolds, spin) - still == pytest.approx(0.514 * spin, rel=within)
    for spin in (10.0, 1e9, 1e300):
        most = still + 0.514 * SPIN_DRAG_LIMIT
        assert MODELS[ball](reynolds, spin) == pytest.approx(most, rel=1e-9)


def test_spin_drag_agrees_with_a_second_law():
    # Goff & Carre 2010: 0.4127 Sp^0.3056 for a spinning Teamgeist; at 25 m/s
    for spin in (0.05, 0.1, 0.2, 0.3):
        ours = MODELS["teamgeist"](25 * REYNOLDS_PER_SPEED, spin)
        assert ours == pytest.approx(0.4127 * spin**0.3056, abs=0.016)


def test_a_constant_can_be_compared_copied_and_pickled():
    air = kd.Air(drag=constant(0.25))
    for again in (copy.deepcopy(air), pickle.loads(pickle.dumps(air))):
        assert again == air != kd.Air(drag=constant(0.3))
        assert again.drag(1e5, 0.0) == 0.25


def test_constant_is():
    assert constant(0.2)(1e-9, 3.0) == constant(0.2)(1e9, 0.0) == 0.2


def test_registry_says_where_each_came_from():
    for name, model in MODELS.items():
        assert model.name == name
        assert model.source
        assert model.reynolds[0] < model.reynolds[1]
    assert MODELS["stokes"](0.5) == stokes(0.5)


def test_the_range_of_the_default_is_that_of_flights_of_a_match():
    """Its source has the range of trajectories without spin; a second minute had 27.0 m/s."""
    track = kd.Track.from_csv(Path(__file__).resolve().parents[2] / "data" / "match_ball.csv")
    flights = kd.segments(track).flights
    speeds = [np.linalg.norm(np.diff(one.positions, axis=0), axis=1) * 50 for one in flights]
    least, most = (end / REYNOLDS_PER_SPEED for end in kd.Air().drag.reynolds)
    assert np.concatenate(speeds).max() == pytest.approx(most, abs=2.0)
    assert min(speed.min() for speed in speeds) < least
    assert kd.Air().drag.spin == (0.0, 0.3)


def test_goff_carre_takes_its_published_values():
    model = MODELS["goff-carre"]
    for v in (5.0, 10.0, 12.19, 20.0, 30.0):
        level = 0.155 + 0.346 / (1 + math.exp((v - 12.19) / 1.309))
        assert model(v * REYNOLDS_PER_SPEED) == pytest.approx(level, rel=1e-12)
    assert model(25 * REYNOLDS_PER_SPEED, 0.2) == pytest.approx(0.2524, abs=5e-5)


def test_goff_carre_joins_its_formulas_between_spin_parameters_of_4_and_6_per_cent():
    fast = 30 * REYNOLDS_PER_SPEED
    level = 0.155 + 0.346 / (1 + math.exp((30 - 12.19) / 1.309))
    assert MODELS["goff-carre"](fast, 0.04) == pytest.approx(level, rel=1e-12)
    assert MODELS["goff-carre"](fast, 0.06) == pytest.approx(0.4127 * 0.06**0.3056, rel=1e-12)
    between = MODELS["goff-carre"](fast, 0.0400 * 1.5**0.5)  # half way in the logarithm
    mean = 0.5 * (level + 0.4127 * (0.0400 * 1.5**0.5) ** 0.3056)
    assert between == pytest.approx(mean, rel=1e-12)


@pytest.mark.parametrize("name", sorted(BALLS))
@pytest.mark.parametrize("reynolds", [4e4, 6e4, 1e5, 3e5])
def test_a_drag_without_a_spin_parameter_is_of_no_spin(name, reynolds):
    model = MODELS[name]
    assert model(reynolds) == model(reynolds, 0.0) < model(reynolds, 0.1)
