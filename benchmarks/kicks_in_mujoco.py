"""Planned kicks carried out in MuJoCo: corrected twice, and with seeded noise.

    python benchmarks/kicks_in_mujoco.py [g1-7.9 g1-9.1 g1-11.4 talos humanoid] [--runs 50]

A line for each kick as it was planned, and after two corrections: errors of the ball's speed and
direction, miss of the target, whether the robot stands 1 s later, and processor time. Then, of the
corrected kick in runs with the noise of `kd.KickNoise()` (masses 2 %, friction 10 %, commands up to
5 ms late, place of the ball 5 mm), the share in which the robot stands, and the scatter of the ball
where it reaches the plane of the target or the ground: means and standard deviations.
"""

import argparse
import math
import time
from pathlib import Path

import numpy as np

import kickdyn as kd

BALL, AIR = kd.Ball(), kd.Air()
ARMS_ASIDE = {
    "left_shoulder_roll_joint": 0.8,
    "right_shoulder_roll_joint": -0.8,
    "*elbow*": 1.5,
}
TOE = kd.Contact(friction=0.4, offset=(0.1, 0.0, 0.1))


def g1() -> kd.Leg:
    """Return G1 on its left foot, with its arms aside of the kicking leg."""
    robot = kd.Leg.from_robot("g1", base="floating", legs_only=True, locked=ARMS_ASIDE)
    return robot.with_supports(kd.Support("left_ankle_roll_link", friction=0.7))


def talos() -> kd.Leg:
    """Return TALOS on its left foot."""
    robot = kd.Leg.from_robot("talos", base="floating", legs_only=True)
    return robot.with_supports(kd.Support("left_sole_link", friction=0.7))


def humanoid() -> kd.Leg:
    """Return the humanoid of gymnasium on its left foot."""
    import gymnasium

    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    return kd.Leg.from_mjcf(file, "right_foot", base="floating").with_supports("left_foot")


CASES = {
    "g1-7.9": (g1, kd.Goal(3, time=0.4), None),
    "g1-9.1": (g1, kd.Goal(3.5, time=0.4), None),
    "g1-11.4": (g1, kd.Goal(5, time=0.46), None),
    "talos": (talos, kd.Goal(3, time=0.4), None),
    "humanoid": (humanoid, kd.Goal(1.5, time=0.4), TOE),
}


def describe(run: kd.MujocoRun) -> str:
    """Return the errors of a run as text."""
    return (
        f"speed {run.speed_error:+.1%}, direction {math.degrees(run.direction_error):.1f} deg, "
        f"misses by {100 * run.miss:.1f} cm, {'stands' if run.upright else 'FALLS'}"
    )


def noisy(plan: kd.KickPlan, first: kd.MujocoRun, count: int) -> str:
    """Return what seeded runs of a plan give, as text."""
    runs = [kd.run_in_mujoco(plan, tuning=first.tuning, seed=seed) for seed in range(count)]
    hits = [run for run in runs if run.path is not None]
    speeds = np.array([run.speed_error for run in hits])
    angles = np.degrees([
        [math.atan2(y, x), math.atan2(z, math.hypot(x, y))]
        for x, y, z in (run.ball_after.velocity for run in hits)
    ])  # fmt: skip
    misses = 100 * np.array([run.miss for run in hits])
    azimuth, elevation = angles.std(axis=0, ddof=1)
    upright = sum(run.upright for run in runs)
    return (
        f"{upright} of {count} stand, {count - len(hits)} miss the ball; speed "
        f"{speeds.mean():+.1%} +- {speeds.std(ddof=1):.1%}, azimuth +- {azimuth:.1f} deg, "
        f"elevation +- {elevation:.1f} deg, miss {np.median(misses):.0f} cm (median), "
        f"{np.quantile(misses, 0.9):.0f} cm (90 %)"
    )


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
        print(f"  with noise: {noisy(plan, run, arguments.runs)}", flush=True)


if __name__ == "__main__":
    main()
