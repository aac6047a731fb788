"""Read every URDF file of example-robot-data that has moving joints: which load, and why not.

    python benchmarks/urdf_files.py [--all]

Prints how many load, and the table of docs/explanation/robots.md of those that do not; with --all,
a table of all files.
"""

import sys
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree

import kickdyn as kd
from kickdyn.robot.catalog import robots_folder

MOVING = ("revolute", "continuous", "prismatic")


class Reading(NamedTuple):
    """What became of a file.

    Attributes:
        file: below the folder of the robots.
        joints: how many of the file move.
        leg: what was loaded; None if the file was refused.
        reason: of a refusal, without the name of the file.
    """

    file: str
    joints: int
    leg: kd.Leg | None
    reason: str


def readings() -> Iterator[Reading]:
    """Yield what becomes of each file whose joints move, by its name.

    The contact frame is the link behind the last of them.
    """
    root = robots_folder()
    for path in sorted(root.rglob("*.urdf")):
        joints = ElementTree.parse(path).getroot().findall("joint")
        moved = [joint.find("child") for joint in joints if joint.get("type") in MOVING]
        if not moved or moved[-1] is None:
            continue
        leg, reason = None, ""
        try:
            leg = kd.Leg.from_urdf(path, moved[-1].get("link", ""))
        except kd.UrdfError as error:
            reason = "; ".join(error.faults)
        yield Reading(path.relative_to(root).as_posix(), len(moved), leg, reason)


def summary(found: list[Reading]) -> str:
    """Return how many files load."""
    return f"{sum(reading.leg is not None for reading in found)} of {len(found)} files load"


def refused_table(found: list[Reading]) -> str:
    """Return the files that do not load, with the beginning of the reason, in Markdown."""
    refused = [reading for reading in found if reading.leg is None]
    lines = [f"| {file} | {reason.partition(': ')[0]} |" for file, _, _, reason in refused]
    return "\n".join(["| file | reason |", "|---|---|", *lines])


def whole_table(found: list[Reading]) -> str:
    """Return all files, in Markdown."""
    lines = ["| file | moving joints | mimic joints | loads | reason |", "|---|---:|---:|---|---|"]
    for file, joints, leg, reason in found:
        mimics = len(leg.mimics) if leg else ""
        short = reason.partition(": ")[0]
        lines.append(f"| {file} | {joints} | {mimics} | {'yes' if leg else 'no'} | {short} |")
    return "\n".join(lines)


if __name__ == "__main__":
    found = list(readings())
    print(summary(found))
    print(whole_table(found) if sys.argv[1:] == ["--all"] else refused_table(found))
