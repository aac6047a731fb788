"""Planned kicks carried out in MuJoCo: with a plate and the own foot, corrected, and with noise.

    python benchmarks/kicks_in_mujoco.py [g1-7.9 g1-9.4 g1-11.4 talos humanoid] [--runs 50]
    python benchmarks/kicks_in_mujoco.py t1 --t1 booster_gym/resources/T1/T1_serial.urdf

A line for each kick as it was planned, and after two corrections: errors of the ball's speed and
direction, miss of the target and of the planned flight 3 m away, whether the robot stands 1 s
later, and processor time. A plate at the contact point strikes the ball, or the robot's own foot;
a kick corrected with the plate is also carried out with the own foot. Then, for the kick corrected
with the own foot, a table of both errors with the ball displaced, and runs with the noise of
`kd.KickNoise()` (masses 2 %, friction 10 %, commands up to 5 ms late, place of the ball 5 mm): how
many robots stand, and how the balls scatter.

T1 is Booster's, of github.com/BoosterRobotics/booster_gym, without rotors, on its left foot, its
arms spread.
"""

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import kickdyn as kd

BALL, AIR = kd.Ball(), kd.Air()
ARMS = {"*wrist*": 0.0}
HANDS = {"arm_*_[567]_joint": 0.0, "*gripper*": 0.0, "head_*": 0.0}
NEAR = 3.0
"""Distance at which the balls are compared with the planned flight [m]."""

TOE = kd.Contact(friction=0.4, offset=(0.066, -0.0135, 0.133))
"""A point of the humanoid's foot, a sphere of 75 mm, where the ball of its kick meets it."""

DISPLACED = 0.0, 0.01, 0.02, 0.05
"""Displacements of the ball [m]."""

SPREAD = {"*Head*": 0.0, "*Elbow*": 0.0, "*Shoulder_Pitch": 0.0} | {
    "Left_Shoulder_Roll": -1.3, "Right_Shoulder_Roll": 1.3
}  # fmt: skip


def g1() -> kd.Leg:
    """Return G1 with 23 joints on its left foot."""
    robot = kd.Leg.from_robot("g1", base="floating", locked=ARMS)
    return robot.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))


def talos() -> kd.Leg:
    """Return TALOS on its left foot; its planner holds the arms aside of the kicking leg."""
    robot = kd.Leg.from_robot("talos", base="floating", locked=HANDS)
    return robot.with_supports(kd.Support("left_sole_link", friction=0.7))


def humanoid() -> kd.Leg:
    """Return the humanoid of gymnasium on its left foot."""
    import gymnasium

    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    return kd.Leg.from_mjcf(file, "right_foot", base="floating").with_supports("left_foot")


def t1(file: str) -> kd.Leg:
    """Return Booster's T1 on its left foot; it kicks with its toe."""
    robot = kd.Leg.from_urdf(
        file, "right_foot_link", base="floating", drives=False, locked=SPREAD
    )  # fmt: skip
    return kd.kick_with(robot, "toe").with_supports(kd.Support("left_foot_link", friction=0.7))


CASES = {
    "g1-7.9": (g1, kd.Goal(3, time=0.4), None),
    "g1-9.4": (g1, kd.Goal(3.5, time=0.387), None),
    "g1-11.4": (g1, kd.Goal(5, time=0.46), None),
    "talos": (talos, kd.Goal(3, time=0.4), None),
    "humanoid": (humanoid, kd.Goal(1.2, time=0.22), TOE),
}


def describe(run: kd.MujocoRun) -> str:
    """Return the errors of a run as text."""
    return (
        f"speed {run.speed_error:+.1%}, direction {math.degrees(run.direction_error):.1f} deg, "
        f"misses by {100 * run.miss:.1f} cm, by {100 * miss_at(run, NEAR):.1f} cm at {NEAR:g} m, "
        f"{'stands' if run.upright else 'FALLS'}"
    )


