"""Motions of kicks: whether all limits hold between the points, and what they cost.

    python benchmarks/kick_that_runs.py [--out FILE] [--most N] [CASE ...]

Cases are human, testbed, g1-legs, g1, g1-both (from both feet), talos, humanoid and goals. Two
tables: a row for each goal of each robot has the status, the share of the launch, processor time,
the largest torque and speed over their limits, least distances of the centre of pressure from the
edge of the sole and of the kicking foot from the ground, and by how much `strike` and `fly` miss
the target. A row for each of 20 goals of G1 over 1 to 9 m in three directions has, where it is
refused, the limits that hold it back, and the share that the same robot reaches with these limits
relaxed. Rows are kept in FILE (build/kick_that_runs.jsonl), so that the same command continues
after an interruption, or after the N plans that one call makes at most.
"""

import argparse
import json
import re
import time
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np

import kickdyn as kd
from kickdyn.motion import motion_problem
from kickdyn.motion.kick_task import KickTask
from kickdyn.motion.limits import INSIDE, Impulse, Limit
from kickdyn.motion.separation import Gap, Surroundings
from kickdyn.robot.standing import StandingRobot

BALL, AIR = kd.Ball(), kd.Air()
GOALS = {
    "7.9 m/s": kd.Goal(3, time=0.4),
    "9.4 m/s": kd.Goal(3.5, time=0.387),
    "11.4 m/s": kd.Goal(5, time=0.46),
}
ARMS = {"*wrist*": 0.0}
HANDS = {"arm_*_[567]_joint": 0.0, "*gripper*": 0.0, "head_*": 0.0}
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
    "g1-both": (lambda: standing("g1", "left_ankle_roll_link", locked=ARMS), GOALS),
    "talos": (
        lambda: standing("talos", "left_sole_link", locked=HANDS),
        {"7.9 m/s": GOALS["7.9 m/s"]},
    ),
    "humanoid": (humanoid, {"4.2 m/s": kd.Goal(1.5, time=0.4)}),
    "goals": (lambda: standing("g1", "left_ankle_roll_link", locked=ARMS), TWENTY),
}


RELAXED = (
    "twice the torque and speed, 0.5 rad more range, twice the friction and the sole, and other "
    "limits, as those in the impact, left out"
)


def relaxed(robot: kd.Leg, names: Sequence[str]) -> kd.Leg:
    """Return a standing robot with limits relaxed, by their names."""
    model = robot.model
    support = StandingRobot(robot).support
    for name in names:
        if name.endswith("in the impact"):
            continue
        of_joint = re.match(r"(torque|speed|range) of (.+)", name)
        if of_joint:
            what, i = of_joint[1], robot.velocity_index(of_joint[2])
            if what == "range":
                at = i + 1  # after the quaternion of the base
                model.lowerPositionLimit[at] -= 0.5
                model.upperPositionLimit[at] += 0.5
            else:
                limit = model.effortLimit if what == "torque" else model.velocityLimit
                limit[i] *= 2.0
        elif "friction" in name or "moment about" in name:
            support = replace(support, friction=2.0 * (support.friction or 0.7))
        elif "centre of pressure" in name:
            middle = support.sole.mean(axis=0)
            support = replace(support, sole=middle + 2.0 * (support.sole - middle))
    return robot.with_model(model).with_supports(support)


@contextmanager
def left_out(names: Collection[str]) -> Iterator[None]:
    """Plan motions without limits that a robot has no number for, by their names."""
    limits_of, gaps_of = motion_problem.limits_of, Surroundings.gaps
    of_robot = re.compile(r"(torque|speed|range) of |friction|moment about|centre of pressure")

    def kept(limit: Limit) -> bool:
        return limit.labels[0] not in names or (
            not isinstance(limit, Impulse) and of_robot.match(limit.labels[0].removeprefix("the "))
        )

    def limits(task: KickTask) -> tuple[list[Limit], list[Impulse]]:
        every = limits_of(task)
        return tuple([limit for limit in some if kept(limit)] for some in every)

    def gaps(self: Surroundings, *args: object) -> list[Gap]:
        return [gap for gap in gaps_of(self, *args) if self.label(self.joints(gap)) not in names]

    motion_problem.limits_of, Surroundings.gaps = limits, gaps
    try:
        yield
    finally:
        motion_problem.limits_of, Surroundings.gaps = limits_of, gaps_of


