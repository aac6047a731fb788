"""The task by which trained kicking robots are judged: how far from a target do balls of G1 pass?

    python benchmarks/public_task.py [KICKS] [--distances 3 5] [--rolling] [--seed S]

A ball lies at random in a square of 20 cm before G1, which stands on its left foot, turned about
the middle of the square by up to 0.2 rad. The target is 3 m or 5 m from that middle. Each of KICKS
(500) for each distance is interpolated in a library over the azimuth of the launch and the place of
the ball, of one speed and elevation, whose motions are carried out in MuJoCo once, to aim. The kick
is carried out once in MuJoCo, by a robot whose masses, friction and delay differ from the model at
random. With `--rolling`, balls roll at up to 1 m/s to places in the square. Library and kicks are
stored in build/public_task (--folder): the same command continues after an interruption. The
library takes about 15 minutes of processor, a kick about 1 s.
"""

import argparse
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.impact.force_model import CONTACT_TIME
from kickdyn.motion import plan_motion
from kickdyn.planning import library_making, library_motions
from kickdyn.planning.kick_library import KickLibrary
from kickdyn.planning.kick_reader import launch_axes, launch_velocity

BALL, AIR, GROUND = kd.Ball(), kd.Air(), kd.Ground(0.0, "turf")
CONTACT = kd.Contact(restitution=0.8, friction=0.4)

PLACE, HALF = np.array([0.35, -0.08]), 0.1
"""Middle and half the side of the square in which the ball lies, in the axes of the robot [m]."""

YAW, HEIGHT = 0.2, 0.3
"""Largest angle by which the robot is turned [rad], and height of the target [m]."""

DISTANCES = 3.0, 5.0
"""Distances of the target from the middle of the square [m]."""

SPEED, ELEVATION, AZIMUTHS, STEP = 8.3, math.radians(13.5), (-0.28, 0.24, 0.13), 0.05
"""Launches of the library by `strike`: speed [m/s], elevation [rad], least and largest azimuth and
its step [rad]; and the step of the ball's place [m]."""

ALLOWED, ITERATIONS = (0.1, 0.03), 60
"""What the motion at the centre of a cell of the library may lack of a limit, a share of it, or a
distance or angle [m, rad], since steps are wider than those of a library that keeps all limits; and
the iterations of the solver after which a motion is given up."""

TURN = 6.6
"""Change of the azimuth with the place of the ball [rad/m]."""

FLIGHT_TIME = 0.05
"""Time of the flights for which motions are taken [s]."""

TURNS, AIMED = 5, 0.2
"""Corrections of the azimuth to aim, and the largest distance from the target at which a kick is
expected to pass it that counts as aimed [m]."""

FASTEST_ROLLING = 1.0
"""Speed of a rolling ball at the impact [m/s]."""

NOISE = kd.KickNoise(place=0.0)
"""The disturbance of the kicks: the robot knows the place of the ball."""

WITHIN = 0.5, 1.0, 1.5
"""Distances whose shares are printed [m]."""

ERROR, MEAN_SPEED, FASTEST = (
    "mean error at the plane [m]",
    "mean speed [m/s]",
    "largest speed [m/s]",
)

PUBLISHED = {
    "RoboNaldo, simulated, 5 m": {ERROR: "0.90", "within 1 m": "65.5%", MEAN_SPEED: "14.8"},
    "RoboNaldo, real G1, 3 m": {ERROR: "0.73", FASTEST: "13.1"},
    "RoboNaldo, real G1, 3 m, rolling": {ERROR: "0.86"},
}

NOTES = """
RoboNaldo: Zhong et al. 2026, arXiv 2606.11092. Not comparable: it walks up to the ball, and sees it
on the robot by its own sensors; in its public configuration, targets are spread over 6 m by 2 m,
5 m before its start and 4 m before the ball. Here the robot stands on one foot and knows where the
ball is, or will be; ball, contact, friction and drives are others. Shares are of all kicks; those
within distances are of the least distance from the target."""


