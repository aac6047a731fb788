"""Coefficients of a ball in the air as functions of Reynolds number and spin parameter."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput

Coefficient = Callable[[float, float], float]
"""A function `(reynolds, spin_parameter) -> coefficient`."""

_REGISTERED: "dict[tuple[str, str], CoefficientModel]" = {}


@dataclass(frozen=True)
class CoefficientModel:
    r"""One published (or composed) coefficient, callable as `model(reynolds, spin_parameter)`.

    The Reynolds number is :math:`Re = 2 \rho v r / \mu`, the spin parameter
    :math:`Sp = r |\omega_\perp| / v`, with the velocity relative to the air and the part of the
    spin that is perpendicular to it. Any function of the same two floats can stand in for a model;
    `fly_many` compiles one that uses only floats and `math`.

    Args:
        kind: `drag`, `lift` or `torque`.
        name: by which `Air` finds it.
        function: `(reynolds, spin_parameter) -> coefficient`, for reynolds > 0.
        reynolds: range it is meant for.
        spin: range of the spin parameter it is meant for.
        source: where the numbers come from.
        branch_free: a Reynolds number, and a function without branches that is the same from there
            on: `fly_many` computes it for several flights with one instruction.
    """

    kind: str
    name: str
    function: Coefficient
    reynolds: tuple[float, float]
    spin: tuple[float, float]
    source: str
    branch_free: tuple[float, Coefficient] | None = None

    def __reduce__(self) -> "tuple[Callable[..., CoefficientModel], tuple[Any, ...]]":
        """Pickle a registered model by its name, any other by its values."""
        if is_known(self):
            return _registered, (self.kind, self.name)
        return CoefficientModel, tuple(getattr(self, field.name) for field in fields(self))

    def beyond(self, reynolds: Array, spin_parameter: Array) -> NDArray[np.bool_]:
        """Return whether n of each lie outside the range this is meant for, shape `(4, n)`.

        The rows are: Reynolds number below and above its range, spin parameter below and above.
        """
        pairs = (reynolds, self.reynolds), (spin_parameter, self.spin)
        return np.array([side for x, (low, high) in pairs for side in (x < low, x > high)])

    def __call__(self, reynolds: float, spin_parameter: float = 0.0) -> float:
        """Return the coefficient (dimensionless)."""
        if not (0.0 < reynolds < math.inf and 0.0 <= spin_parameter < math.inf):
            raise InvalidInput(
                f"{self.kind} {self.name} at Re {reynolds!r}, spin parameter {spin_parameter!r}: "
                "the first must be above 0, the second 0 or more, both finite"
            )
        return self.function(reynolds, spin_parameter)


@dataclass(frozen=True)
class ConstantCoefficient:
    """A coefficient that is `value` everywhere; it can be compared, copied and pickled."""

    value: float

    @property
    def function(self) -> Coefficient:
        """The coefficient as a plain function, which `fly_many` compiles."""
        value = self.value

        def model(reynolds: float, spin_parameter: float = 0.0) -> float:
            return value

        return model

    def __call__(self, reynolds: float, spin_parameter: float = 0.0) -> float:
        """Return the value (dimensionless)."""
        return self.value


@dataclass(frozen=True)
class ScaledCoefficient:
    """A coefficient times a factor, without the limits of its range.

    It can be compared, copied and pickled if the coefficient can.
    """

    model: Coefficient
    factor: float

    @property
    def name(self) -> str:
        """The factor and the name of the coefficient."""
        return f"{self.factor:.6g} x {name_of(self.model)}"

    @property
    def function(self) -> Coefficient:
        """The coefficient as a plain function, which `fly_many` compiles."""
        factor = self.factor
        unscaled: Coefficient = getattr(self.model, "function", self.model)

        def model(reynolds: float, spin_parameter: float = 0.0) -> float:
            return factor * unscaled(reynolds, spin_parameter)

        return model

    def __call__(self, reynolds: float, spin_parameter: float = 0.0) -> float:
        """Return the scaled coefficient (dimensionless)."""
        return self.function(reynolds, spin_parameter)


def name_of(model: object) -> object:
    """Return the value of a constant coefficient, or the name of another one, for printing."""
    if isinstance(model, ConstantCoefficient):
        return model.value
    return getattr(model, "name", getattr(model, "__name__", model))


def registry(*models: CoefficientModel) -> dict[str, CoefficientModel]:
    """Return models by name; copies and pickles of them are the very same objects from now on."""
    _REGISTERED.update({(model.kind, model.name): model for model in models})
    return {model.name: model for model in models}


def _registered(kind: str, name: str) -> CoefficientModel:
    """Return a model of one of the registries, which `kickdyn.aerodynamics` fills on import."""
    return _REGISTERED[kind, name]


def is_known(model: Coefficient) -> bool:
    """Return whether a coefficient is constant or one of those that come with kickdyn."""
    registered = any(model is known for known in _REGISTERED.values())
    return registered or isinstance(model, ConstantCoefficient)


def constant_limits(kind: str) -> dict[str, Any]:
    """Return the limits of a coefficient that is the same everywhere, for `validation.number`.

    Lift may act downwards, the others brake.
    """
    return {"at_least": -1000.0 if kind == "lift" else 0.0, "at_most": 1000.0}


def find_model(
    kind: str, models: Mapping[str, CoefficientModel], choice: str | float | Coefficient | None
) -> Coefficient | None:
    """Return the model that a name or a number stands for, a function as it is, None for None."""
    if choice is None or callable(choice):
        return choice
    if isinstance(choice, Real) and not isinstance(choice, bool):
        name = f"{kind} coefficient"
        return ConstantCoefficient(validation.number(name, choice, **constant_limits(kind)))
    if not isinstance(choice, str) or choice not in models:
        raise InvalidInput(
            f"{kind} model {validation.brief(choice)} is unknown: choose {', '.join(models)}, "
            "or pass a number or a function of (reynolds, spin_parameter)"
        )
    return models[choice]


def smoothstep(x: float, low: float, high: float) -> float:
    r"""Return 0 below `low`, 1 above `high`, between them a polynomial with three derivatives.

    It is :math:`s^4 (35 - 84 s + 70 s^2 - 20 s^3)` with :math:`s = \ln(x/low) / \ln(high/low)`.
    A kink in the third derivative already costs an integrator of order 8 digits.
    """
    s = math.log(min(max(x, low), high) / low) / math.log(high / low)
    t = min(s, 1.0 - s)  # the polynomial is its own mirror image, and cancels near 1
    square = t * t
    value = square * square * (35.0 - 84.0 * t + 70.0 * square - 20.0 * square * t)
    return value if s < 0.5 else 1.0 - value
