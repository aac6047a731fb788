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
        chain: the joints that move, with their limits.
        sign: -1 before the impact, 1 after it.
        duration: duration of the phase [s].
    """

    chain: KickingChain
    sign: int
    duration: float
    _a: PPoly
    _v: PPoly
    _q: PPoly

    def _rows(self) -> Iterable[Row]:
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
        nodes, count = self._a.x, len(self._a.x) - 1
        away = np.interp(np.arange(20 * count + 1) / 20, np.arange(count + 1), nodes)
        return self.sample(np.sort(self.sign * away))

    @property
    def torque_use(self) -> float:
        """Largest torque over its limit, at the times of `fine`."""
        return float((np.abs(self.fine.torque) / self.chain.effort_limit).max())

    @property
    def speed_use(self) -> float:
        """Largest joint speed over its limit, at the times of `fine`."""
        return float((np.abs(self.fine.v) / self.chain.velocity_limit).max())

    @property
    def range_left(self) -> float:
        """Least distance of a joint from the ends of its range at the times of `fine` [rad]."""
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
    times: Array,
    rest: Array,
) -> SwingPhase:
    """Return a phase whose ends are exact: a line in time is added to a solver's accelerations.

    Args:
        chain: of the joints that move.
        sign: -1 before the impact, 1 after it.
        q: posture at the impact, shape `(n,)` [rad].
        v: velocity away from it, shape `(n,)` [rad/s].
        accelerations: at the nodes, shape `(nodes + 1, n)` [rad/s2].
        times: of the nodes from the impact on, 0 the first, shape `(nodes + 1,)` [s].
        rest: posture at rest, shape `(n,)` [rad].
    """
    _, velocity, position = integrate_accelerations(accelerations, times, v, q)
    t = float(times[-1])
    off = np.array([-velocity(t), rest - position(t)])
    line = np.linalg.solve([[t, t**2 / 2], [t**2 / 2, t**3 / 6]], off)
    exact = accelerations + line[0] + times[:, None] * line[1]
    return SwingPhase(chain, sign, t, *integrate_accelerations(exact, times, v, q))


def integrate_accelerations(
    accelerations: Array, times: Array, v: ArrayLike = 0.0, q: ArrayLike = 0.0
) -> tuple[PPoly, PPoly, PPoly]:
    """Return acceleration, velocity and position as polynomials, for accelerations at times.

    `v` and `q` are those at the first time; accelerations have one row for each time.
    """
    slopes = np.diff(accelerations, axis=0) / np.diff(times)[:, None]
    acceleration = PPoly(np.array([slopes, accelerations[:-1]]), times)
    velocity = acceleration.antiderivative()
    velocity.c[-1] += v
    position = velocity.antiderivative()
    position.c[-1] += q
    return acceleration, velocity, position


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
