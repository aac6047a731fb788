"""Kicks of moving balls: times of plans, and random balls from all sides.

    python benchmarks/replan.py [BALLS [REFUSALS]]

Without numbers it prints the processor time of a plan for a ball at rest, of one for a rolling
ball, and of `plan.replan` for a ball that is seen again 20 ms later. With them, random balls roll
at 0.5 to 5 m/s or fly at 5 to 20 m/s towards the leg; each is kicked and lands within 1 cm of its
target by `follow`, `strike` and `fly`, or the plan is refused. For some refusals, a random search
over times and postures looks for a kick that keeps all conditions of the plan; for as many planned
kicks it does so, too, which shows what the search can find.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import kickdyn as kd
from kickdyn.impact.strike_many import Impacts
from kickdyn.planning.interception import Reach, reach_of, waits_in_plane
from kickdyn.planning.kick_problem import KickProblem
from kickdyn.planning.kick_steps import ImpactTask, KickSettings, checked_contact
from kickdyn.planning.kick_terms import Facing, KickPoint
from kickdyn.planning.moving_kick import Interceptor
from kickdyn.planning.problem import Bounds, Function, Kind
from kickdyn.robot.collisions import find_ball_overlaps, find_self_collisions
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.standing import rest_configuration

BALL, AIR = kd.Ball(), kd.Air()
TURF = "turf"

TIMES, POSTURES, CHECKED = 12, 1000, 60
"""Of the search: times on the path, postures for each, and those of them for which all is checked:
those that need the least joint speed."""

STEPS, STEP, NEAR, LAWSON = 8, 1e-7, 1e-4, 20
"""Steps of Newton's method towards the ball, their differences [rad], the distance of a posture
that is there [m], and iterations for the least joint speed."""

ADDITIONS = 100_000
"""Number of additions with which times are compared."""

FAST, STICKING = 1e3, 1e3
"""Speed of a ball that every foot meets [m/s], and friction with which every contact sticks."""


class Case(NamedTuple):
    """A ball that comes, and the leg, goal and contact with which it is kicked."""

    leg: kd.Leg
    goal: kd.Goal
    incoming: kd.IncomingBall
    contact: kd.Contact | None


def g1() -> kd.Leg:
    """Return the leg of G1, on a fixed base."""
    return kd.Leg.from_robot("g1", base="fixed", legs_only=True)


def rolling(velocity: np.ndarray, position: np.ndarray, at: float = 0.0) -> kd.BallState:
    """Return a ball that rolls."""
    spin = np.array([-velocity[1], velocity[0], 0.0]) / BALL.radius
    return kd.BallState(position, velocity, spin, at)


def cases(n: int, seed: int = 0) -> Iterator[Case]:
    """Yield random balls: to the leg of G1 from any side, to the human leg in its plane too.

    Every ball would pass a random place near the leg if it moved straight on.
    """
    draw, human, robot = np.random.default_rng(seed), kd.Leg.human(), g1()
    for number in range(n):
        leg, flies = (human, robot)[number % 2], number % 4 > 1
        in_plane = leg is human and number % 8 < 4
        low = -0.7042 if leg is human else -0.6825  # on the ground under the sole of the other leg
        near = np.array([
            draw.uniform(0.0, 0.6), 0.0 if in_plane else draw.uniform(-0.35, 0.15),
            draw.uniform(low, low + 0.4) if flies else low,
        ])  # fmt: skip
        angle = math.pi if in_plane else draw.uniform(-math.pi, math.pi)
        speed, ahead = draw.uniform(5, 20) if flies else draw.uniform(0.5, 5), draw.uniform(0.3, 1)
        velocity = speed * np.array([math.cos(angle), math.sin(angle), 0.0])
        target = np.array([draw.uniform(4, 9), 0.0 if in_plane else draw.uniform(-3, 3), 0.3])
        ground = kd.Ground(low - BALL.radius, TURF)
        spin = draw.normal(0, 5, 3) * ((0.0, 1.0, 0.0) if in_plane else 1.0)
        start = near - velocity * ahead
        if flies:  # it is as high at the start as near the leg
            velocity[2] = 0.5 * 9.81 * ahead
            state = kd.BallState(start, velocity, spin)
        else:
            state = rolling(velocity, start)
        goal = kd.Goal(target - state.position + near, time=float(draw.uniform(0.7, 1.2)))
        contact = None if leg is robot or in_plane else kd.Contact(restitution=0.8, friction=0.0)
        yield Case(leg, goal, kd.IncomingBall(state, ground), contact)


def landing_error(case: Case, plan: kd.KickPlan) -> float:
    """Return how far from its target the ball lands, by `follow`, `strike` and `fly` [m]."""
    seen = case.incoming.state
    course = kd.follow(seen, BALL, AIR, case.incoming.ground, 1e-12)
    before = course.sample(min(plan.meeting.time - seen.time, course.duration))
    posture = plan.leg.posture(plan.q)
    contact = plan.impact.contact
    touching = posture.contact_point + BALL.radius * contact.normal
    hit = kd.strike(
        posture, plan.v, BALL, contact, ball_velocity=before.velocity, ball_spin=before.spin
    )
    target = seen.position + case.goal.target
    plane = kd.Plane(target, -plan.goal.ahead, "centre")
    start = kd.BallState(touching, hit.ball_after.velocity, hit.ball_after.spin)
    path = kd.fly(start, BALL, AIR, kd.Ground(-50.0), plane=plane)
    return math.dist(path.landing.position, target) + math.dist(touching, before.position)


def finds_kick(case: Case, draw: np.random.Generator) -> bool:
    """Return whether random times and postures give a kick that keeps the plan's conditions."""
    settings = KickSettings(case.leg, case.goal, BALL, AIR, checked_contact(case.contact))
    balls, reach = Interceptor(settings, case.incoming), reach_of(case.leg, BALL)
    problem: KickProblem | None = None
    for wait in _random_waits(balls, reach, draw):
        try:
            task = balls.at(wait)
            ahead = np.eye(3)[0] if reach.across is None else task.ahead
            if float(ahead @ (task.before.position - reach.centre)) < -BALL.radius:
                continue
            problem = task.problem(problem)
        except kd.InvalidInput:
            continue
        assert task.incoming is not None
        assert task.incoming.ground is not None
        height = task.incoming.ground.height
        for x in _fast_enough(task, problem, draw):
            point = task.exactly(problem, problem.variables.point(x))
            if _keeps_all(problem, point) and not _collides(problem, point, height):
                return True
    return False


