"""The air the ball flies through, and which of its effects are modelled."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from kickdyn import checks
from kickdyn.aerodynamics import drag as drag_models
from kickdyn.aerodynamics import lift as lift_models
from kickdyn.aerodynamics.model import Coefficient, find
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Air:
    """Still or moving air of one density.

    Density and viscosity default to dry air at 20 degC and 101325 Pa: p/(R T) with
    R = 287.05287 J/(kg K), and Sutherland's formula (both from the U.S. Standard Atmosphere 1976).

    Args:
        density: [kg/m3], 0 or more.
        viscosity: dynamic [Pa s], above 0.
        wind: velocity of the air, shape `(3,)` [m/s, world frame].
        drag: name of a model in `kickdyn.aerodynamics.drag.MODELS`, or a function of
            `(reynolds, spin_parameter)`; None leaves drag out.
        lift: likewise from `kickdyn.aerodynamics.lift.MODELS`; None leaves lift out.
        buoyancy: whether the air carries the ball's volume (1.5 % of a soccer ball's weight).

    Raises:
        InvalidInput: a value outside its range, or an unknown model.
    """

    density: float
    viscosity: float
    wind: Array
    drag: Coefficient | None
    lift: Coefficient | None
    buoyancy: bool

    def __init__(
        self,
        density: float = 101_325 / (287.05287 * 293.15),
        viscosity: float = 1.458e-6 * 293.15**1.5 / (293.15 + 110.4),
        wind: ArrayLike = (0.0, 0.0, 0.0),
        drag: str | Coefficient | None = "brazuca",
        lift: str | Coefficient | None = "saturating",
        *,
        buoyancy: bool = True,
    ) -> None:
        rho = checks.number("air density", density, at_least=0, unit="kg/m3")
        mu = checks.number("air viscosity", viscosity, above=0, unit="Pa s")
        blowing = checks.vector("wind", wind, 3, unit="m/s")
        blowing.setflags(write=False)
        object.__setattr__(self, "density", rho)
        object.__setattr__(self, "viscosity", mu)
        object.__setattr__(self, "wind", blowing)
        drag = None if drag is None else find("drag", drag_models.MODELS, drag)
        lift = None if lift is None else find("lift", lift_models.MODELS, lift)
        object.__setattr__(self, "drag", drag)
        object.__setattr__(self, "lift", lift)
        if not isinstance(buoyancy, bool):
            raise InvalidInput(f"buoyancy is {buoyancy!r}: it must be True or False")
        object.__setattr__(self, "buoyancy", buoyancy)

    def __repr__(self) -> str:
        """Name every value, and the models by name."""
        models = {"drag": self.drag, "lift": self.lift}
        names = {
            key: getattr(model, "name", getattr(model, "__name__", model))
            for key, model in models.items()
        }
        return (
            f"Air(density={self.density:.6g}, viscosity={self.viscosity:.6g}, "
            f"wind={self.wind.tolist()}, drag={names['drag']!r}, lift={names['lift']!r}, "
            f"buoyancy={self.buoyancy})"
        )

    @classmethod
    def paper(
        cls,
        drag: str | Coefficient | None = "brazuca",
        lift: str | Coefficient | None = "saturating",
    ) -> Air:
        """Return the air of the paper's Table 3: 1.220 kg/m3, 1.8e-5 Pa s, no wind, no buoyancy.

        The paper prints no coefficients; those of kickdyn's default ball stand in.
        """
        return cls(density=1.220, viscosity=1.8e-5, drag=drag, lift=lift, buoyancy=False)
