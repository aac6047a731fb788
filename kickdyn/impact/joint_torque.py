"""What acts at the joints during a contact that takes time."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from inspect import signature

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput

Torque = Callable[[float, Array, Array], ArrayLike]
"""A function of time since touch, q and v."""


def own_torque(torque: ArrayLike | Torque | None, nv: int) -> Array | Torque:
    """Return the function, or numbers that nobody else can change, shape `(nv,)` [N m; N].

    Raises:
        InvalidInput: a wrong shape, or a function that does not take three values.
    """
    if not callable(torque):
        return (
            np.zeros(nv) if torque is None else validation.vector("torque", torque, nv, unit="N m")
        )
    try:
        signature(torque).bind(0.0, torque, torque)
    except TypeError:
        raise InvalidInput(f"torque is {torque!r}: it must take three values, t, q, v") from None
    except ValueError:  # written in C, and says nothing of what it takes
        pass
    return torque


def acting(torque: Array | Torque, nv: int) -> Callable[[float, Array, Array], Array]:
    """Return it as a function whose answers are checked."""
    if callable(torque):
        return lambda t, q, v: validation.vector("torque", torque(t, q, v), nv, unit="N m")
    return lambda t, q, v: torque


def check_pickles(torque: Array | Torque) -> None:
    """Raise `InvalidInput` for a function that no other process would find."""
    try:
        pickle.dumps(torque)
    except (pickle.PicklingError, AttributeError, TypeError):
        raise InvalidInput(
            f"torque is {torque!r}: to pickle a collision it must be numbers or a function of a "
            "module"
        ) from None
