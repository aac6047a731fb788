r"""`segments`: a track cut into flights, rolling and rest, and what each bounce says of the ground.

Between two touches each coordinate is nearly a cubic in time (drag and lift change slowly). The
cuts are those that minimise

.. math:: \sum_{\text{segments}} \Big( \frac{1}{\sigma^2} \sum_k |y_k - c(t_k)|^2 + \beta \Big)

over all partitions of the samples, with :math:`\sigma` the noise and :math:`\beta` the price of 12
coefficients by the Bayesian information criterion, found by dynamic programming (Jackson et al.
2005, IEEE Signal Process. Lett. 12:105).
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.core.gravity import GRAVITY
from kickdyn.core.representation import Printed
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.forces import acceleration_function
from kickdyn.ground import Ground, Surface
from kickdyn.identification.track import Track, refuse_intervals, refuse_units

LONGEST = 1.0
"""Longest time that one cubic is fitted to [s]; longer flights are joined afterwards."""

LEAST_NOISE = 0.012
"""Least noise of a coordinate that cuts are judged by [m]: cubics are no exact flights."""

SHORT = 15
"""Samples of a piece that may be an artefact of two cuts for one touch."""

GAP = 0.25
"""Time without a sample after which a new segment begins [s]."""

ON_GROUND = 0.25
"""Height above rest on the ground below which a ball may touch it [m]: pitches are crowned, and
trackers do not all report the ball's centre."""

NEAR = 0.3
"""Time around a cut from which velocities just before and after it are taken [s]."""

ACCELERATION, JERK = 6.0, 15.0
"""How far a ball's acceleration differs from gravity's [m/s2], and how fast it changes [m/s3], as
standard deviations: drag and lift of a ball at 20 m/s, and their change within its flight."""

LEVEL = 0.15
"""Change of height of a ball that rolls [m], within one part."""

SMOOTHED, SMOOTHED_SHARE = 0.1, 0.1
"""Time after and before a cut in which positions are those of a smoothed corner [s], and the share
of the flight that it is at most."""

LONG_ROLL = 0.5
"""Duration of a rolling part from which its deceleration is taken [s]."""

LEAST_ROLLING = 1e-3
"""Least rolling deceleration of a measured surface [m/s2]: measurements can give one below 0."""

FRICTION_DEVIATION, ROLLING_DEVIATION = 0.05, 0.3
"""Standard deviations of one bounce's friction and of one part's rolling deceleration [m/s2]: grass
is not level."""

MOST_FRICTION = 1.0
"""Ratio of the changes of velocity along and across the ground above which it was no bounce."""

SLIDES = 0.1
"""Share of the slip before a bounce that is left after it, from which the ball slid to the end."""

MEASURED = ("restitution", "friction", "rolling_deceleration")
"""What the bounces and the rolling say of the ground."""

UNDERGROUND = 0.1
"""Share of samples below the ground from which a track is refused."""

SLOW = 0.3
"""Speed below which a ball on the ground counts as at rest [m/s]."""


class SegmentKind(StrEnum):
    """What the ball does in a part of a track."""

    FLIGHT = "flight"
    ROLLING = "rolling"
    REST = "rest"
    OTHER = "other"


