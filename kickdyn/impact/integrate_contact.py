"""Integration of leg and ball while they touch, and what happens between its steps."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from kickdyn.core.dop853 import STAGES, TABLE
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact import contact_phases as phases
from kickdyn.impact.compliant_contact import CompliantContact
from kickdyn.impact.contact_phases import AGAIN, AT_BEGINNING, FAILED, TAKEN, THROUGH


@dataclass(frozen=True, eq=False)
class IntegratedContact:
    """Leg and ball from first contact to separation, as they were integrated.

    Attributes:
        equations: the equations of motion.
        times: of the integrator's steps and of separation, shape `(n + 1,)` [s].
        columns: columns of the integrator at these times, shape `(n + 1, dim)`.
        phases: of each step, largest deflection so far [m], kind of friction, and direction of the
            sliding as the phase began, shape `(n, 4)`.
        evaluations: number of evaluations of the equations that the integration took.
    """

    equations: CompliantContact
    times: Array
    columns: Array
    phases: Array
    evaluations: int

    @property
    def last(self) -> Array:
        """Column at separation."""
        return np.asarray(self.columns[-1])

    @property
    def sticks(self) -> bool:
        """Whether the points stick at separation."""
        return bool(self.phases[-1, 1] == phases.STICKS and self.equations.lane.friction[0] > 0.0)

    def column(self, t: float) -> Array:
        """Return the column at a time: a step of the integrator from the last one before."""
        k = self._step_at(t)
        if t in (self.times[k], self.times[k + 1]):
            return np.asarray(self.columns[k if t == self.times[k] else k + 1])
        lane, y, h = self.equations.lane_of(self.phases[k]), self.columns[k], t - self.times[k]
        rates = np.empty((STAGES, len(y)))
        return _stages(self.equations, lane, (float(self.times[k]), y, h), rates)

    def sample(self, t: float) -> tuple[Array, Array, float]:
        """Return force [N] and impulse so far [N s] on the ball, and deflection [m] at a time."""
        y, lane = self.column(t), self.equations.lane_of(self.phases[self._step_at(t)])
        with np.errstate(all="ignore"):  # as the contact begins
            _, force = self.equations.evaluate(t, y, lane)
        return force, self.equations.impulse(t, y), float(lane.deflection[0])

    def _step_at(self, t: float) -> int:
        return min(max(bisect_right(self.times, t) - 1, 0), len(self.phases) - 1)

    def peak_force(self) -> float:
        """Return the largest force [N]: the largest of the steps, refined."""

        def size(t: float) -> float:
            return math.hypot(*self.sample(float(t))[0])

        values = [size(t) for t in self.times.tolist()]
        best = int(np.argmax(values))
        refined = minimize_scalar(
            lambda t: -size(t),
            bounds=(self.times[max(best - 1, 0)], self.times[min(best + 1, len(values) - 1)]),
            method="bounded",
            options={"xatol": 1e-6 * float(self.times[-1])},
        )
        return max(-float(refined.fun), values[best])


def _stages(
    equations: CompliantContact, lane: Any, begin: tuple[float, Array, float], rates: Array,
    first: int = 0,
) -> Array:  # fmt: skip
    """Fill in the rates of a step from stage `first` on; return its last column.

    `begin` has time, column and length of the step.
    """
    t, y, h = begin
    for k in range(first, STAGES):
        new = y + h * TABLE[k, :k].dot(rates[:k])
        rates[k] = equations.evaluate(t + TABLE[k].sum() * h, new, lane)[0]
    return np.asarray(y + h * TABLE[STAGES].dot(rates[:STAGES]))


def integrate_contact(equations: CompliantContact) -> IntegratedContact:
    """Return the motion from first contact to separation, or raise `KickdynError`.

    It ends, too, where the foot reaches the centre of the ball.
    """
    with np.errstate(all="ignore"):  # what is not finite is reported
        return _integrate(equations)


def _integrate(equations: CompliantContact) -> IntegratedContact:
    """Integrate by DOP853 with its error estimate, step by step as `collide_kernel`.

    The tolerance is relative to how far a column departs from uniform motion: of a foot that grazes
    the ball, far less than the column itself.
    """
    lane, y, rtol = equations.lane, equations.start(), max(equations.tol, 3e-14)
    start, drift, nv = y, np.zeros(len(y)), equations.leg.nv
    drift[:nv], drift[2 * nv : 2 * nv + 3] = y[nv : 2 * nv], y[2 * nv + 3 : 2 * nv + 6]
    rates, precision = np.empty((STAGES + 1, len(y))), phases.event_precision(rtol)
    scales, begins, columns, kinds = equations.scales(), [0.0], [y], []
    is_new, outcome = True, TAKEN
    while True:
        t = begins[-1]
        if is_new:
            rates[0] = equations.evaluate(t, y, lane)[0]
            is_new = False
        if outcome != AGAIN:
            phases.limit_step(lane, 0)
        h = float(lane.step[0])
        new = _stages(equations, lane, (t, y, h), rates, 1)
        rates[STAGES] = equations.evaluate(t + h, new, lane)[0]
        moved, later = start + t * drift, start + (t + h) * drift
        size = scales + np.maximum(np.abs(y - moved), np.abs(new - later))
        per = 1.0 / (rtol * lane.tolerance_factor[0] * size)
        five, three = np.square(TABLE[STAGES + 1 :].dot(rates[:STAGES]) * per).sum(axis=1).tolist()
        square = (five + 0.01 * three) * len(y)
        error = h * five / math.sqrt(square) if square != 0.0 else 0.0
        phase = lane.largest[0], lane.kind[0], *lane.along[:, 0]
        outcome = phases.finish_step(lane, 0, error, precision)
        if outcome == FAILED:
            raise KickdynError(_failure(equations, error))
        if outcome in (TAKEN, THROUGH) or 0 <= outcome < AT_BEGINNING:
            begins.append(t + h)
            columns.append(new)
            kinds.append(phase)
            y, rates[0] = new, rates[STAGES]
        is_new = outcome >= 0
        parted = is_new and equations.begin_phase(outcome % AT_BEGINNING)
        if parted:  # nothing but gravity acts since then
            late = float(lane.ends[0, 0] / lane.sliding[2, 0])
            begins[-1], columns[-1] = begins[-1] + late, y + late * rates[STAGES]
        if parted or outcome == THROUGH:
            evaluations = int(lane.calls[0])
            times, steps = np.array(begins), np.array(kinds)
            return IntegratedContact(equations, times, np.array(columns), steps, evaluations)


def _failure(equations: CompliantContact, error: float) -> str:
    lane, expected = equations.lane, equations.expected
    t = float(lane.time[0])
    if not math.isfinite(error):
        return "the integration exceeded double precision: torques, speeds or lengths are too large"
    if t > 2.0 * expected:
        return (
            f"foot and ball are still in contact after {t:.3g} s, {t / expected:.3g} times the "
            "time that the two alone would take: the motion of the leg, gravity or a torque "
            "presses them together"
        )
    if lane.calls[0] > phases.MAX_EVALUATIONS:
        return (
            f"the contact has not ended after {phases.MAX_EVALUATIONS} evaluations, at {t:g} of "
            f"about {expected:g} s: the equations of motion are too stiff (friction "
            f"{equations.approach.contact.friction:g}, a light foot or a ball of small inertia)"
        )
    return (
        f"the integrator failed at {t:g} s: the motion changes in less than 1e-13 of the contact "
        f"time of {expected:g} s that foot and ball alone would take; speeds or torques are too "
        "large"
    )
