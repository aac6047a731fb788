"""`LegMotion`: the measured motion of a leg over time, and `ContactMotion`, that at an impact."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.plot_style import COLUMN_WIDTH, styled
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array, read_only
from kickdyn.errors import InvalidInput
from kickdyn.identification.marker_kinematics import FittedLeg
from kickdyn.identification.smoothing_spline import GROWTH, GROWTH_TIME, SmoothingSpline
from kickdyn.identification.track import LEAST_SAMPLES, Track, refuse_units
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.surgery import has_floating_base

MEAN_TIME, MEAN_TIME_DEVIATION = 0.0044, 0.0007
"""Mean time of the force from the beginning of the contact, and its standard deviation [s]. Visible
contacts last 9 to 14 ms (Ball et al., ISBS 2013), and the ball accelerates in about the first 3/4
of them (Nunome et al., ISBS 2012): half of that is 3.4 to 5.3 ms."""

FLIES_AFTER = 0.015
"""Time after the beginning of a contact at which the ball flies [s]."""

BALL_WINDOW = 0.1
"""Time before and after the contact in which quadratics follow the ball [s]."""

LEAST_CHANGE = 1.0
"""Change of a ball's velocity below which nothing struck it [m/s]."""

LEAST_FRAMES = 8
"""Fewer frames before a contact do not determine a velocity with its deviation."""

CONTACT_WINDOW = GROWTH_TIME
"""Time before a contact whose frames the motion at the contact is smoothed from [s]."""

LONGEST_GAP, LONGEST_UNSEEN = 3.0, 0.02
"""Frames, and time [s], without markers that determine the whole leg just before a contact: the
larger of both may pass."""

SHORT_TIME = 1e-3
"""Time in which a derivative by time is taken [s]."""

DRAWN_TIMES = 200
"""Number of times that are drawn in each part of the motion."""

LARGEST_RATIO_TO_MEDIAN = 2.5
"""Larger residuals of a marker, over the median of all, have a warning. In the measured kicks of
`data/`, noise alone gives 1.1, and a leg that is 3 % too long gives 3."""

RANGE_MARGIN = math.radians(10.0)
"""Angle outside the range of a joint that persons reach [rad]."""

LARGEST_TILT = 60.0
"""Tilt of a pelvis [deg] above which the vertical axis of the track is in doubt."""


class Moment(NamedTuple):
    """A time [s] and its standard deviation [s]."""

    time: float
    deviation: float


class BallSide(NamedTuple):
    """A ball on one side of a contact: position and velocity there, `(3,)`, and the deviations."""

    position: Array
    velocity: Array
    position_deviation: Array
    velocity_deviation: Array


def ball_side(track: Track, side: str, begin: float, end: float, moment: float) -> BallSide:
    """Return position and velocity at a moment, by quadratics through the samples of a side."""
    chosen = (track.times >= begin) & (track.times <= end)
    if chosen.sum() < LEAST_SAMPLES:
        raise InvalidInput(
            f"track of the ball has {int(chosen.sum())} samples {side} the contact, from "
            f"{begin:.4g} to {end:.4g} s: at least {LEAST_SAMPLES} are needed"
        )
    refuse_units(Track(track.times[chosen], track.positions[chosen]), 0.0)
    rows = np.vander(track.times[chosen] - moment, 3, increasing=True)
    fitted, *_ = np.linalg.lstsq(rows, track.positions[chosen], rcond=None)
    missed = track.positions[chosen] - rows @ fitted
    variance = (missed**2).sum(axis=0) / max(len(rows) - 3, 1)
    inverse = np.linalg.inv(rows.T @ rows)
    fall, spread = 2.0 * fitted[2], 8.0 * np.sqrt(variance * inverse[2, 2])
    if fall[1] + spread[1] < -0.5 * GRAVITY and fall[2] - spread[2] > -0.5 * GRAVITY:
        raise InvalidInput(
            f"the ball falls along y {side} the contact, with {-fall[1]:.2g} m/s2: positions of "
            "its track must have z up"
        )
    return BallSide(*fitted[:2], *(np.sqrt(variance * inverse[i, i]) for i in (0, 1)))