class CutReason(StrEnum):
    """Why a part of a track begins where it does."""

    START = "start"
    BOUNCE = "bounce"
    TOUCH = "touch"
    LANDING = "landing"
    GAP = "gap"


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
        end_velocity: just before the segment's end, shape `(3,)` [m/s].
    """

    kind: SegmentKind
    first: int
    last: int
    begins: CutReason
    start: float
    velocity_before: Array | None
    velocity_after: Array
    end_velocity: Array

    def __len__(self) -> int:
        """Return the number of samples."""
        return self.last - self.first


class Measured(NamedTuple):
    """A median of several measurements, its standard deviation, their number, kind and unit.

    The median, because a bounce beside a player's foot looks like any other.
    """

    median: float
    deviation: float
    samples: int
    kind: str = "bounce"
    unit: str = ""

    def __str__(self) -> str:
        value = f"{self.median:.3g} +- {self.deviation:.2g} {self.unit}".rstrip()
        return f"{value} (of {self.samples} {self.kind}{'s' if self.samples > 1 else ''})"


@dataclass(frozen=True, eq=False, repr=False)
class Segments(Printed):
    r"""The parts of a track, and the coefficients of the ground that follow from them.

    Attributes:
        track: the whole track.
        parts: the parts, in the order of time.
        restitution: restitution of the bounces, :math:`-v_z^+ / v_z^-`; None without a bounce.
        friction: ratio of the impulses along and across the ground,
            :math:`|\Delta v_{xy}| / \Delta v_z`, of the bounces in which the ball slid to the end.
            A ball that comes from a touch is taken to have no spin, one that comes from a bounce to
            have the spin that the bounce gave it. Where no ball slid, it is the largest of all
            ratios; `warnings` then says that friction may be higher. None without a bounce.
        rolling_deceleration: deceleration in the second halves of the parts in which the ball rolls
            [m/s2], without the drag of the air. A kicked ball slides in the first half. None
            without such a part.
        warnings: lines about what to know before using the numbers; empty if there is nothing.
    """

    track: Track
    parts: tuple[Segment, ...]
    restitution: Measured | None
    friction: Measured | None
    rolling_deceleration: Measured | None
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return a line for each part, and what the bounces and the rolling say."""
        lines = ["kind       samples        time [s]       begins by   speed [m/s]"]
        for part in self.parts:
            first, last = self.track.times[[part.first, part.last - 1]]
            speed = float(np.linalg.norm(part.velocity_after))
            lines.append(
                f"{part.kind:9} {part.first:5}-{part.last:<5} {first:8.2f}-{last:<8.2f} "
                f"{part.begins:9} {speed:8.2f}"
            )
        for name in MEASURED:
            value = getattr(self, name)
            if value is not None:
                lines.append(f"{name.replace('_', ' ')}: {value}")
        return "\n".join([*lines, *(f"warning: {line}" for line in self.warnings)])

    @property
    def flights(self) -> tuple[Track, ...]:
        """The parts in which the ball flies, without the samples near their cuts.

        Tracking systems smooth over touches. The samples within 0.1 s of a cut are left out, but no
        more than a tenth of the flight at each end.
        """
        found = []
        for part in self.parts:
            times = self.track.times[part.first : part.last]
            margin = min(SMOOTHED, SMOOTHED_SHARE * float(times[-1] - times[0]))
            inside = (times > times[0] + margin) & (times < times[-1] - margin)
            if part.kind is SegmentKind.FLIGHT and inside.any():
                where = part.first + np.flatnonzero(inside)
                found.append(self.track[int(where[0]) : int(where[-1]) + 1])
        return tuple(found)

    @property
    def surface(self) -> Surface:
        """The surface of the ground for `kickdyn.follow`, with the deviations of its coefficients.

        Raises:
            InvalidInput: the track has no bounce, or no rolling part.
        """
        if self.restitution is None or self.friction is None or self.rolling_deceleration is None:
            missing = "bounce" if self.restitution is None else "part in which the ball rolls"
            raise InvalidInput(f"the track has no {missing}: it does not determine a surface")
        return Surface(
            "measured",
            min(max(self.restitution.median, 0.0), 1.0),
            max(self.friction.median, 0.0),
            max(self.rolling_deceleration.median, LEAST_ROLLING),
            source=f"{self.restitution.samples} bounces of a measured track",
            deviations={name: getattr(self, name).deviation for name in MEASURED},
        )


class _Piece(NamedTuple):
    """Samples first to last - 1 of the kept ones, and polynomials fitted to them.

    Attributes:
        first, last: indices.
        origin: time that the polynomials count from [s].
        coefficients: of the polynomials, lowest power first, shape `(k, 3)`.
        cost: sum of squared residuals over the squared noise.
    """

    first: int
    last: int
    origin: float
    coefficients: Array
    cost: float

    def at(self, time: float, order: int = 0) -> Array:
        """Return position, velocity or acceleration at a time."""
        powers = np.polynomial.polynomial.polyder(self.coefficients, order)
        return np.asarray(np.polynomial.polynomial.polyval(time - self.origin, powers))


