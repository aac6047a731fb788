"""Planned kicks carried out in MuJoCo: corrected twice, and with seeded noise.

    python benchmarks/kicks_in_mujoco.py [g1-7.9 g1-9.4 g1-11.4 talos humanoid] [--runs 50]

A line for each kick as it was planned, and after two corrections: errors of the ball's speed and
direction, miss of the target and of the planned flight 3 m away, whether the robot stands 1 s
later, and processor time. Then the corrected kick in runs with the noise of `kd.KickNoise()`
(masses 2 %, friction 10 %, commands up to 5 ms late, place of the ball 5 mm): how many robots
stand, and how the balls scatter.
"""

import argparse
import math
import time
from pathlib import Path

import numpy as np

import kickdyn as kd

BALL, AIR = kd.Ball(), kd.Air()
ARMS = {"*wrist*": 0.0}
HANDS = {"arm_*_[567]_joint": 0.0, "*gripper*": 0.0, "head_*": 0.0}
NEAR = 3.0
"""Distance at which the balls are compared with the planned flight [m]."""

TOE = kd.Contact(friction=0.4, offset=(0.1, 0.0, 0.1))


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


CASES = {
    "g1-7.9": (g1, kd.Goal(3, time=0.4), None),
    "g1-9.4": (g1, kd.Goal(3.5, time=0.387), None),
    "g1-11.4": (g1, kd.Goal(5, time=0.46), None),
    "talos": (talos, kd.Goal(3, time=0.4), None),
    "humanoid": (humanoid, kd.Goal(1.5, time=0.4), TOE),
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


def main() -> None:
    """Print the lines of each kick."""
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--runs", type=int, default=50)
    arguments = parser.parse_args()
    for name in arguments.cases:
        make, goal, contact = CASES[name]
        start = time.process_time()
        plan = kd.plan_kick(make(), goal, BALL, AIR, contact=contact, motion=True)
        planned = time.process_time() - start
        print(f"{name}, {plan.launch.speed:.2f} m/s: {plan.status}, {planned:.0f} s", flush=True)
        print(f"  as planned: {describe(kd.run_in_mujoco(plan))}", flush=True)
        start = time.process_time()
        plan = kd.refine_kick(plan, rounds=2, by="mujoco")
        corrected = time.process_time() - start
        run = kd.run_in_mujoco(plan)
        print(f"  corrected twice, {corrected:.0f} s: {describe(run)}", flush=True)
        if arguments.runs:
            print(kd.run_with_noise(plan, arguments.runs, tuning=run.tuning), flush=True)


if __name__ == "__main__":
    main()