def contact_moment(name: str, value: float | Sequence[float] | Track) -> Moment:
    r"""Return the time of a contact: a number, a number and its deviation, or from a track.

    The ball's velocity changes by :math:`\Delta v` during the contact. The quadratics through its
    positions before and after, extrapolated along :math:`\Delta v`, meet at the mean time of the
    force, :math:`\int t F \, dt / \int F \, dt`; the contact begins earlier.
    """
    if isinstance(value, Track):
        return _from_track(value)
    deviation = 0.0
    if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str):
        if len(value) != 2:
            raise InvalidInput(
                f"{name} is {validation.brief(list(value))}: it must be a time [s], (time, its "
                "standard deviation), or the track of the ball"
            )
        value, spread = value
        deviation = validation.number(f"deviation of {name}", spread, at_least=0, unit="s")
    return Moment(validation.number(name, value, unit="s"), deviation)


def _from_track(track: Track) -> Moment:
    times = track.times
    if len(track) < 2 * LEAST_SAMPLES:
        needed = f"at least {2 * LEAST_SAMPLES} are needed"
        raise InvalidInput(f"track of the ball has {len(track)} samples: {needed}")
    # the largest change of velocity over the duration of a contact gives its rough place; mean
    # velocities of several samples, so that noise alone is no change
    span = LEAST_SAMPLES - 1
    displacements, lasted = (x[span:] - x[:-span] for x in (track.positions, times))
    means = displacements / lasted[:, None]
    last = np.arange(span, len(times))  # samples at which a contact may begin
    first = np.searchsorted(times, times[last] + FLIES_AFTER)
    last, first = last[first < len(means)], first[first < len(means)]
    changes = np.linalg.norm(means[first] - means[last - span], axis=1)
    _check_change(float(changes.max(initial=0.0)), track)
    moment = float(times[last[int(np.argmax(changes))]])
    for _ in range(10):
        before = ball_side(track, "before", moment - BALL_WINDOW, moment, moment)
        begin = moment + FLIES_AFTER
        after = ball_side(track, "after", begin, begin + BALL_WINDOW, moment)
        change = after.velocity - before.velocity
        size = float(np.linalg.norm(change))
        _check_change(size, track)
        along = change / size
        step = float(along @ (before.position - after.position)) / size - MEAN_TIME
        moment += step
        if abs(step) < 1e-9:
            break
    spread = np.hypot(before.position_deviation, after.position_deviation)
    measured = float(np.linalg.norm(along * spread)) / size
    return Moment(moment, float(np.hypot(measured, MEAN_TIME_DEVIATION)))


