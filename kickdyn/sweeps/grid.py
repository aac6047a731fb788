"""The postures of a sweep: a grid over named joints."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg

MAX_POSTURES = 1_000_000
"""Held in memory at once; more go to the disk chunk by chunk."""

MOST_POSTURES = 10**10
"""About a terabyte on the disk."""

BYTES = 105
"""Per posture: thirteen numbers and the status."""

RATE = 2e5
"""Postures per second that one core strikes and flies, about (`benchmarks/sweep.py`)."""

DEFAULT_STEP_DEG = 10.0

DIGITS = 9
"""Decimals of an angle [deg]: it is 30, not 29.999999999999996, whichever way it came."""

_UNIT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(deg|degrees|°|rad|m|cm|mm)")


@dataclass(frozen=True, eq=False)
class Grid:
    """Every combination of joint values; joints that are not named stay at 0.

    Attributes:
        axes: joint name to its values, ascending [rad; m for prismatic joints].
    """

    axes: Mapping[str, Array]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values per axis."""
        return tuple(len(values) for values in self.axes.values())

    @property
    def size(self) -> int:
        """Number of postures."""
        return math.prod(self.shape)

    def configuration(self, leg: Leg, number: int) -> Array:
        """Return q of a posture by its number, the last axis running fastest."""
        index = np.unravel_index(number, self.shape)
        axes = zip(self.axes.items(), index, strict=True)
        return leg.configuration({name: values[i] for (name, values), i in axes})

    def configurations(self, leg: Leg) -> Iterator[Array]:
        """Yield q of every posture, the last axis running fastest."""
        names = list(self.axes)
        for index in np.ndindex(self.shape):
            values = (self.axes[name][i] for name, i in zip(names, index, strict=True))
            yield leg.configuration(dict(zip(names, values, strict=True)))


def grid(leg: Leg, joints: Iterable[str] = (), most: int = MAX_POSTURES) -> Grid:
    """Read a grid as it is typed.

    Args:
        leg: whose joints and ranges count.
        joints: `NAME=LOW:HIGH:STEP` or `NAME=VALUE` [deg; m for prismatic joints]. None at all:
            every joint of a leg of up to three, over its range, each 10 deg.
        most: postures that are allowed.

    Raises:
        InvalidInput: a text that cannot be read, an unknown joint, values outside the joint's
            range, too many postures.
    """
    axes: dict[str, Array] = {}
    for text in joints:
        name, values = _axis(leg, text)
        if name in axes:
            raise InvalidInput(f"joint {name!r} is given twice: once is meant")
        axes[name] = values
    if not axes:
        axes = _default(leg)
    result = Grid(axes)
    if result.size > most:
        raise InvalidInput(
            f"the grid has {result.size:,} postures ({' x '.join(map(str, result.shape))}): they "
            f"would fill {_bytes(result.size)} and take about {_time(result.size)} of one core; "
            f"at most {most:,} are "
            + (
                "held at once: name a store, --out DIR.zarr (in Python, most=)"
                if most < MOST_POSTURES
                else "swept"
            )
            + ", or take larger steps"
        )
    for name in _joints(leg):
        if name not in axes:
            _inside(leg, name, np.zeros(1), "not named, so at")
    return result


def _axis(leg: Leg, text: str) -> tuple[str, Array]:
    name, equals, span = text.rpartition("=")
    parts = span.split(":")
    if not equals or len(parts) not in (1, 3):
        raise InvalidInput(f"joint {text!r} cannot be read: write NAME=LOW:HIGH:STEP or NAME=VALUE")
    leg.velocity_index(name)
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        raise InvalidInput(f"joint {text!r} cannot be read: {_no_numbers(parts)}") from None
    for number in numbers:
        validation.number(f"joint {name}", number)
    low, high, step = numbers if len(numbers) == 3 else (numbers[0], numbers[0], 1.0)
    if step <= 0:
        raise InvalidInput(f"joint {text!r}: STEP must be above 0, not {step:g}")
    if low > high:
        raise InvalidInput(
            f"joint {text!r}: LOW must not exceed HIGH: {name}={high:g}:{low:g}:{step:g}, perhaps"
        )
    intervals = (high - low) / step * (1 + 1e-12) + 1e-9  # so that 0:1:0.1 ends at 1
    if intervals >= MAX_POSTURES:
        raise InvalidInput(
            f"joint {text!r} alone has {intervals + 1:.3g} values, which would fill "
            f"{_bytes(intervals)} and take about {_time(intervals)} of one core; at most "
            f"{MAX_POSTURES:,} are swept: take a larger step"
        )
    values = np.minimum(low + step * np.arange(math.floor(intervals) + 1), high)
    values = values if leg.joint_unit(name) == "m" else np.radians(values)
    _inside(leg, name, values, "swept")
    return name, values


def _no_numbers(parts: list[str]) -> str:
    """Return what is wrong with the parts of a span, one of which is no number."""
    for part in parts:
        if found := _UNIT.fullmatch(part.strip()):
            said = f"{part!r} has a unit: write plain numbers, in deg (in m for a prismatic joint)"
            return said + (
                f"; {part} are {math.degrees(float(found[1])):.6g} deg" if found[2] == "rad" else ""
            )
    return f"{':'.join(parts)!r} are not numbers"


def _bytes(postures: float) -> str:
    size = postures * BYTES
    for unit, scale in (("TB", 1e12), ("GB", 1e9)):
        if size >= scale:
            return f"{size / scale:,.3g} {unit}"
    return f"{size / 1e6:,.3g} MB"


def _time(postures: float) -> str:
    seconds = postures / RATE
    for unit, scale, least in (("days", 86400, 2 * 86400), ("hours", 3600, 3600)):
        if seconds >= least:
            return f"{seconds / scale:,.3g} {unit}"
    return f"{seconds:,.3g} s"


def _joints(leg: Leg) -> list[str]:
    return leg.single_joints  # a floating base has no one value


def _default(leg: Leg) -> dict[str, Array]:
    joints = _joints(leg)
    if len(joints) > 3:
        raise InvalidInput(
            f"{leg.name} has {len(joints)} joints: name those to sweep, "
            f"for example --joint {joints[0]}=0:30:5 (there are {', '.join(joints)})"
        )
    axes = {}
    for name in joints:
        low, high = leg.joint_range(name)
        metres = leg.joint_unit(name) == "m"
        step = (high - low) / 9 if metres else math.radians(DEFAULT_STEP_DEG)
        if not abs(low) + abs(high) < (1e6 if metres else MAX_POSTURES * step):
            raise InvalidInput(
                f"joint {name} ranges from {low:g} to {high:g}: name the part to sweep, "
                f"for example --joint {name}=0:30:5"
            )
        if step == 0.0 or metres:
            axes[name] = np.linspace(low, high, 10 if step else 1)
            continue
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        axes[name] = np.radians(DEFAULT_STEP_DEG * np.arange(first, last + 1))
        if not axes[name].size:
            axes[name] = np.array([low])
    return axes


def _inside(leg: Leg, name: str, values: Array, how: str) -> None:
    low, high = leg.joint_range(name)
    slack = 1e-9 * max(1.0, abs(low), abs(high))
    outside = values[(values < low - slack) | (values > high + slack)]
    if outside.size:
        scale, unit = (1.0, "m") if leg.joint_unit(name) == "m" else (180 / math.pi, "deg")
        raise InvalidInput(
            f"joint {name} is {how} {outside[0] * scale:g} {unit}: "
            f"its range is {low * scale:g} to {high * scale:g} {unit}"
        )