def planned(name: str, words: str, leg: kd.Leg, goal: kd.Goal) -> dict[str, object]:
    """Return the row of a goal."""
    options = {"motion": "both-feet" if name == "g1-both" else True, "contact": CONTACTS.get(name)}
    start = time.process_time()
    plan = kd.plan_kick(leg, goal, BALL, AIR, **options)
    seconds = time.process_time() - start
    row = {
        "robot": name, "goal": words, "launch": plan.launch.speed, "status": str(plan.status),
        "share": plan.share, "seconds": seconds, "torque": plan.torque_use,
        "speed": plan.speed_use, "squared": plan.value, **least_margins(plan.motion),
        "miss": 1e3 * plan.landing_error, "joints": len(plan.motion.joints),
        "lines": [line for line in plan.warnings if "of the flight is outside" not in line],
    }  # fmt: skip
    if name == "goals" and plan.status != "met":
        first = next((line for line in row["lines"] if "limits that hold it back" in line), "")
        names = [re.sub(r" \(.*", "", part) for part in first.partition("most: ")[2].split(", ")]
        row["limits"] = [name for name in names if name]
        with left_out(row["limits"]):
            again = kd.plan_kick(relaxed(leg, row["limits"]), goal, BALL, AIR, **options)
        row["relaxed"], row["broken"] = again.share, list(again.motion.warnings)
    return row


def least_margins(motion: kd.Motion) -> dict[str, float]:
    """Return the least distances of a standing robot [mm]."""
    times = np.linspace(motion.begin, motion.end, 2000)
    every = [motion.margins(t) for t in times]
    least = {}
    for words, short, more in (
        ("centre of pressure under the supp", "pressure", INSIDE), ("kicking foot above", "foot", 0)
    ):  # fmt: skip
        values = [v for row in every for name, v in row.items() if words in name]
        least[short] = 1e3 * (min(values) + more) if values else float("nan")
    return least


def main() -> None:
    """Plan what is not known yet, and print the tables."""
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--out", type=Path, default=Path("build/kick_that_runs.jsonl"))
    reader.add_argument("--most", type=int, default=10**6)
    reader.add_argument("cases", nargs="*", default=[*CASES])
    arguments = reader.parse_args()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    known = {}
    if arguments.out.exists():
        rows = map(json.loads, arguments.out.read_text().splitlines())
        known = {(row["robot"], row["goal"]): row for row in rows}
    wanted = [(name, words) for name in arguments.cases for words in CASES[name][1]]
    for name, words in [key for key in wanted if key not in known][: arguments.most]:
        make, goals = CASES[name]
        row = known[name, words] = planned(name, words, make(), goals[words])
        with arguments.out.open("a") as file:
            file.write(json.dumps(row) + "\n")
    print_tables([known[key] for key in wanted if key in known])


def print_tables(rows: Sequence[dict]) -> None:
    """Print the rows of robots, then of goals."""
    print("| robot | launch [m/s] | status | share | processor [s] | torque | speed | "
          "squared torque [s] | centre of pressure in the sole [mm] | foot above the ground [mm] | "
          "miss [mm] |\n"
          "|---|---|---|---|---|---|---|---|---|---|---|")  # fmt: skip
    for row in rows:
        if row["robot"] != "goals":
            print(f"| {row['robot']}, {row['joints']} joints | {row['launch']:.1f} | "
                  f"{row['status']} | {row['share']:.3f} | {row['seconds']:.1f} | "
                  f"{row['torque']:.2f} | {row['speed']:.2f} | {row['squared']:.3f} | "
                  f"{row['pressure']:.1f} | {row['foot']:.1f} | {row['miss']:.1g} |")  # fmt: skip
    print(
        f"\nRelaxed: {RELAXED}.\n\n| goal | launch [m/s] | status | share | processor [s] | "
        "limits that hold it back | share with these relaxed |\n|---|---|---|---|---|---|---|"
    )
    for row in rows:
        if row["robot"] == "goals":
            again = ""
            if "relaxed" in row:
                again = f"{row['relaxed']:.3f}, {'not met' if row['broken'] else 'met'}"
            names = "; ".join(row.get("limits", ()))
            print(f"| {row['goal']} | {row['launch']:.1f} | {row['status']} | {row['share']:.3f} | "
                  f"{row['seconds']:.1f} | {names} | {again} |")  # fmt: skip


if __name__ == "__main__":
    main()
