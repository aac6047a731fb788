"""Plan kicks of robots that are not in the catalogue, and carry them out in MuJoCo.

    python benchmarks/other_robots.py FOLDER [--robot NAME ...] [--corrections N] [--out FILE]

FOLDER has the unpacked wheels of robosuite (GR1) and dm_control (humanoid and humanoid_CMU), as
`pip download --no-deps robosuite dm_control` and `unzip` leave them; robots whose file is missing
are left out. GR1's file has neither rotors nor limits of torque: 0.1 kg m2 and 120 N m are guesses.
Three more, of 3 kg with a box as foot, 7 kg with a mesh and 30 kg, are `urdf/biped.urdf` on another
scale: lengths by s, masses by m, torques by m s, inertias of rotors by m s**2 and angular speeds by
s**-0.5, so that the same motions take s**0.5 of the time.

Each robot has five goals: straight, 30 degrees to the side, a pass on turf, with the other foot,
and from both feet to both feet. Of each: status, processor time, what holds it back where it is not
met; in MuJoCo, after corrections, errors of speed and direction, and whether the robot stays
upright. Rows are kept in FILE (build/other_robots.jsonl), so that the same command continues;
remove it after a change of the code.
"""

import argparse
import json
import re
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

import kickdyn as kd

ROOT = Path(__file__).resolve().parents[1]
BALL, SMALL_BALL = kd.Ball(), kd.Ball(mass=0.2, radius=0.07)
"""The second one is of the size of the RoboCup's kid size league."""

FRICTION = 0.7


class Robot(NamedTuple):
    """A file, its right and left foot, the axis it faces, its ball, and the length of its kicks."""

    file: Path
    feet: tuple[str, str]
    facing: str = "x"
    ball: kd.Ball = BALL
    length: float = 2.0  # of the straight kick [m]
    drive: kd.Drive | None = None  # of each joint; None are those of the file

    def on(self, kicking: int) -> kd.Leg:
        """Return the robot on one foot, kicking with the toe of the other one."""
        load = kd.Leg.from_mjcf if self.file.suffix == ".xml" else kd.Leg.from_urdf
        leg = load(self.file, self.feet[kicking], base="floating", facing=self.facing)
        if self.drive is not None:
            leg = leg.with_drives({"*": self.drive})
        support = kd.Support(self.feet[1 - kicking], friction=FRICTION)
        return kd.kick_with(leg, "toe").with_supports(support)


def scaled_biped(
    folder: Path, mass: float, length: float, kick: float, *,
    mesh: bool = False, ball: kd.Ball = BALL,
) -> Robot:  # fmt: skip
    """Return the biped on another scale, and write its file.

    `length` is relative to the biped's, and `kick` the length of the straight kick [m].
    """
    text = (ROOT / "urdf" / "biped.urdf").read_text("utf-8")
    m = mass / sum(float(each) for each in re.findall(r'<mass value="([^"]+)"', text))

    def times(factor: float, name: str, text: str) -> str:
        def product(found: re.Match[str]) -> str:
            numbers = " ".join(repr(factor * float(x)) for x in found[1].split())
            return f'{name}="{numbers}"'

        return re.sub(rf'\b{name}="([-+.e\d ]+)"', product, text)

    for name in ("xyz", "size", "radius", "length"):
        parts = re.split(r"(<axis [^>]*>)", text)  # of unit length
        text = "".join(p if p.startswith("<axis") else times(length, name, p) for p in parts)
    text = times(m, "value", text)
    for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        text = times(m * length**2, name, text)
    text = times(length**-0.5, "velocity", times(m * length, "effort", text))
    if mesh:  # the boxes of the feet as files
        for side in ("left", "right"):
            head, link, tail = text.partition(f'<link name="{side}_foot">')
            size = re.search(r'<box size="([^"]+)"', tail)
            assert size is not None
            box = trimesh.creation.box([float(each) for each in size[1].split()])
            box.export(folder / f"{side}_foot.stl")
            body, end, rest = tail.partition("</link>")
            body = re.sub(r"<box [^>]*/>", f'<mesh filename="{side}_foot.stl"/>', body)
            text = head + link + body + end + rest
    file = folder / f"biped_{mass:g}_kg.urdf"
    file.write_text(text, "utf-8")
    drive = kd.Drive(4.3e-3 * m * length**2)  # of urdf/biped_drives.toml
    return Robot(file, ("right_foot", "left_foot"), ball=ball, length=kick, drive=drive)


