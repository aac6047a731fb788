"""The task by which trained kicking robots are judged: how far from a target do balls of G1 pass?

    python benchmarks/public_task.py [KICKS] [--distances 3 5] [--seed S] [--calibration M]

A ball lies at random in a square of 20 cm before G1 (29 joints), which stands on its left foot,
turned about the middle of the square by up to 0.2 rad. The target is 3 m or 5 m from that middle.
Each of KICKS (500) for each distance is a motion that keeps all limits, planned next to one that is
stored, and carried out once in MuJoCo, by a robot whose masses, friction and delay differ from the
model at random. The commanded launch is the wished one, corrected by a polynomial for what a
contact of 10 ms makes of it, which is fitted to M (100) kicks of the undisturbed robot at other
random balls. Motions and kicks are stored in build/public_task (--folder), so that the same command
continues after an interruption. A kick takes 5 to 10 s of processor, at 5 m up to 60 s at first.
"""

import argparse
import json
import math
import pickle
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations_with_replacement
from pathlib import Path
from typing import NamedTuple

import numpy as np

import kickdyn as kd
from kickdyn.core.files import replacing
from kickdyn.impact.strike import strike
from kickdyn.motion.limits import SpeedLimit, TorqueLimit
from kickdyn.motion.motion_program import MotionSolution
from kickdyn.motion.plan_motion import continue_motion, plan_motion
from kickdyn.motion.verdict import Verdict
from kickdyn.planning.kick_steps import one_thread, path_to_target
from kickdyn.planning.kick_terms import KickObjective
from kickdyn.planning.library_making import STEPS
from kickdyn.planning.library_motions import Kicks, solution_arrays, solution_of

BALL, AIR = kd.Ball(), kd.Air()
CONTACT = kd.Contact(restitution=0.8, friction=0.4)

PLACE, HALF = np.array([0.33, -0.08]), 0.1
"""Middle and half the side of the square in which the ball lies, in the axes of the robot [m]."""

YAW, HEIGHT = 0.2, 0.3
"""Largest angle by which the robot is turned [rad], and height of the target [m]."""

SPEEDS = {3.0: (8.5, 8.0), 5.0: (9.5, 9.0)}
"""Speeds of the launch that are tried in turn, by the distance of the target [m/s; m]."""

MIDDLE = np.array([9.0, math.radians(16.0), 0.0, *PLACE])
"""The point of the first motion: speed, elevation and azimuth of its launch, and place of its ball
[m/s, rad, m]."""

SPREAD, RIDGE = np.array([1.0, 0.15, 0.2, 0.1, 0.1]), 0.3
"""Scales of the differences from it in polynomials, and weight of ridge regression."""

SIZES, STEP = np.array([9.0, 1.0, 1.0, 1.0, 1.0]) * [*STEPS.values()], 1.5
"""Steps of a library of kicks in these units, and the longest step from a motion to the next one,
in such steps."""

MISHIT = 0.2
"""Error of a launch, relative or in rad, from which on a kick does not count among those fitted."""

NOISE = kd.KickNoise(place=0.0)
"""The disturbance of the kicks that count: the robot knows the place of the ball."""

WITHIN = 0.5, 1.0, 1.5
"""Distances whose shares are printed [m]."""

ERROR, SPEED, FASTEST = "mean error at the plane [m]", "mean speed [m/s]", "largest speed [m/s]"

PUBLISHED = {
    "RoboNaldo, simulated, 5 m": {ERROR: "0.90", "within 1 m": "65.5%", SPEED: "14.8"},
    "RoboNaldo, real G1, 3 m": {ERROR: "0.73", FASTEST: "13.1"},
}

NOTES = """
RoboNaldo: Zhong et al. 2026, arXiv 2606.11092, balls at rest. Not comparable: it walks up to the
ball, and sees it on the robot by its own sensors; in its public configuration, targets are spread
over 6 m by 2 m, 5 m before its start and 4 m before the ball. Here the robot stands on one foot and
knows where the ball is; ball, contact, friction and drives are others. Shares are of the least
distance from the target. Balls that roll are not kicked: plan_kick plans no motion for these."""


