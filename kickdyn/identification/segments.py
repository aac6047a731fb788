r"""`segments`: a track cut into flights, rolling and rest, and what each bounce says of the ground.

Between two touches each coordinate is nearly a cubic in time (drag and lift change slowly). The
cuts are those that minimise

.. math:: \sum_{\text{segments}} \Big( \frac{1}{\sigma^2} \sum_k |y_k - c(t_k)|^2 + \beta \Big)

over all partitions of the samples, with :math:`\sigma` the noise and :math:`\beta` the price of 12
coefficients by the Bayesian information criterion. Dynamic programming finds them (Jackson et al.
2005, IEEE Signal Process. Lett. 12:105).
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.representation import Printed
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.forces import acceleration_function
from kickdyn.ground import Ground, Surface
from kickdyn.identification.track import Track, check_samples, doubts_of_track, refuse_units

COEFFICIENTS = ("restitution", "friction", "rolling_deceleration")
"""What the bounces and the rolling say of the ground."""

SMOOTHED, SMOOTHED_FRACTION = 0.1, 0.1
"""Time after and before a cut in which trackers smooth over the corner [s]; and the fraction of a
flight that is left out at most at either end."""


SegmentKind = StrEnum("SegmentKind", ["FLIGHT", "ROLLING", "REST", "OTHER"])
"""What the ball does in a part of a track."""

CutReason = StrEnum("CutReason", ["START", "BOUNCE", "TOUCH", "LANDING", "GAP"])
"""Why a part of a track begins where it does."""


ON_GROUND = (SegmentKind.ROLLING, SegmentKind.REST)
"""What a ball does that stays on the ground."""


@dataclass(frozen=True)
class Segment:
    """A part of a track between two cuts.

    Attributes:
        kind: `flight`, `rolling`, `rest` or `other` (in contact with something, or too short).
        first, last: index of its first sample, and of the one after its last: `track[first:last]`.
        begins: why it begins: the `start` of the track, a `bounce` off the ground, a `touch` by a
            player or an obstacle, a `landing` from which it does not rise, or a `gap`.
        start: estimated time of the cut at which it begins [s].
        velocity_before: of the ball just before that cut, shape `(3,)` [m/s]; None at a start.
        velocity_after: just after it, shape `(3,)` [m/s].
    """

    kind: SegmentKind
    first: int
    last: int
    begins: CutReason
    start: float
    velocity_before: Array | None
    velocity_after: Array

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.last - self.first


class Measured(NamedTuple):
    """A median of several measurements, its standard deviation, their number, kind and unit.

    The median, because a bounce beside a player's foot looks like any other. Where `is_lower_bound`
    is true, `median` is the largest of several lower bounds, and `deviation` its deviation.
    """

    median: float
    deviation: float
    samples: int
    kind: str = "bounce"
    unit: str = ""
    is_lower_bound: bool = False

    def __str__(self) -> str:
        measurements = f"{self.samples} {self.kind}{'s' if self.samples > 1 else ''}"
        if self.is_lower_bound:
            least = max(self.median - 2.0 * self.deviation, 0.0)
            return f"at least {least:.2g} (of {measurements})"
        value = f"{self.median:.3g} +- {self.deviation:.2g} {self.unit}".rstrip()
        return f"{value} (of {measurements})"


@dataclass(frozen=True, eq=False, repr=False)
class Segments(Printed):
    r"""The parts of a track, and the coefficients of the ground that follow from them.

    Attributes:
        track: the whole track.
        parts: the parts, in the order of time.
        restitution: restitution of the bounces, :math:`-v_z^+ / v_z^-`; None without a bounce.
        friction: ratio of the impulses along and across the ground,
            :math:`|\Delta v_{xy}| / \Delta v_z`, of the bounces in which the ball slid to the end.
            This is seen at the next contact with the ground, which slows the slip that was left. If
            no ball slid, the largest ratio is a lower bound of friction. None without a bounce.
        rolling_deceleration: deceleration in the second halves of the parts in which the ball rolls
            [m/s2], without the drag of the air. A kicked ball slides in the first half. None
            without such a segment.
        warnings: lines about what to know before using the numbers; empty if there is nothing.
    """

    track: Track
    parts: tuple[Segment, ...]
    restitution: Measured | None
    friction: Measured | None
    rolling_deceleration: Measured | None
    warnings: tuple[str, ...]

    def __str__(self) -> str:
        """Return a line for each part, and for each coefficient of the ground."""
        lines = ["kind       samples        time [s]       begins by   speed [m/s]"]
        for segment in self.parts:
            begin, end = self.track.times[[segment.first, segment.last - 1]]
            speed = float(np.linalg.norm(segment.velocity_after))
            lines.append(
                f"{segment.kind:9} {segment.first:5}-{segment.last:<5} {begin:8.2f}-{end:<8.2f} "
                f"{segment.begins:9} {speed:8.2f}"
            )
        for name in COEFFICIENTS:
            value = getattr(self, name)
            if value is not None:
                lines.append(f"{name.replace('_', ' ')}: {value}")
        return "\n".join([*lines, *(f"warning: {line}" for line in self.warnings)])

    @property
    def flights(self) -> tuple[Track, ...]:
        """The parts in which the ball flies, without the samples near their cuts.

        Trackers smooth there: samples within 0.1 s of a cut are left out, but at most a tenth at
        each end.
        """
        flights = []
        for segment in self.parts:
            times = self.track.times[segment.first : segment.last]
            margin = min(SMOOTHED, SMOOTHED_FRACTION * float(times[-1] - times[0]))
            inside = np.flatnonzero((times > times[0] + margin) & (times < times[-1] - margin))
            if segment.kind is SegmentKind.FLIGHT and inside.size:
                first, last = segment.first + int(inside[0]), segment.first + int(inside[-1])
                flights.append(self.track[first : last + 1])
        return tuple(flights)

    @property
    def surface(self) -> Surface:
        """The surface of the ground for `kickdyn.follow`, with the deviations of its coefficients.

        A lower bound of friction has no deviation: with it, the ball grips in all measured bounces.

        Raises:
            InvalidInput: the track has no bounce or no rolling segment, or the ball speeds up.
        """
        rolling = self.rolling_deceleration
        if rolling is not None and rolling.median < 0.0:
            raise InvalidInput(
                f"the rolling ball accelerates by {-rolling.median:.3g} m/s2: the ground must be "
                "level, and the z axis of the track must point up"
            )
        if self.restitution is None or self.friction is None or rolling is None:
            missing = "bounce" if self.restitution is None else "part in which the ball rolls"
            raise InvalidInput(f"the track has no {missing}: it does not determine a surface")
        return Surface(
            "measured",
            self.restitution.median,
            self.friction.median,
            rolling.median,
            source=f"{self.restitution.samples} bounces of a measured track",
            deviations={
                name: getattr(self, name).deviation
                for name in COEFFICIENTS
                if not getattr(self, name).is_lower_bound
            },
        )


LONGEST_CUBIC = 1.0
"""Longest time that one cubic is fitted to [s]; longer flights are joined afterwards."""

LEAST_NOISE = 0.012
"""Least noise of a coordinate that cuts and deviations are judged by [m]: cubics are no exact
flights, and trackers smooth."""

CONTACT_HEIGHT = 0.25
"""Height above rest on the ground below which a ball may touch it [m]: pitches are crowned, and
trackers do not all report the ball's centre."""

