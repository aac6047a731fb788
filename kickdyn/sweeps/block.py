"""Part of a sweep as reductions see it: postures by number, results by name, angles in degrees."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.grid import DIGITS, Grid
from kickdyn.sweeps.run import VARIABLES

Numbers = NDArray[np.int64]


def shown(unit: str) -> str:
    """Return the unit in which a quantity is shown: degrees for radians, else its own."""
    return "deg" if unit == "rad" else unit


@dataclass(frozen=True, eq=False)
class Space:
    """The joints of a sweep; postures count with the last one running fastest.

    Attributes:
        axes: joint name to its values, ascending [deg; m for prismatic joints].
        units: of every joint and result, as shown.
    """

    axes: Mapping[str, Array]
    units: Mapping[str, str]

    @classmethod
    def of(cls, axes: Mapping[str, Array], units: Mapping[str, str]) -> Space:
        """Return the space of joint values [rad; m] with their units."""
        values = {
            name: np.round(np.degrees(each) if units[name] == "rad" else each, DIGITS)
            + 0.0  # no -0
            for name, each in axes.items()
        }
        results = {name: unit for name, (unit, _) in VARIABLES.items()}
        every = {**{name: units[name] for name in axes}, **results}
        return cls(values, {name: shown(unit) for name, unit in every.items()})

    @classmethod
    def of_grid(cls, leg: Leg, grid: Grid) -> Space:
        """Return the space of a grid over a leg's joints."""
        return cls.of(grid.axes, {name: leg.joint_unit(name) for name in grid.axes})

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values per joint."""
        return tuple(len(values) for values in self.axes.values())

    @property
    def size(self) -> int:
        """Number of postures."""
        return math.prod(self.shape)

    def index(self, name: str, numbers: Numbers) -> Numbers:
        """Return where along a joint's values postures lie."""
        place = list(self.axes).index(name)
        return np.asarray(numbers // math.prod(self.shape[place + 1 :]) % self.shape[place])

    def angles(self, number: int) -> dict[str, float]:
        """Return the joints' values of a posture [deg; m]."""
        place = np.unravel_index(number, self.shape)
        return {
            name: float(values[i])
            for (name, values), i in zip(self.axes.items(), place, strict=True)
        }

    def text(self, number: int) -> str:
        """Return a posture in words."""
        return ", ".join(f"{k} {v:.4g} {self.units[k]}" for k, v in self.angles(number).items())


@dataclass(frozen=True, eq=False)
class Block:
    """Some postures of a sweep.

    Attributes:
        space: the joints.
        numbers: of the postures, shape `(n,)`, ascending.
        read: gives a result by name, shape `(n,)`, in the units of `VARIABLES`.
    """

    space: Space
    numbers: Numbers
    read: Callable[[str], Array]
    _kept: dict[str, Array] = field(default_factory=dict)

    def __call__(self, name: str) -> Array:
        """Return a joint's values or a result, shape `(n,)`, angles in degrees."""
        if name not in self._kept:
            self._kept[name] = self._column(name)
        return self._kept[name]

    def _column(self, name: str) -> Array:
        if name in self.space.axes:
            return np.asarray(self.space.axes[name][self.space.index(name, self.numbers)])
        values = self.read(name)
        return np.degrees(values) if VARIABLES[name][0] == "rad" else values

    def pick(self, mask: NDArray[np.bool_]) -> Block:
        """Return those postures where `mask`, shape `(n,)`, is true."""
        return Block(self.space, self.numbers[mask], lambda name: self.read(name)[mask])
