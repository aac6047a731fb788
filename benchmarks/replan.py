"""Kicks of moving balls: times of plans, and random balls from all sides.

    python benchmarks/replan.py [BALLS [REFUSALS]]

Without numbers it prints the processor time of a plan for a ball at rest, of one for a rolling
ball, and of `plan.replan` for a ball that is seen again 20 ms later. With them, random balls roll
at 0.5 to 5 m/s or fly at 5 to 20 m/s towards the leg; each is kicked and lands within 1 cm of its
target by `follow`, `strike` and `fly`, or the plan is refused. For some refusals, a random search
over times and postures looks for a kick that keeps all conditions of the plan.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

import kickdyn as kd
from kickdyn.planning.kick_problem import KickProblem
from kickdyn.planning.kick_steps import checked_contact
from kickdyn.planning.kick_terms import BallPosition, StrikeVelocity, place_exactly
from kickdyn.planning.moving_kick import Interceptor, KickSettings
from kickdyn.planning.objectives import KickObjective
from kickdyn.planning.problem import Bounds, Function, Kind

BALL, AIR = kd.Ball(), kd.Air()
TURF = "turf"

TIMES, POSTURES = 6, 25
"""Of the search: times on the path, and postures for each."""


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
    settings = KickSettings(
        case.goal, BALL, AIR, checked_contact(case.contact), KickObjective.JOINT_SPEED, True, None,
        "slsqp",
    )  # fmt: skip
    balls = Interceptor(case.leg, settings, case.incoming)
    times = np.linspace(0.0, balls.course.duration, 400)
    places = balls.course.sample(times).position
    foot = case.leg.posture(case.leg.configuration()).contact_point
    reach = 1.2 * math.dist(foot, (0.0, foot[1], 0.0)) + BALL.radius
    near = times[np.linalg.norm(places - [0.0, foot[1], 0.0], axis=1) < reach]
    for wait in draw.choice(near, TIMES) if near.size else ():
        try:
            problem = balls.at(float(wait)).problem()
        except kd.InvalidInput:
            continue
        if balls.at(float(wait)).before.position[0] < -BALL.radius:
            continue
        if any(_keeps_all(problem, draw) for _ in range(POSTURES)):
            return True
    return False


def _keeps_all(problem: KickProblem, draw: np.random.Generator) -> bool:
    """Return whether a random posture that is moved to the ball gives a kick."""
    variables, position = problem.variables, problem.find(BallPosition)
    q = draw.uniform(variables.lower, variables.upper)
    point = variables.point(np.array([*q, *np.zeros(variables.n), 1.0]))
    point = problem.find(StrikeVelocity).make_exact(
        place_exactly(position, place_exactly(position, point))
    )
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


def random_balls(n: int, refusals: int) -> None:
    """Print how many random balls land, why others are refused, and what a search finds."""
    draw, errors, statuses = np.random.default_rng(1), [], Counter[str]()
    reasons, refused = Counter[str](), []
    for case in cases(n):
        try:
            plan = kd.plan_kick(
                case.leg, case.goal, BALL, AIR, incoming=case.incoming, contact=case.contact
            )
        except kd.InvalidInput as error:
            refused.append(case)
            reasons[_short(str(error))] += 1
            continue
        statuses[plan.status] += 1
        if plan.share == 1.0:
            errors.append(landing_error(case, plan))
        else:
            refused.append(case)
    print(f"{n} balls: {dict(statuses)}; {sum(reasons.values())} refused")
    print(f"{len(errors)} that reach their targets miss them by {max(errors):.1e} m at most")
    for reason, count in reasons.most_common():
        print(f"  {count:4} {reason}")
    chosen = [refused[k] for k in draw.permutation(len(refused))[:refusals]]
    found = sum(finds_kick(case, draw) for case in chosen)
    print(f"a random search finds a kick for {found} of {len(chosen)} refused or weaker ones")


def _short(reason: str) -> str:
    """Return a reason without its numbers."""
    for text in (
        "never comes within reach", "only behind the leg", "leaves the plane", "does not cross it",
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
    print(
        f"{leg.name}: {rest:.0f} ms for a ball at rest, {rolls:.0f} ms for one that rolls "
        f"({rolls / rest:.1f} times), {replans:.1f} ms to plan again"
    )


def main() -> None:
    """Print times, or what becomes of random balls."""
    numbers = [int(text) for text in sys.argv[1:3]]
    if numbers:
        random_balls(numbers[0], numbers[1] if len(numbers) > 1 else 50)
    else:
        timings()


if __name__ == "__main__":
    main()