VELOCITY_WINDOW = 0.3
"""Time around a cut from which velocities just before and after it are taken [s]."""

ACCELERATION_DEVIATION, JERK_DEVIATION = 6.0, 15.0
"""How far a ball's acceleration differs from gravity's [m/s2], and how fast it changes [m/s3], as
standard deviations: drag and lift of a ball at 20 m/s, and their change within its flight."""

LEAST_ROLLING_TIME = 0.5
"""Duration of a rolling part from which its deceleration is taken [s]."""

FRICTION_DEVIATION, ROLLING_DEVIATION = 0.05, 0.3
"""Standard deviations of one bounce's friction and of one part's rolling deceleration [m/s2]: grass
is not level."""

LEAST_FALL, MOST_FALL = 4.0, 22.0
"""Downward accelerations between which a ball flies [m/s2]; lift and drag change gravity."""


class _Samples(NamedTuple):
    """Samples of a track without spikes, their indices in it, and a coordinate's noise [m]."""

    times: Array
    positions: Array
    indices: NDArray[np.intp]
    noise: float


class _Piece(NamedTuple):
    """Samples `first` to `last - 1`, polynomials in time from `middle`, `(k, 3)`, and the cost."""

    first: int
    last: int
    middle: float
    coefficients: Array
    cost: float

    @property
    def fall(self) -> float:
        return -float(self.derivative(self.middle, 2)[2])

    def derivative(self, times: float | Array, order: int) -> Array:
        """Return position, velocity or acceleration, for order 0, 1 or 2: `(3,)` or `(3, n)`."""
        coefficients = polynomial.polyder(self.coefficients, order)
        return np.asarray(polynomial.polyval(times - self.middle, coefficients))


