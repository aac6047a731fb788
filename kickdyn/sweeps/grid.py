"""The postures of a sweep: a grid over named joints or a list, and the chunks it is computed in."""

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg

IN_MEMORY = 1_000_000
"""Largest number of postures whose results are returned in memory (105 MB)."""

LARGEST = 10**10
"""Largest number of postures of a grid: about 320 GB in a store."""

GIGABYTES = 32e-9
"""Size of a posture with all variables in a store [GB]."""

MOST_SAMPLES = 10**7
"""Largest number of postures of a list or a sample, which is kept in memory."""

DECIMALS = 9
"""Decimals of an angle in degrees, so that it is 30, not 29.999999999999996."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Every combination of joint values, or rows of them; other joints stay at 0, or close loops.

    Postures are numbered from 0, the last joint running fastest.
    """

    axes: Mapping[str, Array]  # joint to its values, ascending, each of shape `(k,)` [rad; m]
    is_list: bool = False  # whether posture i has value i of each joint, in any order, instead

    @classmethod
    def of(
        cls, leg: Leg, postures: Mapping[str, ArrayLike], samples: int | str | None = None
    ) -> "Grid":
        """Return the grid over joints of a leg, from a value or ascending values [rad; m] of each.

        With `samples`, the values are a list, or bounds of a sample, see `kickdyn.sweep`.

        Raises `InvalidInput` with all faults in one line: an unknown joint, one that mimics
        another, values that are not ascending or outside the joint's range, too many postures.
        """
        if not isinstance(postures, Mapping) or not postures:
            raise InvalidInput(
                f"postures is {validation.brief(postures)}: it must map joint names to values, "
                f"such as {{{leg.single_joints[0]!r}: [0.0, 0.1]}}{_of_rows(leg, postures)}"
            )
        axes: dict[str, Array] = {}
        faults: list[str] = []
        listed = isinstance(samples, str) and samples == "list"
        for name, values in postures.items():
            with _collected(faults):
                axes[name] = _checked_axis(leg, name, values, ascending=not listed)
        still = np.zeros(1)
        drivers = {mimic.joint: mimic for mimic in leg.mimics}
        for name in leg.single_joints:
            with _collected(faults):
                if mimic := drivers.get(name):
                    moved = mimic.value(axes.get(mimic.driver, still))
                    _check_range(leg, name, moved, f"moved by {mimic.driver}, which it mimics, to")
                elif name not in postures:
                    _check_range(leg, name, still, "not named, so at")
        if faults:
            raise InvalidInput(*faults)
        grid = cls(axes) if samples is None else cls(_sampled(axes, samples), is_list=True)
        check_size(grid.shape, LARGEST)
        return grid

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions: the joints, or `posture` of a list."""
        return ("posture",) if self.is_list else tuple(self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values per joint; of a list, the number of postures."""
        lengths = tuple(len(values) for values in self.axes.values())
        return lengths[:1] if self.is_list else lengths

    @property
    def size(self) -> int:
        """Number of postures."""
        return math.prod(self.shape)

    def configuration(self, leg: Leg, number: int) -> Array:
        """Return q of a posture by its number, shape `(nq,)`, the leg's loops closed.

        The grid's joints keep their values; other joints of a loop move.

        Raises `InvalidInput` where the loops cannot be closed with all joints in their ranges.
        """
        index = np.unravel_index(number, self.shape)
        axes = zip(self.axes.items(), index * (len(self.axes) if self.is_list else 1), strict=True)
        q = leg.configuration({name: values[i] for (name, values), i in axes})
        if leg.constraints is None or not leg.constraints.loops:
            return q
        closed = leg.close_loops(q, keep=self.axes)
        outside = leg.outside_range(closed)
        if outside:
            raise InvalidInput(f"with the loops closed, {outside[0]}")
        return closed


