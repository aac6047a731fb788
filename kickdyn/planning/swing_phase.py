"""One phase of a swing, from rest to the impact or from there to rest, and what it takes."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.integrate import simpson
from scipy.interpolate import PPoly

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.kicking_chain import KickingChain, kicking_chain
from kickdyn.robot.leg import Leg

LONGEST = 1.0
"""Longest duration of a phase, when not named [s]."""


class Motion(NamedTuple):
    """Joints at several times, in the order of `Swing.joints`, each array of shape `(k, n)`.

    `time` counts from the impact, shape `(k,)` [s]; q [rad], v [rad/s], a [rad/s2], torque of the
    joints [N m], gravity included, and its power [W].
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
        chain: of the joints that move.
        sign: -1 before the impact, 1 after it.
        duration: [s].
    """

    chain: KickingChain
    sign: int
    duration: float
    _a: PPoly
    _v: PPoly
    _q: PPoly

    def _rows(self) -> Iterable[Row]:
        """Return the lines that are shown."""
        yield "joints", ", ".join(self.chain.names), ""
        yield "duration", self.duration, "s"
        yield "nodes", len(self._a.x), ""

    @property
    def nodes(self) -> Array:
        """Times of the nodes, rising [s]."""
        return np.sort(self.sign * self._a.x)

    def sample(self, t: ArrayLike) -> Motion:
        r"""Return the motion at times from the impact, with :math:`\tau = M a + c(q, v) + g(q)`.

        Args:
            t: a time or times, shape `(k,)` [s].

        Raises:
            InvalidInput: a time outside of this phase.
        """
        time = np.atleast_1d(validation.floats("t", t, unit="s"))
        away = self.sign * time
        if (away < 0.0).any() or (away > self.duration).any():
            low, high = sorted((0.0, self.sign * self.duration))
            raise InvalidInput(f"t is {time.tolist()}: this phase lasts from {low:g} to {high:g} s")
        q, v, a = self._q(away), self.sign * self._v(away), self._a(away)
        model, data = self.chain.model, self.chain.model.createData()
        rows = zip(q, v, a, strict=True)
        torque = np.array([pin.rnea(model, data, *row) for row in rows]).reshape(q.shape)
        return Motion(time, q, v, a, torque, torque * v)

    @cached_property
    def fine(self) -> Motion:
        """The motion at 20 times per interval, both ends included, in order."""
        count = 20 * (len(self._a.x) - 1) + 1
        low, high = sorted((0.0, self.sign * self.duration))
        return self.sample(np.linspace(low, high, count))

    @property
    def torque_use(self) -> float:
        """Largest torque on the fine grid over its limit."""
        return float((np.abs(self.fine.torque) / self.chain.effort_limit).max())

    @property
    def speed_use(self) -> float:
        """Largest joint speed on the fine grid over its limit."""
        return float((np.abs(self.fine.v) / self.chain.velocity_limit).max())

    @property
    def range_left(self) -> float:
        """Least distance from an end of the range on the fine grid [rad]; below 0 is outside."""
        q = self.fine.q
        return float(np.minimum(q - self.chain.lower, self.chain.upper - q).min())

    @property
    def torque_squared(self) -> float:
        r"""On the fine grid, :math:`\int \frac1n \sum_i (\tau_i / \tau_{max,i})^2 dt` [s]."""
        use = self.fine.torque / self.chain.effort_limit
        return float(simpson(np.mean(use**2, axis=1), x=self.fine.time))


def make_phase(
    chain: KickingChain,
    sign: int,
    q: Array,
    v: Array,
    accelerations: Array,
    duration: float,
    rest: Array,
) -> SwingPhase:
    """Return a phase whose ends are exact: a line in time is added to a solver's accelerations.

    Args:
        chain: of the joints that move.
        sign: -1 before the impact, 1 after it.
        q: posture at the impact, shape `(n,)` [rad].
        v: velocity away from it, shape `(n,)` [rad/s].
        accelerations: at even nodes away from it, shape `(nodes + 1, n)` [rad/s2].
        duration: [s].
        rest: posture at rest, shape `(n,)` [rad].
    """
    s = np.linspace(0.0, duration, len(accelerations))

    def integrate(values: Array) -> tuple[PPoly, PPoly, PPoly]:
        """Return position, velocity and acceleration as polynomials."""
        slopes = np.diff(values, axis=0) / np.diff(s)[:, None]
        acceleration = PPoly(np.array([slopes, values[:-1]]), s)
        velocity = acceleration.antiderivative()
        velocity.c[-1] += v
        position = velocity.antiderivative()
        position.c[-1] += q
        return acceleration, velocity, position

    _, velocity, position = integrate(accelerations)
    off = np.array([-velocity(duration), rest - position(duration)])
    t = duration
    line = np.linalg.solve([[t, t**2 / 2], [t**2 / 2, t**3 / 6]], off)
    return SwingPhase(chain, sign, t, *integrate(accelerations + line[0] + s[:, None] * line[1]))


def swing_chain(leg: Leg) -> KickingChain:
    """Return the joints that swing a leg's foot; raise `InvalidInput` where one has no limit."""
    chain = kicking_chain(leg)
    for what, limits in (("speed", chain.velocity_limit), ("torque", chain.effort_limit)):
        for name, limit in zip(chain.names, limits.tolist(), strict=True):
            if not 0.0 < limit < 1e6:
                raise InvalidInput(
                    f"{what} limit of {name} is {limit:g}: a swing needs one, above 0"
                )
    return chain


def check_solver() -> None:
    """Raise `InvalidInput` where CasADi is not installed."""
    if find_spec("casadi") is None:
        raise InvalidInput(
            'swings need the package casadi: install it with pip install "kickdyn[swing]"'
        )
