"""A library of kicks of G1: what it covers and costs, and how good its kicks are.

    python benchmarks/kick_library.py [--robot g1|biped|human] [--file FILE.npz] [--square]
        [--kicks 1000] [--checks 100] [--runs 100] [--plans 5] [--workers 2]

It makes the library FILE (build/ROBOT_library.npz), or continues or reads it: G1 on its left foot
with its legs alone, with `--square` the ball in a square of 2 cm, the biped of 3 kg of
`other_robots.py`, or the leg of a person, with the ranges of `CASES`. Its motions are carried out
in MuJoCo once, by `correct_library`. Then it prints

- for KICKS random kicks, the errors of the launch by `strike`; for CHECKS of them, the least
  distance from all limits on a grid ten times finer than the planner's, with what is inside each
  other; for PLANS of them, the squared torques over those of a full plan;
- for RUNS random goals that its motions meet in MuJoCo, for a robot up to 30 degrees aside, the
  errors in MuJoCo with the own foot, and the processor time, of the interpolated and corrected
  motion, also by a robot that differs at random (`kd.KickNoise()`, another seed for each goal); for
  every fourth goal those of the interpolated one without correction and of the nearest one that is
  stored; for every fourth goal up to PLANS of them those of a full plan, and after two corrections.

Ctrl-C ends the runs, and prints the table of those that were done.
"""

import argparse
import math
import pickle
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin
from other_robots import SMALL_BALL, scaled_biped

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.planning.kick_library import KickLibrary
from kickdyn.planning.kick_reader import launch_velocity
from kickdyn.planning.library_motions import Kicks, check_between

SQUARE = {"x": (0.31, 0.33), "y": (-0.06, -0.04)}
"""Ranges of the place of G1's ball with `--square` [m]."""

T = TypeVar("T")

Range = tuple[float, float]

FLIGHT_TIME = 0.3
"""Time of the flights to the goals [s]."""


def g1() -> kd.Leg:
    """Return G1 on its left foot, with its legs alone."""
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    return robot.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))


def biped() -> kd.Leg:
    """Return a biped of the kid size league on its left foot."""
    Path("build").mkdir(exist_ok=True)
    return scaled_biped(Path("build"), 3.0, 0.5, 0.35, ball=SMALL_BALL).on(0)


class Case(NamedTuple):
    """A robot with its ball, the ranges of its library and of the goals that are carried out."""

    robot: Callable[[], kd.Leg]
    ball: kd.Ball
    speed: Range  # [m/s]
    elevation: Range  # [deg]
    goals: tuple[Range, Range, Range]  # speed, elevation, azimuth [m/s, deg]
    height: float | None = None  # of the ball's centre [m]

    def range(self) -> dict[str, Any]:
        """Return the arguments of the library."""
        elevation = math.radians(self.elevation[0]), math.radians(self.elevation[1])
        return {"speed": self.speed, "elevation": elevation, "height": self.height}


CASES = {
    "g1": Case(g1, kd.Ball(), (7.0, 8.2), (8, 20), ((7.5, 8.2), (11.5, 16.5), (-30, 30))),
    "biped": Case(biped, SMALL_BALL, (2.2, 2.8), (8, 16), ((2.2, 2.5), (13, 16), (-30, 30))),
    "human": Case(
        kd.Leg.human, kd.Ball(), (11.0, 13.0), (8, 14), ((11.1, 11.7), (11, 13.5), (0, 0)), -0.7042
    ),
}


def make(case: Case, file: Path, workers: int, places: dict[str, Range]) -> KickLibrary:
    """Return the library, with its times."""
    began, counts = time.perf_counter(), {}

    def show(what: str, count: int, total: int) -> None:
        counts[what] = count
        if sys.stderr.isatty():
            print(f"{count} of {total} {what}", end="\r", file=sys.stderr)

    with ProcessPoolExecutor(workers, get_context("spawn")) as executor:
        library = kd.kick_library(
            case.robot(),
            file,
            case.ball,
            **case.range(),
            **places,
            executor=executor,
            progress=show,
        )
        library = kd.correct_library(library, executor=executor, progress=show)
    print(f"{time.perf_counter() - began:.0f} s wall by {workers} processes: {counts or 'read'}")
    print(library, f"{file.stat().st_size / 1e6:.2f} MB", sep="\n")
    return library


