"""Planning a launch: every launch that meets a goal, or the nearest there is."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.representation import Row
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.derivatives import DifferentiableFlight
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.ground import Ground
from kickdyn.plane import Plane
from kickdyn.planning.goal import (
    REASONS,
    Goal,
    LaunchArc,
    LaunchLimit,
    PlannedLaunch,
    PlanStatus,
    meet_receiver,
)
from kickdyn.planning.launch_family import LaunchFamily
from kickdyn.planning.launch_solver import (
    UP,
    LaunchSolution,
    ShootingProblem,
    crossing,
    crossing_time,
    solve_launch,
)

SPEED_LIMIT = 343.0
"""Speed of sound [m/s]: drag coefficients without a Mach number do not hold beyond."""

FLIGHT_TOL = 1e-12
"""Relative tolerance of the flight by which a launch is verified."""


class OutOfReach(InvalidInput):
    """A goal that no launch meets.

    Attributes:
        limit: the reason why there is no such launch.
        nearest: the nearest launch or pass there is; None if none is known.
    """

    def __init__(self, message: str, limit: LaunchLimit, nearest: PlannedLaunch | None) -> None:
        self.limit, self.nearest = limit, nearest
        super().__init__(message)

    def __reduce__(self) -> "tuple[type[OutOfReach], tuple[Any, ...]]":
        return OutOfReach, (str(self), self.limit, self.nearest)


@dataclass(frozen=True, eq=False, repr=False)
class Launch(PlannedLaunch):
    """A launch from the origin that meets a goal, or comes nearest to it.

    Attributes:
        reached: the goal that this launch meets: `goal` where the status is `met`, else the nearest
            there is.
        errors: errors of the target (3 components), of the condition beside it and of `beside`
            [m, s, m/s], shape `(4,)`, or `(5,)` with `beside`.
        history: launch velocities of Newton's method, shape `(iterations + 1, 3)` [m/s]. The first
            is the vacuum's solution, Eqs. (24)-(25), or, where Newton's method fails from there,
            another launch to the target; the last is `velocity`.
        limits: largest launch speed [m/s] and size of the spin that `beside` seeks [rad/s].
    """

    reached: Goal
    errors: Array
    history: Array
    limits: tuple[float, float]
    _slopes: Array = field(repr=False, default_factory=lambda: np.zeros((0, 0)))

    def _rows(self) -> Iterable[Row]:
        yield "status", f"{self.status}: {self.limit}" if self.limit else self.status, ""
        if self.limit:
            yield "nearest", repr(self.reached), ""
        yield "speed", self.speed, "m/s"
        yield "angle", math.degrees(self.angle), "deg"
        yield "azimuth", math.degrees(self.azimuth), "deg"
        yield "spin", self.spin, "rad/s"
        yield "time", self.time, "s"
        yield "largest error", float(abs(self.errors).max()), ""
        yield "iterations", self.iterations, ""
        for other in self.others:
            yield "another", f"{other.speed:.4g} m/s, {math.degrees(other.angle):.4g} deg", ""
        for line in self.flight.warnings:
            yield "warning", line, ""

    @property
    def iterations(self) -> int:
        """Number of steps of Newton's method."""
        return len(self.history) - 1

    @cached_property
    def others(self) -> "tuple[Launch, ...]":
        """The other launches that meet the goal, by time of flight; computed when first read.

        Launches to the target form branches, with one for each time of flight. These are all on the
        branches to which Newton's method comes from the vacuum's solutions; others can be missing.
        """
        if self.limit is not None:
            return ()
        problem = _shooting_problem(self.goal, self.ball, self.air, self.spin)
        family = LaunchFamily(problem, self.goal, *self.limits)
        unknowns = *self.velocity, self.time
        return tuple(
            _launch(family, self.goal, None, solution)
            for solution in family.solutions
            if solution.is_above_ground
            and math.dist((*solution.velocity, solution.time), unknowns) > 1e-6 * self.speed
        )

    @cached_property
    def flight(self) -> Flight:
        """The flight by `kickdyn.fly` to the vertical plane through the target; `tol` is 1e-12."""
        return fly_to_target(self.state, self.reached, self.ball, self.air, self.time)

    @property
    def summary(self) -> str:
        """A line that says whether the goal is met, and if not, why."""
        if self.limit is None:
            count = 1 + len(self.others)
            return "1 launch meets the goal" if count == 1 else f"{count} launches meet the goal"
        goal, reached, speed = self.goal, self.reached, f", at {self.speed:.4g} m/s"
        if (reached.target != goal.target).any():
            nearest = f"the farthest is {reached.distance:.4g} m{speed}"
        else:
            changed = reached.kind if reached.beside in (None, goal.beside) else "beside"
            named = {name: f"{name} {value} {unit}" for name, value, unit in reached.named_values()}
            straight = " without beside" if reached.beside is None and goal.beside else ""
            nearest = f"the nearest is {named[changed]}{straight}"
            nearest += "" if changed == "speed" else speed
        fastest, spin = self.limits
        reason = REASONS[self.limit].format(speed=fastest, spin=spin)
        return f"out of reach: {reason}; {nearest}"


