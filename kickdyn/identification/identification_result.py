"""The result of `identify`: the launch, the other unknowns, and how well they are determined."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.plot_style import styled
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.ground import Ground
from kickdyn.identification.track import Track, doubts_of_track, mean_acceleration

UNITS = {
    **dict.fromkeys(("x", "y", "z"), "m"),
    **dict.fromkeys(("vx", "vy", "vz", "wind_x", "wind_y"), "m/s"),
    **dict.fromkeys(("back_spin", "side_spin", "gyro_spin"), "rad/s"),
    **dict.fromkeys(("elevation", "azimuth"), "rad"),
}
"""Units of the unknowns, and of a learner's errors of aim; coefficients and factors have none."""

LARGEST_DEVIATION = {
    **dict.fromkeys(("back_spin", "side_spin", "gyro_spin"), 20.0),
    **{"drag": 0.1, "drag_scale": 0.5, "lift_scale": 0.5, "wind_x": 3.0, "wind_y": 3.0},
}
"""Standard deviation above which a value is not given: about half of its usual value."""

SMALL_SHARE = 0.05
"""Share of `LARGEST_DEVIATION` up to which a value near zero is given, as a spin to 1 rad/s."""


@dataclass(frozen=True, eq=False, repr=False)
class Identification(ReprMixin):
    """Launch, spin, drag, lift and wind of a measured flight, with their uncertainty.

    Names of the unknowns: `x`, `y`, `z` [m] and `vx`, `vy`, `vz` [m/s] at the first sample;
    `back_spin`, `side_spin` (positive bends the flight to the left) and `gyro_spin` (about the
    velocity) [rad/s]; `drag`, `drag_scale`, `lift_scale`; `wind_x`, `wind_y` [m/s].

    Attributes:
        track: the measured track.
        ball: the ball.
        air: the air, with the fitted coefficients and wind.
        launch: the state of the ball at the first sample; components of the spin that the
            measurement does not determine are the most probable ones.
        names: names of the unknowns.
        estimates: estimates of the unknowns, shape `(p,)`.
        covariance: covariance of the estimates, shape `(p, p)`.
        residuals: fitted less measured positions, shape `(n, 3)` [m].
        used: which samples count, shape `(n,)`; the others are outliers.
        noise: standard deviation of one measured coordinate [m]; if that of the axes differs, the
            root of the mean of their squares.
        widening: factor on the deviations because neighbouring residuals are correlated.
        curved: unknowns whose deviations are larger than in a linear fit, because the sum of
            squares is not quadratic around the estimate.
    """

    track: Track
    ball: Ball
    air: Air
    launch: BallState
    names: tuple[str, ...]
    estimates: Array
    covariance: Array
    residuals: Array
    used: NDArray[np.bool_]
    noise: float
    widening: float
    curved: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        validation.protect(self.estimates, self.covariance, self.residuals, self.used)

    def _rows(self) -> Iterable[Row]:
        yield "samples", f"{self.used.size - self.outliers} of {self.used.size} used", ""
        yield "rms distance", self.rms, "m"
        for name, value in self.values.items():
            yield name, f"{value:.4g} +- {self.deviations[name]:.2g}", UNITS.get(name, "")
        for name, reason in self.undetermined.items():
            yield name, f"not determined: {reason}", ""
        for line in self.warnings:
            yield "warning", line, ""

    @cached_property
    def undetermined(self) -> dict[str, str]:
        """The unknowns that the measurement does not determine, each with the reason.

        Their deviation is above `LARGEST_DEVIATION`, or above both half the value and `SMALL_SHARE`
        of it.
        """
        reasons = {}
        deviations = np.sqrt(np.diag(self.covariance)).tolist()
        for name, value, deviation in zip(self.names, self.estimates, deviations, strict=True):
            loosest = LARGEST_DEVIATION.get(name, math.inf)
            if deviation > min(max(0.5 * abs(value), SMALL_SHARE * loosest), loosest):
                size = f"{deviation:.2g}" if deviation < 99.5 else f"{deviation:.0f}"
                reason = f"its standard deviation is {size} {UNITS.get(name, '')}".rstrip()
                reasons[name] = reason if deviation > loosest else f"{reason}, over half the value"
        return reasons

    @property
    def values(self) -> dict[str, float]:
        """The estimates by name, without those that the measurement does not determine."""
        return self._determined(self.estimates)

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of `values`, by name and in the same units."""
        return self._determined(np.sqrt(np.diag(self.covariance)))

    def _determined(self, numbers: Array) -> dict[str, float]:
        pairs = zip(self.names, numbers.tolist(), strict=True)
        return {name: number for name, number in pairs if name not in self.undetermined}

    @property
    def correlations(self) -> Array:
        """Correlations of the estimates, shape `(p, p)`, in the order of `names`."""
        size = np.maximum(np.sqrt(np.diag(self.covariance)), 1e-300)
        return np.asarray(self.covariance / np.outer(size, size))

    @cached_property
    def flight(self) -> Flight:
        """The fitted flight, flown on until it is as low as its lowest measured position."""
        lowest = min(float(self.track.positions[:, 2].min()), float(self.launch.position[2]))
        return fly(self.launch, self.ball, self.air, Ground(lowest - self.ball.radius))

    @property
    def outliers(self) -> int:
        """Number of samples that were left out."""
        return int((~self.used).sum())

    @property
    def rms(self) -> float:
        """Root mean square distance of fit and measurement, outliers left out [m]."""
        residuals = self.residuals[self.used]
        return math.sqrt(float((residuals * residuals).sum()) / max(len(residuals), 1))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines about what to know before using the numbers; empty if there is nothing."""
        drag = self.values.get("drag", self.values.get("drag_scale", 0.0))
        falling = -float(mean_acceleration(self.track)[2])
        lines = {
            f"the fit misses the positions by {self.rms:.2g} m, more than the ball's radius: "
            "they may not be one flight, without a bounce, in metres and seconds with z up":
                self.rms > self.ball.radius,
            f"drag is {drag:.2g}, below 0, as if the air pushed the ball: wind, a touch within "
            "the flight, or positions that are not in metres can cause this": drag < 0.0,
            f"not determined by the measurement: {', '.join(self.undetermined)}":
                self.undetermined,
            "the sum of squares is not quadratic around the estimate: the standard deviations "
            f"of {', '.join(self.curved)} were increased to match it": self.curved,
            "neighbouring residuals are correlated, as in smoothed tracks: the standard "
            f"deviations are increased by a factor of {self.widening:.2g}": self.widening > 1.0,
            f"{self.outliers} of {self.used.size} samples are outliers and were left out":
                self.outliers,
        }  # fmt: skip
        doubts = doubts_of_track(self.track, falling)
        return (*(line for line, holds in lines.items() if holds), *doubts, *self.flight.warnings)

    @styled()
    def plot(self) -> Any:
        """Return a matplotlib figure: measured points and fitted path, and the residuals."""
        from matplotlib.figure import Figure  # takes long to import

        figure = Figure(figsize=(9.0, 6.0))
        side, top, residuals = figure.subplots(3, 1, height_ratios=(2, 2, 1))
        measured, used = self.track.positions, self.used
        fitted = measured + self.residuals
        for axes, ordinate in ((side, 2), (top, 1)):
            axes.plot(fitted[:, 0], fitted[:, ordinate], color="C0")
            axes.plot(*measured[used][:, [0, ordinate]].T, ".", color="C1", markersize=3)
            axes.plot(*measured[~used][:, [0, ordinate]].T, "x", color="C3")
        residuals.plot(self.track.times, 100.0 * self.residuals, linewidth=0.8)
        side.legend(side.lines, ("fitted", "measured", "outlier, not used"))
        residuals.legend(residuals.lines, ("x", "y", "z"), loc="upper left", ncols=3)
        side.set(xlabel="x [m]", ylabel="z [m]", title="measured positions and fitted flight")
        top.set(xlabel="x [m]", ylabel="y [m]")
        residuals.set(xlabel="time [s]", ylabel="residual [cm]")
        return figure