@validation.check_arguments
def segments(
    track: Track,
    ball: Ball | None = None,
    ground: Ground | None = None,
    air: Air | None = None,
) -> Segments:
    """Return the flights, rolls and rests of a track, with the reason for each cut.

    Args:
        track: measured positions of the centre of the ball.
        ball: the ball, whose radius tells when it is on the ground; None is `Ball()`.
        ground: the ground, of which the height counts; None is z = 0.
        air: the air, whose drag is not counted as rolling deceleration; None is `Air()`.

    Raises:
        InvalidInput: fewer than 5 samples, samples a second or more apart, a track under the
            ground, or one whose ball falls as if the positions were not in metres; or a wrong
            argument.
    """
    ball, air = Ball() if ball is None else ball, Air() if air is None else air
    level = ground.height if ground is not None else 0.0
    if len(track) < 5:
        raise InvalidInput(f"track has {len(track)} samples: at least 5 are needed")
    refuse_intervals(track)
    _check_heights(track, level)
    height = level + ball.radius
    noise = max(_noise(track), LEAST_NOISE)
    kept = np.flatnonzero(_without_spikes(track, noise))
    clean = Track(track.times[kept], track.positions[kept])
    pieces: list[_Piece] = []
    gaps = np.flatnonzero(np.diff(clean.times) > GAP) + 1
    for first, last in zip([0, *gaps], [*gaps, len(clean)], strict=True):
        pieces += _joined(clean, noise, _partition(clean, noise, int(first), int(last)))
    _check_units(clean, pieces)
    parts = _described(clean, pieces, kept, height, set(gaps.tolist()), noise)
    friction, warnings = _friction(parts, ball)
    return Segments(
        track, parts, _restitution(parts, noise, track), friction,
        _rolling(clean, parts, kept, ball, air), warnings,
    )  # fmt: skip


def _check_heights(track: Track, level: float) -> None:
    """Raise `InvalidInput` for a track under the ground; trackers are off by `ON_GROUND`."""
    heights = track.positions[:, 2]
    if np.mean(heights < level - ON_GROUND) > UNDERGROUND:
        where = int(np.argmin(heights))
        raise InvalidInput(
            f"the ball is at {heights[where]:.4g} m at {track.times[where]:.10g} s, under the "
            f"ground at {level:g} m: z must point up; if the ground is lower, give its height "
            "(--ground-height)"
        )


def _check_units(track: Track, pieces: Sequence[_Piece]) -> None:
    """Raise `InvalidInput` where most that falls does so as in other units than metres."""
    falls = []
    for piece in pieces:
        if piece.last - piece.first >= 8:
            middle = 0.5 * float(track.times[piece.first] + track.times[piece.last - 1])
            falls.append(-float(piece.at(middle, 2)[2]))
    falling = np.array([fall for fall in falls if fall > 4.0])
    refuse_units(track, float(np.median(falling)) if falling.size else 0.0)


def _noise(track: Track) -> float:
    """Return the noise of a coordinate [m] from third differences, which smooth motion has not."""
    if len(track) < 8:
        return LEAST_NOISE
    differences = np.diff(track.positions, 3, axis=0)
    return 1.4826 * float(np.median(np.abs(differences))) / math.sqrt(20.0)


def _without_spikes(track: Track, noise: float) -> NDArray[np.bool_]:
    """Return which samples are no spikes: single ones far off a path that is smooth around them."""
    kept = np.ones(len(track), dtype=bool)
    for _ in range(2):
        where = np.flatnonzero(kept)
        times, points = track.times[where], track.positions[where]
        for k in range(2, len(where) - 2):
            around = [k - 2, k - 1, k + 1, k + 2]
            span = times[around] - times[k]
            design = np.vander(span, 3)
            fit, *_ = np.linalg.lstsq(design, points[around], rcond=None)
            rough = float(np.abs(design @ fit - points[around]).max())
            if np.abs(fit[2] - points[k]).max() > 10.0 * noise + 4.0 * rough:
                kept[where[k]] = False
    return kept