@validation.check_arguments
def plan_launch(
    goal: Goal,
    ball: Ball,
    air: Air | None = None,
    *,
    speed_limit: float = SPEED_LIMIT,
    spin_limit: float = 100.0,
    struck: BallState | None = None,
    near: Launch | None = None,
) -> Launch:
    r"""Find the launch that meets a goal, with drag, lift and wind, in three dimensions.

    Newton's method starts from the launches in a vacuum, Eqs. (24)-(25),

    .. math:: v = x_{target} / t + \tfrac12 g t\, e_z,

    with derivatives that are integrated along the flight. Where it does not converge, the launches
    to the target are followed in the time of flight; among them is the solution, or the nearest
    launch. A launch whose flight intersects the ground, as with strong back spin, does not count.

    Args:
        goal: the goal, seen from the position of the ball.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum. A wind that depends on the height takes the height above
            the launch.
        speed_limit: largest speed of the launch [m/s], at most 343.
        spin_limit: largest spin that `beside` may take [rad/s].
        struck: the ball just before it is struck; velocity and spin count. Its spin along the
            impulse stays, in place of what the goal names. None leaves the spin as the goal has it.
        near: launch to a similar goal, near which the launch is sought first.

    Returns:
        The launch, with all others that meet the goal; or the nearest, with status `unreachable`.

    Raises:
        InvalidInput: a value out of range, or `beside` where no lift can bend the flight.
        OutOfReach: the ground is in the way of every launch to the target.

    Example:
        >>> import kickdyn as kd
        >>> launch = kd.plan_launch(kd.Goal(30, time=1.5), kd.Ball(), kd.Air())
        >>> str(launch.status), round(launch.speed, 2), round(launch.angle, 3)
        ('met', 24.85, 0.315)
    """
    limit = validation.number("speed limit", speed_limit, above=0, at_most=SPEED_LIMIT, unit="m/s")
    most_spin = validation.number("spin limit", spin_limit, above=0, unit="rad/s")
    ball.check_movable("a flight")
    if goal.receiver_velocity.any():
        again = partial(
            plan_launch, ball=ball, air=air, speed_limit=limit, spin_limit=most_spin,
            struck=struck, near=near,
        )  # fmt: skip
        return meet_receiver(goal, again)
    problem = replace(_shooting_problem(goal, ball, air, goal.spin), struck=struck)
    family = LaunchFamily(problem, goal, limit, most_spin)
    if near is not None and goal.beside is None:
        sloping = goal.kind not in ("time", "speed")
        solution = solve_launch(problem, goal, _unknowns_near(near, goal), last_slopes=sloping)
        if solution and family.is_inside(solution) and solution.is_above_ground:
            return _launch(family, goal, None, solution)

    solutions = [solution for solution in family.direct if family.is_inside(solution)]
    clear = [solution for solution in solutions if solution.is_above_ground]
    if goal.arc == LaunchArc.LOW and clear and len(solutions) == (2 if goal.kind == "speed" else 1):
        return _launch(family, goal, None, clear[0])

    clear = [solution for solution in family.solutions if solution.is_above_ground]
    if clear:
        return _launch(family, goal, None, clear[0 if goal.arc == LaunchArc.LOW else -1])
    if goal.beside is not None and not family.solutions:
        return _nearest_curve(family)
    inside = [m for branch in family.branches for m in branch if family.is_inside(m)]
    return _nearest(family, inside) if inside else _farthest(family)