class FlightMean(NamedTuple):
    """The mean of a value over flights that were fitted one by one, by `weighted_mean`."""

    mean: float
    deviation: float  # standard error of the mean
    scatter: float  # standard deviation between flights beyond the flights' own deviations
    flights: int  # number of flights that determine the value
    slowest: float  # lowest mean speed of these flights [m/s]
    fastest: float  # highest one [m/s]

    def __str__(self) -> str:
        scatter = f"from flight to flight it scatters by {self.scatter:.2g}"
        if self.scatter == 0.0:
            scatter = "the flights differ no more than their deviations explain"
        return (
            f"{with_deviation(self.mean, self.deviation)}, mean of {self.flights} flights "
            f"with mean speeds of {self.slowest:.2g} to {self.fastest:.2g} m/s; {scatter}"
        )


def mean_over_flights(fits: Sequence[Identification], name: str) -> FlightMean | None:
    """Return the mean of a value over flights, None if fewer than two determine it."""
    determined = [fit for fit in fits if name in fit.values]
    if len(determined) < 2:
        return None
    values = np.array([fit.values[name] for fit in determined])
    deviations = np.array([fit.deviations[name] for fit in determined])
    speeds = []
    for fit in determined:
        steps = np.diff(fit.track.positions + fit.residuals, axis=0)
        speeds.append(float(np.linalg.norm(steps, axis=1).sum()) / fit.track.duration)
    return FlightMean(*weighted_mean(values, deviations), len(determined), min(speeds), max(speeds))


