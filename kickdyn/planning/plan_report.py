"""A planned kick in words and in JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from kickdyn.ball import BallState
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course
from kickdyn.planning.free_kick import Wall, score
from kickdyn.planning.goal import Goal
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.launch import Launch, OutOfReach
from kickdyn.planning.objectives import SAID, UNITS
from kickdyn.planning.scatter import scatter
from kickdyn.planning.swing_result import Swing

NEAR = 5e-4
"""Distance from the target that is not worth a word beside the limits [m]."""

MARGIN = 5e-3
"""How much slower than the hardest kick one is that is named as possible: more than rounding."""


def verdict(planned: KickPlan) -> str:
    """Return the answer in a line."""
    where = ", ".join(f"{part:.4g}" for part in planned.goal.target)
    if planned.status == "met":
        return (
            f"The ball comes to ({where}) m after {planned.path.duration:.4g} s; strike and flight "
            f"miss it by {planned.landing_error:.2g} m."
        )
    reached = ", ".join(limit.replace("effort of", "torque of") for limit in planned.binding)
    limits = f" ({reached})" if reached else ""
    return (
        f"Beyond the leg's limits{limits}: it gives the ball {planned.share:.0%} of the speed that "
        f"({where}) m takes. {_end(planned)}{_within(planned)}"
    )


def _end(planned: KickPlan) -> str:
    """Return where and when a kick that is too weak ends."""
    path, missed = planned.path, planned.landing_error
    after = f"after {path.duration:.4g} s"
    off = "" if missed < NEAR else f", {missed:.3g} m from it"
    if path.status == "at-plane":
        late = planned.time_error
        return (
            f"The ball passes it {after}, {abs(late):.3g} s {'late' if late > 0 else 'early'}{off}."
        )
    if isinstance(path, Course):
        return f"The ball stops {path.distance:.4g} m away {after}{off}."
    way = "comes down" if path.status == "landed" else "is still aloft"
    return f"The ball {way} {path.range:.4g} m away {after}{off}."


def _within(planned: KickPlan) -> str:
    path = within_limits(planned)
    if path is None:
        return ""
    return f" Within them, that way, are {path.range:.4g} m in {path.duration:.4g} s."


def within_limits(planned: KickPlan) -> Flight | None:
    """Return a flight in the kick's direction that is a little within the limits, if known."""
    if isinstance(planned.path, Course) or planned.launch.spin.any():
        return None
    state, ball = planned.hit.ball_after, planned.hit.ball
    slower = BallState(state.position, (1.0 - MARGIN) * state.velocity)
    path = fly(slower, ball, planned.launch.air)
    return path if planned.launch.angle > 0.0 and path.status == "landed" else None


def aftermath(planned: KickPlan, limits: bool) -> list[str]:
    """Return what the joints do just after the impact that they should not, in a line, or none.

    Args:
        planned: the kick.
        limits: whether speed limits matter.
    """
    parts = [f"{name} into its stop" for name in planned.into_stop]
    if limits:
        parts += [f"{name} at {use:.0%} of its speed limit" for name, use in planned.after.items()]
    return [f"Just after the impact: {', '.join(parts)}."] if parts else []


def cautions(planned: KickPlan) -> list[str]:
    """Return the flight's warnings as sentences, or none."""
    return [f"Warning: {line}." for line in planned.warnings]


def scattered(planned: KickPlan, spread: Mapping[str, float]) -> str:
    """Return in a line how far off the ball lands for errors of given size."""
    found = scatter(planned.hit, planned.launch.air, **spread)
    parts = {name: math.sqrt(float(part.trace())) for name, part in found.by_source.items()}
    said = ", ".join(f"{size:.3g} m by {name}" for name, size in parts.items())
    return f"It lands {found.radius:.3g} m off in the root mean square: {said}."


def _deg(angle: float) -> str:
    return f"{round(math.degrees(angle), 3) + 0.0:.3f}"  # no -0


def _mm(length: float) -> str:
    return f"{round(1e3 * length, 1) + 0.0:.1f}"


def _side(shown: str) -> str:
    """Return where to something shown as a number is, which counts to the left."""
    return "right" if shown.startswith("-") else "left"


def text(planned: KickPlan) -> list[str]:
    """Return a plan's numbers as lines of text."""
    launch, hit, leg = planned.launch, planned.hit, planned.leg
    up, left = planned.impact_target.place
    joints = [
        f"  {name:24} {value:9.2f} {unit}  "
        f"{planned.v[leg.velocity_index(name)]:9.3f} {leg.joint_unit(name)}/s"
        for name, (value, unit) in leg.display_values(planned.q).items()
        if planned.v[leg.velocity_index(name)] != 0.0 or value != 0.0
    ]
    value = f"{planned.value:.4g} {UNITS.get(planned.objective, '')}".strip()
    what = SAID.get(planned.objective, planned.objective)
    azimuth, sideways = _deg(launch.azimuth), _mm(left)
    turned = f"{math.degrees(planned.heading):.2f}"
    aside = [f"base    turned {turned.lstrip('-')} deg to the {_side(turned)}"]
    return [
        f"launch  {launch.speed:.4f} m/s, {_deg(launch.angle)} deg up, "
        f"{azimuth.lstrip('-')} deg {_side(azimuth)}; {launch.iterations} Newton steps",
        f"touch   {_mm(abs(up))} mm {'above' if up >= 0.0 else 'below'} and "
        f"{sideways.lstrip('-')} mm {_side(sideways)} of the ball's centre, "
        f"impulse {math.hypot(*hit.impulse):.4f} N s, "
        f"foot {math.hypot(*hit.foot_velocity):.4f} m/s",
        f"leg     {what} {value}; speed {planned.speed_use:.0%} and "
        f"torque {planned.effort_use:.0%} of their limits; worst joint impulse "
        f"{hit.worst_joint[1]:.3g} N s at {hit.worst_joint[0]}",
        *(aside if float(turned) else []),
        *joints,
    ]


