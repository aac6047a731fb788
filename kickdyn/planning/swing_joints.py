"""The joints that swing the foot, taken out of a leg: their model, their places, their limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg

LONGEST = 1.0
"""Duration of either part of a swing, at most, unless told otherwise [s]."""


@dataclass(frozen=True, eq=False)
class Joints:
    """The joints between a fixed base and the foot, each of one degree of freedom.

    Attributes:
        model: `pin.Model` of them alone, gravity included; all other joints are locked at 0.
        names: of them, in order.
        qs, vs: their indices in the leg's q and v.
        low, high: range, a turn at most, shape `(n,)` [rad; m for prismatic joints].
        speed, effort: limits of speed and torque, shape `(n,)` [rad/s, N m].
    """

    model: Any
    names: tuple[str, ...]
    qs: Any
    vs: Any
    low: Array
    high: Array
    speed: Array
    effort: Array


def joints_of(leg: Leg) -> Joints:
    """Return the joints that swing a leg's foot.

    Raises:
        InvalidInput: one has more than one degree of freedom, or no limit of speed or torque.
    """
    whole = leg.model
    numbers = [int(j) for j in whole.supports[leg.contact_joint] if j > 0]
    if any(whole.nqs[j] != 1 for j in numbers):
        raise InvalidInput(f"{leg.name} is moved by joints without one angle: no swing is planned")
    others = [j for j in range(1, whole.njoints) if j not in numbers]
    model = pin.buildReducedModel(whole, others, leg.configuration()) if others else whole
    names = tuple(model.names)[1:]
    for what, limits in (("speed", model.velocityLimit), ("torque", model.effortLimit)):
        for name, limit in zip(names, limits.tolist(), strict=True):
            if not 0.0 < limit < 1e6:
                raise InvalidInput(
                    f"{what} limit of {name} is {limit:g}: a swing needs one, above 0"
                )
    return Joints(
        model,
        names,
        np.array([int(whole.idx_qs[j]) for j in numbers]),
        np.array([int(whole.idx_vs[j]) for j in numbers]),
        np.maximum(model.lowerPositionLimit, -math.pi),
        np.minimum(model.upperPositionLimit, math.pi),
        model.velocityLimit.copy(),
        model.effortLimit.copy(),
    )


def check_solver() -> None:
    """Raise `InvalidInput` where CasADi is not installed."""
    if find_spec("casadi") is None:
        raise InvalidInput(
            'swings need the package casadi: install it with pip install "kickdyn[swing]"'
        )
