"""A coefficient of a sphere as a function of Reynolds number and spin parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput

Coefficient = Callable[[float, float], float]


@dataclass(frozen=True)
class CoefficientModel:
    """One published (or composed) coefficient, callable as `model(reynolds, spin_parameter)`.

    Any function of the same two floats can stand in for it; one that uses `math` only can be
    compiled.

    Args:
        kind: `drag`, `lift` or `torque`.
        name: by which `Air` finds it.
        function: `(reynolds, spin_parameter) -> coefficient`, for reynolds > 0.
        reynolds: range it is meant for, `rho v D / mu` with D the diameter.
        spin: range of the spin parameter `r |omega_perp| / v` it is meant for.
        source: where the numbers come from.
        refuses: whether it is wrong, not just unproven, outside its range: a flight that leaves
            it then ends in an error.
        straight: a Reynolds number and a function without branches that is the same from there on,
            for machines that compute many flights side by side.
    """

    kind: str
    name: str
    function: Coefficient
    reynolds: tuple[float, float]
    spin: tuple[float, float]
    source: str
    refuses: bool = False
    straight: tuple[float, Coefficient] | None = None

    def __reduce__(self) -> tuple[Callable[[str, str], CoefficientModel], tuple[str, str]]:
        """Pickle by kind and name: some of the functions are closures."""
        return _shipped, (self.kind, self.name)

    def range_left(self, reynolds: Array, spin_parameter: Array) -> NDArray[np.bool_]:
        """Return where this is outside what the model is meant for."""
        low, high = self.reynolds
        least, most = self.spin
        inside = (low <= reynolds) & (reynolds <= high)
        return np.logical_not(inside & (least <= spin_parameter) & (spin_parameter <= most))

    def __call__(self, reynolds: float, spin_parameter: float = 0.0) -> float:
        """Return the coefficient (dimensionless).

        Raises:
            InvalidInput: a Reynolds number that is not above 0 and finite, or a spin parameter
                below 0 or not finite.
        """
        if not (0.0 < reynolds < math.inf and 0.0 <= spin_parameter < math.inf):
            raise InvalidInput(
                f"{self.kind} {self.name} at Re {reynolds!r}, spin parameter {spin_parameter!r}: "
                "the first must be above 0, the second 0 or more, both finite"
            )
        return self.function(reynolds, spin_parameter)


MODULES = {"torque": "spin_decay"}


def _shipped(kind: str, name: str) -> CoefficientModel:
    model = import_module(f"kickdyn.aerodynamics.{MODULES.get(kind, kind)}").MODELS[name]
    assert isinstance(model, CoefficientModel)
    return model


def smoothstep(x: float, low: float, high: float) -> float:
    """Return 0 below `low`, 1 above `high`, between a polynomial of degree 7 in log(x), C3.

    A kink in the third derivative already costs an integrator of order 8 digits.
    """
    if x <= low:
        return 0.0
    if x >= high:
        return 1.0
    s = math.log(x / low) / math.log(high / low)
    near = min(s, 1.0 - s)  # the polynomial is its own mirror image, and cancels near 1
    square = near * near
    value = square * square * (35.0 - 84.0 * near + 70.0 * square - 20.0 * square * near)
    return value if s < 0.5 else 1.0 - value


def find(
    kind: str, models: Mapping[str, CoefficientModel], choice: str | Coefficient
) -> Coefficient:
    """Return the model a name stands for, or the function itself."""
    if callable(choice):
        return choice
    if not isinstance(choice, str) or choice not in models:
        raise InvalidInput(
            f"{kind} model {choice!r} is unknown: choose {', '.join(models)}, "
            "or pass a function of (reynolds, spin_parameter)"
        )
    return models[choice]
