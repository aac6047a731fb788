"""The air the ball flies through, and which of its effects are modelled."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from kickdyn.aerodynamics import drag as drag_models
from kickdyn.aerodynamics import lift as lift_models
from kickdyn.aerodynamics import spin_decay as torque_models
from kickdyn.aerodynamics.coefficient_model import Coefficient, find_model, name_of
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, ValueEquality, format_value
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput

GAS_CONSTANT = 287.05287
"""Of dry air [J/(kg K)]; this and what follows: U.S. Standard Atmosphere 1976."""

Wind = Callable[[float], Sequence[float]]


def density_of(temperature: float, pressure: float) -> float:
    r"""Return the density of dry air :math:`p/(R T)` [kg/m3] at T [K] and p [Pa]."""
    return pressure / (GAS_CONSTANT * temperature)


def viscosity_of(temperature: float) -> float:
    r"""Return :math:`1.458 \cdot 10^{-6} T^{1.5}/(T + 110.4)`, Sutherland's viscosity [Pa s]."""
    return 1.458e-6 * math.pow(temperature, 1.5) / (temperature + 110.4)


def standard_atmosphere(altitude: float) -> tuple[float, float]:
    r"""Return temperature [K] and pressure [Pa] at an altitude up to 11 km [m].

    With :math:`H = r z / (r + z)`, :math:`T = T_0 - L H` and
    :math:`p = p_0 (T / T_0)^{g_0 / (R L)}` (U.S. Standard Atmosphere 1976).
    """
    height = 6_356_766 * altitude / (6_356_766 + altitude)  # geopotential
    temperature = 288.15 - 0.0065 * height
    exponent = 9.80665 / (GAS_CONSTANT * 0.0065)
    return temperature, 101_325 * math.pow(temperature / 288.15, exponent)


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Air(ValueEquality, ReprMixin):
    """Air of uniform density, with or without wind.

    Density and viscosity default to dry air at 20 degC and 101325 Pa; `Air.at` takes altitude,
    temperature and pressure.

    Args:
        density: density [kg/m3], 0 or more.
        viscosity: dynamic viscosity [Pa s], above 0.
        wind: velocity of the air, shape `(3,)` [m/s, world frame], or a function of the height z
            [m] that returns its three components.
        drag: name of a model in `kickdyn.aerodynamics.drag.MODELS`; a number, 0 to 1000, for a
            coefficient that is the same everywhere; or a function of `(reynolds, spin_parameter)`.
            None means no drag.
        lift: name of a model in `kickdyn.aerodynamics.lift.MODELS`, a number from -1000 to 1000, or
            a function as for `drag`. None means no lift.
        torque: coefficient of the torque that brakes the spin: name of a model in
            `kickdyn.aerodynamics.spin_decay.MODELS`, a number or a function as for `drag`. None
            means that the spin does not decay.
        buoyancy: whether the weight of the displaced air is subtracted from the ball's; it is
            1.6 % of a soccer ball.

    Raises:
        InvalidInput: a value outside its range, or an unknown model.
    """

    density: float
    viscosity: float
    wind: Array | Wind
    drag: Coefficient | None
    lift: Coefficient | None
    torque: Coefficient | None
    buoyancy: bool

    def __init__(
        self,
        density: float = density_of(293.15, 101_325),
        viscosity: float = viscosity_of(293.15),
        wind: ArrayLike | Wind = (0.0, 0.0, 0.0),
        drag: str | float | Coefficient | None = "supercritical",
        lift: str | float | Coefficient | None = "saturating",
        torque: str | float | Coefficient | None = "smits-smith",
        *,
        buoyancy: bool = True,
    ) -> None:
        self.__dict__.update(
            density=validation.number("air density", density, at_least=0, unit="kg/m3"),
            viscosity=validation.number("air viscosity", viscosity, above=0, unit="Pa s"),
            wind=_checked_wind(wind),
            drag=find_model("drag", drag_models.MODELS, drag),
            lift=find_model("lift", lift_models.MODELS, lift),
            torque=find_model("torque", torque_models.MODELS, torque),
            buoyancy=validation.flag("buoyancy", buoyancy),
        )

    def __repr__(self) -> str:
        names = self._names()
        return (
            f"Air(density={self.density:.6g}, viscosity={self.viscosity:.6g}, "
            f"wind={names['wind'] if callable(self.wind) else self.wind.tolist()}, "
            f"drag={names['drag']!r}, lift={names['lift']!r}, torque={names['torque']!r}, "
            f"buoyancy={self.buoyancy})"
        )

    def _names(self) -> dict[str, object]:
        models = {"drag": self.drag, "lift": self.lift, "torque": self.torque, "wind": self.wind}
        return {key: name_of(model) for key, model in models.items()}

    def _rows(self) -> Iterable[Row]:
        names = self._names()
        yield "density", self.density, "kg/m3"
        yield "viscosity", self.viscosity, "Pa s"
        yield "wind", names["wind"] if callable(self.wind) else format_value(self.wind), "m/s"
        for name, what in (("drag", "drag"), ("lift", "lift"), ("torque", "spin decay")):
            yield what, "not modelled" if names[name] is None else names[name], ""
        yield "buoyancy", self.buoyancy, ""

    @classmethod
    def paper(
        cls,
        drag: str | float | Coefficient | None = "brazuca",
        lift: str | float | Coefficient | None = "saturating",
    ) -> "Air":
        """Return the air of the paper's Table 3: 1.220 kg/m3, 1.8e-5 Pa s, no wind.

        The paper prints no coefficients; a Brazuca's in the wind tunnel stand in. It has
        neither buoyancy nor decay of spin.
        """
        return cls(
            density=1.220, viscosity=1.8e-5, drag=drag, lift=lift, torque=None, buoyancy=False
        )

    @classmethod
    def at(
        cls,
        altitude: float = 0.0,
        temperature_c: float | None = None,
        pressure: float | None = None,
        **options: Any,
    ) -> "Air":
        """Return dry air at an altitude; values left out are from the standard atmosphere.

        Args:
            altitude: altitude above sea level [m], -1000 to 11000.
            temperature_c: temperature [degC], -80 to 60.
            pressure: pressure [Pa], 10,000 to 200,000.
            options: wind, drag, lift, torque and buoyancy, as for `Air`.

        Raises:
            InvalidInput: a value outside its range, or another option.
        """
        valid = ("wind", "drag", "lift", "torque", "buoyancy")
        for name in options:
            if name not in valid:
                raise InvalidInput(
                    f"Air.at has no option {name!r}: it takes altitude [m], temperature_c [degC], "
                    f"pressure [Pa], {', '.join(valid)}"
                )
        height = validation.number("altitude", altitude, at_least=-1000, at_most=11_000, unit="m")
        kelvin, pascal = standard_atmosphere(height)
        if temperature_c is not None:
            celsius = validation.number(
                "temperature", temperature_c, at_least=-80, at_most=60, unit="degC"
            )
            kelvin = 273.15 + celsius
        if pressure is not None:
            pascal = validation.number(
                "pressure", pressure, at_least=10_000, at_most=200_000, unit="Pa"
            )
        return cls(density_of(kelvin, pascal), viscosity_of(kelvin), **options)

    @property
    def wind_at(self) -> Wind:
        """The wind [m/s] as a function of the height [m], also where it is the same everywhere."""
        if callable(self.wind):
            return self.wind
        steady = tuple(self.wind.tolist())
        return lambda height: steady


def _checked_wind(wind: ArrayLike | Wind) -> Array | Wind:
    if not callable(wind):
        return validation.read_only(validation.vector("wind", wind, 3, unit="m/s"))
    try:
        blowing = wind(0.0)
    except (ArithmeticError, ValueError):  # as a logarithm, not defined there
        return wind
    except Exception as fault:
        raise InvalidInput(
            f"wind is a function that raised {type(fault).__name__} at height 0: {fault}; it must "
            "take a height [m] and return three floats [m/s]"
        ) from fault
    validation.vector("wind at height 0", blowing, 3, unit="m/s")
    return wind


AIRS: dict[str, Air | None] = {"standard": Air(), "paper": Air.paper(), "none": None}
"""Airs by the names that command lines have for them; `none` is the vacuum."""