@validation.check_arguments
def segments(
    track: Track, ball: Ball | None = None, ground: Ground | None = None, air: Air | None = None
) -> Segments:
    """Return the flights, rolls and rests of a track, with the reason for each cut.

    Args:
        track: measured positions of the centre of the ball.
        ball: the ball, whose radius tells when it is on the ground; None is `Ball()`.
        ground: the ground, of which the height counts; None is z = 0.
        air: the air, whose drag is not counted as rolling deceleration; None is `Air()`.

    Raises:
        InvalidInput: few samples, or a second or more apart, a track under the ground or not in
            metres.
    """
    ball, air = Ball() if ball is None else ball, Air() if air is None else air
    level = ground.height if ground is not None else 0.0
    check_samples(track)
    heights = track.positions[:, 2]  # trackers are off by up to CONTACT_HEIGHT
    # share of samples below the ground from which a track is refused
    if np.mean(heights < level - CONTACT_HEIGHT) > 0.1:
        lowest = int(np.argmin(heights))
        raise InvalidInput(
            f"the ball is at {heights[lowest]:.4g} m at {track.times[lowest]:.10g} s, under the "
            f"ground at {level:g} m: z must point up, or the ground is lower (--ground-height)"
        )
    noise = max(_noise(track), LEAST_NOISE)
    indices = _without_spikes(track, noise)
    samples = _Samples(track.times[indices], track.positions[indices], indices, noise)
    pieces: list[_Piece] = []
    # time without a sample after which a new segment begins [s]
    gaps = [int(k) for k in np.flatnonzero(np.diff(samples.times) > 0.25) + 1]
    for first, last in zip([0, *gaps], [*gaps, len(indices)], strict=True):
        pieces += _joined(samples, _partition(samples, first, last))
    falls = [piece.fall for piece in pieces if piece.last - piece.first >= 8]
    falling = [fall for fall in falls if fall > LEAST_FALL]
    fall = float(np.median(falling)) if falling else 0.0
    refuse_units(track, fall)
    segments, deviations = _described(samples, pieces, level + ball.radius, gaps)
    restitution, friction = _at_bounces(track, segments, deviations, ball)
    rolling_deceleration = _rolling_deceleration(samples, segments, ball, air)
    warnings = [*ball.warnings, *doubts_of_track(track, fall)]
    if not falling and any(segment.kind is SegmentKind.OTHER for segment in segments):
        warnings.append(
            "the ball never falls along z, which must point up: name the columns t,z,x,y if y "
            "points up in the track, or t,y,z,x if x does (--columns)"
        )
    if friction is not None and friction.is_lower_bound:
        warnings.append("no bounce shows that the ball slid to its end: friction may be higher")
    return Segments(track, segments, restitution, friction, rolling_deceleration, tuple(warnings))


def _noise(track: Track) -> float:
    """Return the noise of a coordinate [m] from third differences, which smooth motion has not."""
    if len(track) < 8:
        return LEAST_NOISE
    differences = np.diff(track.positions, 3, axis=0)
    return 1.4826 * float(np.median(np.abs(differences))) / math.sqrt(20.0)


def _without_spikes(track: Track, noise: float) -> NDArray[np.intp]:
    """Return the indices of samples that are near the parabola of two before and two after."""
    inliers = np.ones(len(track), dtype=bool)
    for _ in range(2):
        indices = np.flatnonzero(inliers)
        times, points = track.times[indices], track.positions[indices]
        for k in range(2, len(indices) - 2):
            neighbours = [k - 2, k - 1, k + 1, k + 2]
            design = np.vander(times[neighbours] - times[k], 3)
            fit, *_ = np.linalg.lstsq(design, points[neighbours], rcond=None)
            rough = float(np.abs(design @ fit - points[neighbours]).max())
            if np.abs(fit[2] - points[k]).max() > 10.0 * noise + 4.0 * rough:
                inliers[indices[k]] = False
    return np.flatnonzero(inliers)


