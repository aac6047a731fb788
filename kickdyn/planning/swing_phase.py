"""One side of a swing: the way from the impact to rest, or from rest to it, and what it takes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.swing_joints import Joints

FINE = 20
"""Points per interval at which a swing is checked."""


class Motion(NamedTuple):
    """Joints at several times, in the order of `Swing.joints`, each array of shape `(k, n)`.

    `time` counts from the impact [s]; q [rad], v [rad/s], a [rad/s2], torque of the joints [N m],
    gravity included, and its power [W].
    """

    time: Array
    q: Array
    v: Array
    a: Array
    torque: Array
    power: Array


@dataclass(frozen=True, eq=False, repr=False)
class SwingPhase(ReprMixin):
    """The backswing or the follow-through: accelerations linear in time between nodes.

    Attributes:
        joints: that move.
        sign: -1 before the impact, 1 after it.
        duration: [s].
    """

    joints: Joints
    sign: int
    duration: float
    _a: PPoly
    _v: PPoly
    _q: PPoly

    def _rows(self) -> Iterable[Row]:
        yield "joints", ", ".join(self.joints.names), ""
        yield "duration", self.duration, "s"
        yield "nodes", len(self._a.x), ""

    @property
    def nodes(self) -> Array:
        """Times of the nodes, rising [s]."""
        return np.sort(self.sign * self._a.x)

    def sample(self, t: ArrayLike) -> Motion:
        """Return the motion at times from the impact, shape `(k,)` [s].

        Raises:
            InvalidInput: a time outside of this part.
        """
        time = np.atleast_1d(validation.floats("t", t, unit="s"))
        away = self.sign * time
        if (away < 0.0).any() or (away > self.duration).any():
            low, high = sorted((0.0, self.sign * self.duration))
            raise InvalidInput(f"t is {time.tolist()}: this part lasts from {low:g} to {high:g} s")
        q, v, a = self._q(away), self.sign * self._v(away), self._a(away)
        model, data = self.joints.model, self.joints.model.createData()
        rows = zip(q, v, a, strict=True)
        torque = np.array([pin.rnea(model, data, *row) for row in rows]).reshape(q.shape)
        return Motion(time, q, v, a, torque, torque * v)

    def fine(self) -> Motion:
        """Return the motion at many times between the nodes, both ends included, in order."""
        many = FINE * (len(self._a.x) - 1) + 1
        low, high = sorted((0.0, self.sign * self.duration))
        return self.sample(np.linspace(low, high, many))

    @property
    def torque_use(self) -> float:
        """Largest torque on the fine grid over its limit."""
        return float((np.abs(self.fine().torque) / self.joints.effort).max())

    def resampled(self, nodes: int) -> tuple[Array, Array, Array]:
        """Return q, v and a at as many even steps, away from the impact: shape `(nodes + 1, n)`.

        The same way, where `nodes` is a multiple of its own.
        """
        away = np.linspace(0.0, self.duration, nodes + 1)
        return self._q(away), self._v(away), self._a(away)


def part_of(
    joints: Joints, sign: int, q: Array, w: Array, accelerations: Array, duration: float, end: Array
) -> SwingPhase:
    """Return a part, the solver's rounding put right so that both ends are met exactly.

    Args:
        joints: that move.
        sign: -1 before the impact, 1 after it.
        q: posture at the impact, shape `(n,)`.
        w: velocity away from it, shape `(n,)`.
        accelerations: at even nodes away from it, shape `(nodes + 1, n)`.
        duration: [s].
        end: posture at rest, shape `(n,)`.
    """
    s = np.linspace(0.0, duration, len(accelerations))

    def rates(pulls: Array) -> tuple[PPoly, PPoly, PPoly]:
        slopes = np.diff(pulls, axis=0) / np.diff(s)[:, None]
        a = PPoly(np.array([slopes, pulls[:-1]]), s)
        v = a.antiderivative()
        v.c[-1] += w
        turn = v.antiderivative()
        turn.c[-1] += q
        return a, v, turn

    _, v, turn = rates(accelerations)
    off = np.array([-v(duration), end - turn(duration)])
    time = duration
    lines = np.linalg.solve([[time, time**2 / 2], [time**2 / 2, time**3 / 6]], off)
    a, v, turn = rates(accelerations + lines[0] + s[:, None] * lines[1])
    return SwingPhase(joints, sign, duration, a, v, turn)