class Draw(NamedTuple):
    """A ball and a target, in the axes of the robot."""

    distance: float  # of the target from the middle of the square [m]
    ball: Array  # x and y at the impact [m]
    yaw: float  # of the robot to the left [rad]
    velocity: Array  # of the ball at the impact, shape `(3,)` [m/s]

    @classmethod
    def at(cls, distance: float, seed: int, number: int, *, rolling: bool) -> "Draw":
        """Return a draw; a rolling ball comes from ahead, or from aside."""
        random = np.random.default_rng([seed, number, round(distance)])
        ball, yaw = PLACE + random.uniform(-HALF, HALF, 2), random.uniform(-YAW, YAW)
        speed, angle = random.uniform(0.0, FASTEST_ROLLING), math.pi * random.uniform(0.5, 1.5)
        velocity = speed * rolling * np.array([math.cos(angle), math.sin(angle), 0.0])
        return cls(distance, ball, yaw, velocity)

    @property
    def ahead(self) -> Array:
        """Horizontal unit vector across the plane of the target, shape `(3,)`."""
        return np.array([math.cos(self.yaw), -math.sin(self.yaw), 0.0])

    @property
    def target(self) -> Array:
        """Position of the target, shape `(3,)` [m]."""
        return np.array([*PLACE, HEIGHT]) + self.distance * self.ahead

    def seen(self, before: float) -> kd.BallState:
        """Return the rolling ball at a time before the impact [s]."""
        speed, braking = math.hypot(*self.velocity), GROUND.surface.rolling_deceleration
        direction = self.velocity / speed
        place = np.array([*self.ball, BALL.radius])
        place -= (speed * before + 0.5 * braking * before**2) * direction
        return rolling_ball(place, (speed + braking * before) * direction)


def rolling_ball(place: Array, velocity: Array) -> kd.BallState:
    """Return a ball that rolls without slip."""
    return kd.BallState(place, velocity, np.cross([0.0, 0.0, 1.0 / BALL.radius], velocity))


class Player:
    """G1 with its library."""

    def __init__(self, folder: Path) -> None:
        g1 = kd.Leg.from_robot("g1", base="floating", legs_only=True)
        g1 = g1.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))
        file = folder / "library.npz"
        folder.mkdir(parents=True, exist_ok=True)
        library_making.REFINEMENTS, plan_motion.CONTINUED = 0, ITERATIONS
        library_motions.ALLOWED_SHARE, library_motions.ALLOWED_DISTANCE = ALLOWED
        library_making.Cell.checked = lambda cell: [(cell.centre(), cell.corners())]
        x, y = ((place - HALF, place + HALF, STEP) for place in PLACE.tolist())
        library = kd.kick_library(
            g1, file, BALL, speed=SPEED, elevation=ELEVATION, azimuth=AZIMUTHS,
            x=x, y=y, contact=CONTACT, progress=show,
        )  # fmt: skip
        self.plain = KickLibrary(file, g1)
        self.plain.reader.arrays.pop("simulated", None)
        middle = library.reader.nearest(0.5 * (library.reader.lower + library.reader.upper))
        self.tuning = kd.run_in_mujoco(self.plan(middle)).tuning
        self.library = kd.correct_library(library, tuning=self.tuning, progress=show)
        arrays = self.library.reader.arrays
        launches = arrays["simulated"][arrays["cell_nodes"]]
        self.cells = (arrays["cell_reasons"] == "") & np.isfinite(launches).all(axis=(1, 2))
        print(self.library)

    def covered(self, point: Array) -> Array:
        """Return the nearest point with a kick."""
        ends = (self.library.reader.arrays[f"cell_{end}"] for end in ("lower", "upper"))
        points = np.clip(point, *(end[self.cells] for end in ends))
        apart = np.abs(points - point) * [1.0, 1.0, 1.0, TURN, TURN]
        return points[apart.sum(axis=1).argmin()]

    def plan(self, point: Array) -> kd.KickPlan:
        """Return the plan of the kick at a point."""
        fall = np.array([0.0, 0.0, -0.5 * 9.81 * FLIGHT_TIME**2])
        goal = kd.Goal(FLIGHT_TIME * launch_velocity(point) + fall, time=FLIGHT_TIME)
        return self.plain.plan(goal, ball_position=point[3:])

    def aim(self, draw: Draw, ball: kd.BallState) -> tuple[float, Array]:
        """Return the expected error at the target, and the point of the kick towards it.

        What the velocity of the ball adds to a launch is by `strike`.
        """
        reader = self.library.reader
        point = np.array([*0.5 * (reader.lower + reader.upper)[:3], *ball.position[:2]])
        for _ in range(TURNS):
            used = self.covered(point)
            velocity = launch_velocity(reader.simulated(used))
            if ball.velocity.any():
                kick = self.plain.kick_at(used)
                rolling = struck(kick.motion, kick.impact, ball)
                velocity += rolling.ball_after.velocity - kick.launch
            start = ball.position + 0.5 * CONTACT_TIME * velocity
            wished, azimuth = draw.target - start, launch_axes(velocity)[2]
            point[2] = used[2] + math.atan2(wished[1], wished[0]) - azimuth
        return passing(draw, kd.BallState(start, velocity)).get("error", math.inf), used

    def kick(self, draw: Draw, seed: int) -> dict[str, object]:
        """Return the results of a kick, for JSON."""
        began, ball = process_time(), kd.BallState([*draw.ball, BALL.radius])
        if draw.velocity.any():  # its place is predicted as the motion begins
            duration = -float(self.plain.reader.arrays["before_knots"][0])
            course = kd.follow(draw.seen(duration), BALL, None, GROUND)
            state = course.sample(duration)
            ball = rolling_ball(state.position, state.velocity)
        expected, used = self.aim(draw, ball)
        plan, seconds = self.plan(used), process_time() - began
        plan = replace(plan, impact=struck(plan.motion, plan.impact, ball))
        displacement = draw.ball - used[3:]
        run = kd.run_in_mujoco(
            plan, tuning=self.tuning, seed=seed, noise=NOISE, ball_displacement=displacement
        )
        row = {
            "expected": expected,
            "place": bool(np.allclose(displacement, 0.0)),
            "point": used.tolist(),
            "seconds": seconds,
            "upright": run.upright,
            "touched": run.path is not None,
        }
        if run.path is not None:
            launch = launch_axes(run.ball_after.velocity)
            row |= {"launch": launch.tolist(), "speed": launch[0], **passing(draw, run.ball_after)}
        return row