def _random_waits(balls: Interceptor, reach: Reach, draw: np.random.Generator) -> list[float]:
    """Return random times within reach; of a leg in a plane, those at which a ball crosses it."""
    times = np.linspace(0.0, balls.course.duration, 2000)
    places = balls.course.sample(times).position
    near = times[np.linalg.norm(places - reach.centre, axis=1) < 1.1 * reach.radius]
    if not near.size:
        return []
    waits = np.sort(draw.uniform(near[0], near[-1], TIMES))
    if reach.across is None:
        return list(waits)
    crossing = waits_in_plane(waits, lambda wait: balls.beside(wait) - reach.beside)
    return list(crossing if len(crossing) else waits)  # at others, the leg is placed at the ball


def _fast_enough(task: ImpactTask, problem: KickProblem, draw: np.random.Generator) -> np.ndarray:
    """Return unknowns of random postures at the ball, whose joints are fast enough for the launch.

    Postures and impacts are of `strike_many`. While the contact sticks, the impulse is a + B v.
    Among the v that give the launch, the one whose largest speed over its limit is least comes
    from Lawson's iteration of weighted least squares.
    """
    variables, before, target = problem.variables, task.before, task.target
    n, leg, scale = variables.n, variables.leg, variables.velocity_scale
    rest, normal = rest_configuration(leg), target.contact.normal
    contact = replace(target.contact, friction=STICKING if target.contact.friction else 0.0)

    def impacts(
        q: np.ndarray, v: np.ndarray | None = None, contact: kd.Contact = contact,
        closing: float = FAST,
    ) -> Impacts:  # fmt: skip
        full, speeds = np.tile(rest, (len(q), 1)), np.zeros((len(q), leg.nv))
        full[:, variables.qs] = q
        if v is not None:
            speeds[:, variables.vs] = v * scale
        ball_velocity = before.velocity - closing * normal
        return kd.strike_many(
            leg, full, speeds, BALL, contact, ball_velocity=ball_velocity, ball_spin=before.spin
        )

    # postures drawn, moved to the ball, and turned to it with the side of the foot that may meet it
    q = draw.uniform(variables.lower, variables.upper, (POSTURES, n))
    for _ in range(STEPS):
        here = impacts(q).ball_position
        moved = (q[:, None] + STEP * np.eye(n)).reshape(-1, n)
        slopes = (impacts(moved).ball_position.reshape(-1, n, 3) - here[:, None]) / STEP
        gap = (before.position - here)[:, :, None]
        step = (np.linalg.pinv(slopes.swapaxes(1, 2), rcond=1e-4) @ gap)[:, :, 0]
        q = np.clip(q + np.clip(step, -1.0, 1.0), variables.lower, variables.upper)
    here = impacts(q).ball_position
    fits = np.linalg.norm(here - before.position, axis=1) < NEAR
    facing = problem.find(Facing)
    for row in () if facing is None else facing.cone:
        aside = impacts(q, None, replace(contact, offset=row)).ball_position
        fits &= (aside - here) @ normal > -1e-6
    q = q[fits]
    if not len(q):
        return np.zeros((0, variables.size))

    # joint speeds that give the launch: of least squares, of the least maximum, and between them
    # the impulse is linear in the speed of closing, too: from 1 and 2 times FAST, that of 0 follows
    still = impacts(q).impulse
    by_v = np.stack([impacts(q, np.tile(v, (len(q), 1))).impulse - still for v in np.eye(n)], 2)
    at_rest = 2.0 * still - impacts(q, closing=2.0 * FAST).impulse
    needed, weights = (target.impulse - at_rest)[:, :, None], np.ones((len(q), n))
    solutions = []
    for _ in range(LAWSON):
        rows = by_v / weights[:, None]
        gain = np.linalg.pinv(rows @ by_v.swapaxes(1, 2), rcond=1e-9)
        v = (rows.swapaxes(1, 2) @ gain @ needed)[:, :, 0]
        solutions.append(v)
        weights *= np.abs(v) / np.abs(v).max(axis=1, keepdims=True)
        weights = np.maximum(weights / weights.max(axis=1, keepdims=True), 1e-6)
    v = np.concatenate([share * v + (1.0 - share) * solutions[0] for share in (1.0, 0.5, 0.0)])
    q, use = np.tile(q, (3, 1)), np.abs(v).max(axis=1)
    best = np.flatnonzero(use < 1.0)
    best = best[np.argsort(use[best])][:CHECKED]
    return np.column_stack([q[best], v[best], np.ones(len(best))])


