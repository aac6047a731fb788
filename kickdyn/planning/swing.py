"""The swing around a planned kick: from rest through the impact to rest again, within limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.constraint_impulses import check_free
from kickdyn.planning.goal import PlanStatus
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.swing_joints import LONGEST, Joints, check_solver, joints_of
from kickdyn.planning.swing_phase import SwingPhase
from kickdyn.planning.swing_result import Swing
from kickdyn.robot.leg import Leg

if TYPE_CHECKING:
    from kickdyn.planning.kept_stop import Ask
    from kickdyn.planning.stop_problem import Solved

LEAST = 1e-3
"""Share of the planned speed below which there is no swing to show."""


def plan_swing(
    leg: Leg,
    plan: KickPlan,
    *,
    objective: Literal["effort", "time"] = "effort",
    longest: float = LONGEST,
    start: ArrayLike | None = None,
    end: ArrayLike | None = None,
    nodes: int = 24,
) -> Swing:
    """Find the way from rest to a planned impact, and from there to rest again.

    Range, speed and torque limits of the leg hold all the way. Torques may jump at both ends and
    at the impact. Needs CasADi, `pip install "kickdyn[swing]"`.

    Args:
        leg: that was planned for, or one that differs from it in limits only.
        plan: by `plan_kick`; `swing=True` there leaves room to swing.
        objective: `effort`, that of the torques: the mean over the joints of (torque / limit)^2,
            integrated over time (`plan_kick` calls the kinetic energy so); or `time`, the duration
            of each part.
        longest: duration of either part [s].
        start: posture at rest before, shape `(nq,)`; free when not named, as long as the joints'
            torques can hold it.
        end: posture at rest after, likewise.
        nodes: intervals of either part. Where the solver falls short of the way that
            `plan_kick(..., swing=True)` found, that one is taken, with its own nodes.

    Raises:
        InvalidInput: CasADi is missing; a joint is at the end of its range and moves into it; no
            swing is found; a leg that is held by more than its joints, moves what is not between
            base and foot, or has no limits; a value out of range.
    """
    check_free(leg, "swings are planned")
    validation.check_type(KickPlan, plan=plan)
    check_solver()
    if objective not in ("effort", "time"):
        raise InvalidInput(f"objective {objective!r} is unknown: choose effort, time")
    longest = validation.number("longest", longest, at_least=0.01, at_most=60, unit="s")
    if not isinstance(nodes, int) or isinstance(nodes, bool) or not 4 <= nodes <= 200:
        raise InvalidInput(f"nodes is {nodes!r}: it must be a whole number from 4 to 200")
    joints = _joints(leg, plan)
    rests = [_rest(joints, leg, "start", start), _rest(joints, leg, "end", end)]
    from kickdyn.planning.chain import Chain
    from kickdyn.planning.kept_stop import Ask, kept_stop
    from kickdyn.planning.stop_problem import Stopper

    chain = Chain(joints.model, plan.hit.posture.contact_lever)
    stopper = Stopper(chain, joints, nodes, objective)
    asks = [
        Ask(-1, plan.q[joints.qs], -plan.v[joints.vs], rests[0]),
        Ask(1, plan.q[joints.qs], plan.hit.v_after[joints.vs], rests[1]),
    ]
    parts: list[tuple[SwingPhase, Solved]] = []
    share, limit = 1.0, ""
    known = plan.parts or (None, None)
    for ask, near in zip(asks, known, strict=True):
        _check_room(joints, leg, ask)
        parts.append(kept_stop(stopper, joints, ask, longest, share, near))
        if parts[-1][1].share < share:
            share = parts[-1][1].share
            what, number = parts[-1][1].about
            limit = (
                f"{ask.name}: the {what} limit of {joints.names[number]} leaves {share:.4g} of the "
                "planned speed"
            )
            if share < LEAST:
                raise InvalidInput(f"there is no swing to this kick; {limit}")
    if parts[0][1].share > share:
        parts[0] = kept_stop(stopper, joints, asks[0], longest, share, known[0])
    return Swing(
        status=PlanStatus.MET if share == 1.0 else PlanStatus.BEYOND_LIMITS,
        plan=plan,
        share=share,
        limit=limit,
        objective=objective,
        value=sum(solved.value for _, solved in parts),
        joints=joints.names,
        backswing=parts[0][0],
        follow_through=parts[1][0],
    )


def _joints(leg: Leg, plan: KickPlan) -> Joints:
    own = plan.hit.posture.leg
    if own.joint_names != leg.joint_names or own.frame != leg.frame:
        raise InvalidInput(f"the plan is for {own!r}: it must be for {leg!r}")
    joints = joints_of(leg)
    others = np.abs(plan.hit.v_after)
    others[joints.vs] = 0.0
    if others.max() > 1e-9 * np.abs(plan.hit.v_after).max():
        worst = int(np.argmax(others))
        name = next(n for n in leg.joint_names if leg.velocity_index(n) == worst)
        raise InvalidInput(f"the impact moves {name}, which does not swing the foot: lock it first")
    return joints


def _rest(joints: Joints, leg: Leg, name: str, q: ArrayLike | None) -> Array | None:
    if q is None:
        return None
    rest: Array = validation.vector(name, q, leg.nq, unit="rad")[joints.qs]
    outside = (rest < joints.low) | (rest > joints.high)
    if outside.any():
        number = int(np.argmax(outside))
        raise InvalidInput(
            f"{name} has {joints.names[number]} at {rest[number]:g}: it must be in "
            f"{joints.low[number]:g} to {joints.high[number]:g} rad"
        )
    return rest


def _check_room(joints: Joints, leg: Leg, ask: Ask) -> None:
    """Refuse what no torque can stop, with the joint's name: the solver would only say no."""
    room = np.where(ask.w > 0, joints.high - ask.q, ask.q - joints.low)
    stuck = (room <= 1e-9) & (np.abs(ask.w) > 1e-6 * joints.speed)
    if not stuck.any():
        return
    worst = int(np.argmax(np.where(stuck, np.abs(ask.w) / joints.speed, 0.0)))
    name, speed = joints.names[worst], abs(float(ask.w[worst]))
    unit = leg.joint_unit(name)
    end = float(ask.q[worst])
    where = f"{end:.4g} m" if unit == "m" else f"{round(math.degrees(end), 1) + 0.0:g} deg"
    does = "just before the impact it would come from beyond" if ask.sign < 0 else (
        "just after the impact it moves on"
    )  # fmt: skip
    raise InvalidInput(
        f"there is no swing to this kick; {ask.name}: {name} is at the end of its range ({where}) "
        f"and {does} at {speed:.4g} {unit}/s; plan_kick(..., swing=True) leaves room"
    )