@dataclass(frozen=True)
class Chunks:
    """The division of a grid into chunks of postures whose numbers follow each other."""

    grid_shape: tuple[int, ...]
    shape: tuple[int, ...]  # of a chunk; the last ones of an axis may be smaller

    @classmethod
    def of(cls, grid_shape: tuple[int, ...], size: int) -> "Chunks":
        """Divide a grid into chunks of about `size` postures."""
        shape, remaining = [1] * len(grid_shape), size
        for axis in range(len(grid_shape) - 1, -1, -1):
            length = grid_shape[axis]
            shape[axis] = -(-length // -(-length // max(1, remaining)))  # equal parts
            if shape[axis] < length:
                break
            remaining //= length
        return cls(grid_shape, tuple(shape))

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of chunks along each axis."""
        return tuple(-(-n // c) for n, c in zip(self.grid_shape, self.shape, strict=True))

    def __len__(self) -> int:
        return math.prod(self.counts)

    def index(self, k: int) -> tuple[int, ...]:
        """Return the place of chunk number `k` along each axis."""
        return tuple(map(int, np.unravel_index(k, self.counts)))

    def region(self, k: int) -> tuple[slice, ...]:
        """Return the slices of the grid that chunk number `k` covers."""
        return tuple(
            slice(i * c, min((i + 1) * c, n))
            for i, c, n in zip(self.index(k), self.shape, self.grid_shape, strict=True)
        )

    def span(self, k: int) -> tuple[int, int]:
        """Return the first posture and the number of postures of a chunk."""
        region = self.region(k)
        begin = np.ravel_multi_index([axis.start for axis in region], self.grid_shape)
        return int(begin), math.prod(axis.stop - axis.start for axis in region)


def check_size(shape: tuple[int, ...], largest: int) -> None:
    """Raise `InvalidInput` where a grid has more postures than `largest`."""
    size = math.prod(shape)
    if size > largest:
        limit = "can be swept"
        if largest < LARGEST:
            limit = "are kept in memory: name a store, --out DIR.zarr (store= in Python)"
        raise InvalidInput(
            f"the grid has {size:,} postures ({' x '.join(map(str, shape))}, in a store "
            f"{GIGABYTES * size:,.1f} GB): at most {largest:,} {limit}, or take larger steps"
        )


def _of_rows(leg: Leg, postures: object) -> str:
    """Return how n configurations in rows, `(n, nq)`, are swept; empty for anything else."""
    names = leg.single_joints
    try:
        shape = validation.floats("postures", postures).shape  # type: ignore[arg-type]
    except InvalidInput:
        shape = ()
    if shape[1:] != (len(names),) or leg.nq != len(names) or leg.mimics:
        return ""
    columns = [f"{name!r}: rows[:, {k}]" for k, name in enumerate(names)]
    return f"; for rows of q, {{{', '.join(columns)}}} with samples='list'"


def _sampled(axes: Mapping[str, Array], samples: int | str) -> dict[str, Array]:
    """Return n values of each joint: of a list, or of the Sobol sequence between two bounds."""
    lengths = {name: len(values) for name, values in axes.items()}
    if isinstance(samples, str):
        if samples != "list":
            raise InvalidInput(f"samples is {samples!r}: it must be 'list' or a number of postures")
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{name} {length}" for name, length in lengths.items())
            different = f"joints have different numbers of values, {counts}"
            raise InvalidInput(f"{different}: a list needs equal ones")
        check_size((max(lengths.values()),), MOST_SAMPLES)
        return dict(axes)
    n = validation.whole("samples", samples, at_least=1, at_most=MOST_SAMPLES)
    for name, length in lengths.items():
        if length != 2:
            raise InvalidInput(f"joint {name} has {length} values: a sample needs two, its bounds")
    from scipy.stats import qmc  # here, because it takes long to import

    with warnings.catch_warnings():  # that a power of two would be balanced
        warnings.simplefilter("ignore", UserWarning)
        points = qmc.Sobol(len(axes), scramble=False).random(n)
    pairs = zip(axes.items(), points.T, strict=True)
    return {name: low + (high - low) * share for (name, (low, high)), share in pairs}


def read_postures(leg: Leg, joints: Iterable[str]) -> dict[str, Array]:
    """Return the postures that a command line asks for, as `Grid.of` takes them [rad; m].

    Texts are `NAME=LOW:HIGH:STEP` or `NAME=VALUE` [deg; m for prismatic joints]. Raises
    `InvalidInput` without any, or with all faults in one line.
    """
    axes: dict[str, Array] = {}
    faults: list[str] = []
    for text in joints:
        with _collected(faults):
            name, values = _read_axis(leg, text)
            if name in axes:
                raise InvalidInput(f"joint {name!r} is given twice: give it once")
            axes[name] = values
    if faults:
        raise InvalidInput(*faults)
    if not axes:
        names = leg.joint_names
        raise InvalidInput(
            f"name the joints of {leg.name} to sweep, for example --joint {names[0]}=0:30:5 "
            f"(there are {', '.join(names)})"
        )
    return axes


def _read_axis(leg: Leg, text: str) -> tuple[str, Array]:
    name, equals, span = text.rpartition("=")
    values = span.split(":")
    if not equals or len(values) not in (1, 3):
        raise InvalidInput(f"joint {text!r} cannot be read: write NAME=LOW:HIGH:STEP or NAME=VALUE")
    try:
        numbers = [float(value) for value in values]
    except ValueError:
        raise InvalidInput(f"joint {text!r} cannot be read: write plain numbers [deg; m]") from None
    for number in numbers:
        validation.number(f"joint {name}", number)
    low, high, step = numbers if len(numbers) == 3 else (numbers[0], numbers[0], 1.0)
    if step <= 0:
        raise InvalidInput(f"joint {text!r}: STEP must be above 0, not {step:g}")
    if low > high:
        raise InvalidInput(
            f"joint {text!r}: LOW must not exceed HIGH: did you mean "
            f"{name}={high:g}:{low:g}:{step:g}?"
        )
    intervals = (high - low) / step * (1 + 1e-12) + 1e-9  # so that 0:1:0.1 ends at 1
    if intervals >= IN_MEMORY:
        raise InvalidInput(
            f"joint {text!r} alone has {intervals + 1:.3g} values: at most {IN_MEMORY:,} can be "
            "swept, take a larger step"
        )
    axis = np.minimum(low + step * np.arange(math.floor(intervals) + 1), high)
    axis = axis if leg.joint_unit(name) == "m" else np.radians(axis)
    _check_range(leg, name, axis, "swept")
    return name, axis


@contextmanager
def _collected(faults: list[str]) -> Iterator[None]:
    """Append the refusals inside to the faults."""
    try:
        yield
    except InvalidInput as error:
        faults.append(str(error))


def _checked_axis(leg: Leg, name: str, given: ArrayLike, *, ascending: bool) -> Array:
    """Return the values of a joint of a grid; raise `InvalidInput` if it cannot take them."""
    leg.velocity_index(name)
    for mimic in leg.mimics:
        if name == mimic.joint:
            raise InvalidInput(f"joint {name} mimics {mimic.driver}: sweep {mimic.driver} instead")
    values = np.atleast_1d(validation.floats(f"joint {name}", given))
    if values.ndim != 1 or not values.size or (ascending and not (np.diff(values) > 0).all()):
        order, shown = "ascending, " if ascending else "of ", validation.brief(given)
        raise InvalidInput(f"joint {name} has {shown}: its values must be {order}shape (k,)")
    _check_range(leg, name, values, "swept")
    return values


def _check_range(leg: Leg, name: str, values: Array, how: str) -> None:
    low, high = leg.joint_range(name)
    tolerance = 1e-9 * max(1.0, abs(low), abs(high))
    outside = values[(values < low - tolerance) | (values > high + tolerance)]
    if outside.size:
        scale, unit = (1.0, "m") if leg.joint_unit(name) == "m" else (180 / math.pi, "deg")
        raise InvalidInput(
            f"joint {name} is {how} {outside[0] * scale:g} {unit}: "
            f"its range is {low * scale:g} to {high * scale:g} {unit}"
        )