def _fitted(samples: _Samples, first: int, last: int, degree: int) -> _Piece:
    """Return polynomials of a degree, or of the highest that the samples allow, fitted to them."""
    times, points = samples.times[first:last], samples.positions[first:last]
    middle = 0.5 * float(times[0] + times[-1])
    degree = min(degree, last - first - 1)
    fit = np.asarray(polynomial.polyfit(times - middle, points, degree), dtype=float)
    residuals = (polynomial.polyval(times - middle, fit).T - points) / samples.noise
    return _Piece(first, last, middle, fit, float((residuals**2).sum()))


def _partition(samples: _Samples, start: int, stop: int) -> list[tuple[int, int]]:
    count, price = stop - start, 12 * math.log(samples.positions.size)
    best = np.full(count + 1, math.inf)  # cost of the samples before
    best[0] = 0.0
    previous_cut = np.zeros(count + 1, dtype=int)
    for i in range(count):
        times = samples.times[start + i : stop]
        reach = int(np.searchsorted(times, times[0] + LONGEST_CUBIC, side="right"))
        costs = _cubic_costs(times[:reach], samples.positions[start + i : start + i + reach])
        total = best[i] + costs / samples.noise**2 + price
        ends = slice(i + 1, i + 1 + reach)
        better = total < best[ends]
        best[ends] = np.where(better, total, best[ends])
        previous_cut[ends] = np.where(better, i, previous_cut[ends])
    cuts = [count]
    while cuts[-1]:
        cuts.append(int(previous_cut[cuts[-1]]))
    return [(start + a, start + b) for a, b in pairwise(reversed(cuts))]


def _cubic_costs(times: Array, points: Array) -> Array:
    """Return the squared residuals of cubics through the first 1, 2, ... samples, shape `(n,)`."""
    t = (times - times[0]) / LONGEST_CUBIC
    y = points - points[0]
    powers = np.vander(t, 4, increasing=True)
    normal = np.cumsum(powers[:, :, None] * powers[:, None, :], axis=0)
    right = np.cumsum(powers[:, :, None] * y[:, None, :], axis=0)
    squares = np.cumsum((y * y).sum(axis=1))
    costs = np.zeros(len(t))
    if len(t) > 4:
        solved = np.linalg.solve(normal[4:], right[4:])
        costs[4:] = np.maximum(squares[4:] - (solved * right[4:]).sum(axis=(1, 2)), 0.0)
    return costs


def _joined(samples: _Samples, cuts: list[tuple[int, int]]) -> list[_Piece]:
    """Return pieces; neighbours are joined if a quintic follows both as well.

    A short piece, of a touch that trackers smooth, is divided if two quintics do as well.
    """
    pieces = [_fitted(samples, first, last, 3) for first, last in cuts]
    price = 6 * math.log(samples.positions.size)
    i = 0
    while i + 1 < len(pieces):
        left, right = pieces[i], pieces[i + 1]
        joined = _fitted(samples, left.first, right.last, 5)
        if joined.cost - left.cost - right.cost < price:
            pieces[i : i + 2] = [joined]
            i = max(i - 1, 0)
        else:
            i += 1
    i = 1
    while i + 1 < len(pieces):
        left, middle, right = pieces[i - 1 : i + 2]
        # samples of a piece that may be an artefact of two cuts for one touch
        if middle.last - middle.first <= 15:
            choices = [
                [_fitted(samples, left.first, cut, 5), _fitted(samples, cut, right.last, 5)]
                for cut in range(middle.first, middle.last + 1)
            ]
            costs = [before.cost + after.cost for before, after in choices]
            if min(costs) < left.cost + middle.cost + right.cost + price:
                pieces[i - 1 : i + 2] = choices[int(np.argmin(costs))]
                continue
        i += 1
    return pieces