def miss_at(run: kd.MujocoRun, distance: float) -> float:
    """Return how far the ball passes from the planned flight at a distance [m]."""
    if run.path is None:
        return math.inf
    plan = run.plan
    start, ahead = plan.impact.ball_before.position, plan.aim.ahead
    plane = kd.Plane(start + distance * ahead, -ahead, "centre")
    wish = kd.BallState(start, plan.launch.velocity, plan.launch.spin)
    ends = [
        kd.fly(ball, BALL, AIR, kd.Ground(-9), plane=plane).landing.position
        for ball in (wish, run.ball_after)
    ]
    return float(np.linalg.norm(ends[1] - ends[0]))


def displaced(plan: kd.KickPlan, place: np.ndarray) -> kd.KickPlan:
    """Return a plan whose ball lies aside by `place`, shape `(3,)` [m], which the robot ignores."""
    approach = plan.impact.approach
    ball = replace(approach.ball_before, position=approach.ball_before.position + place)
    return replace(plan, impact=replace(plan.impact, approach=approach._replace(ball_before=ball)))


def print_displacements(plan: kd.KickPlan, contact: kd.MujocoRun) -> None:
    """Print errors of speed and direction of displaced balls, in the contact of a run."""
    ahead = plan.aim.ahead
    left = np.cross((0.0, 0.0, 1.0), ahead)
    sides = {"ahead": ahead, "back": -ahead, "left": left, "right": -left}
    print("  | ball | plate | own foot |\n  |---|---|---|")
    for distance in DISPLACED:
        for side, along in sides.items() if distance else [("in its place", ahead)]:
            moved = displaced(plan, distance * along)
            errors = []
            for foot in ("plate", "shapes"):
                run = kd.run_in_mujoco(moved, tuning=contact.tuning, foot=foot)
                text = f"{run.speed_error:+.1%}, {math.degrees(run.direction_error):.1f}°"
                text = "missed" if run.path is None else text
                errors.append(text if run.foot == foot else f"{text} (a plate)")
            where = f"{100 * distance:g} cm {side}" if distance else side
            print(f"  | {where} | {' | '.join(errors)} |", flush=True)


def main() -> None:
    """Print the lines of each kick."""
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--t1", metavar="URDF", help="the file of T1, for the case t1")
    arguments = parser.parse_args()
    cases = CASES | {"t1": (lambda: t1(arguments.t1), kd.Goal(1.2, time=0.3), None)}
    for name in arguments.cases:
        make, goal, point = cases[name]
        start = time.process_time()
        plan = kd.plan_kick(make(), goal, BALL, AIR, contact=point, motion=True)
        planned = time.process_time() - start
        print(f"{name}, {plan.launch.speed:.2f} m/s: {plan.status}, {planned:.0f} s", flush=True)
        contact = kd.run_in_mujoco(plan)
        corrected = {"planned": plan}
        for foot, text in (("plate", "a plate"), ("shapes", "the own foot")):
            start = time.process_time()
            corrected[foot] = kd.refine_kick(plan, rounds=2, by="mujoco", foot=foot)
            print(f"  corrected twice with {text}: {time.process_time() - start:.0f} s", flush=True)
        for text, plan, foot in (
            ("as planned, a plate", corrected["planned"], "plate"),
            ("as planned, the own foot", corrected["planned"], "shapes"),
            ("corrected with a plate, a plate", corrected["plate"], "plate"),
            ("corrected with a plate, the own foot", corrected["plate"], "shapes"),
            ("corrected with the own foot", corrected["shapes"], "shapes"),
        ):
            run = kd.run_in_mujoco(plan, tuning=contact.tuning, foot=foot)
            print(f"  {text}: {describe(run)}", *run.doubts, sep="\n    ", flush=True)
        print_displacements(plan, contact)
        if arguments.runs:
            print(kd.run_with_noise(plan, arguments.runs, tuning=contact.tuning), flush=True)


if __name__ == "__main__":
    main()
