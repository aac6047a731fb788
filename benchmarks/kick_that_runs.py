"""Motions of kicks: whether all limits hold between the points, and what they cost.

    python benchmarks/kick_that_runs.py [human testbed g1-legs g1 talos humanoid goals]

A line for each goal: status, share of the launch, processor time, largest torque and speed over
their limits, least distances of the centre of pressure from the edge of the sole and of the kicking
foot from the ground, and by how much `strike` and `fly` miss the target. `goals` are 20 goals of G1
over 1 to 9 m in three directions.
"""

import sys
import time
from pathlib import Path

import gymnasium
import numpy as np

import kickdyn as kd

BALL, AIR = kd.Ball(), kd.Air()
GOALS = {
    "7.9 m/s": kd.Goal(3, time=0.4),
    "9.4 m/s": kd.Goal(3.5, time=0.4),
    "11.4 m/s": kd.Goal(5, time=0.46),
}
ARMS = {"*wrist*": 0.0}
TWENTY = {
    f"{length:g} m, {azimuth} deg": kd.Goal(
        length * np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0]),
        time=0.2 + 0.08 * length,
    )
    for azimuth, lengths in ((0, 7), (30, 7), (-30, 6))
    for length in (9, 7.5, 6, 4.5, 3, 2, 1)[:lengths]
}


def standing(name: str, foot: str, **options: object) -> kd.Leg:
    """Return a robot of the catalogue on one foot."""
    robot = kd.Leg.from_robot(name, base="floating", **options)
    return robot.with_supports(kd.Support(foot, friction=0.7))


def humanoid() -> kd.Leg:
    """Return the humanoid of gymnasium on its left foot."""
    file = Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml"
    return kd.Leg.from_mjcf(file, "right_foot", base="floating").with_supports("left_foot")


CONTACTS = {"humanoid": kd.Contact(friction=0.4, offset=(0.1, 0.0, 0.1))}
"""Contacts of robots whose foot has no toe."""

CASES = {
    "human": (kd.Leg.human, {"15 m": kd.Goal(15, time=1), "20 m": kd.Goal(20, time=1.2)}),
    "testbed": (kd.Leg.testbed, {"1.5 m": kd.Goal(1.5, time=0.6)}),
    "g1-legs": (lambda: standing("g1", "left_ankle_roll_link", legs_only=True), GOALS),
    "g1": (lambda: standing("g1", "left_ankle_roll_link", locked=ARMS), GOALS),
    "talos": (
        lambda: standing("talos", "left_sole_link", legs_only=True),
        {"7.9 m/s": GOALS["7.9 m/s"]},
    ),
    "humanoid": (humanoid, {"4.2 m/s": kd.Goal(1.5, time=0.4)}),
    "goals": (lambda: standing("g1", "left_ankle_roll_link", locked=ARMS), TWENTY),
}


def main() -> None:
    """Print a line for each goal of each leg."""
    for name in sys.argv[1:] or CASES:
        make, goals = CASES[name]
        leg = make()
        for words, goal in goals.items():
            start = time.process_time()
            plan = kd.plan_kick(leg, goal, BALL, AIR, motion=True, contact=CONTACTS.get(name))
            spent = time.process_time() - start
            margins = least_margins(plan.motion)
            print(
                f"{name} {words} ({plan.launch.speed:.1f}): {plan.status}, share {plan.share:.3f}, "
                f"{spent:.1f} s, torque {plan.torque_use:.2f}, speed {plan.speed_use:.2f}, "
                f"squared torque {plan.value:.3f} s, {margins}misses by {plan.landing_error:.1g} m",
                flush=True,
            )
            for line in plan.warnings:
                print(f"    {line}")


def least_margins(motion: kd.Motion) -> str:
    """Return the least margins of a standing robot in millimetres, as text."""
    times = np.linspace(motion.begin, motion.end, 2000)
    every = [motion.margins(t) for t in times]
    shown = {"centre of pressure": "pressure", "kicking foot above": "foot"}
    parts = []
    for label in every[0]:
        for words, short in shown.items():
            if words in label:
                parts.append(f"{short} {1e3 * min(margins[label] for margins in every):.1f} mm")
    return "".join(f"{part}, " for part in parts)


if __name__ == "__main__":
    main()
