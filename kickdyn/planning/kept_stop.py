"""A stop whose torques keep their limits between the solver's points too."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.stop_problem import Solved, Stopper
from kickdyn.planning.swing_joints import Joints
from kickdyn.planning.swing_phase import SwingPhase, part_of

SLACK = 0.005
"""Share of the torque limits left over at first, for torques between the points of the solver."""

ROUNDS = 5
"""Solutions, each with more slack, until the torques keep their limits between those points."""


class Ask(NamedTuple):
    """A stop that is asked for: side of the impact, posture, velocity away from it, rest."""

    sign: int
    q: Array
    w: Array
    rest: Array | None

    @property
    def name(self) -> str:
        """Of the part of the swing."""
        return "backswing" if self.sign < 0 else "follow-through"


def kept_stop(
    stopper: Stopper,
    joints: Joints,
    ask: Ask,
    longest: float,
    most: float,
    known: SwingPhase | None,
) -> tuple[SwingPhase, Solved]:
    """Return a stop from the largest share, up to `most`, of the velocity that is asked for.

    Torques are bounded at nodes and half-way; where they leave their limits between those, it is
    solved again with so much more slack.

    Args:
        stopper: of the chain.
        joints: that move.
        ask: for a stop.
        longest: duration [s].
        most: share of the velocity.
        known: a stop from all of it; where the solver, whose optima are local, falls short of one
            that keeps the limits, this is the answer.

    Raises:
        InvalidInput: the solver finds none.
    """
    sure = known is not None and ask.rest is None and most == 1.0 and _keeps(known, joints, longest)
    slack, near = SLACK, None if known is None else stopper.near(known)
    for _ in range(ROUNDS):
        solved = stopper.solve(
            ask.q, ask.w, longest=longest, rest=ask.rest, slack=slack, most=most, near=near
        )
        if known is not None and sure and not (solved.ok and solved.share == most):
            return replace(known, joints=joints), stopper.as_it_is(known)
        if not solved.ok:
            raise InvalidInput(f"no {ask.name} is found: Ipopt ends with {solved.said}")
        part = part_of(
            joints, ask.sign, ask.q, solved.share * ask.w,
            solved.accelerations, solved.duration, solved.end,
        )  # fmt: skip
        over = part.torque_use - 1.0
        if over <= 0.0:
            return part, solved
        slack, near = slack + over + SLACK / 2, solved.unknowns
    if known is not None and sure:
        return replace(known, joints=joints), stopper.as_it_is(known)
    raise InvalidInput(
        f"no {ask.name} is found whose torques keep their limits between {len(part.nodes) - 1} "
        "intervals: take more nodes"
    )


def _keeps(known: SwingPhase, joints: Joints, longest: float) -> bool:
    """Return whether a stop keeps limits, which may differ from those it was found with."""
    way = known.fine()
    return bool(
        known.duration <= longest
        and (np.abs(way.torque) <= joints.effort).all()
        and (np.abs(way.v) <= joints.speed).all()
        and (way.q >= joints.low).all()
        and (way.q <= joints.high).all()
    )
