"""Integration of leg and ball while they touch: phases of smooth forces, and where they end."""

import math
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.integrate import DOP853, OdeSolution
from scipy.optimize import brentq, minimize_scalar

from kickdyn.core.dop853 import EVENT_MARGIN, keep_stages
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.compliant_contact import CompliantContact, Evaluation, Phase

MAX_CONTACT_TIMES = 50.0
"""Expected contact times after which foot and ball count as not separating."""

MAX_PHASES = 500
"""Phases after which the motion counts as one that does not end."""

FIRST_STEP = 3.0
"""First step over the expected contact time, per tolerance of the integrator to the power 2/7: the
error that a step leaves where the force begins as the deflection to the power 3/2."""

LOOSE = 1e-5
"""Tolerance from which interpolants are exact enough in the whole step: the launch of 98 % of 200
random kicks is within 10 times the tolerance either way, and this takes a third fewer
evaluations."""

BEYOND_SEPARATION = 1.02
"""Longest step over the time to separation at the present speed: the force ends there at once."""


@dataclass(frozen=True, eq=False)
class ContactMotion:
    """Leg and ball from first contact to separation, as they were integrated.

    Attributes:
        equations: the equations of motion.
        times: of the integrator's steps, shape `(n,)` [s].
        last: column at separation.
        begins: times at which the phases begin [s].
        phases: the phases.
        evaluations: number of evaluations of the equations that the integration took.
    """

    equations: CompliantContact
    times: Array
    last: Array
    begins: list[float]
    phases: list[Phase]
    evaluations: int
    _steps: list[DOP853]

    @cached_property
    def column(self) -> OdeSolution:
        """Column of the integrator at a time; its interpolants take a quarter more evaluations."""
        return OdeSolution(self.times, [solver.dense_output() for solver in self._steps])

    def sample(self, t: float) -> tuple[Array, Array, float]:
        """Return force [N] and impulse so far [N s] on the ball, and deflection [m] at a time."""
        equations, y = self.equations, self.column(t)
        now = equations.evaluate(t, y, self.phases[bisect_right(self.begins, t) - 1])
        return now.force, equations.impulse(t, y), now.deflection

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