def _fitted(track: Track, noise: float, first: int, last: int, degree: int) -> _Piece:
    """Return polynomials of a degree, or what the samples allow, fitted to samples."""
    times, points = track.times[first:last], track.positions[first:last]
    origin = float(times.mean())
    span = max(float(times[-1] - times[0]), 1e-9)
    degree = min(degree, max(last - first - 1, 0))
    powers = np.vander((times - origin) / span, degree + 1, increasing=True)
    fit, *_ = np.linalg.lstsq(powers, points, rcond=None)
    rest = powers @ fit - points
    scale = span ** np.arange(degree + 1)
    return _Piece(first, last, origin, fit / scale[:, None], float((rest**2).sum()) / noise**2)


def _partition(track: Track, noise: float, start: int, stop: int) -> list[tuple[int, int]]:
    """Return the best partition of samples start to stop - 1 into cubics."""
    count = stop - start
    price = 12.0 * math.log(max(3 * len(track), 2))
    best = np.full(count + 1, math.inf)
    best[0] = 0.0
    before = np.zeros(count + 1, dtype=int)
    for i in range(count):
        times = track.times[start + i : stop]
        reach = int(np.searchsorted(times, times[0] + LONGEST, side="right"))
        costs = _cubic_costs(times[:reach], track.positions[start + i : start + i + reach])
        total = best[i] + costs / noise**2 + price
        ends = slice(i + 1, i + 1 + reach)
        better = total < best[ends]
        best[ends] = np.where(better, total, best[ends])
        before[ends] = np.where(better, i, before[ends])
    cuts = [count]
    while cuts[-1]:
        cuts.append(int(before[cuts[-1]]))
    cuts = cuts[::-1]
    return [(start + a, start + b) for a, b in pairwise(cuts)]


def _cubic_costs(times: Array, points: Array) -> Array:
    """Return the squared residuals of cubics through the first 1, 2, ... samples, shape `(n,)`."""
    t = (times - times[0]) / LONGEST
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


def _joined(track: Track, noise: float, cuts: list[tuple[int, int]]) -> list[_Piece]:
    """Return pieces, two neighbours made one wherever a quintic follows both as well."""
    pieces = [_fitted(track, noise, first, last, 3) for first, last in cuts]
    price = 6.0 * math.log(max(3 * len(track), 2))
    i = 0
    while i + 1 < len(pieces):
        left, right = pieces[i], pieces[i + 1]
        one = _fitted(track, noise, left.first, right.last, 5)
        if one.cost - left.cost - right.cost < price:
            pieces[i : i + 2] = [one]
            i = max(i - 1, 0)
        else:
            i += 1
    i = 1
    while i + 1 < len(pieces):
        two = _without_middle(track, noise, *pieces[i - 1 : i + 2])
        now = sum(piece.cost for piece in pieces[i - 1 : i + 2])
        if len(two) == 2 and two[0].cost + two[1].cost < now + price:
            pieces[i - 1 : i + 2] = two
        else:
            i += 1
    return pieces


def _without_middle(
    track: Track, noise: float, left: _Piece, middle: _Piece, right: _Piece
) -> tuple[_Piece, ...]:
    """Return two quintics that share the samples of a short middle piece best, or all three."""
    if middle.last - middle.first > SHORT:
        return left, middle, right
    choices = [
        (_fitted(track, noise, left.first, cut, 5), _fitted(track, noise, cut, right.last, 5))
        for cut in range(middle.first, middle.last + 1)
    ]
    return min(choices, key=lambda two: two[0].cost + two[1].cost)