def goal_of(point: Array) -> kd.Goal:
    """Return a goal in the vacuum that needs a launch, in the air for `FLIGHT_TIME`."""
    fall = np.array([0.0, 0.0, -0.5 * 9.81 * FLIGHT_TIME**2])
    return kd.Goal(FLIGHT_TIME * launch_velocity(point) + fall, time=FLIGHT_TIME)


def errors(velocity: Array, wished: Array) -> tuple[float, float]:
    """Return the relative error of a speed, and the angle between velocities [deg]."""
    sine, cosine = np.linalg.norm(np.cross(velocity, wished)), velocity @ wished
    return math.hypot(*velocity) / math.hypot(*wished) - 1, math.degrees(math.atan2(sine, cosine))


def print_planned(case: Case, plain: KickLibrary, count: int, checks: int, plans: int) -> None:
    """Print the errors of kicks by `strike`, their limits, and their torques."""
    reader, draw = plain.reader, np.random.default_rng(0)
    points = draw.uniform(reader.lower, reader.upper, (count, 5))
    began = time.process_time()
    for point in points:
        reader.kick(point)
    print(f"{1e3 * (time.process_time() - began) / count:.2f} ms a kick, without Pinocchio")
    kicks = [kick for point in points if (kick := plain.kick_at(point)).met]
    print(f"{len(kicks)} of {count} random kicks are covered")
    off = np.array([errors(kick.impact.ball_after.velocity, kick.launch) for kick in kicks])
    print(f"launch of these by strike: {100 * np.abs(off[:, 0]).max():.1e} % and "
          f"{off[:, 1].max():.1e} degrees off at most")  # fmt: skip
    motion, height = kicks[0].motion, float(reader.arrays["ball"][2])
    contact = kd.Contact(None, *reader.arrays["impact"].tolist())
    kinds = Kicks(case.robot(), case.ball, contact, height, motion.joints, dict(motion.aside))
    pickled = pickle.dumps(kinds)
    found = [
        check_between(pickled, kick.point, kick.interpolated.coefficients)
        for kick in kicks[:checks]
    ]
    least = np.min([one.margins for one in found], axis=0)
    for unit in ("", "m", "rad"):
        of_unit = [
            k for k, name in enumerate(reader.limits) if name.partition(" [")[2][:-1] == unit
        ]
        if not of_unit:
            continue
        k = min(of_unit, key=least.__getitem__)
        print(f"least margin of {len(found)}: {least[k]:.4f} {unit or 'of the limit'}, "
              f"{reader.limits[k]}")  # fmt: skip
    reasons = [one.reason for one in found if one.reason]
    print(f"{len(reasons)} of {len(found)} break a limit by more than 1 % or 3 mm", *reasons)
    ratios = []
    for kick in kicks[:plans]:
        goal, place = goal_of(kick.point), kick.point[3:]
        plan = plain.plan(goal, ball_position=place)
        full = kd.plan_kick(
            case.robot(), goal, case.ball, motion=plan.motion, ball_position=(*place, height),
            contact=contact,
        )  # fmt: skip
        ratios.append(f"{plan.value / full.value:.3f} ({full.status})")
    print("squared torques over those of a full plan from there:", *ratios)


def timed(function: Callable[[], T]) -> tuple[T, float]:
    """Return a result and its processor time [s]."""
    began = time.process_time()
    result = function()
    return result, time.process_time() - began


class Table:
    """Rows of runs in MuJoCo: errors, whether the robot stands, and times of the answers [s]."""

    def __init__(self) -> None:
        self.rows: dict[str, list[tuple[float, ...]]] = {}

    def add(
        self, name: str, seconds: float, plan: kd.KickPlan | None, wished: Array, **options: object
    ) -> kd.MujocoRun | None:
        """Carry a plan out, and keep a row of it; None counts as a miss."""
        row, run = (math.inf, math.inf, False, seconds), None
        if plan is not None:
            run = kd.run_in_mujoco(plan, **options)
            if run.path is not None:
                row = *errors(run.ball_after.velocity, wished), run.upright, seconds
        self.rows.setdefault(name, []).append(row)
        return run

    def print(self) -> None:
        """Print the table."""
        print("| kick | goals | speed, median and 95 % | direction | within 3 % and 2° | upright | "
              "both | processor |\n|---|---|---|---|---|---|---|---|")  # fmt: skip
        for name, rows in self.rows.items():
            speed, angle, upright, seconds = np.array(rows, dtype=float).T
            right, stands = (np.abs(speed) <= 0.03) & (angle <= 2.0), upright > 0
            quantiles = [
                np.quantile(values, (0.5, 0.95), method="inverted_cdf")
                for values in (100 * np.abs(speed), angle)
            ]
            middle = float(np.median(seconds))
            spent = f"{1e3 * middle:.1f} ms" if middle < 1.0 else f"{middle:.0f} s"
            print(f"| {name} | {len(rows)} | {' %, '.join(f'{x:.1f}' for x in quantiles[0])} % | "
                  f"{'°, '.join(f'{x:.1f}' for x in quantiles[1])}° | {right.mean():.0%} | "
                  f"{stands.mean():.0%} | {(right & stands).mean():.0%} | {spent} |")  # fmt: skip