def _described(
    samples: _Samples, pieces: list[_Piece], rest_height: float, gaps: list[int]
) -> tuple[tuple[Segment, ...], list[tuple[float, float]]]:
    """Return the motion of each piece, why it begins, and deviations of both velocities [m/s]."""
    segments: list[Segment] = []
    deviations: list[tuple[float, float]] = []
    kinds = [_kind(samples, piece, rest_height) for piece in pieces]
    for i, (piece, kind) in enumerate(zip(pieces, kinds, strict=True)):
        start, before, spread = float(samples.times[piece.first]), None, 0.0
        begins = CutReason.START if i == 0 else CutReason.GAP
        if i > 0 and piece.first not in gaps:
            # they meet where they are nearest to each other, around the cut between them
            last, next_one = samples.times[[pieces[i - 1].last - 1, piece.first]]
            times = np.linspace(2.0 * last - next_one, 2.0 * next_one - last, 61)
            gaps_there = pieces[i - 1].derivative(times, 0) - piece.derivative(times, 0)
            start = float(times[int(np.argmin(np.linalg.norm(gaps_there, axis=0)))])
            before, spread = _velocity(samples, pieces[i - 1], start, kinds[i - 1])
        after, deviation = _velocity(samples, piece, start, kind)
        deviations.append((spread, deviation))
        if before is not None:
            begins = CutReason.TOUCH
            height = float(piece.derivative(start, 0)[2]) - rest_height
            down, up = -float(before[2]), float(after[2])
            if kinds[i - 1] not in ON_GROUND and height < CONTACT_HEIGHT and down > 0.0:
                along = math.hypot(*(after - before)[:2])
                faster = up - down > 2.0 * math.hypot(spread, deviation)
                if kind in ON_GROUND:
                    begins = CutReason.LANDING
                # a bounce changes the velocity less along the ground than across it
                elif up > 0.0 and not faster and along < up + down:
                    begins = CutReason.BOUNCE
        first, last = int(samples.indices[piece.first]), int(samples.indices[piece.last - 1]) + 1
        segments.append(Segment(kind, first, last, begins, start, before, after))
    return tuple(segments), deviations


def _velocity(
    samples: _Samples, piece: _Piece, time: float, kind: SegmentKind
) -> tuple[Array, float]:
    """Return the velocity in a piece near one of its ends, shape `(3,)`, and its deviation [m/s].

    A cubic is fitted to the samples within `VELOCITY_WINDOW`, and to what is known of the
    acceleration and its change: a few noisy samples after a bounce do not determine them.
    """
    acceleration = np.array([0.0, 0.0, 0.0 if kind in ON_GROUND else -GRAVITY])
    times = samples.times[piece.first : piece.last] - time
    sixth_nearest = float(np.sort(np.abs(times))[min(5, len(times) - 1)])
    within = np.abs(times) <= max(VELOCITY_WINDOW, sixth_nearest)
    t, weight = times[within], 1.0 / samples.noise
    powers = np.column_stack([np.ones_like(t), t, t**2 / 2.0, t**3 / 6.0])
    prior = np.array([[0, 0, 1 / ACCELERATION_DEVIATION, 0], [0, 0, 0, 1 / JERK_DEVIATION]])
    points = samples.positions[piece.first : piece.last][within]
    wanted = np.vstack([points * weight, acceleration / ACCELERATION_DEVIATION, np.zeros(3)])
    design = np.vstack([powers * weight, prior])
    fit, *_ = np.linalg.lstsq(design, wanted)
    return np.asarray(fit[1]), math.sqrt(np.linalg.inv(design.T @ design)[1, 1])


def _kind(samples: _Samples, piece: _Piece, rest_height: float) -> SegmentKind:
    heights = samples.positions[piece.first : piece.last, 2]
    if len(heights) < 4:
        return SegmentKind.OTHER
    # vertical acceleration above which a ball does not roll [m/s2]
    # change of height of a ball that rolls [m], within one segment
    is_level = float(np.ptp(heights)) < 0.15 and abs(piece.fall) < 2.0
    # a ball that falls along a horizontal axis: the track's z is not up
    if samples.times[piece.last - 1] - samples.times[piece.first] > LEAST_ROLLING_TIME:
        is_level &= math.hypot(*piece.derivative(piece.middle, 2)[:2]) < LEAST_FALL
    if is_level and float(heights.max()) < rest_height + CONTACT_HEIGHT:
        speed = float(np.linalg.norm(piece.derivative(piece.middle, 1)))
        # speed below which a ball on the ground counts as at rest [m/s]
        return SegmentKind.REST if speed < 0.3 else SegmentKind.ROLLING
    return SegmentKind.FLIGHT if LEAST_FALL < piece.fall < MOST_FALL else SegmentKind.OTHER