def _keeps_all(problem: KickProblem, point: KickPoint) -> bool:
    """Return whether a point keeps all terms of the problem."""
    for term in problem.terms:
        if isinstance(term, Function):
            value = term.value(point) / term.scale
            wrong = np.abs(value) if term.kind == Kind.EQUALITY else -value
            if wrong.size and wrong.max() > 1e-6:
                return False
        elif (
            isinstance(term, Bounds)
            and not ((point.x >= term.lower) & (point.x <= term.upper)).all()
        ):
            return False
    return True


def _collides(problem: KickProblem, point: KickPoint, ground: float) -> bool:
    """Return whether bodies are inside each other or the ball, or under the ground, as in plans."""
    q, _ = problem.on_robot(point)
    posture, radius = problem.robot.posture(q), BALL.radius
    return bool(
        find_self_collisions(problem.robot, q)
        or find_ball_overlaps(posture, point.ball_centre, radius)
        or find_depths(problem.robot, q, ground)
    )


def random_balls(n: int, refusals: int) -> None:
    """Print how many random balls land, why others are refused, and what a search finds."""
    errors, statuses, reasons = list[float](), Counter[str](), Counter[str]()
    met, failed = list[Case](), list[Case]()
    for case in cases(n):
        try:
            plan = kd.plan_kick(
                case.leg, case.goal, BALL, AIR, incoming=case.incoming, contact=case.contact
            )
        except kd.InvalidInput as error:
            failed.append(case)
            reasons[_short(str(error))] += 1
            continue
        statuses[f"{plan.status}{'' if plan.share == 1.0 else ', weaker'}"] += 1
        if plan.share == 1.0:
            errors.append(landing_error(case, plan))
            met.append(case)
        else:
            failed.append(case)
    print(f"{n} balls: {dict(statuses)}; {sum(reasons.values())} refused")
    largest = max(errors, default=math.nan)
    print(f"{len(errors)} that reach their targets miss them by {largest:.1e} m at most")
    for reason, count in reasons.most_common():
        print(f"  {count:4} {reason}")
    planned = time.process_time()
    draw = np.random.default_rng(1)
    for name, known in (("refused or weaker", failed), ("planned", met)):
        chosen = [known[k] for k in draw.permutation(len(known))[:refusals]]
        found = sum(finds_kick(case, draw) for case in chosen)
        print(f"a random search finds a kick for {found} of {len(chosen)} {name} ones")
    ended = time.process_time()
    print(
        f"processor: {planned / 60:.1f} minutes for plans, {(ended - planned) / 60:.1f} to search"
    )