class Draw(NamedTuple):
    """A ball and a target, in the axes of the robot."""

    distance: float  # of the target from the middle of the square [m]
    ball: np.ndarray  # x and y [m]
    yaw: float  # of the robot to the left [rad]

    @classmethod
    def at(cls, distance: float, *seed: int) -> "Draw":
        """Return the draw of a seed."""
        random = np.random.default_rng([*seed, round(distance)])
        return cls(distance, PLACE + random.uniform(-HALF, HALF, 2), random.uniform(-YAW, YAW))

    @property
    def ahead(self) -> np.ndarray:
        """Horizontal unit vector across the plane of the target, shape `(3,)`."""
        return np.array([math.cos(self.yaw), -math.sin(self.yaw), 0.0])

    @property
    def target(self) -> np.ndarray:
        """Position of the target, shape `(3,)` [m]."""
        return np.array([*PLACE, HEIGHT]) + self.distance * self.ahead


def features(point: np.ndarray) -> np.ndarray:
    """Return the monomials of degree 0 to 2 at a point."""
    x = (point - MIDDLE) / SPREAD
    return np.array([a * b for a, b in combinations_with_replacement([1.0, *x], 2)])


def fitted(points: Sequence[np.ndarray], values: np.ndarray) -> np.ndarray:
    """Return the weights of the monomials that fit values at points, shape `(k, n)`."""
    rows = np.array([features(point) for point in points])
    ridge = RIDGE * np.eye(rows.shape[1])
    zeros = np.zeros((len(ridge), values.shape[1]))
    return np.linalg.lstsq(np.vstack([rows, ridge]), np.vstack([values, zeros]))[0]


