"""Rounds of kicking and correcting until a goal is met: `kd.Learner` and the paper's learning loop.

    python benchmarks/learning.py [PLANTS]

The goals are those of the paper's Fig. 15. A simulated plant has a ball whose C_D is the same at
all speeds, 0.12 to 0.30, a wind with a standard deviation of 2 m/s along and across, a restitution
of 0.6 to 0.95, and kicks whose speed scatters by 3 % and whose direction by 0.03 rad up and
sideways. Neither method knows any of it: the learner begins with the drag model `goff-carre`, no
wind and a restitution of 0.8; the loop begins in the vacuum.

The miss is that of the kick without its own scatter. A round counts from which on the miss is first
within twice the scatter of the landing, in the sense of its covariance: for the learner along and
across the line to the goal, for the loop along it only, because it does not correct the other.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

import kickdyn as kd
from kickdyn.aerodynamics.drag import constant
from kickdyn.paper.fig_15 import GOALS, learn_launch

BALL, SCATTER, MOST = kd.Ball.paper(), 0.03, 30
SHOWN = (1, 2, 3)
"""Rounds whose miss is printed."""


class Plant:
    """A world whose drag, wind and restitution are drawn at random, and whose kicks scatter."""

    def __init__(self, seed: int) -> None:
        draw = self.draw = np.random.default_rng(seed)
        drag, wind = constant(draw.uniform(0.12, 0.30)), (*draw.normal(0.0, 2.0, 2), 0.0)
        self.air = kd.Air(1.22, 1.8e-5, wind, drag, None, None, buoyancy=False)
        self.gain = (1.0 + draw.uniform(0.6, 0.95)) / 1.8

    def kick(self, velocity: np.ndarray, errors: np.ndarray | None = None) -> kd.Flight:
        """Return the flight of a command; errors of speed and direction are drawn unless given."""
        faster, up, left = self.draw.normal(0.0, SCATTER, 3) if errors is None else errors
        speed, level = self.gain * (1.0 + faster) * math.hypot(*velocity), math.hypot(*velocity[:2])
        elevation = math.atan2(velocity[2], level) + up
        azimuth = math.atan2(velocity[1], velocity[0]) + left
        ahead = (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth))
        launch = kd.BallState(velocity=speed * np.array([*ahead, math.sin(elevation)]))
        return kd.fly(launch, BALL, self.air, tol=1e-6)

    def miss(self, velocity: np.ndarray, goal: float, axes: int) -> float:
        """Return the miss of a command without scatter, in standard deviations of the landing.

        It counts along the line to the goal for 1 axis, and across it, too, for 2.
        """
        errors = SCATTER * np.vstack([np.zeros(3), np.eye(3)])
        ends = [self.kick(velocity, one).landing.position[:axes] for one in errors]
        moved = np.array(ends[1:]) - ends[0]
        off = ends[0] - np.array([goal, 0.0])[:axes]
        return math.sqrt(off @ np.linalg.solve(moved.T @ moved, off))


def of_learner(plant: Plant, distance: float, time: float) -> Iterator[float]:
    """Yield the miss of each round of a `Learner`."""
    model = kd.Air.paper(drag="goff-carre", lift=None)
    learner = kd.Learner(kd.Goal(distance, time=time), BALL, model, scatter=SCATTER)
    while True:
        velocity = learner.command.velocity
        yield plant.miss(velocity, distance, 2)
        path = plant.kick(velocity)
        learner.observe(path.landing.position, path.duration)


def of_loop(plant: Plant, distance: float, time: float) -> Iterator[float]:
    """Yield the miss of each round of the paper's loop, until it ends."""
    commands: list[np.ndarray] = []

    def kick(velocity: np.ndarray) -> kd.Flight:
        """Return the flight of a command, which is kept."""
        commands.append(velocity)
        return plant.kick(velocity)

    learn_launch(distance, time, BALL, None, kick=kick, rounds=MOST)
    for velocity in commands:
        yield plant.miss(velocity, distance, 1)


def run(method: str, goal: int, seed: int) -> tuple[float, list[float]]:
    """Return the first round within twice the scatter, and the misses of the rounds `SHOWN`."""
    distance, time, _ = GOALS[goal]
    rounds = {"learner": of_learner, "loop": of_loop}[method](Plant(seed), distance, time)
    first, misses = math.inf, list[float]()
    for number, miss in enumerate(rounds, start=1):
        misses.append(miss)
        first = min(first, number if miss <= 2.0 else math.inf)
        if number >= MOST or (number >= SHOWN[-1] and first <= number):
            break
    misses += [math.nan] * SHOWN[-1]
    return first, [misses[number - 1] for number in SHOWN]


def main() -> None:
    """Print the table."""
    plants = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print(f"{plants} plants; misses in standard deviations of the landing")
    heads = ("rounds, median", "rounds, 95 %", *(f"miss, round {number}" for number in SHOWN))
    print("| goal | method |", " | ".join(heads), "|")
    print("|---|---|" + "---|" * len(heads))
    with ProcessPoolExecutor() as pool:
        for goal, (distance, time, _) in enumerate(GOALS):
            for method in ("learner", "loop"):
                found = list(pool.map(partial(run, method, goal), range(plants), chunksize=5))
                first = np.array([one for one, _ in found])
                misses = np.nanmedian(np.array([rest for _, rest in found]), axis=0)
                middle, late = np.quantile(first, (0.5, 0.95), method="higher")
                cells = (f"{middle:g}", f"{late:g}", *(f"{miss:.2f}" for miss in misses))
                print(f"| {distance:g} m, {time:g} s | {method} |", " | ".join(cells), "|")


if __name__ == "__main__":
    main()
