"""What a reader wants of a sweep: the paper's postures, the best and the worst, and why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.grid import DIGITS, Grid
from kickdyn.sweeps.kick import STATUSES, Kick, Outcome, kick_from
from kickdyn.sweeps.opened import Sweep
from kickdyn.sweeps.run import numbers
from kickdyn.sweeps.top import Top

PAPER_POSTURES = {
    "paper a": ((5.0, 10.0, -5.0), 1.554),
    "paper b": ((5.0, 10.0, 15.0), 0.944),
    "paper c": ((5.0, 10.0, 40.0), 0.646),
}
"""Hip, knee, ankle [deg] of Fig. 7, the foot at 0, 20 and 45 deg, and Table 2's total [N s].

The paper prints the foot's angle; hip and knee are those that reproduce Table 2 within 0.2 %.
"""

PAPER_KICK = Kick()
"""Foot speed, attack and restitution that Table 2 is for; its rows fit no other."""


@dataclass(frozen=True, eq=False)
class Line:
    """One posture of the summary.

    Attributes:
        label: what it is.
        angles: joint name to value as it is given, to nine decimals [deg; m for prismatic joints].
        outcome: the kick from it.
        numbers: those of `kickdyn.sweeps.run.VARIABLES`.
        paper: the paper's impulse on an immovable obstacle [N s], where it prints one.
        why: of the best and the worst.
    """

    label: str
    angles: dict[str, float]
    outcome: Outcome
    numbers: dict[str, float]
    paper: float | None = None
    why: str = ""

    def posture(self) -> str:
        """Return the joints' values with their units."""
        leg = self.outcome.posture.leg
        return ", ".join(
            f"{name} {value:.4g} {'m' if leg.joint_unit(name) == 'm' else 'deg'}"
            for name, value in self.angles.items()
        )

    def as_json(self) -> dict[str, object]:
        """Return plain values; what does not exist is None, not nan."""
        hit = self.outcome.hit
        values = {k: v if math.isfinite(v) else None for k, v in self.numbers.items()}
        if hit is not None and math.isinf(hit.effective_mass):
            values["effective_mass"] = None
        return {
            "posture": self.label,
            "angles": self.angles,
            "status": self.outcome.status,
            **values,
            "impulse_vector": None if hit is None else hit.impulse.tolist(),
            "worst_joint": None if hit is None else hit.worst_joint[0],
            "paper_immovable_impulse": self.paper,
            "why": self.why or None,
        }


def paper_lines(leg: Leg, kick: Kick) -> list[Line]:
    """Return the paper's three postures of the human leg."""
    return [
        _line(leg, kick, label, np.radians(angles), paper=paper if _as_printed(leg, kick) else None)
        for label, (angles, paper) in PAPER_POSTURES.items()
    ]


def best_and_worst(leg: Leg, found: Sweep, kick: Kick) -> list[Line]:
    """Return the postures of highest and lowest ball speed among those of a sweep, if any."""
    best, worst = (Top(1, found.value(of)) for of in ("ball_speed", "-ball_speed"))
    found.reduce(best, worst)
    joints = Grid({name: found.data[name].values for name in found.space.axes})
    return extremes(leg, joints, kick, [int(n) for each in (best, worst) for n in each.numbers])


def extremes(leg: Leg, grid: Grid, kick: Kick, numbers: Sequence[int]) -> list[Line]:
    """Return the lines of the best and the worst posture, by their numbers; of none, no line."""
    ends = zip(("best", "worst"), numbers, strict=False)
    lines = [_line(leg, kick, label, grid.configuration(leg, number)) for label, number in ends]
    return [replace(line, why=_why(line, kick)) for line in lines]


def _as_printed(leg: Leg, kick: Kick) -> bool:
    return leg.frame == "toe" and all(
        getattr(kick, name) == getattr(PAPER_KICK, name)
        for name in ("speed", "attack", "restitution")
    )


def counts(data: xr.Dataset) -> dict[str, int]:
    """Return how many postures have each status."""
    return {name: int((data.status == i).sum()) for i, name in enumerate(STATUSES)}


def worst_residual(data: xr.Dataset) -> float:
    """Return the largest residual of restitution and momentum."""
    return max(float(data.restitution_residual.max()), float(data.momentum_residual.max()))


def _line(leg: Leg, kick: Kick, label: str, q: Array, paper: float | None = None) -> Line:
    outcome = kick_from(leg.posture(q), kick)
    joints = leg.display_values(q)
    angles = {name: round(value, DIGITS) + 0.0 for name, (value, _) in joints.items()}
    return Line(label, angles, outcome, numbers(outcome, kick), paper)


def _why(line: Line, kick: Kick) -> str:
    n = line.numbers
    heavier = n["effective_mass"] / kick.ball.mass
    return (
        f"along the kick the leg weighs {n['effective_mass']:.3g} kg, {heavier:.3g} times the "
        f"ball, which leaves at {n['speed_ratio']:.3g} times the foot's speed "
        f"(1 + e = {1 + kick.restitution:.3g} for an endlessly heavy leg); "
        f"its joints need {n['speed_use']:.0%} of their speed limits"
    )