def _at_bounces(
    track: Track,
    segments: Sequence[Segment],
    deviations: Sequence[tuple[float, float]],
    ball: Ball,
) -> tuple[Measured | None, Measured | None]:
    """Return restitution and friction at bounces, None without any.

    A ball slides to the end of a bounce if slip is left that the next bounce takes away. Friction
    changes the slip by 1 + m r^2 / I times the velocity, and flight as the velocity.
    """
    slip_per_change = 1.0 + ball.turning * ball.mass
    restitutions, ratios, sliding_ratios = [], [], []
    for i, segment in enumerate(segments):
        if segment.begins is not CutReason.BOUNCE or segment.velocity_before is None:
            continue
        following = segments[i + 1] if i + 1 < len(segments) else None
        at_change = math.hypot(*deviations[i])
        before, after = -float(segment.velocity_before[2]), float(segment.velocity_after[2])
        # a piece that lasts longer than a flight with its speed has more small bounces in it
        if track.times[segment.last - 1] - segment.start > 2.0 * after / LEAST_FALL:
            continue
        deviation = math.hypot(deviations[i][1], deviations[i][0] * after / before) / before
        restitutions.append((after / before, deviation))
        change = segment.velocity_after - segment.velocity_before
        size = math.hypot(*change[:2])
        deviation = math.hypot(FRICTION_DEVIATION, at_change / float(change[2]))
        ratios.append((size / float(change[2]), deviation))
        if following is None or following.velocity_before is None or not size:
            continue
        next_change = following.velocity_after - following.velocity_before
        slowing = following.velocity_before - segment.velocity_after
        slip_left = (slip_per_change * next_change + slowing)[:2] @ change[:2] / size
        unevenness = FRICTION_DEVIATION * abs(float(next_change[2]))
        deviation = slip_per_change * math.hypot(unevenness, *deviations[i + 1])
        on_ground = following.begins in (CutReason.BOUNCE, CutReason.LANDING)
        if on_ground and slip_left > 2.0 * deviation:
            sliding_ratios.append(ratios[-1])
    friction = _median(sliding_ratios)
    if ratios and not sliding_ratios:
        largest, deviation = max(ratios, key=lambda ratio: ratio[0] - 2.0 * ratio[1])
        friction = Measured(largest, deviation, len(ratios), is_lower_bound=True)
    return _median(restitutions), friction


def _rolling_deceleration(
    samples: _Samples, segments: Iterable[Segment], ball: Ball, air: Air
) -> Measured | None:
    decelerations: list[tuple[float, float]] = []
    drag = acceleration_function(ball, air)
    heavier = 1.0 + ball.inertia / (ball.mass * ball.radius**2)
    for segment in segments:
        first, last = np.searchsorted(samples.indices, (segment.first, segment.last)).tolist()
        middle = (first + last) // 2
        if segment.kind is not SegmentKind.ROLLING or last - middle < 6:
            continue
        times, points = samples.times[middle:last], samples.positions[middle:last, :2]
        if times[-1] - samples.times[first] < LEAST_ROLLING_TIME:
            continue
        curvature, velocity, _ = np.polyfit(times - times.mean(), points, 2)
        ax, ay, *_ = drag(0.0, float(velocity[0]), float(velocity[1]), 0.0, 0.0, 0.0, 0.0)
        by_ground = 2.0 * curvature - np.array([ax, ay]) / heavier
        speed = max(math.hypot(*velocity), 1e-300)
        decelerations.append((-float(by_ground @ velocity) / speed, ROLLING_DEVIATION))
    median = _median(decelerations)
    return median and median._replace(kind="rolling part", unit="m/s2")


def _median(measurements: Sequence[tuple[float, float]]) -> Measured | None:
    """Return the median of values with deviations, which bound its own from below, or None."""
    if not measurements:
        return None
    values, deviations = np.array(measurements).T
    median = float(np.median(values))
    spread = 1.4826 * float(np.median(np.abs(values - median)))
    largest = max(spread, float(np.median(deviations)))
    efficiency = 1.2533 if len(values) > 2 else 1.0
    return Measured(median, efficiency * largest / math.sqrt(len(values)), len(values))
