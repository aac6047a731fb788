"""The air against the U.S. Standard Atmosphere 1976; its models, winds and refusals."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift, spin_decay
from kickdyn.air import AIRS, viscosity_of

MODELS = {"drag": drag.MODELS, "lift": lift.MODELS, "torque": spin_decay.MODELS}

# U.S. Standard Atmosphere 1976, tables by altitude: temperature, pressure, density and viscosity
ATMOSPHERE = [
    (0, 288.15, 101_325, 1.2250, 1.7894e-5), (2000, 275.154, 79_501, 1.0066, 1.7260e-5),
    (10_000, 223.252, 26_500, 0.41351, 1.4577e-5)]  # fmt: skip


@pytest.mark.parametrize(("altitude", "kelvin", "pressure", "density", "viscosity"), ATMOSPHERE)
def test_air_at_an_altitude(altitude, kelvin, pressure, density, viscosity):
    air = kd.Air.at(altitude)
    assert air.density == pytest.approx(density, rel=1e-4)  # digits of the tables
    assert air.viscosity == pytest.approx(viscosity_of(kelvin), rel=1e-5)
    assert air.viscosity == pytest.approx(viscosity, rel=1e-4)
    same = kd.Air.at(0, kelvin - 273.15, pressure)
    assert same.density == pytest.approx(density, rel=1e-4)
    assert same.viscosity == pytest.approx(air.viscosity, rel=1e-5)


def test_the_default_is_at_20_degrees_and_sea_level():
    air = kd.Air()
    assert air == kd.Air.at(0, 20, 101_325)
    assert kd.Air.at() == kd.Air.at(0.0)
    assert air.density == pytest.approx(1.2250 * 288.15 / 293.15, rel=1e-4)  # p / (R T)
    assert air.buoyancy is True
    assert (air.drag, air.lift, air.torque) == (drag.MODELS["supercritical"],
        lift.MODELS["saturating"], spin_decay.MODELS["smits-smith"])  # fmt: skip


def test_the_paper_s_air_is_of_table_3():
    air = kd.Air.paper()
    assert (air.density, air.viscosity, air.wind.tolist()) == (1.220, 1.8e-5, [0, 0, 0])
    assert (air.torque, air.buoyancy) == (None, False)
    assert {"standard": kd.Air(), "paper": air, "none": None} == AIRS


@pytest.mark.parametrize("number", [0.25, 1, np.float32(0.5)])
@pytest.mark.parametrize("kind", MODELS)
def test_a_number_is_a_constant_coefficient(kind, number):
    coefficient = getattr(kd.Air(**{kind: number}), kind)
    assert coefficient(1e-9, 3.0) == coefficient(1e9, 0.0) == number


def test_a_function_is_taken_as_it_is():
    def model(reynolds, spin_parameter):
        return 0.3

    air = kd.Air(drag=model, lift=None, wind=lambda height: (height, 0, 1))
    assert (air.drag, air.lift) == (model, None)
    assert air.wind_at(5.0) == (5.0, 0, 1)
    assert kd.Air(wind=(1, 2, 3)).wind_at(5.0) == (1, 2, 3)
    assert "model" in repr(air)


@pytest.mark.parametrize(("name", "value", "words"), [
    *(("density", rho, "air density .*at least 0") for rho in (-1, math.nan, math.inf, "1")),
    *(("viscosity", mu, "air viscosity .*above 0") for mu in (0, -1, math.nan, True)),
    ("wind", (1, 2), r"wind .*\(2,\)"), ("wind", (0, math.nan, 0), "wind .*finite"),
    ("wind", lambda h: (1, 2), r"wind at height 0 .*\(2,\)"),
    ("wind", lambda h: (1, math.nan, 0), "wind at height 0 .*finite"),
    ("wind", lambda: (1, 2, 3), "wind .*TypeError"),
    *(("buoyancy", value, "buoyancy is .*True") for value in (1, None, "no")),
    *(("drag", value, "drag coefficient .*at least 0") for value in (-0.2, 1e300, 10**400)),
    ("torque", -0.2, "torque coefficient .*at least 0"),
    *(("lift", value, "lift coefficient .*-1000") for value in (math.nan, -1e300)),
    *(("drag", value, "drag model .*choose stokes") for value in ("brazooka", "0.25", True)),
    ("lift", "", "lift model .*choose saturating")])  # fmt: skip
def test_refusals(name, value, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Air(**{name: value})


@pytest.mark.parametrize(("arguments", "words"), [
    ({"altitude": 12_000}, "altitude is 12000.*11000"),
    ({"temperature_c": 293.15}, "temperature is 293.15.*degC"),
    ({"pressure": 1013.25}, "pressure is 1013.25.*10000"),
    ({"temperature": 20}, "'temperature'.*temperature_c")])  # fmt: skip
def test_refusals_of_air_at(arguments, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.Air.at(**arguments)
