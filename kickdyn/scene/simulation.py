"""What a simulation answers: where the ball ends, how sure that is, and what was left out."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NamedTuple

from kickdyn.ball import BallState
from kickdyn.core.representation import Printed
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.collide import Collision
from kickdyn.impact.impact_result import Impact
from kickdyn.scene.exact_end import ENDS
from kickdyn.scene.scene import Scene


class Verdict(NamedTuple):
    """What became of one effect that the scene names.

    Attributes:
        effect: its name.
        modelled: or left out.
        bound: how far leaving it out can move the end [m]; inf where no bound is known, nan where
            none was needed.
        why: in words.
    """

    effect: str
    modelled: bool
    bound: float
    why: str


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Printed):
    """The answer to a scene. `print` shows the budget as a table.

    Attributes:
        scene: as it was asked.
        tolerance: [m]; None where none was asked for: all is modelled, but for what `verdicts` say.
        hit: the impact: of an instant, or one that took time.
        launch: the ball as it leaves the foot.
        end: where its way ends: on the ground, back at the height of the launch, at the plane, or
            at rest on a ground with a surface. Its time counts from the launch.
        status: which of them: `landed`, `at-plane` or `at-rest`; else the way has no end and `end`
            is where it was given up: `aloft`, `blown` or `bouncing`, as of `Flight` and `Course`.
        path: the flight or the course; None where large steps did.
        verdicts: on each effect that the scene names.
        method: how the end was computed.
        evaluations: of the accelerations in contact and flight, those for bounds and for `spread`
            included; not what `numerical_error` adds where it is asked for.
        spread: standard deviation of the end by what the scene's `spread` says is not known
            exactly, to first order, velocity and spin varying together [m]; nan where it says
            nothing, inf where the way has no end.
    """

    scene: Scene
    tolerance: float | None
    hit: Impact | Collision
    launch: BallState
    end: BallState
    status: str
    path: Flight | Course | None
    verdicts: tuple[Verdict, ...]
    method: str
    evaluations: int
    spread: float
    _numerical: Callable[[], float] = field(repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Pickle the estimate, not how it is made."""
        return {**self.__dict__, "_numerical": partial(float, self.numerical_error)}

    @cached_property
    def numerical_error(self) -> float:
        """Estimate of what contact and flight integrators miss at the end [m]; inf without one."""
        return self._numerical()

    @property
    def model_error(self) -> float:
        """Bound on what the effects left out would change at the end [m]."""
        return math.fsum(v.bound for v in self.verdicts if not v.modelled)

    @property
    def error(self) -> float:
        """Of the end, the bound of what is left out and the estimate of the numerics together [m].

        `tolerance` at most, but for what the numerics cannot reach: see `met`.
        """
        return self.model_error + self.numerical_error

    @property
    def met(self) -> bool:
        """Whether the error is within the tolerance; without one, whether it is known."""
        return self.error <= (sys.float_info.max if self.tolerance is None else self.tolerance)

    @property
    def modelled(self) -> tuple[str, ...]:
        """Names of the effects that were modelled."""
        return tuple(v.effect for v in self.verdicts if v.modelled)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the effects that the scene has and the simulation did not model."""
        return tuple(v.effect for v in self.verdicts if not v.modelled)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Those of `path`: coefficients used outside the range they are meant for."""
        return () if self.path is None else self.path.warnings

    def __str__(self) -> str:
        """Return end and budget."""
        x, y, z = self.end.position.round(3) + 0.0  # no -0
        wish = "all modelled" if self.tolerance is None else f"asked {self.tolerance:g} m"
        if self.tolerance is None and self.left_out:
            wish += f" but {', '.join(self.left_out)}"
        wish += "" if self.met else ", NOT MET"
        ended = self.status if self.status in ENDS else f"NO END, given up {self.status}"
        lines = [
            f"{ended} at ({x:.3f}, {y:.3f}, {z:.3f}) m after {self.end.time:.3f} s; "
            f"error {self.error:.2g} m, {wish}; {self.method}",
            f"{'effect':20}{'':12}{'bound m':>9}  why",
        ]
        for effect, modelled, bound, why in self.verdicts:
            size = "" if math.isnan(bound) else f"{bound:.2g}"
            lines.append(f"{effect:20}{'modelled' if modelled else 'left out':12}{size:>9}  {why}")
        numerics = self.numerical_error
        size = f"{numerics:.2g}" if numerics > 1e-12 else "rounding"
        lines.append(f"{'numerics':32}{size:>9}")
        if not math.isnan(self.spread):
            lines.append(f"{'not known exactly':32}{self.spread:9.2g}  standard deviation")
        lines += [f"note: {note}" for note in self.scene.notes]
        lines += [f"warning: {warning}" for warning in self.warnings]
        return "\n".join(lines)