def _unknowns_near(near: Launch, goal: Goal) -> Array:
    """Return velocity and time of the launch to a goal, to first order from a launch near it."""
    unknowns = np.array([*near.velocity, near.time])
    errors = np.zeros(4)
    errors[:3] = near.goal.target - goal.target
    if goal.time is not None:
        errors[3] = near.time - goal.time
    elif goal.speed is not None:
        errors[3] = near.speed - goal.speed
    if near._slopes.shape == (4, 4):
        unknowns -= np.linalg.lstsq(near._slopes, errors, rcond=1e-14)[0]
    if goal.time is not None:
        unknowns[3] = goal.time
    return unknowns


def _shooting_problem(goal: Goal, ball: Ball, air: Air | None, spin: Array) -> ShootingProblem:
    """Return ball, air and spin as a shooting problem; the spin's size is unknown for `beside`."""
    if goal.beside is not None:
        if air is None or air.lift is None or air.density == 0.0:
            raise InvalidInput(
                f"beside is {goal.beside[0]:g} m, {goal.beside[1]:g} m: only a curved flight "
                "passes there, which needs air with density and lift"
            )
        spin = validation.direction("spin", spin if spin.any() else (0.0, 0.0, 1.0))
    return ShootingProblem(ball, air, spin, goal.beside is not None)


def _launch(
    family: LaunchFamily, reached: Goal, limit: LaunchLimit | None, solution: LaunchSolution
) -> Launch:
    return Launch(
        status=PlanStatus.MET if limit is None else PlanStatus.UNREACHABLE,
        goal=family.goal,
        reached=reached,
        limit=limit,
        velocity=solution.velocity,
        spin=family.problem.spin_of(solution.unknowns[:-1]),
        time=solution.time,
        errors=solution.errors,
        history=solution.history,
        ball=family.problem.ball,
        air=family.problem.air,
        limits=(family.speed_limit, family.spin_limit),
        _slopes=solution.slopes,
    )


def _farthest(family: LaunchFamily) -> Launch:
    """Return the launch at the speed limit that comes farthest on the line to the target."""
    goal, speed = family.goal, family.speed_limit
    slope = float(goal.target[2]) / goal.distance
    most = 2.5 * speed / GRAVITY * (1.0 + abs(slope))

    def flight(angle: float) -> DifferentiableFlight | None:
        velocity = speed * (math.cos(angle) * goal.ahead + math.sin(angle) * UP)
        longest = family.problem.shoot(velocity, most)
        if longest is None:
            return None
        time = crossing_time(longest, slope * goal.ahead - UP, 0.0, begin=1e-6 * most)
        return None if time is None else replace(longest, end=time)

    def negative_distance(angle: float) -> float:
        path = flight(angle)
        return 0.0 if path is None else -float(goal.ahead @ path.position(path.end))

    bounds = math.atan(slope) + 1e-3, math.pi / 2 - 1e-3
    how: Any = {"method": "bounded", "options": {"xatol": 1e-5}}
    best = minimize_scalar(negative_distance, bounds=bounds, **how)
    path = flight(float(best.x))
    if path is None:
        line = f"the goal is out of reach of every launch at {speed:.4g} m/s"
        raise OutOfReach(line, LaunchLimit.SPEED, None)
    unknowns = np.array([*path.velocity(0.0), path.end])
    solution = LaunchSolution(unknowns, np.zeros(4), unknowns[None, :3], path, np.zeros((0, 0)))
    reached = Goal(path.position(path.end), time=path.end, spin=goal.spin)
    return _launch(family, reached, LaunchLimit.SPEED, solution)


