"""The result of `segments`: the parts of a track, and the properties of the ground."""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from kickdyn.core.representation import Printed
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.ground import Surface
from kickdyn.identification.track import Track

COEFFICIENTS = ("restitution", "friction", "rolling_deceleration")
"""What the bounces and the rolling say of the ground."""

SMOOTHED, SMOOTHED_FRACTION = 0.1, 0.1
"""Time after and before a cut in which trackers smooth over the corner [s]; and the fraction of a
flight that is left out at most at either end."""


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
