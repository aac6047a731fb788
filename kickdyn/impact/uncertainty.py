"""How sure a strike is: what is not known exactly before it, carried to what comes after."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.representation import ROUNDING, Printed
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.sensitivity import Sensitivity, sensitivity
from kickdyn.impact.uncertainty_sources import UNITS, columns

if TYPE_CHECKING:
    from kickdyn.impact.impact_result import Impact

MAX_SPREAD = 1e100
"""Above it, variances would leave double precision."""

RESULTS = {"impulse": "N s", "velocity": "m/s", "spin": "rad/s"}

SIZES = {"impulse_size": "impulse", "speed": "velocity"}
"""What has a size of its own, and the vector it is the size of."""

COLUMNS = {
    "impulse_size": "impulse size",
    "speed": "ball speed",
    "velocity": "velocity vector",
    "spin": "spin vector",
}
"""What the table shows, and what it calls it."""


@dataclass(frozen=True, eq=False, repr=False)
class Uncertainty(Printed):
    """Covariances of a strike's results, and the budget: which source makes which part.

    `print` shows the budget as a table.

    Attributes:
        impulse: covariance of the impulse on the ball, shape `(3, 3)` [N2 s2, world frame].
        velocity: of the ball's velocity just after, shape `(3, 3)` [m2/s2].
        spin: of the ball's spin just after, shape `(3, 3)` [rad2/s2].
        impulse_size: standard deviation of the impulse's size [N s].
        speed: of the ball's speed just after [m/s]. Both leave out what only turns the vector: the
            root of a covariance's trace is more. Of a ball brought to rest it is that root.
        ways: unit vectors of the impulse (`impulse_size`) and of the ball's velocity (`speed`).
        by_source: for each source named, what `impulse`, `velocity` and `spin` would be if it were
            the only one; they add up to these.
        branch: `frictionless`, `stick` or `slip`.
        branch_sigmas: how many standard deviations the other branch is away. First order holds on
            one branch only: below about 2, read the covariances as rough.
    """

    impulse: Array
    velocity: Array
    spin: Array
    impulse_size: float
    speed: float
    ways: Mapping[str, Array]
    by_source: Mapping[str, Mapping[str, Array]]
    branch: str
    branch_sigmas: float

    def share(self, result: str) -> dict[str, float]:
        """Return the part of a result's variance that each source makes; together 1.

        All are 0 where the result is certain.

        Args:
            result: `impulse_size`, `speed`, `impulse`, `velocity` or `spin`; the variance of the
                last three, which are vectors, is the trace of their covariance.

        Raises:
            InvalidInput: another result.
        """
        known = (*SIZES, *RESULTS)
        if result not in known:
            raise InvalidInput(f"result {result!r} is unknown: choose {', '.join(known)}")
        parts = {source: self._variance(result, of) for source, of in self.by_source.items()}
        total = sum(parts.values())
        return {source: part / total if total else 0.0 for source, part in parts.items()}

    def _variance(self, result: str, of: Mapping[str, Array]) -> float:
        if result in SIZES:
            return _along(self.ways[result], of[SIZES[result]])
        return float(np.trace(of[result]))

    def __str__(self) -> str:
        """Return the budget: standard deviation and share of the variance by source."""
        units = {result: RESULTS[SIZES.get(result, result)] for result in COLUMNS}
        lines = [
            f"{'':13}" + "".join(f"{title:>16}" for title in COLUMNS.values()),
            f"{'source':13}" + "".join(f"{unit:>9}{'share':>7}" for unit in units.values()),
        ]
        shares = {result: self.share(result) for result in COLUMNS}
        totals = {
            result: sum(self._variance(result, of) for of in self.by_source.values())
            for result in COLUMNS
        }
        for source in self.by_source:
            line = f"{source:13}"
            for result, total in totals.items():
                share = shares[result][source]
                part = math.sqrt(share * total) if share > ROUNDING**2 else 0.0
                line += f"{part:9.3g}" + (f"{share:7.1%}" if total else f"{'':7}")
            lines.append(line.rstrip())
        whole = "".join(f"{math.sqrt(total):9.3g}{'':7}" for total in totals.values())
        lines.append(f"{'all':13}{whole}".rstrip())
        lines.append("standard deviations; a vector's is the root of its covariance's trace")
        if self.branch != "frictionless":
            other = "slip" if self.branch == "stick" else "stick"
            lines.append(
                f"{self.branch}; {other} is {self.branch_sigmas:.2g} standard deviations away"
            )
        return "\n".join(lines)


def uncertainty(hit: Impact, **spread: ArrayLike) -> Uncertainty:
    """Carry uncertainties through a strike, to first order (JCGM 100:2008, 5.1 and 5.2).

    Args:
        hit: from `strike` or `strike_at`, law `newton`.
        **spread: by the name of a source (`kickdyn.impact.uncertainty_sources.UNITS`), its standard
            deviation: one for all its components, or one for each, shape `(n,)`, independent
            of each other; or their covariance, shape `(n, n)`. Sources are independent. For a
            direction, `normal`, it is the angle that it tilts by to each side [rad].

    Raises:
        InvalidInput: no source or an unknown one, a wrong shape, a negative or infinite deviation,
            a covariance that is not symmetric and positive semidefinite, or another law.
    """
    if not spread:
        raise InvalidInput(f"no source is named: choose among {', '.join(UNITS)}")
    unknown = [name for name in spread if name not in UNITS]
    if unknown:
        raise InvalidInput(f"source {unknown[0]!r} is unknown: choose among {', '.join(UNITS)}")
    slopes = sensitivity(hit)
    places = columns(hit.posture.leg)
    by_source: dict[str, Mapping[str, Array]] = {}
    margin = 0.0
    for name, value in spread.items():
        size = places[name].stop - places[name].start
        covariance = _covariance(name, value, size)
        parts = {result: _carried(getattr(slopes, result)[name], covariance) for result in RESULTS}
        by_source[name] = parts
        margin += float(_carried(slopes.margin_slope[name], covariance)[0, 0])
    impulse, velocity, spin = (
        np.sum([parts[result] for parts in by_source.values()], axis=0) for result in RESULTS
    )
    for array in (impulse, velocity, spin):
        array.setflags(write=False)
    ways = {"impulse_size": _way(hit.impulse), "speed": _way(hit.ball_after.velocity)}
    return Uncertainty(
        impulse=impulse,
        velocity=velocity,
        spin=spin,
        impulse_size=math.sqrt(_along(ways["impulse_size"], impulse)),
        speed=math.sqrt(_along(ways["speed"], velocity)),
        ways=ways,
        by_source=by_source,
        branch=slopes.branch,
        branch_sigmas=_sigmas(slopes, margin),
    )


def _way(vector: Array) -> Array:
    """Return the unit vector along a vector; 0 of 0, which has no direction."""
    size = math.hypot(*vector)
    way: Array = vector / size if size else np.zeros(3)
    way.setflags(write=False)
    return way


def _along(way: Array, covariance: Array) -> float:
    """Return the variance of the size of a vector that points this way."""
    if not way.any():
        return float(np.trace(covariance))
    return max(float(way @ covariance @ way), 0.0)


def _sigmas(slopes: Sensitivity, variance: float) -> float:
    if slopes.at_boundary:
        return 0.0
    return math.inf if variance <= 0.0 else slopes.margin / math.sqrt(variance)


def _carried(jacobian: Array, covariance: Array) -> Array:
    carried: Array = jacobian @ covariance @ jacobian.T
    carried.setflags(write=False)
    return carried


def _covariance(name: str, value: ArrayLike, size: int) -> Array:
    array = validation.floats(f"spread of {name}", value, unit=UNITS[name])
    if np.abs(array).max(initial=0.0) > MAX_SPREAD:
        raise InvalidInput(f"spread of {name} is {array.tolist()}: at most {MAX_SPREAD:g}")
    if array.shape == (size, size) and size > 1:
        lowest = float(np.linalg.eigvalsh(array)[0])
        largest = float(np.abs(array).max())
        aslant = float(np.abs(array - array.T).max())
        if aslant > 1e-9 * largest:
            raise InvalidInput(
                f"covariance of {name} differs from its transpose by {aslant:.3g}: it must be "
                "symmetric and positive semidefinite"
            )
        if lowest < -1e-9 * largest:
            raise InvalidInput(
                f"covariance of {name} has a smallest eigenvalue of {lowest:.3g}: it must be "
                "symmetric and positive semidefinite"
            )
        return array
    if array.shape not in ((), (size,)):
        shapes = "a number" if size == 1 else f"a number, ({size},) or ({size}, {size})"
        raise InvalidInput(f"spread of {name} has shape {array.shape}: it must be {shapes}")
    if (array < 0).any():
        raise InvalidInput(f"spread of {name} is {array.tolist()}: it must be 0 or more")
    return np.asarray(np.eye(size) * array**2)
