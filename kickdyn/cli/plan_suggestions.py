"""Options of `kickdyn plan` that work where those that were typed do not; each one is tried."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Protocol

from kickdyn.errors import InvalidInput
from kickdyn.flight.follow import Course
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.launch import Launch, OutOfReach
from kickdyn.planning.passes import Pass
from kickdyn.planning.plan_report import OVER, flight_within_limits, passage_of
from kickdyn.scene.pitch import Wall

STEPS = 4
"""Parts of the largest curve of `--beside` that are distinguished."""

HEIGHTS = (0.05, -0.05, 0.1, -0.1)
"""Changes of the height of the ball that are tried [m]."""


class Attempt(Protocol):
    """Plans the kick of a command for another goal, or with other arguments of `plan_kick`."""

    def __call__(self, goal: Goal, **changes: Any) -> KickPlan:
        """Return the plan; raise `InvalidInput` as `plan_kick`."""


def explain_unreachable(goal: Goal, error: OutOfReach, attempt: Attempt) -> InvalidInput:
    """Return an error with the reason why no launch meets a goal, and an option that works."""
    nearest = error.nearest
    if nearest is None:
        return error
    pass_or_goal = "goal" if isinstance(nearest, Launch) else "pass"
    reason = f"the {pass_or_goal} is out of reach: {nearest.reason}"
    refusal: InvalidInput = error
    attempt = cache(attempt)  # the last of `_less_bent` has been planned
    for other in (*_nearest_goals(goal, nearest), *_less_bent(goal, nearest, attempt)):
        try:
            planned = attempt(other)
        except OutOfReach:
            continue
        except InvalidInput as refused:
            refusal = refused
            continue
        if planned.status == PlanStatus.MET:
            return InvalidInput(f"{reason}; {_option(other, goal)} is in reach")
        refusal = InvalidInput(
            f"{reason}; {_option(other, goal)} is in reach of the ball, but beyond the limits of "
            "the leg"
        )
    return refusal


def clear_wall(wall: Wall, plan: KickPlan, attempt: Attempt) -> str:
    """Return the options with which the ball does not hit the wall, as the end of a sentence."""
    goal = plan.goal
    if isinstance(plan.path, Course):
        return ""
    passage = passage_of(wall, plan)
    side = 1.0 if passage is None else math.copysign(1.0, passage.left + 1e-6)
    edge = math.ceil(1e3 * (wall.width / 2 + plan.impact.ball.radius + OVER)) / 1e3
    over = (wall.distance, float(f"{wall.height + OVER:g}"))
    others = [
        Goal(goal.target, over=over, beside=goal.beside),
        replace(goal, beside=(wall.distance, side * edge)),
    ]
    found = []
    for other in others:
        if (planned := _met(other, attempt)) is None:
            continue
        passed = passage_of(wall, planned)
        if passed is not None and passed.is_clear:
            found.append(_option(other, goal))
    return f": use {', or '.join(found)}" if found else ""


def clear_ground(plan: KickPlan, attempt: Attempt) -> Iterator[str]:
    """Yield a sentence with a height of the ball at which no body is under the ground, if any."""
    if not plan.depths:
        return
    height = float(plan.impact.ball_before.position[2])
    for change in HEIGHTS:
        other = float(f"{height + change:.3f}")
        planned = _met(plan.goal, attempt, ball_height=other)
        if planned is not None and not planned.depths:
            yield f"With --ball-height {other:g}, no body is under the ground."
            return


def back_spin(goal: Goal, spin: Sequence[float], attempt: Attempt) -> str:
    """Return the option of a spin about the y axis, turned to the target, as the end of a sentence.

    It is empty for other spins, and if the leg cannot give this one either.
    """
    distance, left, _ = goal.target.tolist()
    if spin[0] or spin[2] or not left * spin[1]:
        return ""
    size = spin[1] / math.hypot(distance, left)
    across = [float(f"{part:.6g}") for part in (-left * size, distance * size)]
    try:
        attempt(goal, spin=(*across, 0.0))
    except InvalidInput:
        return ""
    turned = f"{across[0]:.6g},{across[1]:.6g},0"
    return f"; turned with the line to the target, this spin is --spin {turned}"


def within_limits(plan: KickPlan, attempt: Attempt, wall: Wall | None) -> Iterator[str]:
    """Yield a sentence with a goal in the direction of a plan that its leg reaches, if any."""
    slower = flight_within_limits(plan) if plan.share < 1.0 else None
    if slower is None:
        return
    distance, left, _ = (slower.landing.position - slower.launch.position).tolist()
    if math.hypot(distance, left) < 0.01:  # the leg gives the ball no speed in this direction
        return
    options = f"--distance {distance:.4g} --time {slower.duration:.4g}"
    if left := float(f"{left:.4g}") if abs(left) > 1e-3 * distance else 0.0:
        options += f" --left {left:g}"
    time, target = float(f"{slower.duration:.4g}"), (float(f"{distance:.4g}"), left, 0.0)
    if _met(Goal(target, time=time), attempt) is not None:
        dropped = ["--height"] if plan.goal.target[2] != 0.0 else []
        dropped += ["--wall"] if wall and wall.distance >= math.hypot(*target[:2]) else []
        without = f", without {' and '.join(dropped)}" if dropped else ""
        yield f"Within the limits of the leg is, for instance, {options}{without}."


def _met(goal: Goal, attempt: Attempt, **changes: Any) -> KickPlan | None:
    """Return the plan that meets a goal; None where there is none."""
    try:
        planned = attempt(goal, **changes)
    except InvalidInput:
        return None
    return planned if planned.status == PlanStatus.MET else None


def _nearest_goals(goal: Goal, nearest: Launch | Pass) -> Iterator[Goal]:
    """Yield the goal of the nearest launch or pass, rounded away from what was asked for."""
    kind, wished, found = goal.kind, getattr(goal, goal.kind), None
    if isinstance(nearest, Launch):
        reached = nearest.reached
        if not (reached.target != goal.target).any() and reached.beside == goal.beside:
            found = getattr(reached, kind)
    elif nearest.course.status == "at-plane":
        found = nearest.time
    if isinstance(found, tuple):  # a distance, and the height there
        for value in _rounded_away(found[1], wished[1]):
            yield _with(goal, kind, (found[0], value))
    elif found is not None:
        for value in _rounded_away(found, wished):
            yield _with(goal, kind, value)


def _with(goal: Goal, name: str, value: Any) -> Goal:
    """Return a goal with another value of its condition or of `beside`."""
    changes: dict[str, Any] = {name: value}
    return replace(goal, **changes)


def _rounded_away(value: float, wished: float) -> Iterator[float]:
    """Yield a value with four, three and two digits, rounded away from another one."""
    for digits in (4, 3, 2):
        size = 10.0 ** (math.floor(math.log10(abs(value) or 1.0)) + 1 - digits)
        away = math.floor if wished > value else math.ceil
        yield float(f"{away(value / size) * size:.{digits}g}")


def _less_bent(goal: Goal, nearest: Launch | Pass, attempt: Attempt) -> Iterator[Goal]:
    """Yield goals with `beside` between the nearest launch and a flight that is not curved.

    By bisection, the most curved one that the leg kicks comes last.
    """
    reached = nearest.reached.beside if isinstance(nearest, Launch) else None
    if goal.beside is None or reached is None or reached == goal.beside:
        return
    distance, most = reached
    straight = _met(replace(goal, beside=None), attempt)
    passage = straight and passage_of(Wall(distance, 1.0), straight)
    if not passage:
        return
    low, high, best = 0, STEPS, None
    while high - low > 1:
        step = (low + high) // 2
        left = float(f"{passage.left + (most - passage.left) * step / STEPS:.2f}")
        other = replace(goal, beside=(distance, left))
        if _met(other, attempt) is None:
            high, last = step, other
        else:
            low, best = step, other
    yield best or last


def _option(goal: Goal, asked: Goal) -> str:
    """Return the option that makes one goal of another, which it replaces if it is of its kind."""
    names = {"speed": "launch-speed"}
    for name in ("beside", "over", "time", "apex", "speed"):
        value = getattr(goal, name)
        if value is None or value == getattr(asked, name):
            continue
        shown = (
            ":".join(f"{part:g}" for part in value) if isinstance(value, tuple) else f"{value:g}"
        )
        replaced = "" if name in ("beside", asked.kind) else asked.kind
        instead = f" in place of --{names.get(replaced, replaced)}" if replaced else ""
        return f"--{names.get(name, name)} {shown}{instead}"
    return ""