def add_runs(case: Case, library: KickLibrary, plain: KickLibrary, table: Table, point: Array,
             seed: int, *, with_plan: bool) -> None:  # fmt: skip
    """Carry out the kicks of a goal."""
    reader = library.reader
    scale = np.where(reader.upper > reader.lower, reader.upper - reader.lower, 1.0)
    wished, place = launch_velocity(point), point[3:]
    straight = point * [1, 1, 0, 1, 1]
    found, seconds = timed(lambda: reader.correct(point))
    plan = None
    if found is not None:
        seconds += timed(lambda: reader.kick(found[0]))[1]
        plan = library.plan(goal_of(point), ball_position=place)
    run = table.add("interpolated and corrected", seconds, plan, wished)
    tuning = None if run is None else run.tuning
    table.add("the same, with noise", seconds, plan, wished, tuning=tuning, seed=seed)
    if seed % 4:
        return
    _, seconds = timed(lambda: reader.kick(straight))
    plan = plain.plan(goal_of(point), ball_position=place)
    table.add("interpolated", seconds, plan, wished, tuning=tuning)
    far = np.linalg.norm((reader.node_points - straight) / scale, axis=1)
    node = reader.node_points[np.nanargmin(far)]
    _, seconds = timed(lambda: reader.kick(node))
    plan = plain.plan(goal_of(node + point[2] * np.eye(5)[2]), ball_position=node[3:])
    aside = pin.rpy.rpyToMatrix(0.0, 0.0, point[2])[:2, :2] @ (place - node[3:])
    table.add("nearest stored", seconds, plan, wished, tuning=tuning, ball_displacement=aside)
    if with_plan:
        wished = launch_velocity(straight)
        goal = goal_of(straight)
        height = None if case.height is None else (*place, case.height)
        full, seconds = timed(lambda: kd.plan_kick(
            case.robot(), goal, case.ball, motion=True, ball_position=height
        ))  # fmt: skip
        table.add("full plan", seconds, full, wished)
        plan, more = timed(lambda: kd.refine_kick(full, 2, "mujoco"))
        table.add("full plan, corrected twice", seconds + more, plan, wished)


def print_runs(
    case: Case, library: KickLibrary, plain: KickLibrary, count: int, plans: int
) -> None:
    """Print the table of kicks in MuJoCo."""
    reader, draw, table = library.reader, np.random.default_rng(1), Table()
    places = np.array([reader.lower, reader.upper])[:, 3:].T
    points = draw.uniform(*np.array([*case.goals, *places]).T, (count, 5))
    points[:, 1:3] *= math.pi / 180.0
    with suppress(KeyboardInterrupt):  # what was run until then is printed
        for seed, point in enumerate(points):
            add_runs(case, library, plain, table, point, seed, with_plan=seed < 4 * plans)
    table.print()


def main() -> None:
    """Print the figures."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--robot", choices=CASES, default="g1")
    options.add_argument("--file", type=Path)
    for name, default in ("kicks", 1000), ("checks", 100), ("runs", 100), ("plans", 5):
        options.add_argument(f"--{name}", type=int, default=default)
    options.add_argument("--square", action="store_true")
    options.add_argument("--workers", type=int, default=2)
    chosen = options.parse_args()
    case, file = CASES[chosen.robot], chosen.file or Path(f"build/{chosen.robot}_library.npz")
    file.parent.mkdir(parents=True, exist_ok=True)
    library = make(case, file, chosen.workers, SQUARE if chosen.square else {})
    plain = KickLibrary(file, case.robot())
    plain.reader.arrays.pop("simulated")
    print_planned(case, plain, chosen.kicks, chosen.checks, chosen.plans)
    print_runs(case, library, plain, chosen.runs, chosen.plans)


if __name__ == "__main__":
    main()