def _described(
    track: Track,
    pieces: list[_Piece],
    kept: NDArray[np.int_],
    height: float,
    gaps: set[int],
    noise: float,
) -> tuple[Segment, ...]:
    """Return what each piece is and why it begins."""
    parts: list[Segment] = []
    kinds = [_kind(track, piece, height) for piece in pieces]
    for i, (piece, kind) in enumerate(zip(pieces, kinds, strict=True)):
        first, end = float(track.times[piece.first]), float(track.times[piece.last - 1])
        start, speed_before, begins = first, None, CutReason.START
        if i and piece.first not in gaps:
            start = _meeting(track, pieces[i - 1], piece)
        speed_after = _velocity(track, piece, start, kind, noise)
        if piece.first in gaps:
            begins = CutReason.GAP
        elif i:
            speed_before = _velocity(track, pieces[i - 1], start, kinds[i - 1], noise)
            low = float(piece.at(start)[2]) < height + ON_GROUND
            down, up = -float(speed_before[2]), float(speed_after[2])
            begins = CutReason.TOUCH
            if low and down > 0.0 and parts[-1].kind is SegmentKind.FLIGHT:
                along = float(np.hypot(*(speed_after - speed_before)[:2]))
                is_passive = 0.0 < up <= down and along < MOST_FRICTION * (up + down)
                if kind is SegmentKind.FLIGHT and is_passive:
                    begins = CutReason.BOUNCE
                elif kind in (SegmentKind.ROLLING, SegmentKind.REST):
                    begins = CutReason.LANDING
        parts.append(
            Segment(
                kind, int(kept[piece.first]), int(kept[piece.last - 1]) + 1, begins, start,
                speed_before, speed_after, _velocity(track, piece, end, kind, noise),
            )
        )  # fmt: skip
    return tuple(parts)


def _velocity(track: Track, piece: _Piece, time: float, kind: SegmentKind, noise: float) -> Array:
    """Return the velocity in a piece at a time near one of its ends, shape `(3,)` [m/s].

    It is that of a cubic through the samples within `NEAR` of it. What is known of its acceleration
    and its change (`ACCELERATION`, `JERK`) weighs as much as measurements of that accuracy would:
    a few noisy samples after a bounce do not determine them.
    """
    known = np.array([0.0, 0.0, -GRAVITY if kind is SegmentKind.FLIGHT else 0.0])
    times = track.times[piece.first : piece.last] - time
    near = np.abs(times) <= max(NEAR, float(np.sort(np.abs(times))[min(5, len(times) - 1)]))
    span = times[near]
    powers = np.column_stack([np.ones_like(span), span, span**2 / 2.0, span**3 / 6.0])
    rows = np.vstack([powers / noise, [0, 0, 1 / ACCELERATION, 0], [0, 0, 0, 1 / JERK]])
    points = track.positions[piece.first : piece.last][near] / noise
    fit, *_ = np.linalg.lstsq(rows, np.vstack([points, known / ACCELERATION, np.zeros(3)]))
    return np.asarray(fit[1])


def _kind(track: Track, piece: _Piece, height: float) -> SegmentKind:
    """Return what the ball does in a piece."""
    points = track.positions[piece.first : piece.last]
    if len(points) < 4:
        return SegmentKind.OTHER
    middle = 0.5 * float(track.times[piece.first] + track.times[piece.last - 1])
    falling = -float(piece.at(middle, 2)[2])
    level = float(np.ptp(points[:, 2])) < LEVEL and abs(falling) < 2.0
    if level and float(points[:, 2].max()) < height + ON_GROUND:
        speed = float(np.linalg.norm(piece.at(middle, 1)))
        return SegmentKind.REST if speed < SLOW else SegmentKind.ROLLING
    return SegmentKind.FLIGHT if 4.0 < falling < 22.0 else SegmentKind.OTHER


def _meeting(track: Track, left: _Piece, right: _Piece) -> float:
    """Return when two pieces are nearest to each other, around the cut between them [s]."""
    before, after = track.times[left.last - 1], track.times[right.first]
    margin = after - before
    times = np.linspace(before - margin, after + margin, 61)
    gaps = [float(np.linalg.norm(left.at(t) - right.at(t))) for t in times]
    return float(times[int(np.argmin(gaps))])


def _restitution(parts: Iterable[Segment], noise: float, track: Track) -> Measured | None:
    """Return the ratio of vertical speeds at bounces, None without any."""
    values, deviations = [], []
    for part in parts:
        if part.begins is CutReason.BOUNCE and part.velocity_before is not None:
            before, after = -float(part.velocity_before[2]), float(part.velocity_after[2])
            values.append(after / before)
            slope = _slope_deviation(track, noise)
            deviations.append(slope * math.hypot(1.0, after / before) / before)
    return _median(values, deviations)


