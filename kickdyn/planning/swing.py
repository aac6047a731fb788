"""The swing around a planned kick: from rest through the impact to rest again, within limits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

from kickdyn import checks
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.held import check_free
from kickdyn.leg import Leg
from kickdyn.planning.joints import LONGEST, Joints, check_solver, joints_of
from kickdyn.planning.kick import KickPlan
from kickdyn.planning.swing_answer import Part, Swing

if TYPE_CHECKING:
    from kickdyn.planning.stop import Solved, Stopper

SLACK = 0.005
"""Share of the torque limits left over at first, for torques between the points of the solver."""

ROUNDS = 5
"""Solutions, each with more slack, until the torques keep their limits between those points."""

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
        objective: `effort`, the mean over the joints of (torque / limit)^2, integrated over time;
            or `time`, the duration of each part.
        longest: duration of either part [s].
        start: posture at rest before, shape `(nq,)`; free when not named, as long as the joints'
            torques can hold it.
        end: posture at rest after, likewise.
        nodes: intervals of either part.

    Raises:
        InvalidInput: CasADi is missing; a joint is at the end of its range and moves into it; no
            swing is found; a leg that is held by more than its joints, moves what is not between
            base and foot, or has no limits; a value out of range.
    """
    check_free(leg, "swings are planned")
    checks.made_of(KickPlan, plan=plan)
    check_solver()
    if objective not in ("effort", "time"):
        raise InvalidInput(f"objective {objective!r} is unknown: choose effort, time")
    longest = checks.number("longest", longest, at_least=0.01, at_most=60, unit="s")
    if not isinstance(nodes, int) or isinstance(nodes, bool) or not 4 <= nodes <= 200:
        raise InvalidInput(f"nodes is {nodes!r}: it must be a whole number from 4 to 200")
    joints = _joints(leg, plan)
    rests = [_rest(joints, leg, "start", start), _rest(joints, leg, "end", end)]
    from kickdyn.planning.chain import Chain
    from kickdyn.planning.stop import Stopper

    chain = Chain(joints.model, plan.hit.posture.contact_lever)
    stopper = Stopper(chain, joints, nodes, objective)
    asks = [
        _Ask(-1, plan.q[joints.qs], -plan.v[joints.vs], rests[0]),
        _Ask(1, plan.q[joints.qs], plan.hit.v_after[joints.vs], rests[1]),
    ]
    parts: list[tuple[Part, Solved]] = []
    share, limit = 1.0, ""
    for ask in asks:
        _check_room(joints, leg, ask)
        parts.append(_part(stopper, joints, ask, longest, share))
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
        parts[0] = _part(stopper, joints, asks[0], longest, share)
    return Swing(
        status="met" if share == 1.0 else "beyond limits",
        plan=plan,
        share=share,
        limit=limit,
        objective=objective,
        value=sum(solved.value for _, solved in parts),
        joints=joints.names,
        backswing=parts[0][0],
        follow_through=parts[1][0],
    )


class _Ask(NamedTuple):
    """A stop that is asked for: side of the impact, posture, velocity away from it, rest."""

    sign: int
    q: Array
    w: Array
    rest: Array | None

    @property
    def name(self) -> str:
        return "backswing" if self.sign < 0 else "follow-through"


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
    rest: Array = checks.vector(name, q, leg.nq, unit="rad")[joints.qs]
    outside = (rest < joints.low) | (rest > joints.high)
    if outside.any():
        number = int(np.argmax(outside))
        raise InvalidInput(
            f"{name} has {joints.names[number]} at {rest[number]:g}: it must be in "
            f"{joints.low[number]:g} to {joints.high[number]:g} rad"
        )
    return rest


def _check_room(joints: Joints, leg: Leg, ask: _Ask) -> None:
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


def _part(
    stopper: Stopper, joints: Joints, ask: _Ask, longest: float, most: float
) -> tuple[Part, Solved]:
    slack, near = SLACK, None
    for _ in range(ROUNDS):
        solved = stopper.solve(
            ask.q, ask.w, longest=longest, rest=ask.rest, slack=slack, most=most, near=near
        )
        if not solved.ok:
            raise InvalidInput(f"no {ask.name} is found: Ipopt ends with {solved.said}")
        part = _spline(joints, ask, solved)
        over = float((np.abs(part.fine().torque) / joints.effort).max()) - 1.0
        if over <= 0.0:
            return part, solved
        slack, near = slack + over + SLACK / 2, solved.unknowns
    raise InvalidInput(
        f"no {ask.name} is found whose torques keep their limits between {len(part.nodes) - 1} "
        "intervals: take more nodes"
    )


def _spline(joints: Joints, ask: _Ask, solved: Solved) -> Part:
    """Return the part, rounding of the solver put right so that both ends are met exactly."""
    time, pulls = solved.duration, solved.accelerations
    s = np.linspace(0.0, time, len(pulls))
    w = solved.share * ask.w

    def rates(pulls: Array) -> tuple[PPoly, PPoly, PPoly]:
        slopes = np.diff(pulls, axis=0) / np.diff(s)[:, None]
        a = PPoly(np.array([slopes, pulls[:-1]]), s)
        v = a.antiderivative()
        v.c[-1] += w
        q = v.antiderivative()
        q.c[-1] += ask.q
        return a, v, q

    _, v, q = rates(pulls)
    off = np.array([-v(time), solved.end - q(time)])
    lines = np.linalg.solve([[time, time**2 / 2], [time**2 / 2, time**3 / 6]], off)
    a, v, q = rates(pulls + lines[0] + s[:, None] * lines[1])
    return Part(joints, ask.sign, time, a, v, q)
