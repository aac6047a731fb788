r"""`contact_moment`: when a contact begins, as a number with its deviation or from a ball's track.

The ball's velocity changes by :math:`\Delta v` during the contact. The quadratics through its
positions before and after, extrapolated along :math:`\Delta v`, meet at the mean time of the force
:math:`\int t F \, dt / \int F \, dt`, whatever the force is over time; the contact begins earlier.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.identification.track import LEAST_SAMPLES, Track, refuse_units

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
    """Return the time of a contact: a number, a number and its deviation, or from a track."""
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
    """Return the time at which a ball's velocity changes, with its deviation [s]."""
    times = track.times
    if len(track) < 2 * LEAST_SAMPLES:
        raise InvalidInput(
            f"track of the ball has {len(track)} samples: at least {2 * LEAST_SAMPLES} are needed"
        )
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
    """Raise `InvalidInput` for a change of velocity that is no kick's."""
    if size < LEAST_CHANGE:
        raise InvalidInput(
            f"the velocity of the ball changes by {size:.2g} m/s at most in its track, from "
            f"{track.times[0]:.4g} to {track.times[-1]:.4g} s: a kick changes it by "
            f"{LEAST_CHANGE:g} m/s or more"
        )