def covariance(slopes: Array) -> Array:
    r"""Return the covariance :math:`(J^T J)^{-1}` of a least-squares estimate, shape `(p, p)`.

    The slopes J are the derivatives of all residuals, in standard deviations, shape `(n, p)`. A
    direction that the residuals do not determine, to rounding, has a huge variance.
    """
    size = np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    _, singular, right = np.linalg.svd(slopes / size, full_matrices=False)
    root = right.T / np.maximum(singular, 1e-14 * singular[0]) / size[:, None]
    return np.asarray(root @ root.T)


def weighted_mean(values: Array, deviations: Array) -> tuple[float, float, float]:
    r"""Return the mean of values, its standard error, and their scatter.

    With two or more values :math:`y_i` of standard deviations :math:`\sigma_i > 0`, the mean has
    the weights :math:`w_i = 1 / (\sigma_i^2 + \tau^2)`, and its standard error is
    :math:`(\sum w_i)^{-1/2}`. The scatter :math:`\tau` solves :math:`\sum w_i (y_i - \bar y)^2 =
    n - 1`; it is 0 where the :math:`\sigma_i` alone explain the differences (Paule & Mandel 1982,
    J. Res. Natl. Bur. Stand. 87:377).
    """

    def excess(scatter2: float) -> float:
        weights = 1.0 / (deviations**2 + scatter2)
        mean = weights @ values / weights.sum()
        return float(weights @ (values - mean) ** 2) - (len(values) - 1)

    scatter2 = 0.0
    if excess(0.0) > 0.0:  # at the variance of the values the sum is smaller
        scatter2 = float(brentq(excess, 0.0, float(np.var(values, ddof=1))))
    weights = 1.0 / (deviations**2 + scatter2)
    mean = float(weights @ values / weights.sum())
    return mean, float(weights.sum()) ** -0.5, math.sqrt(scatter2)


def with_deviation(value: float, deviation: float) -> str:
    """Return a value and its deviation, both to the second digit of the deviation."""
    digits = max(1 - math.floor(math.log10(deviation)), 0) if deviation > 0.0 else 3
    return f"{value:.{digits}f} +- {deviation:.{digits}f}"
