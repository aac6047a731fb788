"""All launches that meet a goal; where there is none, the nearest goal that can be met, and why."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core import validation
from kickdyn.errors import InvalidInput
from kickdyn.planning.goal import Goal, nominal_velocity
from kickdyn.planning.launch_family import Family, Member, farthest_point
from kickdyn.planning.launch_newton import LaunchSolution, newton
from kickdyn.planning.launch_result import Launch, Launches
from kickdyn.planning.shooting import ShootingProblem

SPEED_LIMIT = 343.0
"""[m/s]. Faster than sound, drag coefficients without a Mach number mean nothing."""

SAME = 1e-6
"""Share by which two times of flight differ at least, if they are two solutions."""


def plan_launches(
    goal: Goal,
    ball: Ball,
    air: Air | None = None,
    *,
    spin: ArrayLike = (0.0, 0.0, 0.0),
    speed_limit: float = SPEED_LIMIT,
    spin_limit: float = 100.0,
) -> Launches:
    """Find every launch, in space, that meets a goal: with drag, lift and wind.

    Newton's method starts from the vacuum's answers, Eqs. (24)-(25), with derivatives that are
    integrated along. Where that finds nothing, the family of all launches to the target is
    followed: it gives the answer, or the nearest one there is. A launch whose way to the target
    leads through the ground, as strong back spin may ask for, is none.

    Args:
        goal: from the ball's place.
        ball: mass and radius.
        air: None is the vacuum; wind that depends on height counts it from the launch.
        spin: shape `(3,)` [rad/s, world axes]; for `beside`, its axis, the size being sought.
        speed_limit: of the launch [m/s], at most 343.
        spin_limit: largest spin that `beside` may ask for [rad/s].

    Raises:
        InvalidInput: a value out of range, or `beside` where no lift can bend the way.
    """
    validation.check_type(Goal, goal=goal)
    most = validation.number("speed limit", speed_limit, above=0, at_most=SPEED_LIMIT, unit="m/s")
    turn_limit = validation.number("spin limit", spin_limit, above=0, unit="rad/s")
    turning = validation.vector("spin", spin, 3, unit="rad/s")
    if goal.beside is not None:
        if air is None or air.lift is None or air.density == 0.0:
            raise InvalidInput("beside asks for a curved way: name air with lift")
        turning = validation.direction("spin", turning if turning.any() else (0.0, 0.0, 1.0))
    field = ShootingProblem(ball, air, turning, goal.beside is not None)
    roots = _direct(field, goal)
    bends = [root for root in roots if abs(root.size) <= turn_limit]
    meeting = [root for root in bends if math.hypot(*root.velocity) <= most * (1 + 1e-12)]
    clear = [root for root in meeting if root.above_ground(goal)]
    expected = 2 if goal.speed is not None else 1
    if len(meeting) >= expected and clear:
        return _met(field, goal, clear)
    if goal.beside is not None and not meeting:
        return _curved_else(field, goal, most, turn_limit, roots)
    family = Family(field, goal, most)
    members = family.within()
    meeting = _several([*meeting, *_crossings(family, members, turn_limit)])
    clear = [root for root in meeting if root.above_ground(goal)]
    if clear:
        return _met(field, goal, clear)
    if not members:
        return _too_far(field, goal, most)
    return _nearest(goal, family, members, buried=bool(meeting))


def _direct(field: ShootingProblem, goal: Goal) -> list[LaunchSolution]:
    found = []
    for time in goal.nominal_times():
        root = newton(field, goal, nominal_velocity(goal.target, time), time)
        if root.met and (goal.apex is None or _comes_down(root)):
            found.append(root)
    return _several(found)


def _comes_down(root: LaunchSolution) -> bool:
    return root.shot is not None and float(root.shot.place(root.time)[1][2]) <= 1e-9


def _several(roots: list[LaunchSolution]) -> list[LaunchSolution]:
    apart: list[LaunchSolution] = []
    for root in sorted(roots, key=lambda root: root.time):
        if not apart or root.time > apart[-1].time * (1 + SAME):
            apart.append(root)
    return apart


def _crossings(family: Family, members: list[Member], turn_limit: float) -> list[LaunchSolution]:
    """Return the roots between members on both sides of what is named."""
    found = []
    for one, other in pairwise(members):
        if not one.error * other.error <= 0.0:
            continue
        root = _between(family, one, other)
        if root is not None and abs(root.size) <= turn_limit:
            found.append(replace(root, tried=()))
    return [root for root in found if math.hypot(*root.velocity) <= family.limit * (1 + 1e-9)]


def _between(family: Family, one: Member, other: Member) -> LaunchSolution | None:
    """Return the root between two members: by Newton from either, or by bisection for a start."""

    def error(time: float) -> float:
        member = family.at(time)
        return math.nan if member is None else member.error

    early, late = one.root.time, other.root.time
    for start in sorted((one, other), key=lambda member: abs(member.error)):
        near = start.root
        root = newton(family.field, family.goal, near.velocity, near.time, near.size)
        if root.met and early <= root.time <= late:
            return root
    with suppress(ValueError, RuntimeError):
        member = family.at(float(brentq(error, early, late, xtol=1e-13 * late, rtol=1e-13)))
        if member is not None:
            near = member.root
            root = newton(family.field, family.goal, near.velocity, near.time, near.size)
            return root if root.met else None
    return None


def _launch(field: ShootingProblem, goal: Goal, root: LaunchSolution) -> Launch:
    spin = field.spin_of(root.size)
    return Launch(
        goal, root.velocity, spin, root.time, root.errors, root.tried, field.ball, field.air
    )


def _met(field: ShootingProblem, goal: Goal, roots: list[LaunchSolution]) -> Launches:
    return Launches("met", goal, tuple(_launch(field, goal, root) for root in roots))


def _too_far(field: ShootingProblem, goal: Goal, limit: float) -> Launches:
    where, velocity, time = farthest_point(field, goal.target, limit)
    near = Goal(where, time=time)
    root = LaunchSolution(velocity, time, 0.0, np.zeros(4), True, (), None)
    return Launches("unreachable", goal, (), "speed limit", _launch(field, near, root))


def _curved_else(
    field: ShootingProblem, goal: Goal, limit: float, turn_limit: float, roots: list[LaunchSolution]
) -> Launches:
    """Return what hinders a curved way: the speed without it, or else the spin."""
    assert goal.beside is not None
    named = {goal.kind: getattr(goal, goal.kind)}
    way = math.copysign(turn_limit, roots[0].size if roots else _bend(field, goal))
    spun = plan_launches(
        Goal(goal.target, **named), field.ball, field.air, spin=field.spin_of(way),
        speed_limit=limit,
    )  # fmt: skip
    if spun.status != "met":
        return Launches("unreachable", goal, (), spun.limit, spun.nearest)
    best = spun.solutions[0]
    bent = ShootingProblem(field.ball, field.air, best.spin)
    shot = bent.shoot(best.velocity, best.time)
    assert shot is not None
    left = np.cross((0.0, 0.0, 1.0), goal.ahead)
    sideways = shot.crossing(goal.ahead, goal.beside[0], left)[0]
    near = Goal(goal.target, **named, beside=(goal.beside[0], sideways))
    return Launches("unreachable", goal, (), "spin limit", replace(best, goal=near))


def _bend(field: ShootingProblem, goal: Goal) -> float:
    """Return the sign of spin about the axis that bends the way to the side that is asked for."""
    assert goal.beside is not None
    left = np.cross((0.0, 0.0, 1.0), goal.ahead)
    pushed = float(np.cross(field.spin, goal.ahead) @ left)  # it starts to the other side
    return -pushed * goal.beside[1] or 1.0


def _nearest(goal: Goal, family: Family, members: list[Member], *, buried: bool) -> Launches:
    """Return the member that is nearest to what is named and clear of the ground.

    `buried` says that nothing else is in the way.
    """
    best = min(members, key=lambda member: abs(member.error))
    if buried or not best.clear:
        clear = family.clear(members)
        if not clear:
            return Launches("unreachable", goal, (), "ground")
        best, buried = min(clear, key=lambda member: abs(member.error)), True
    best = family.refined(best)
    value: Any = {
        "time": best.root.time,
        "speed": best.speed,
        "apex": (goal.apex or 0.0) + best.error,
        "over": goal.over and (goal.over[0], goal.over[1] + best.error),
    }[goal.kind]
    at_limit = best.speed >= family.limit * (1 - 1e-6)
    bounds = {
        "time": "speed limit",
        "speed": "speed limit" if at_limit else "least speed",
        "apex": "lowest way" if best.error > 0 else "highest way",
        "over": "lowest way" if best.error > 0 else "highest way",
    }
    kind = goal.kind
    if value == 0.0:  # an apex at the start names no one launch
        kind, value = "time", best.root.time
    near = Goal(goal.target, **{kind: value}, beside=goal.beside)
    limit = "ground" if buried else bounds[goal.kind]
    found = replace(best.root, tried=())
    return Launches("unreachable", goal, (), limit, _launch(family.field, near, found))