def _check_change(size: float, track: Track) -> None:
    if size < LEAST_CHANGE:
        raise InvalidInput(
            f"the velocity of the ball changes by {size:.2g} m/s at most from {track.times[0]:.4g} "
            f"to {track.times[-1]:.4g} s: a kick changes it by {LEAST_CHANGE:g} m/s or more"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ContactMotion(ReprMixin):
    """Posture and velocity of a leg just before a contact, with their covariance.

    Attributes:
        moment: time of the contact and its standard deviation, `(time, deviation)` [s].
        posture: the posture.
        v: joint velocity, shape `(nv,)` [rad/s; m/s for prismatic joints].
        covariance: of q, in its tangent space, and v, shape `(2 nv, 2 nv)`, the moment's included.
    """

    moment: Moment
    posture: Posture
    v: Array
    covariance: Array

    @property
    def q_deviations(self) -> Array:
        """Standard deviations of q, in its tangent space, shape `(nv,)` [rad; m]."""
        return np.sqrt(self.covariance.diagonal()[: self.v.size])

    @property
    def v_deviations(self) -> Array:
        """Standard deviations of the joint velocity, shape `(nv,)` [rad/s; m/s]."""
        return np.sqrt(self.covariance.diagonal()[self.v.size :])

    @property
    def foot_velocity(self) -> Array:
        """Velocity of the contact point, shape `(3,)` [m/s, world frame]."""
        return self.posture.point_velocity(self.v)

    def _rows(self) -> Iterable[Row]:
        leg = self.posture.leg
        yield "foot velocity", self.foot_velocity, "m/s"
        for name in leg.single_joints:
            k = leg.velocity_index(name)
            yield f"speed of {name}", f"{self.v[k]:.4g} +- {self.v_deviations[k]:.2g}", "rad/s"
        yield from warned(self.posture.warnings)


@dataclass(frozen=True, eq=False, repr=False)
class LegMotion(ReprMixin):
    """The motion of a leg that is fitted to markers or joint angles.

    Attributes:
        leg: the leg, with segments as long as the person's.
        times: times of the frames that count, shape `(n,)` [s].
        configurations: configuration of each of these frames alone, shape `(n, nq)` [rad; m]; what
            a frame's markers do not determine is as in the frame before.
        information: information matrix of each, in the tangent space, shape `(n, nv, nv)`.
        contact: time of the impact and its standard deviation, `(time, deviation)` [s], or None.
        noise: standard deviation of a coordinate of a marker [m], from the residuals.
        residuals: root mean square distance of each marker from the leg's [m], by name.
        scales: length of each segment over the length in the leg that was given, by joint.
        gaps: frames in which a marker is not seen, by name.
        undetermined: numbers of the frames of the track whose markers do not determine the whole
            configuration; the markers that are seen count all the same.
        notes: markers that may be swapped, and what of the track does not count.
        frames: numbers in the track of the frames that count.
        fitted: lengths of segments and places of markers with their covariance, if estimated.
    """

    leg: Leg
    times: Array
    configurations: Array
    information: Array
    contact: Moment | None
    noise: float
    residuals: Mapping[str, float]
    scales: Mapping[str, float]
    gaps: Mapping[str, tuple[int, ...]]
    undetermined: tuple[int, ...]
    notes: tuple[str, ...]
    frames: tuple[int, ...]
    fitted: FittedLeg | None = None

    def __post_init__(self) -> None:
        validation.protect(self.times, self.configurations, self.information)

    def q(self, t: float) -> Array:
        """Return the smoothed configuration at a time [s], shape `(nq,)` [rad; m]."""
        return self._piece_at(t).state(t)[0]

    def v(self, t: float) -> Array:
        """Return the smoothed joint velocity at a time [s], shape `(nv,)` [rad/s; m/s]."""
        return self._piece_at(t).state(t)[1]

    def deviations(self, t: float) -> tuple[Array, Array]:
        """Return the standard deviations of q and v at a time [s], each of shape `(nv,)`."""
        variances = self._piece_at(t).state(t)[2].diagonal()
        deviations = np.sqrt(np.maximum(variances, 0.0))
        return deviations[: self.leg.nv], deviations[self.leg.nv :]

    def at_contact(self, time: float | Sequence[float] | None = None) -> ContactMotion:
        r"""Return posture and joint velocity just before a contact, from the frames before it.

        A time with the deviation :math:`\sigma` adds :math:`\sigma^2 w w^T` to the covariance, with
        :math:`w = (v, \dot v)`, and frames less than :math:`\sigma` before it do not count. The
        covariance also has what the estimated lengths of segments and places of markers add.

        Args:
            time: time of the contact [s], or time and standard deviation; None is the one that
                `fit_motion` was given.

        Raises:
            InvalidInput: no time, a time without frames shortly before it, or too few of them.
        """
        contact = self.contact if time is None else contact_moment("time", time)
        if contact is None:
            raise InvalidInput("time is None: it is needed, as fit_motion had no contact")
        moment = contact.time
        window = (self.times < moment - contact.deviation) & (self.times >= moment - CONTACT_WINDOW)
        interval = float(np.median(np.diff(self.times)))
        complete = self.times[window & self._complete]
        longest = max(LONGEST_GAP * interval, LONGEST_UNSEEN)
        if len(complete) < LEAST_FRAMES or moment - contact.deviation - complete[-1] > longest:
            begin, end = self.times[self._complete][[0, -1]].tolist()
            gaps = [f"{name!r} in frame {frames[-1]}" for name, frames in self.gaps.items()]
            unseen = ", ".join(gaps[:3]) + (f", {len(gaps) - 3} others" if len(gaps) > 3 else "")
            raise InvalidInput(
                f"contact at {moment:g} s: {len(complete)} frames of the {CONTACT_WINDOW:g} s "
                f"before it determine the leg; at least {LEAST_FRAMES} must, the last one at most "
                f"{longest:.3g} s before the contact. Such frames are from {begin:g} to {end:g} s; "
                f"last gaps: {unseen or 'none'}; three markers on each segment that are not on one "
                "line are always enough"
            )
        spline = self._smoothed(window, GROWTH)
        q, v, covariance = spline.state(moment)
        change = contact.deviation * spline.rate(moment)
        covariance += np.outer(change, change)
        if self.fitted is not None:
            earlier = self.fitted.slopes(spline.state(moment - SHORT_TIME)[0])
            slopes = self.fitted.slopes(q)
            slopes = np.vstack([slopes, (slopes - earlier) / SHORT_TIME])
            covariance += slopes @ self.fitted.covariance @ slopes.T
        return ContactMotion(contact, self.leg.posture(q), read_only(v), read_only(covariance))

    @property
    def _complete(self) -> Any:
        """Whether the markers of each frame determine the whole configuration."""
        return ~np.isin(self.frames, self.undetermined)

    @validation.check_arguments
    @styled()
    def plot(self, joints: Sequence[str] | None = None) -> Any:
        """Return a matplotlib Figure of joint angles and speeds, one journal column wide.

        It shows 0.15 s before the contact and 0.05 s after it, or the whole motion without a
        contact, with bands of 95 %. `joints` are names of joints of one angle each; None draws all.
        """
        from matplotlib.figure import Figure

        available, moment = self.leg.single_joints, self.contact and self.contact.time
        names = available if joints is None else list(joints)
        if not names or not set(names) <= set(available):
            raise InvalidInput(f"joints is {names}: it must name some of {', '.join(available)}")
        begin, end = self.times[[0, -1]].tolist()
        if moment is not None:
            # time after a contact that a plot shows [s]
            begin, end = moment - CONTACT_WINDOW, moment + 0.05
        figure = Figure(figsize=(COLUMN_WIDTH, 4.2))
        angles, speeds = figure.subplots(2, 1, sharex=True)
        model = self.leg.workspace.model
        numbers = [model.getJointId(name) for name in names]
        places, columns = ([of[i] for i in numbers] for of in (model.idx_qs, model.idx_vs))
        labels = [name.replace("$", r"\$") for name in names]  # "$" begins a formula
        for piece in self._pieces:
            first, last = max(begin, piece.begin), min(end, piece.end)
            if first >= last:
                continue
            t = np.linspace(first, last, DRAWN_TIMES)
            ms = 1e3 * (t - (moment or 0.0))
            states = [piece.state(x) for x in t]
            q, v = (np.array([state[k] for state in states]) for k in (0, 1))
            variances = np.array([state[2].diagonal() for state in states])
            sigma_q, sigma_v = np.hsplit(np.sqrt(np.maximum(variances, 0.0)), 2)
            for axes, values, sigma in (
                (angles, np.degrees(q[:, places]), np.degrees(sigma_q[:, columns])),
                (speeds, v[:, columns], sigma_v[:, columns]),
            ):
                axes.set_prop_cycle(None)
                for label, mean, wide in zip(labels, values.T, 1.96 * sigma.T, strict=True):
                    (line,) = axes.plot(ms, mean, label=label, linewidth=1.2)
                    shade = {"color": line.get_color(), "alpha": 0.25}
                    axes.fill_between(ms, mean - wide, mean + wide, **shade)
            labels = ["_"] * len(names)  # only the first piece has a legend
        angles.set_ylabel("angle [deg]")
        speeds.set(ylabel="speed [rad/s]", xlabel="time [ms]")
        if moment is not None:
            speeds.set_xlabel("time from the contact [ms]")
            for axes in (angles, speeds):
                axes.axvline(0.0, color="0.6", linewidth=1, linestyle=":")
        figure.legend(*angles.get_legend_handles_labels(), loc="outside upper center", ncols=3)
        return figure

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines about what to know before using the motion; empty if there is nothing."""
        lines = list(self.notes)
        worst = max(self.residuals, key=self.residuals.__getitem__, default=None)
        usual = float(np.median(list(self.residuals.values()))) if worst is not None else 0.0
        if worst is not None and self.residuals[worst] > LARGEST_RATIO_TO_MEDIAN * usual:
            lines.append(
                f"marker {worst!r} is {1e3 * self.residuals[worst]:.2g} mm from the leg's, the "
                f"median of all {1e3 * usual:.2g} mm: height of the leg or place of the marker "
                "does not fit, or the marker is swapped with another; deviations do not contain "
                "this"
            )
        return (*lines, *self._unseen_at_contact(), *self._outside_ranges(), *self._tilted())

    def _tilted(self) -> Iterable[str]:
        if not has_floating_base(self.leg.workspace.model):
            return
        poses = [pin.XYZQUATToSE3(q[:7]) for q in self.configurations]
        up = np.median([pose.rotation[:, 2] for pose in poses], axis=0)
        tilt = math.degrees(math.acos(float(np.clip(up[2], -1.0, 1.0))))
        if tilt >= LARGEST_TILT:
            yield (
                f"the pelvis is tilted by {tilt:.0f} deg, its upward axis is "
                f"{up.round(2).tolist()} in the track: positions must have z up; if the file has "
                "y up, read it with up='y'"
            )

    def _unseen_at_contact(self) -> Iterable[str]:
        if self.contact is None or self.times[0] >= self.contact.time:
            return
        last = int(self.frames[np.searchsorted(self.times, self.contact.time) - 1])
        unseen = [
            f"{name!r} ({sum(frame <= last for frame in frames)} frames)"
            for name, frames in self.gaps.items()
            if last in frames
        ]
        if unseen:
            yield (
                f"markers {', '.join(unseen)} are not seen in frame {last}, the last one before "
                "the contact: the other markers determine the velocity at the contact, with larger "
                "deviations"
            )

    def _outside_ranges(self) -> Iterable[str]:
        model = self.leg.workspace.model
        for name in self.leg.single_joints:
            values = self.configurations[:, model.idx_qs[model.getJointId(name)]]
            low, high = self.leg.joint_range(name)
            outside = (values < low - RANGE_MARGIN) | (values > high + RANGE_MARGIN)
            if outside.mean() > 0.5:
                yield (
                    f"joint {name} is outside its range of {math.degrees(low):.0f} to "
                    f"{math.degrees(high):.0f} deg in {int(outside.sum())} frames of "
                    f"{len(values)}, at {math.degrees(float(np.median(values))):.0f} deg in the "
                    "median: it turns the other way, or its markers are swapped"
                )

    def _smoothed(self, chosen: Any, growth: float) -> SmoothingSpline:
        arrays = (self.times[chosen], self.configurations[chosen], self.information[chosen])
        return SmoothingSpline(self.leg.workspace.model, *arrays, growth)

    @cached_property
    def _pieces(self) -> list[SmoothingSpline]:
        contact = math.inf if self.contact is None else self.contact.time
        sides = (
            (self.times < contact, 0.0 if self.contact is None else GROWTH),
            (self.times >= contact, 0.0),
        )
        return [self._smoothed(*side) for side in sides if side[0].sum() >= LEAST_FRAMES]

    def _piece_at(self, t: float) -> SmoothingSpline:
        moment = validation.number("t", t, unit="s")
        for piece in self._pieces:
            if piece.begin <= moment <= piece.end:
                return piece
        spans = " and ".join(f"{piece.begin:g} to {piece.end:g}" for piece in self._pieces)
        raise InvalidInput(f"t is {moment:g} s: the motion is known from {spans or 'no time'} s")

    def _rows(self) -> Iterable[Row]:
        yield "frames", len(self.times), ""
        yield "duration", float(self.times[-1] - self.times[0]), "s"
        if self.contact is not None:
            time, deviation = self.contact
            yield "contact", f"{time:.4f}" + (f" +- {deviation:.1g}" if deviation else ""), "s"
        if self.residuals:
            yield "noise of a coordinate", 1e3 * self.noise, "mm"
        for name, residual in self.residuals.items():
            yield f"residual of {name}", 1e3 * residual, "mm"
        for joint, scale in self.scales.items():
            yield f"length of the segment after {joint}", scale, "times the leg's"
        for name, frames in self.gaps.items():
            yield f"gaps of {name}", len(frames), "frames"
        if self.undetermined:
            yield "incomplete frames", len(self.undetermined), ""
        yield from warned(self.warnings)