def robots(folder: Path, built: Path) -> dict[str, Robot]:
    """Return the robots whose files are there."""
    gr1 = folder / "robosuite/models/assets/robots/gr1/robot.xml"
    suite, feet = folder / "dm_control/suite", ("right_foot", "left_foot")
    scaled = partial(scaled_biped, built)
    small = partial(scaled, ball=SMALL_BALL)
    every = {
        "GR1, 54 kg": Robot(
            gr1, ("r_foot_roll", "l_foot_roll"), drive=kd.Drive(0.1, torque_limit=120.0)
        ),
        "dm_control humanoid, 41 kg": Robot(suite / "humanoid.xml", feet),
        "humanoid_CMU, 52 kg": Robot(suite / "humanoid_CMU.xml", ("rfoot", "lfoot"), "-y"),
        "biped, 3 kg": small(3.0, 0.5, 0.35),
        "biped, 7 kg, mesh": small(7.0, 0.75, 0.5, mesh=True),
        "biped, 30 kg": scaled(30.0, 1.25, 1.0),
    }
    return {name: robot for name, robot in every.items() if robot.file.is_file()}


def goals(length: float) -> dict[str, dict[str, Any]]:
    """Return the arguments of the kicks, whose straight one has a length [m].

    Those through the air leave at 20 degrees, but for drag.
    """
    ahead, aside = np.array([1.0, 0.0, 0.0]), np.array([np.cos(np.pi / 6), 0.5, 0.0])
    aloft = float(np.sqrt(2.0 * length * np.tan(np.radians(20)) / 9.81))
    straight = kd.Goal(length * ahead, time=aloft)
    return {
        "straight": {"goal": straight},
        "30 deg": {"goal": kd.Goal(length * aside, time=aloft)},
        "pass": {"goal": kd.Goal(length, time=0.8), "surface": "turf"},
        "other foot": {"goal": straight, "kicking": 1},
        "both feet": {"goal": straight, "motion": "both-feet"},
    }


def carry_out(
    robot: Robot, corrections: int, *, kicking: int = 0, motion: bool | str = True, **kick: Any
) -> dict[str, Any]:
    """Return a row of the table."""
    began = time.process_time()
    try:
        leg = robot.on(kicking)
        plan = kd.plan_kick(leg, ball=robot.ball, air=kd.Air(), motion=motion, **kick)
    except kd.KickdynError as error:
        return {"status": "refused", "seconds": time.process_time() - began, "why": str(error)}
    row = {"status": str(plan.status), "seconds": time.process_time() - began}
    row |= {"share": plan.share, "speed": float(np.linalg.norm(plan.launch.velocity))}
    if plan.status != "met":
        return {**row, "why": "; ".join(map(str, (*plan.binding, *plan.warnings)))}
    began = time.process_time()
    try:
        plan = kd.refine_kick(plan, rounds=corrections, by="mujoco") if corrections else plan
        run = kd.run_in_mujoco(plan)
    except kd.KickdynError as error:
        return {**row, "why": f"in MuJoCo: {error}"}
    return {
        **row,
        "upright": run.upright,
        "speed_error": run.speed_error,
        "direction_error": np.degrees(run.direction_error),
        "seconds_in_mujoco": time.process_time() - began,
        "why": "; ".join(run.warnings),
    }


def measured(file: Path) -> dict[str, dict[str, Any]]:
    """Return the rows of a file by their keys."""
    lines = file.read_text("utf-8").splitlines() if file.is_file() else []
    return {row["key"]: row for row in map(json.loads, lines)}


def shown(row: dict[str, Any]) -> str:
    """Return a row as text."""
    run = "| - | - | - "
    if "upright" in row:
        up = "yes" if row["upright"] else "no"
        run = f"| {up} | {100 * row['speed_error']:+.1f} | {row['direction_error']:.1f} "
    speed = f"{row['speed']:.1f}" if "speed" in row else "-"
    head = f"| {row['key']} | {speed} | {row['status']} | {row['seconds']:.0f} "
    return f"{head}{run}| {row['why'][:200]} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--robot", nargs="*", default=[""], help="part of a name")
    parser.add_argument("--corrections", type=int, default=2)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "other_robots.jsonl")
    given = parser.parse_args(arguments)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    former, rows = measured(given.out), []
    print(
        "| kick | launch [m/s] | status | plan [s] | upright | speed [%] | direction [deg] | why |"
    )
    print("|---" * 8 + "|")
    for name, robot in robots(given.folder, given.out.parent).items():
        if not any(part in name for part in given.robot):
            continue
        for kind, kick in goals(robot.length).items():
            key = f"{name}, {kind}, {given.corrections} corrections"
            if key not in former:
                former[key] = {"key": key, **carry_out(robot, given.corrections, **kick)}
                with given.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(former[key], default=float) + "\n")
            rows.append(former[key])
            print(shown(former[key]), flush=True)
    runs = [row for row in rows if "upright" in row]
    fast = [row for row in rows if row["seconds"] <= 30]
    print(f"\n{sum(row['status'] == 'met' for row in rows)} of {len(rows)} met, "
          f"{len(fast)} answered within 30 s; {sum(row['upright'] for row in runs)} of {len(runs)} "
          f"upright, median errors {100 * np.median([abs(r['speed_error']) for r in runs]):.1f} %, "
          f"{np.median([r['direction_error'] for r in runs]):.1f} degrees")  # fmt: skip


if __name__ == "__main__":
    main()