def _friction(parts: Sequence[Segment], ball: Ball) -> tuple[Measured | None, tuple[str, ...]]:
    """Return the friction at bounces, None without any, and what to know of it.

    The slip of the contact point changes by 1 + m r^2 / I times the change of velocity.
    """
    ratios, sliding = [], []
    shell = 1.0 + ball.mass * ball.radius**2 / ball.inertia if ball.inertia else math.inf
    slip: Array | None = None
    for before, part in pairwise(parts):
        if part.begins is not CutReason.BOUNCE or part.velocity_before is None:
            slip = None
            continue
        if slip is None:
            slip = part.velocity_before[:2]
        else:  # in flight the spin stays, the velocity changes
            slip = slip + part.velocity_before[:2] - before.velocity_after[:2]
        change = part.velocity_after - part.velocity_before
        ratio = float(np.hypot(change[0], change[1]) / change[2])
        left = slip + shell * change[:2]
        ratios.append(ratio)
        least = 2.0 * FRICTION_DEVIATION * shell * float(change[2])  # a smaller slip is noise
        if float(np.hypot(*slip)) > least and float(left @ slip) > SLIDES * float(slip @ slip):
            sliding.append(ratio)
        slip = left
    if sliding or not ratios:
        return _median(sliding, [FRICTION_DEVIATION] * len(sliding)), ()
    largest = Measured(max(ratios), FRICTION_DEVIATION, len(ratios))
    line = f"the ball gripped the ground at all bounces: friction is at least {max(ratios):.2g}"
    return largest, (line,)


def _rolling(
    track: Track, parts: Iterable[Segment], kept: NDArray[np.int_], ball: Ball, air: Air
) -> Measured | None:
    """Return the deceleration of rolling balls without that by drag [m/s2], None without any."""
    decelerations = []
    drag = acceleration_function(ball, air)
    for part in parts:
        inside = np.flatnonzero((kept >= part.first) & (kept < part.last))
        late = inside[len(inside) // 2 :]
        if part.kind is not SegmentKind.ROLLING or len(late) < 6:
            continue
        times, points = track.times[late], track.positions[late, :2]
        if track.times[inside[-1]] - track.times[inside[0]] < LONG_ROLL:
            continue
        fit = np.polyfit(times - times.mean(), points, 2)
        speed = max(float(np.linalg.norm(fit[1])), 1e-300)
        ax, ay, *_ = drag(0.0, float(fit[1][0]), float(fit[1][1]), 0.0, 0.0, 0.0, 0.0)
        by_air = np.array([ax, ay]) / (1.0 + ball.inertia / (ball.mass * ball.radius**2))
        decelerations.append(float((by_air - 2.0 * fit[0]) @ fit[1]) / speed)
    found = _median(decelerations, [ROLLING_DEVIATION] * len(decelerations))
    return found and found._replace(kind="rolling part", unit="m/s2")


def _slope_deviation(track: Track, noise: float) -> float:
    r"""Return the standard deviation of a velocity at the end of `NEAR` seconds of samples [m/s].

    That of a parabola's slope at its end, :math:`\sigma \sqrt{192 / n} / T`.
    """
    step = float(np.median(np.diff(track.times)))
    return noise * math.sqrt(192.0 / max(NEAR / step, 1.0)) / NEAR


def _median(values: Sequence[float], deviations: Sequence[float]) -> Measured | None:
    """Return the median with its standard deviation, None without any values.

    The deviation is that of the median of a normal distribution, whose spread is estimated from the
    values, but is not below that of a single one over the root of their number.
    """
    if not values:
        return None
    middle, root = float(np.median(values)), math.sqrt(len(values))
    spread = 1.4826 * float(np.median(np.abs(np.array(values) - middle)))
    least = float(np.median(deviations))
    return Measured(middle, 1.2533 * max(spread, least) / root, len(values))
