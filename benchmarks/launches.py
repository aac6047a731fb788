"""Random goals for `plan_launch`: 1,000 that can be met, 200 that cannot; and for `plan_kick`.

    python benchmarks/launches.py [REACHABLE UNREACHABLE [KICKS]]

Goals that can be met are drawn as flights: any direction, spin and wind. Those that cannot ask for
less than the least speed, a lower apex than the target, a longer or shorter flight than the speed
limit allows, or a target beyond it. Kicks of the human leg and of G1's go to 30 random goals each,
and are struck and flown to see where they end.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from dataclasses import replace

import numpy as np

import kickdyn as kd
from kickdyn.planning.goal import nominal_velocity
from kickdyn.planning.launch_solver import ShootingProblem, apex, crossing

BALL, LIMIT = kd.Ball(), 40.0


def reachable(n: int, seed: int = 1) -> list[tuple[kd.Goal, kd.Air, np.ndarray]]:
    """Return goals, each with an air and a spin, that a launch drawn at random meets."""
    draw, goals = np.random.default_rng(seed), []
    while len(goals) < n:
        speed, up, turn = draw.uniform(6, 36), draw.uniform(0.1, 1.2), draw.uniform(-0.5, 0.5)
        level = speed * math.cos(up)
        velocity = np.array([level * math.cos(turn), level * math.sin(turn), speed * math.sin(up)])
        spin, wind = draw.normal(0, 20, 3), np.append(draw.normal(0, 3, 2), 0.0)
        air = kd.Air(wind=wind, drag="brazuca")
        shot = ShootingProblem(BALL, air, spin).shoot(
            velocity, 2 * velocity[2] / 9.81 * draw.uniform(0.6, 1)
        )
        if shot is None or shot.velocity(shot.end)[2] >= 0:
            continue
        target = shot.position(shot.end)
        part = 0.4 * math.hypot(*target[:2])
        ahead = np.array([target[0], target[1], 0.0]) / math.hypot(*target[:2])
        kind = ("time", "apex", "speed", "over")[len(goals) % 4]
        height = crossing(shot, ahead, part, np.array([0.0, 0.0, 1.0]))[0]
        value = {"time": shot.end, "apex": apex(shot)[0], "speed": speed, "over": (part, height)}
        goals.append((kd.Goal(target, **{kind: value[kind]}), air, spin))
    return goals


def unreachable(n: int, seed: int = 2) -> list[tuple[kd.Goal, kd.Air]]:
    """Return goals that no launch of up to `LIMIT` meets."""
    draw, air, goals = np.random.default_rng(seed), kd.Air(drag="brazuca"), []
    while len(goals) < n:
        distance, rise = draw.uniform(5, 40), draw.uniform(0.5, 3)
        target, kind = (distance, 0.0, rise), len(goals) % 5
        least = math.sqrt(9.81 * (rise + math.hypot(distance, rise)))  # the vacuum's
        goals.append(
            (
                [
                    lambda t, d, v: kd.Goal(t, speed=0.9 * v),
                    lambda t, d, v: kd.Goal(t, apex=0.9 * t[2]),
                    lambda t, d, v: kd.Goal(t, time=0.95 * d / LIMIT),
                    lambda t, d, v: kd.Goal(t, time=2 * LIMIT / 9.81 + 0.1),
                    lambda t, d, v: kd.Goal((d + 170.0, 0.0, t[2]), time=4.0),
                ][kind](target, distance, least),
                air,
            )
        )
    return goals


def kicks(n: int, seed: int = 3) -> None:
    """Plan kicks to random goals within the legs' limits, and print how far they miss."""
    draw = np.random.default_rng(seed)
    legs = {
        "human leg": (kd.Leg.human(), (8.0, 30.0), 0.0),
        "G1's leg": (kd.Leg.from_robot("g1", legs_only=True), (2.0, 6.0), 0.3),
    }
    for name, (leg, (near, far), turn) in legs.items():
        spent, missed, met, kept = [], [], 0, 0
        for _ in range(n):
            size, aside = draw.uniform(near, far), draw.uniform(-turn, turn)
            target = (size * math.cos(aside), size * math.sin(aside), 0.0)
            goal = kd.Goal(target, time=draw.uniform(0.9, 1.3) * 0.38 * math.sqrt(size))
            began = time.perf_counter()
            plan = kd.plan_kick(leg, goal, BALL, kd.Air(drag="brazuca"))
            spent.append(time.perf_counter() - began)
            inside = (plan.q >= leg.lower).all() and (plan.q <= leg.upper).all()
            kept += bool(inside and max(plan.speed_use, plan.torque_use) <= 1.0)
            if plan.share == 1.0:
                met += 1
                missed.append(plan.landing_error)
        print(
            f"{name}: {met} of {n} kicks met, the others beyond its limits; limits kept by {kept}; "
            f"a met goal is missed by {max(missed):.1e} m at most; {np.median(spent):.2f} s in "
            f"median, {max(spent):.2f} s at most"
        )


def main() -> None:
    """Print what was solved, in how many steps, and how long it took."""
    many, few = (int(text) for text in sys.argv[1:3]) if len(sys.argv) > 2 else (1000, 200)
    steps, solved, began = [], 0, time.perf_counter()
    for goal, air, spin in reachable(many):
        launch = kd.plan_launch(replace(goal, spin=spin), BALL, air)
        solved += launch.status == "met"
        starts = [nominal_velocity(goal.target, t) for t in goal.nominal_times()]
        from_nominal = any(np.array_equal(launch.history[0], start) for start in starts)
        steps += [launch.iterations] if from_nominal else []
    spent = time.perf_counter() - began
    print(
        f"{solved} of {many} met in {1e3 * spent / many:.0f} ms each, {len(steps)} by Newton from"
    )
    print(f"the nominal launch, in median {np.median(steps):g} and at most {max(steps)} steps")
    limits, began = Counter[str](), time.perf_counter()
    for goal, air in unreachable(few):
        launch = kd.plan_launch(goal, BALL, air, speed_limit=LIMIT)
        limits[launch.limit or "MET"] += 1
    spent = time.perf_counter() - began
    print(f"{few} out of reach: {dict(limits)}; {spent / few:.2f} s each")
    for name, air in (("standard", kd.Air(drag="brazuca")), ("the paper's", kd.Air.paper())):
        for distance, flown in ((30, 1.5), (50, 2.0), (100, 3.0)):
            launch = kd.plan_launch(kd.Goal(distance, time=flown), BALL, air)
            missed = np.abs(launch.errors).max()
            print(
                f"({distance} m, {flown:g} s) in {name} air: {launch.iterations} steps, missed by "
                f"{missed:.1e}"
            )
    kicks(int(sys.argv[3]) if len(sys.argv) > 3 else 30)


if __name__ == "__main__":
    main()