def integrate_contact(equations: CompliantContact, tol: float) -> ContactMotion:
    """Return the motion from first contact to separation, or raise `KickdynError`.

    The forces are smooth in every phase: one ends where compression does, where the deflection
    outgrows the largest one before, and where the friction changes its kind.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is reported
        return _Contact(equations, tol).run()


class _Contact:
    """The integration of a contact by scipy's DOP853, phase after phase."""

    def __init__(self, equations: CompliantContact, tol: float) -> None:
        self._equations, self._tol = equations, tol
        self._atol = tol * equations.scales()
        self._limit = MAX_CONTACT_TIMES * equations.expected
        self._steps: list[tuple[float, DOP853]] = []
        self._last: Evaluation

    def run(self) -> ContactMotion:
        """Integrate until foot and ball separate."""
        equations, t, y = self._equations, 0.0, self._equations.start()
        phase = equations.first_phase()
        begins: list[float] = []
        phases: list[Phase] = []
        length = None
        while len(phases) < MAX_PHASES:
            begins.append(t)
            phases.append(phase)
            t, y, event, length = self._run_phase(t, y, phase, length)
            if event == 1:
                phase = equations.next_phase(t, y, phase)
                continue
            deflection = equations.deflection(equations.kinematics(equations.state(y)))
            separation = equations.force_model.separation(phase.largest)
            apart = deflection - separation < phase.largest - deflection
            if (phase.largest > 0.0 and apart) or deflection >= equations.ball.radius * (
                1.0 - 1e-9
            ):
                times = np.array([*(begin for begin, _ in self._steps), t])
                steps, count = [solver for _, solver in self._steps], equations.evaluations
                equations.counts = False
                return ContactMotion(equations, times, y, begins, phases, count, steps)
            phase = phase._replace(largest=0.0 if phase.largest else deflection)
        raise KickdynError(
            f"the integrator failed at {t:g} s: at an approach speed of "
            f"{equations.approach.speed:.3g} m/s gravity or a torque, not the impact, decides the "
            "motion"
        )

    def _run_phase(
        self, begin: float, state: Array, phase: Phase, length: float | None
    ) -> tuple[float, Array, int, float]:
        """Integrate to the end of a phase, with a length of the first step if one is known.

        Return its time and column, whether the deflection (0) or the friction (1) ends it, and the
        length of the last whole step. To a tight tolerance, a step that an end falls into is taken
        anew so that it ends just after it, because interpolants are far more exact there.
        """
        solver = self._solver(begin, state, phase, length)
        while True:
            start, before = float(solver.t), solver.y
            if phase.largest:
                left = self._equations.time_left(before, phase)
                solver.h_abs = min(solver.h_abs, max(BEYOND_SEPARATION * left, 1e-9 * self._limit))
            self._step(solver)
            t, h = float(solver.t), float(solver.t) - start
            falls = [k for k in range(2) if self._last.ends[k] <= 0.0]
            kept = keep_stages(solver)
            if not falls:
                self._steps.append((start, kept))
                length = h
                continue
            length, states = max(length or 0.0, h), solver.dense_output()
            about, event = min((self._root(states, phase, k, start, t, 1e-3 * h), k) for k in falls)
            if about == start:
                return start, before, event, length
            if self._tol < LOOSE and about < t - EVENT_MARGIN * h:
                shorter = (1.0 + 0.5 * EVENT_MARGIN) * max(about - start, 1e-9 * h)
                solver = self._solver(start, before, phase, shorter)
                continue
            end = self._root(states, phase, event, start, t, 1e-13 * h)
            self._steps.append((start, kept))
            return end, states(end), event, length

    def _root(
        self, states: Any, phase: Phase, k: int, start: float, end: float, precision: float
    ) -> float:
        """Return the time at which deflection (0) or friction (1) ends a phase within a step [s].

        It is the beginning of the step only where the phase has ended there.
        """

        def value(time: float) -> float:
            return self._equations.end_of(k, time, states(time), phase)

        # at the beginning of a phase its value may be 0, but for rounding
        for share in (1.0 - 2.0 * EVENT_MARGIN, 0.0, 1e-6):
            low = start + share * (end - start)
            if value(low) > 0.0:
                root = float(brentq(value, low, end, xtol=precision))
                return max(root, start + 1e-9 * (end - start))  # after the beginning
        return start

    def _step(self, solver: DOP853) -> None:
        """Take a step; raise `KickdynError` where there is none."""
        start = float(solver.t)
        message = solver.step()
        if solver.status == "finished":
            raise KickdynError(
                f"foot and ball are still in contact after {self._limit:g} s, "
                f"{MAX_CONTACT_TIMES:g} times the time that the two alone would take"
            )
        if message or not np.isfinite(solver.y).all():
            raise KickdynError(f"the integrator failed at {start:g} s: {message or 'overflow'}")

    def _solver(self, begin: float, state: Array, phase: Phase, length: float | None) -> DOP853:
        """Return a solver for the equations of a phase."""

        def rates(t: float, y: Array) -> Array:
            self._last = self._equations.evaluate(t, y, phase)
            return self._last.rates

        if length is not None:
            length = min(max(length, 10.0 * math.ulp(begin)), self._limit - begin)
        solver = DOP853(rates, begin, state, self._limit, rtol=max(self._tol, 3e-14),
                        atol=self._atol, first_step=length)  # fmt: skip
        if length is None:
            first = self._equations.expected * min(FIRST_STEP * self._tol ** (2 / 7), 0.3)
            solver.h_abs = min(solver.h_abs, first)
        return solver