class Motions:
    """Motions of kicks, each planned next to another one, and stored in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, first = folder, folder / "kicks.pickle"
        self.points, self.solutions = list[np.ndarray](), list[MotionSolution]()
        folder.mkdir(parents=True, exist_ok=True)
        if not first.exists():
            g1 = kd.Leg.from_robot("g1", base="floating")
            g1 = g1.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))
            kicks = Kicks(g1, BALL, CONTACT, BALL.radius)
            with one_thread():
                verdict = plan_motion(kicks.task(MIDDLE))
            if not verdict.keeps_limits:
                raise SystemExit(f"no first motion keeps all limits: {verdict.motion.warnings}")
            motion, near = verdict.motion, verdict.solution.coefficients
            kicks = replace(kicks, joints=motion.joints, aside=dict(motion.aside), near=near)
            self.keep(MIDDLE, verdict.solution)
            first.write_bytes(pickle.dumps(kicks))
        self.kicks: Kicks = pickle.loads(first.read_bytes())
        stored = [dict(np.load(folder / f"{k}.npz")) for k in range(len([*folder.glob("*.npz")]))]
        self.points = [arrays["point"] for arrays in stored]
        self.solutions = [solution_of(arrays) for arrays in stored]

    def near(self, point: np.ndarray) -> tuple[np.ndarray, MotionSolution]:
        """Return the point of the nearest motion, and a solution to start from at another point.

        A polynomial in the points of all motions gives the change from the nearest one.
        """
        apart = np.linalg.norm((np.array(self.points) - point) / SIZES, axis=1)
        nearest = int(apart.argmin())
        start = self.solutions[nearest]
        every = np.array([solution.coefficients.ravel() for solution in self.solutions])
        weights = fitted(self.points, every - every[nearest])
        change = (features(point) - features(self.points[nearest])) @ weights
        moved = start.coefficients + change.reshape(start.coefficients.shape)
        return self.points[nearest], replace(start, coefficients=moved)

    def plan(self, point: np.ndarray) -> Verdict | None:
        """Return the motion of a launch and a place of the ball, `(5,)`; None if none is found."""
        nearest, _ = self.near(point)
        count = max(math.ceil(np.linalg.norm((point - nearest) / SIZES) / STEP), 1)
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            place = nearest + share * (point - nearest)
            with one_thread():
                task = self.kicks.task(place)
                verdict = continue_motion(task, self.near(place)[1], self.kicks.near)
            if not verdict.keeps_limits:
                return None
            self.keep(place, verdict.solution)
        return verdict

    def keep(self, point: np.ndarray, solution: MotionSolution) -> None:
        """Store a motion."""
        file = self.folder / f"{len(self.points)}.npz"
        with replacing(file) as draft, draft.open("wb") as out:
            np.savez(out, point=point, **solution_arrays(solution))
        self.points.append(point)
        self.solutions.append(solution)


class Player:
    """G1 with its motions, and with what the contact makes of their launches."""

    def __init__(self, folder: Path) -> None:
        self.motions, self.tuning = Motions(folder), folder / "tuning.pickle"
        self.points, self.errors = list[np.ndarray](), list[np.ndarray]()

    def learn(self, row: Mapping) -> None:
        """Count a kick: errors of its speed, relative, and of elevation and azimuth [rad]."""
        if row.get("touched"):
            point = np.array(row["point"])
            errors = (row["launch"] - point[:3]) / [point[0], 1.0, 1.0]
            if np.abs(errors).max() < MISHIT:
                self.points.append(np.array([*row["launch"], *point[3:]]))
                self.errors.append(errors)

    def command(self, wished: np.ndarray) -> np.ndarray:
        """Return the point at which a motion is planned for a launch that is wished."""
        point = wished.copy()
        if self.points:
            faster, *turn = features(wished) @ fitted(self.points, np.array(self.errors))
            point[:3] = (wished[:3] - [0.0, *turn]) / [1.0 + faster, 1.0, 1.0]
        return point

    def plan(self, draw: Draw) -> tuple[kd.KickPlan, np.ndarray] | None:
        """Return the plan of a kick, with its point; None if no motion keeps all limits."""
        for speed in SPEEDS[draw.distance]:
            goal = kd.Goal(draw.target - np.append(draw.ball, BALL.radius), speed=speed)
            launch = kd.plan_launch(goal, BALL, AIR)
            point = self.command(np.array([launch.speed, launch.angle, launch.azimuth, *draw.ball]))
            verdict = self.motions.plan(point)
            if verdict is not None:
                break
        else:
            return None
        motion, target = verdict.motion, verdict.problem.task.target
        impact = strike(motion.robot.posture(motion.q(0.0)), motion.v(0.0), BALL, target.contact)
        path = path_to_target(impact, goal, AIR, None)
        uses = verdict.use(SpeedLimit), verdict.use(TorqueLimit)
        plan = kd.KickPlan(
            goal, launch, KickObjective.TORQUE_SQUARED, verdict.torque_squared, 1.0, target, impact,
            path, *uses, verdict.binding, ball_place=impact.ball_before.position, heading=0.0,
            motion=motion,
        )  # fmt: skip
        return plan, point

    def kick(self, draw: Draw, seed: int | None = None) -> dict[str, object]:
        """Return the results of a kick, for JSON; without a seed, of the undisturbed robot."""
        began = time.process_time()
        planned = self.plan(draw)
        row = {"planned": planned is not None, "planning": time.process_time() - began}
        if planned is None:
            return row
        plan, point = planned
        tuning = pickle.loads(self.tuning.read_bytes()) if self.tuning.exists() else None
        noise = None if seed is None else NOISE
        run = kd.run_in_mujoco(plan, tuning=tuning, seed=seed, noise=noise)
        self.tuning.write_bytes(pickle.dumps(run.tuning))
        row |= {"point": point.tolist(), "upright": run.upright, "touched": run.path is not None}
        if run.path is not None:
            x, y, z = run.ball_after.velocity
            launch = math.hypot(x, y, z), math.atan2(z, math.hypot(x, y)), math.atan2(y, x)
            row |= {"launch": launch, "speed": launch[0], **passing(draw, run.ball_after)}
        return row


def passing(draw: Draw, ball: kd.BallState) -> dict[str, float]:
    """Return the error at the plane of the target, the speed there, and the least distance [m].

    The ball flies, bounces and rolls until it is 1 m behind the plane, or at rest.
    """
    position = np.maximum(ball.position, [-np.inf, -np.inf, BALL.radius])
    state = kd.BallState(position, ball.velocity, ball.spin)
    behind = kd.Plane(draw.target + draw.ahead, -draw.ahead, "centre")
    course = kd.follow(state, BALL, AIR, kd.Ground(0.0, "turf"), plane=behind)
    states = course.sample(np.linspace(0.0, course.duration, 4000))
    apart = states.position - draw.target
    past = apart @ draw.ahead
    row = {"least": float(np.linalg.norm(apart, axis=1).min())}
    if past[-1] > 0.0:
        k = int(np.argmax(past > 0.0))
        crossing = apart[k] - past[k] / (past[k] - past[k - 1]) * (apart[k] - apart[k - 1])
        row["error"] = float(np.linalg.norm(crossing))
        row["speed past"] = float(np.linalg.norm(states.velocity[k]))
    return row


class Rows:
    """Rows of a file of JSON lines, by their keys; a last line that was cut is removed."""

    def __init__(self, file: Path) -> None:
        self.file = file
        lines = file.read_text().splitlines(keepends=True) if file.exists() else []
        whole = [line for line in lines if line.endswith("\n")]
        if whole != lines:
            file.write_text("".join(whole))
        self.rows = {tuple(row["key"]): row for row in map(json.loads, whole)}

    def get(self, key: tuple, make: Callable[[], dict]) -> dict:
        """Return the row of a key, which is made and stored if there is none."""
        if key not in self.rows:
            self.rows[key] = {"key": key, **make()}
            with self.file.open("a") as file:
                file.write(json.dumps(self.rows[key]) + "\n")
        return self.rows[key]


def figures(rows: Sequence[dict]) -> dict[str, str]:
    """Return the figures of kicks as text, by name; means are of the kicks that have a value."""

    def of(name: str, function: Callable = np.mean) -> str:
        values = [row[name] for row in rows if name in row]
        return f"{function(values):.2f}" if values else "-"

    def share(name: str, most: float = 1.0) -> str:
        return f"{sum(0.0 < row.get(name, 0.0) <= most for row in rows) / len(rows):.1%}"

    return {
        "kicks": f"{len(rows)}",
        "a motion is found": share("planned"),
        "foot touches the ball": share("touched"),
        "ball crosses the plane": share("error", math.inf),
        ERROR: of("error"),
        "median error at the plane [m]": of("error", np.median),
        "mean least distance [m]": of("least"),
        **{f"within {most:g} m": share("least", most) for most in WITHIN},
        SPEED: of("speed"),
        FASTEST: of("speed", max),
        "mean speed at the plane [m/s]": of("speed past"),
        "upright, of the robots that kick": of("upright"),
        "processor time of a plan, median [s]": of("planning", np.median),
    }


def main() -> None:
    """Carry out the kicks that are not stored, and print the table."""
    reader = argparse.ArgumentParser()
    reader.add_argument("kicks", nargs="?", type=int, default=500)
    reader.add_argument("--distances", nargs="+", type=float, choices=SPEEDS, default=[*SPEEDS])
    reader.add_argument("--seed", type=int, default=0)
    reader.add_argument("--calibration", type=int, default=100, metavar="M")
    reader.add_argument("--folder", type=Path, default=Path("build/public_task"))
    arguments = reader.parse_args()
    player, rows = Player(arguments.folder), Rows(arguments.folder / "kicks.jsonl")
    columns = {}
    for distance in arguments.distances:
        others = [(k, Draw.at(distance, 0, k)) for k in range(arguments.calibration)]
        # from the middle outward, so that each motion is near one that there is
        for k, draw in sorted(others, key=lambda one: math.hypot(*(one[1].ball - PLACE))):
            player.learn(rows.get(("calibration", distance, k), partial(player.kick, draw)))
        counted = []
        for k in range(arguments.kicks):
            draw, seed = Draw.at(distance, 1, arguments.seed, k), 10**6 * arguments.seed + k
            key = ("kick", arguments.calibration, distance, arguments.seed, k)
            counted.append(rows.get(key, partial(player.kick, draw, seed)))
        columns[f"kickdyn, {distance:g} m"] = figures(counted)
    columns |= PUBLISHED
    print("| |", " | ".join(columns), "|\n|---|" + "---|" * len(columns))
    for name in figures(counted):
        print(f"| {name} |", " | ".join(column.get(name, "-") for column in columns.values()), "|")
    print(NOTES)


if __name__ == "__main__":
    main()
