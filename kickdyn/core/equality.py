"""Equality by value for dataclasses that have arrays, which numpy compares entry by entry."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np


class ValueEquality:
    """Compares and hashes a frozen dataclass, declared with `eq=False`, by the values it has."""

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            return NotImplemented
        return self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def _values(self) -> tuple[Any, ...]:
        """Return the fields, arrays as tuples of shape and entries."""
        values = (getattr(self, field.name) for field in fields(self))  # type: ignore[arg-type]
        return tuple(
            (value.shape, *value.ravel().tolist()) if isinstance(value, np.ndarray) else value
            for value in values
        )