def _nearest_curve(family: LaunchFamily) -> Launch:
    problem, goal = family.problem, family.goal
    assert goal.beside is not None
    distance, sideways = goal.beside
    pushed = float(np.cross(problem.spin, goal.ahead) @ goal.left)  # it starts to the other side
    bend = family.direct[0].spin_size if family.direct else -pushed * sideways or 1.0
    spun = plan_launch(
        replace(goal, beside=None, spin=problem.spin * math.copysign(family.spin_limit, bend)),
        problem.ball,
        problem.air,
        speed_limit=family.speed_limit,
        spin_limit=family.spin_limit,
        struck=problem.struck,
    )
    if spun.status != PlanStatus.MET:  # the speed limit is in the way even without `beside`
        return replace(spun, goal=goal)
    flight = ShootingProblem(problem.ball, problem.air, spun.spin).shoot(spun.velocity, spun.time)
    assert flight is not None
    passed, _ = crossing(flight, goal.ahead, distance, goal.left)
    return replace(
        spun,
        status=PlanStatus.UNREACHABLE,
        goal=goal,
        reached=replace(goal, beside=(distance, passed)),
        limit=LaunchLimit.SPIN,
    )


def _nearest(family: LaunchFamily, inside: list[LaunchSolution]) -> Launch:
    """Return the member within limits nearest to what the goal names that is clear of the ground.

    Where solutions exist, all of them lead through the ground.
    """
    goal, ground_blocks = family.goal, bool(family.solutions)

    def distance(member: LaunchSolution) -> float:
        return abs(member.condition(goal)[0])

    nearest = min(inside, key=distance)
    if ground_blocks or not nearest.is_above_ground:
        clear, ground_blocks = family.above_ground(), True
        if not clear:
            line = "the goal is out of reach: the ground is in the way of every launch"
            raise OutOfReach(line, LaunchLimit.GROUND, None)
        nearest = min(clear, key=distance)
    nearest = family.refine(nearest)
    error, _ = nearest.condition(goal)
    if goal.over is not None:
        reached = replace(goal, over=(goal.over[0], goal.over[1] + error))
    elif goal.time is not None or goal.apex == -error:  # many launches have their apex at the start
        reached = replace(goal, apex=None, time=nearest.time)
    else:
        reached = replace(goal, **{goal.kind: getattr(goal, goal.kind) + error})
    limit = LaunchLimit.SPEED
    if ground_blocks:
        limit = LaunchLimit.GROUND
    elif goal.over is not None or goal.apex is not None:
        limit = LaunchLimit.LOWEST_PATH if error > 0 else LaunchLimit.HIGHEST_PATH
    elif goal.speed is not None and nearest.speed < family.speed_limit * (1 - 1e-6):
        limit = LaunchLimit.LEAST_SPEED
    elif nearest.speed < 0.99 * family.speed_limit:
        limit = LaunchLimit.SEARCH
    return _launch(family, reached, limit, nearest)


def fly_to_target(
    state: BallState,
    goal: Goal,
    ball: Ball,
    air: Air | None,
    time: float | None = None,
    ground: float = math.inf,
) -> Flight:
    """Fly to the vertical plane through a goal's target, or to the ground before it.

    A launch that meets the goal has its `time` to the target [s]: it may cross the plane before and
    be blown back, and it does not end on the ground by mere rounding. The ground is at a height
    [m, world frame], or level with the ball or the target where these are lower.
    """
    plane = Plane(state.position + goal.target, -goal.ahead, "centre")
    floor = min(ground, float(state.position[2]) + goal.lowest - ball.radius)
    if time is None:
        return fly(state, ball, air, Ground(floor), FLIGHT_TOL, plane=plane)
    lower = Ground(floor - 1e-6)
    path = fly(state, ball, air, lower, FLIGHT_TOL, plane=plane, time_limit=2 * time)
    if path.status == "at-plane" and abs(path.duration - time) < 0.5 * time:
        return path
    return fly(state, ball, air, lower, FLIGHT_TOL, time_limit=time)