def _short(reason: str) -> str:
    """Return a reason without its numbers."""
    for text in (
        "never comes within reach", "touches the ball", "behind the leg", "leaves the plane",
        "does not cross it",
        "without its speed and torque limits", "for another position of the ball",
        "another side of the foot", "inside the ball", "under the ground", "friction",
    ):  # fmt: skip
        if text in reason:
            return text
    return reason[:100]


def processor_time(action: Callable[[], object], repeats: int) -> float:
    """Return the median processor time of an action [ms]."""
    action()
    times = []
    for _ in range(repeats):
        began = time.process_time()
        action()
        times.append(1e3 * (time.process_time() - began))
    return statistics.median(times)


def timings() -> None:
    """Print times of plans for balls at rest, rolling ones, and those that are seen again."""
    human = kd.Leg.human(), kd.Goal(18, time=1.2), rolling(
        np.array([-2.5, 0.0, 0.0]), np.array([2.0, 0.0, -0.7042])
    )  # fmt: skip
    robot = g1(), kd.Goal((4, 1, 0), time=0.8), rolling(
        np.array([-2.0, -0.9, 0.0]), np.array([1.5, 0.6, -0.6825])
    )  # fmt: skip
    for leg, goal, seen in (human, robot):
        _print_times(leg, goal, seen)


def _print_times(leg: kd.Leg, goal: kd.Goal, seen: kd.BallState) -> None:
    plan = kd.plan_kick(leg, goal, BALL, AIR, incoming=seen)
    place, aim = plan.meeting.ball.position, plan.goal
    later = kd.follow(seen, BALL, AIR, plan.meeting.ground).sample(0.02)
    moved = later.position + np.array([0.004, 0.0, 0.0])
    again = kd.BallState(moved, 1.004 * later.velocity, later.spin, 0.02)
    rest = processor_time(lambda: kd.plan_kick(leg, aim, BALL, AIR, ball_position=place), 7)
    rolls = processor_time(lambda: kd.plan_kick(leg, goal, BALL, AIR, incoming=seen), 7)
    replans = processor_time(lambda: plan.replan(incoming=again), 25)
    peer = processor_time(lambda: _additions(ADDITIONS), 25)
    print(
        f"{leg.name}: {rest:.0f} ms for a ball at rest, {rolls:.0f} ms for one that rolls "
        f"({rolls / rest:.1f} times), {replans:.1f} ms to plan again ({replans / rest:.2f} times; "
        f"{replans / peer:.2f} times {ADDITIONS} additions in Python, {peer:.1f} ms)"
    )


def _additions(n: int) -> int:
    """Return n, by counting: work that is the same for all versions, to compare machines by."""
    total = 0
    for _ in range(n):
        total += 1
    return total


def main() -> None:
    """Print times, or what becomes of random balls."""
    numbers = [int(text) for text in sys.argv[1:3]]
    if numbers:
        random_balls(numbers[0], numbers[1] if len(numbers) > 1 else 50)
    else:
        timings()


if __name__ == "__main__":
    main()
