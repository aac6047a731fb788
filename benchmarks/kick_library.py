"""A library of kicks of G1: what it covers and costs, and how good its kicks are.

    python benchmarks/kick_library.py [FILE.npz] [KICKS [WORKERS [RUNS]]]

It makes the library FILE (build/g1_library.npz) with WORKERS processes, or continues or reads it:
G1 on its left foot with its legs alone, launches of 7.2 to 8.2 m/s at 10 to 18 degrees, the ball in
a square of 4 cm. For KICKS random kicks it prints the share that is covered, the errors of the
launch by `strike`, the largest torques and speeds over their limits and the least distance of the
centre of pressure from the edge of the sole on a grid ten times finer than the planner's, and the
processor time of an answer. RUNS of them are carried out in MuJoCo, as planned.
"""

import math
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import kickdyn as kd
from kickdyn.planning.kick_library import KickLibrary, LibraryKick
from kickdyn.robot.standing import StandingRobot, sole_edges

RANGES = {"speed": (7.2, 8.2), "elevation": (math.radians(10), math.radians(18))}
PLACES = {"x": (0.30, 0.34), "y": (-0.07, -0.03)}


def robot() -> kd.Leg:
    """Return G1 on its left foot, with its legs alone."""
    g1 = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    return g1.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))


def make(file: Path, workers: int) -> KickLibrary:
    """Return the library, with its times."""
    began, counts = time.perf_counter(), {}

    def show(what: str, count: int, total: int) -> None:
        counts[what] = count
        if sys.stderr.isatty():
            print(f"{count} of {total} {what}", end="\r", file=sys.stderr)

    with ProcessPoolExecutor(workers, get_context("spawn")) as executor:
        library = kd.kick_library(
            robot(), file, **RANGES, **PLACES, executor=executor, progress=show
        )
    print(f"{time.perf_counter() - began:.0f} s wall by {workers} processes: {counts or 'read'}")
    return library


def margins(kick: LibraryKick) -> tuple[float, float, float]:
    """Return the largest torque and speed over their limits, and the centre of pressure [m]."""
    motion = kick.motion
    assert motion is not None
    leg = motion.robot
    columns = [leg.velocity_index(name) for name in motion.joints]
    normals, offsets = sole_edges(StandingRobot(robot()))
    torque = speed = 0.0
    inside = math.inf
    for t in np.linspace(motion.begin, motion.end, 2000):
        torque = max(torque, np.abs(motion.torque(t)[columns] / leg.effort_limit[columns]).max())
        speed = max(speed, np.abs(motion.v(t)[columns] / leg.velocity_limit[columns]).max())
        wrench = motion.ground_wrench(t)
        centre = np.array([-wrench[4], wrench[3]]) / wrench[2]
        inside = min(inside, float((offsets - normals @ centre).min()))
    return torque, speed, inside


def main() -> None:
    """Print the figures."""
    file = Path(sys.argv[1] if len(sys.argv) > 1 else "build/g1_library.npz")
    count, workers, runs = (
        int(sys.argv[k]) if len(sys.argv) > k else default
        for k, default in ((2, 200), (3, 2), (4, 10))
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    library = make(file, workers)
    print(library)
    print(f"{file.stat().st_size / 1e6:.2f} MB")
    draw = np.random.default_rng(0)
    points = draw.uniform(library.reader.lower, library.reader.upper, (count, 5))
    began = time.process_time()
    for point in points:
        library.reader.kick(point)
    print(f"{1e3 * (time.process_time() - began) / count:.2f} ms a kick, without Pinocchio")
    kicks = [kick for point in points if (kick := library.kick_at(point)).met]
    print(f"{len(kicks)} of {count} random kicks are covered")
    launches = np.array([kick.impact.ball_after.velocity for kick in kicks])
    wished = np.array([kick.launch for kick in kicks])
    print(f"launch by strike: {np.abs(launches - wished).max():.1e} m/s off at most")
    worst = np.array([margins(kick) for kick in kicks[: max(count // 10, 1)]])
    print(f"torque {worst[:, 0].max():.3f}, speed {worst[:, 1].max():.3f} of the limits at most, "
          f"centre of pressure {1e3 * worst[:, 2].min():.1f} mm inside the sole at least, "
          f"{np.mean(worst[:, 2] > 0):.1%} inside")  # fmt: skip
    errors = []
    for kick in kicks[:runs]:
        speed, elevation, _, *place = kick.point
        goal = kd.Goal(speed**2 * math.sin(2 * elevation) / 9.81, speed=speed)
        run = kd.run_in_mujoco(library.plan(goal, ball_position=place))
        errors.append((abs(run.speed_error), math.degrees(run.direction_error), run.upright))
    if errors:
        speed, direction, upright = np.array(errors).T
        print(f"{len(errors)} runs in MuJoCo as planned: median {100 * np.median(speed):.1f} % and "
              f"{np.median(direction):.1f} degrees off, {upright.mean():.0%} upright")  # fmt: skip


if __name__ == "__main__":
    main()