def struck(motion: kd.Motion, impact: kd.Impact, ball: kd.BallState) -> kd.Impact:
    """Return the impact of a motion with a ball that rolls."""
    return kd.strike(impact.posture, motion.v(0.0), BALL, impact.contact,
                     ball_velocity=ball.velocity, ball_spin=ball.spin)  # fmt: skip


def show(what: str, count: int, total: int) -> None:
    """Print how much of a library there is."""
    print(f"{count} of {total} {what}", flush=True)


def passing(draw: Draw, ball: kd.BallState) -> dict[str, float]:
    """Return the error at the plane of the target, the speed there, and the least distance [m].

    The ball flies, bounces and rolls until it is 1 m behind the plane, or at rest.
    """
    position = np.maximum(ball.position, [-np.inf, -np.inf, BALL.radius])
    state = kd.BallState(position, ball.velocity, ball.spin)
    behind = kd.Plane(draw.target + draw.ahead, -draw.ahead, "centre")
    course = kd.follow(state, BALL, AIR, GROUND, plane=behind)
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
        "the library has a kick for this ball": share("place"),
        f"and expects it within {AIMED:g} m": share("expected", AIMED),
        "foot touches the ball": share("touched"),
        "upright after the kick": share("upright"),
        "ball crosses the plane": share("error", math.inf),
        ERROR: of("error"),
        "median error at the plane [m]": of("error", np.median),
        "mean least distance [m]": of("least"),
        **{f"within {most:g} m": share("least", most) for most in WITHIN},
        MEAN_SPEED: of("speed"),
        FASTEST: of("speed", max),
        "mean speed at the plane [m/s]": of("speed past"),
        "processor time of a plan, median [s]": of("seconds", np.median),
    }


def main() -> None:
    """Carry out the kicks that are not stored, and print the table."""
    reader = argparse.ArgumentParser()
    reader.add_argument("kicks", nargs="?", type=int, default=500)
    reader.add_argument("--distances", nargs="+", type=float, default=DISTANCES)
    reader.add_argument("--rolling", action="store_true")
    reader.add_argument("--seed", type=int, default=0)
    reader.add_argument("--folder", type=Path, default=Path("build/public_task"))
    arguments = reader.parse_args()
    columns, rolling, seed = {}, arguments.rolling, arguments.seed
    player, rows = Player(arguments.folder), Rows(arguments.folder / "kicks.jsonl")
    for distance in arguments.distances:
        counted = []
        for k in range(arguments.kicks):
            draw = Draw.at(distance, seed, k, rolling=rolling)
            key = ("rolling" if rolling else "at rest", distance, seed, k)
            counted.append(rows.get(key, partial(player.kick, draw, 10**6 * seed + k)))
        columns[f"kickdyn, {distance:g} m"] = figures(counted)
    columns |= PUBLISHED
    print("| |", " | ".join(columns), "|\n|---|" + "---|" * len(columns))
    for name in figures(counted):
        print(f"| {name} |", " | ".join(column.get(name, "-") for column in columns.values()), "|")
    print(NOTES)


if __name__ == "__main__":
    main()
