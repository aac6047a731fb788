"""What a simulation answers: where the ball ends, how sure that is, and what was left out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from kickdyn.ball import BallState
from kickdyn.card import Printed
from kickdyn.flight.follow import Course
from kickdyn.flight.path import Flight
from kickdyn.impact.collide import Collision
from kickdyn.impact.result import Impact
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
        tolerance: [m]; None where everything was modelled.
        hit: the impact: of an instant, or one that took time.
        launch: the ball as it leaves the foot.
        end: where its way ends: on the ground, back at the height of the launch, at the plane, or
            at rest on a ground with a surface. Its time counts from the launch.
        path: the flight or the course; None where large steps did.
        verdicts: on each effect that the scene names.
        method: how the end was computed.
        evaluations: of contact and flight, in all.
        spread: standard deviation of the end, at most, by what the scene's `spread` says is not
            known exactly; to first order [m]; nan where it says nothing.
    """

    scene: Scene
    tolerance: float | None
    hit: Impact | Collision
    launch: BallState
    end: BallState
    path: Flight | Course | None
    verdicts: tuple[Verdict, ...]
    method: str
    evaluations: int
    spread: float
    _numerical: Callable[[], float] = field(repr=False)

    @cached_property
    def numerical_error(self) -> float:
        """Estimate of what contact and flight integrators miss at the end [m]."""
        return self._numerical()

    @property
    def model_error(self) -> float:
        """Bound on what the effects left out would change at the end [m]."""
        return math.fsum(v.bound for v in self.verdicts if not v.modelled)

    @property
    def error(self) -> float:
        """Of the end, models left out and numerics together [m]; `tolerance` at most."""
        return self.model_error + self.numerical_error

    @property
    def modelled(self) -> tuple[str, ...]:
        """Names of the effects that were modelled."""
        return tuple(v.effect for v in self.verdicts if v.modelled)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the effects that the scene has and the simulation did not model."""
        return tuple(v.effect for v in self.verdicts if not v.modelled)

    def __str__(self) -> str:
        """Return end and budget."""
        x, y, z = self.end.position.round(3) + 0.0  # no -0
        wish = "all modelled" if self.tolerance is None else f"asked {self.tolerance:g} m"
        lines = [
            f"ends at ({x:.3f}, {y:.3f}, {z:.3f}) m after {self.end.time:.3f} s; "
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
        return "\n".join(lines)
