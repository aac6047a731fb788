"""Print the table of the section "Speed" in README.md.

    python benchmarks/speed.py

Each time is the least of several runs, on one core, after a first run that compiles; `sweep` and
`fly_many` are timed on many cases and their time is divided by the number of these.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import kickdyn as kd

FLIGHTS = 10_000

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()
CONTACT = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
VELOCITY = [6.6, -14.5, 6.6]
ANGLES = np.radians([40, 30, -20])
GOAL = kd.Goal(30, time=1.5)
GRID = {
    "hip": np.radians(np.arange(-30, 90, 2.0)),
    "knee": np.radians(np.arange(0, 140, 2.0)),
    "ankle": np.radians(np.arange(-20, 50, 2.0)),
}


@dataclass(frozen=True)
class Task:
    """What is timed.

    Attributes:
        what: it is, for a reader.
        run: does it.
        cases: number of results of one run.
        runs: number of runs.
    """

    what: str
    run: Callable[[], object]
    cases: int = 1
    runs: int = 5


def seconds(task: Task) -> float:
    """Return the processor time of one result [s]."""
    task.run()
    least = np.inf
    for _ in range(task.runs):
        start = time.process_time()
        task.run()
        least = min(least, time.process_time() - start)
    return least / task.cases


def strikes() -> None:
    """Compute a hundred kicks from their joint angles, and the impulses in the joints."""
    for _ in range(100):
        _ = kd.strike(LEG.posture(ANGLES), VELOCITY, BALL, CONTACT).joint_impulses


def launches() -> kd.BallState:
    """Return kicks at 25 m/s, 10 to 60 degrees upwards."""
    angles = np.radians(np.linspace(10, 60, FLIGHTS))
    velocity = 25 * np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    still = np.zeros_like(velocity)
    return kd.BallState(still, velocity, still, np.zeros(FLIGHTS))


def tasks() -> list[Task]:
    """Return the rows of the table."""
    posture = LEG.posture(ANGLES)
    kicked = kd.strike(posture, VELOCITY, BALL, CONTACT).ball_after
    many = launches()
    postures = int(np.prod([len(angles) for angles in GRID.values()]))
    kick = kd.Kick()
    many_q, many_v = np.tile(ANGLES, (FLIGHTS, 1)), np.tile(VELOCITY, (FLIGHTS, 1))
    scene = kd.load_scene("paper_kick").replace(uncertainty={"v": 0.1})
    return [
        Task("`strike`: impact with the impulses in all joints", strikes, 100, 30),
        Task(
            "`strike_many`: the same, per strike in a batch of 10,000",
            lambda: kd.strike_many(LEG, many_q, many_v, BALL, CONTACT),
            FLIGHTS,
        ),
        Task(
            "`sweep`: impact and flight of each posture",
            lambda: kd.sweep(LEG, GRID, kick),
            postures,
        ),
        Task("`fly`: flight with drag and lift", lambda: kd.fly(kicked, BALL, AIR), runs=50),
        Task(
            "`fly_many`: the same, per flight in a batch of 10,000",
            lambda: kd.fly_many(many, BALL, AIR),
            FLIGHTS,
        ),
        Task(
            "`follow_many`: flight, bounces and rolling, each of 10,000",
            lambda: kd.follow_many(many, BALL, AIR),
            FLIGHTS,
        ),
        Task(
            "`simulate_many`: impact and flight of each draw of a scene",
            lambda: kd.simulate_many(scene, FLIGHTS),
            FLIGHTS,
        ),
        Task(
            "`collide`: contact of finite time",
            lambda: kd.collide(posture, VELOCITY, BALL, CONTACT),
        ),
        Task(
            "`collide_many`: the same, per contact in a batch of 10,000",
            lambda: kd.collide_many(LEG, many_q, many_v, BALL, CONTACT),
            FLIGHTS,
        ),
        Task("`plan_kick`: kick for a target", lambda: kd.plan_kick(LEG, GOAL, BALL, AIR)),
    ]


def shown(value: float) -> str:
    """Return a time with two digits and its unit."""
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("µs", 1e6), ("ns", 1e9)):
        if value * scale >= 1 or unit == "ns":
            return f"{float(f'{value * scale:.2g}'):g} {unit}"
    raise AssertionError


if __name__ == "__main__":
    print("| Computation | Time |\n|---|---:|")
    for task in tasks():
        print(f"| {task.what} | {shown(seconds(task))} |")
