"""Why a leg has no posture from which it can kick so, and where it would have one."""

from __future__ import annotations

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.planning.equations import Objective
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.search import Search
from kickdyn.robot.leg import Leg, Posture


def why_none(
    leg: Leg,
    impact_target: ImpactTarget,
    ball_position: float | Array | None,
    limits: bool,
    turn: bool,
    starts: int,
) -> str:
    """Return what a search that found nothing is to be told of.

    Args:
        leg: as for `Search`.
        impact_target: likewise.
        ball_position: likewise.
        limits: likewise.
        turn: likewise.
        starts: of the searches for a reason.
    """
    if limits:
        lifted = Search(leg, impact_target, ball_position, False, turn)
        found = lifted.run(Objective(lambda posture, v: float(v @ v)), starts)
        if found is not None:
            return _too_weak(lifted, found.posture)
    if ball_position is not None:
        anywhere = Search(leg, impact_target, None, limits, turn)
        held = [2] if isinstance(ball_position, float) else [0, 1, 2]

        def off(posture: Posture, v: Array) -> float:
            return float(np.sum((_centre(anywhere, posture)[held] - ball_position) ** 2))

        found = anywhere.run(Objective(off), starts)
        if found is not None:
            centre = np.round(_centre(anywhere, found.posture), 6) + 0.0
            near = ", ".join(f"{part:.4g}" for part in centre)
            return f"the nearest ball found that it can kick so has its centre at ({near}) m"
    return "its joints' ranges allow none"


def _centre(search: Search, posture: Posture) -> Array:
    """Return where the centre of the ball that is touched would be [m, world frame]."""
    contact = search.impact_target.contact
    return np.asarray(posture.contact_point + search.impact_target.ball.radius * contact.normal)


def _too_weak(search: Search, posture: Posture) -> str:
    """Return which joints cannot even hold a posture."""
    needed = np.abs(search.torque(posture.q, np.zeros(search.leg.nv)))
    own = search.leg.effort_limit[search.vs]
    weak = [
        f"{name} takes {torque:.3g} N m and has {limit:.3g}"
        for name, torque, limit in zip(search.names, needed, own, strict=True)
        if torque > limit
    ]
    said = f": held still, {', '.join(weak)}" if weak else ""
    return f"without its speed and torque limits it has one{said}"