def as_json(
    planned: KickPlan,
    swing: Swing | None = None,
    wall: Wall | None = None,
    mouth: bool = False,
    spread: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Return a plan as what JSON can hold: SI units, degrees where a name says so.

    Args:
        planned: the kick.
        swing: to it, if one was planned.
        wall: that it passes, if there is one.
        mouth: whether there is a goal.
        spread: of the errors its scatter was made least for.
    """
    launch, hit, goal, leg = planned.launch, planned.hit, planned.goal, planned.leg
    return {
        "status": planned.status,
        "goal": _goal_json(goal),
        "launch": {
            "speed": launch.speed,
            "angle_deg": math.degrees(launch.angle),
            "azimuth_deg": math.degrees(launch.azimuth),
            "velocity": launch.velocity.tolist(),
            "spin": launch.spin.tolist(),
            "time": launch.time,
            "iterations": launch.iterations,
        },
        "touch": {
            "impulse": hit.impulse.tolist(),
            "normal": hit.contact.normal.tolist(),
            "up_m": planned.impact_target.place[0],
            "left_m": planned.impact_target.place[1],
            "foot_velocity": hit.foot_velocity.tolist(),
        },
        "leg": {
            "name": leg.name,
            "heading_deg": math.degrees(planned.heading),
            "q_deg": leg.angles_deg(planned.q),
            "q_m": leg.positions_m(planned.q),
            "v": planned.v.tolist(),
            "objective": planned.objective,
            "value": planned.value,
            "binding": list(planned.binding),
            "speed_use": planned.speed_use,
            "effort_use": planned.effort_use,
            "after": planned.after,
            "into_stop": list(planned.into_stop),
            "worst_joint": hit.worst_joint[0],
            "worst_joint_impulse": hit.worst_joint[1],
        },
        "share": planned.share,
        "time": planned.path.duration,
        "landing_error": planned.landing_error,
        "time_error": planned.time_error,
        "warnings": list(planned.warnings),
        **({} if planned.status == "met" else {"within_limits": _within_json(planned)}),
        **({} if wall is None else {"wall": _wall_json(wall, planned)}),
        **({"mouth": score(planned)._asdict()} if mouth else {}),
        **({} if spread is None else {"scatter": _scatter_json(planned, spread)}),
        **({} if swing is None else {"swing": _swing_json(swing)}),
    }


def unreachable_json(goal: Goal, error: OutOfReach) -> dict[str, Any]:
    """Return what `--json` writes of a goal that nothing meets."""
    found, near = error.nearest, None
    if isinstance(found, Launch):
        near = {**_goal_json(found.reached), "launch_speed": found.speed}
    elif found is not None:
        near = {"distance": found.course.distance, "time": found.time}
    return {
        "status": "unreachable",
        "goal": _goal_json(goal),
        "limit": error.limit,
        "nearest": near,
    }


def _goal_json(goal: Goal) -> dict[str, Any]:
    beside = {} if goal.beside is None else {"beside": goal.beside}
    return {"target_m": goal.target.tolist(), goal.kind: getattr(goal, goal.kind), **beside}


def _within_json(planned: KickPlan) -> dict[str, float] | None:
    path = within_limits(planned)
    return None if path is None else {"distance": path.range, "time": path.duration}


def _wall_json(wall: Wall, planned: KickPlan) -> dict[str, float | None]:
    clear = wall.clearance(planned)
    return (
        {"above": None, "beside": None}
        if clear is None
        else dict(zip(("above", "beside"), clear[:2], strict=True))
    )


def _scatter_json(planned: KickPlan, spread: Mapping[str, float]) -> dict[str, Any]:
    found = scatter(planned.hit, planned.launch.air, **spread)
    return {
        "mean": found.mean.tolist(),
        "covariance": found.covariance.tolist(),
        "by_source": {name: part.tolist() for name, part in found.by_source.items()},
        "radius": found.radius,
    }


def swing_said(swing: Swing) -> str:
    """Return a swing in a line."""
    if swing.status != "met":
        return f"No swing gives all of that: {swing.limit}."
    return (
        f"The swing takes {swing.backswing.duration:.3g} s from rest and "
        f"{swing.follow_through.duration:.3g} s to rest, at up to {swing.torque_use:.0%} of the "
        f"torque and {swing.speed_use:.0%} of the speed limits."
    )


def _swing_json(swing: Swing) -> dict[str, Any]:
    """Return a swing with its motion at the nodes of either part."""
    parts = {"backswing": swing.backswing, "follow_through": swing.follow_through}
    return {
        "status": swing.status,
        "share": swing.share,
        "limit": swing.limit,
        "objective": swing.objective,
        "value": swing.value,
        "torque_use": swing.torque_use,
        "speed_use": swing.speed_use,
        "range_left": swing.range_left,
        "defect": swing.defect,
        "impact_error": swing.impact_error,
        "joints": list(swing.joints),
        **{
            name: {key: value.tolist() for key, value in part.sample(part.nodes)._asdict().items()}
            for name, part in parts.items()
        },
    }
