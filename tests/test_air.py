import dataclasses
import math
import pickle

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift
from kickdyn.air import AIRS


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        *[("density", rho, "air density .*at least 0") for rho in (-1, math.nan, math.inf, "1")],
        *[("viscosity", mu, "air viscosity .*above 0") for mu in (0, -1, math.nan, True)],
        ("wind", (1, 2), "wind has shape"),
        ("wind", (0, math.nan, 0), "wind .*finite"),
        ("wind", lambda h: (1, 2), r"wind at height 0 has shape \(2,\)"),
        ("wind", lambda h: (1, math.nan, 0), "wind at height 0 .*finite"),
        ("wind", lambda: (1, 2, 3), "wind is a function that raised TypeError"),
        *[("buoyancy", value, "buoyancy is .*True or False") for value in (1, None, "no")],
        ("drag", 10**400, "drag coefficient is 1000.*: it must be a finite number at least 0"),
        ("drag", -0.2, "drag coefficient is -0.2: it must be a finite number at least 0"),
        ("torque", -0.2, "torque coefficient is -0.2: it must be a finite number at least 0"),
        ("lift", math.nan, "lift coefficient is nan: it must be a finite number"),
        ("drag", 1e300, "drag coefficient is .*: it must be .* at least 0 and at most 1000$"),
        ("lift", -1e300, "lift coefficient is .*: it must be .* at least -1000 and at most 1000$"),
        ("drag", "brazooka", "drag model 'brazooka' is unknown: choose stokes, .*brazuca, "),
        ("lift", "", "lift model '' is unknown: choose saturating, wang"),
    ],
)
def test_air_refuses(name, value, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Air(**{name: value})


def test_default_is_the_standard_atmosphere_at_20_degc():
    # U.S. Standard Atmosphere 1976: 1.2250 kg/m3 and 1.7894e-5 Pa s at 288.15 K, 101325 Pa
    air = kd.Air()
    assert air.density == pytest.approx(1.2250 * 288.15 / 293.15, rel=1e-4)
    cold = 1.458e-6 * 288.15**1.5 / (288.15 + 110.4)
    assert cold == pytest.approx(1.7894e-5, rel=1e-4)
    assert air.viscosity == pytest.approx(cold * (293.15 / 288.15) ** 1.5 * 398.55 / 403.55)
    assert air.buoyancy


def test_air_at_an_altitude_is_the_standard_atmosphere():
    # U.S. Standard Atmosphere 1976: density at 0, 2000 and 10,000 m
    for altitude, density in ((0, 1.2250), (2000, 1.0066), (10_000, 0.41351)):
        assert kd.Air.at(altitude).density == pytest.approx(density, rel=1e-4)
    warm = kd.Air.at(0, 20, 101_325, wind=(1, 0, 0), lift=None, buoyancy=False)
    assert warm == kd.Air(wind=(1, 0, 0), lift=None, buoyancy=False)
    with pytest.raises(kd.InvalidInput, match="altitude is 12000"):
        kd.Air.at(12_000)


def test_paper_air_is_table_3():
    air = kd.Air.paper()
    assert (air.density, air.viscosity, air.wind.tolist(), air.buoyancy) == (
        *(1.220, 1.8e-5),
        *([0, 0, 0], False),
    )
    assert kd.Air.paper(drag=None, lift=None).drag is None


def test_zero_celsius_is_273_15_kelvin():
    # U.S. Standard Atmosphere 1976: 15 degC at sea level, 1.2250 kg/m3
    assert kd.Air.at(0, 15, 101_325).density == pytest.approx(1.2250, rel=1e-5)


def test_the_wind_is_read_only_after_unpickling():
    air = pickle.loads(pickle.dumps(kd.Air(wind=(1, 2, 3))))
    assert air == kd.Air(wind=(1, 2, 3))
    with pytest.raises(ValueError, match="read-only"):
        air.wind[0] = 5.0


@pytest.mark.parametrize("name", drag.MODELS)
def test_every_drag_model_is_found_by_name(name):
    assert kd.Air(drag=name).drag is drag.MODELS[name]


@pytest.mark.parametrize("name", lift.MODELS)
def test_every_lift_model_is_found_by_name(name):
    assert kd.Air(lift=name).lift is lift.MODELS[name]


@pytest.mark.parametrize("value", [True, False, np.True_, np.False_])
def test_buoyancy_is_any_kind_of_bool(value):
    assert kd.Air(buoyancy=value).buoyancy is bool(value)


def test_airs_of_the_same_values_are_equal():
    def blowing(height):
        return (height, 0, 0)

    for options in ({}, {"wind": (1, 2, 0)}, {"wind": blowing}, {"drag": "sphere", "lift": None}):
        one, other = kd.Air(**options), kd.Air(**options)
        assert one == other
        assert hash(one) == hash(other)
        assert one != kd.Air(**{**options, "density": 1.0})
    assert kd.Air() != kd.Air(wind=(1, 0, 0)) != kd.Air(wind=blowing)
    assert kd.Air() != 3


def test_airs_by_name():
    assert list(AIRS) == ["standard", "paper", "none"]
    assert list(AIRS.values()) == [kd.Air(), kd.Air.paper(), None]


def test_any_function_will_do():
    def model(reynolds, spin_parameter):
        return 0.3

    air = kd.Air(drag=model, lift=None)
    assert air.drag is model
    assert air.lift is None
    assert "drag='model', lift=None" in repr(air)


def test_air_cannot_be_changed():
    wind = np.array([1.0, 0.0, 0.0])
    air = kd.Air(wind=wind)
    wind[0] = 9
    assert air.wind.tolist() == [1, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        air.wind[0] = 9
    with pytest.raises(dataclasses.FrozenInstanceError):
        air.density = 0.0


@pytest.mark.parametrize("number", [0.25, 1, np.float32(0.5)])
@pytest.mark.parametrize("kind", ["drag", "lift", "torque"])
def test_a_number_is_a_constant_coefficient(kind, number):
    air = kd.Air(**{kind: number})
    assert air == kd.Air(**{kind: drag.constant(number)})
    assert getattr(air, kind)(1e5, 0.2) == number
    assert f"{kind}={float(number)}" in repr(air)


@pytest.mark.parametrize("nonsense", [True, np.nan, 10**400, "0.25"])
def test_what_is_no_coefficient_is_not_told_so(nonsense):
    with pytest.raises(kd.InvalidInput, match=r"is unknown: choose|must be a finite number"):
        kd.Air(drag=nonsense)


def test_an_unknown_option_of_air_at_is_named():
    with pytest.raises(kd.InvalidInput, match=r"no option 'temperature': it takes .* \[degC\]"):
        kd.Air.at(temperature=293.15)
    with pytest.raises(kd.InvalidInput, match=r"temperature is 293\.15: .* at most 60 \[degC\]"):
        kd.Air.at(temperature_c=293.15)
