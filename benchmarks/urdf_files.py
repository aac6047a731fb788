"""Read every URDF file of example-robot-data that has moving joints: which load, and why not.

    python benchmarks/urdf_files.py [--all | --packages]

Prints how many load, and the table of docs/explanation/robots.md of those that do not; with --all,
a table of all files; with --packages, the table of docs/explanation/robots.md of the URDF and MJCF
files of all packages of PACKAGES that are installed.
"""

import sys
from collections import Counter
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution
from typing import NamedTuple
from xml.etree import ElementTree

import kickdyn as kd
from kickdyn.robot.catalog import robots_folder
from kickdyn.robot.mjcf_file import quiet_mujoco

MOVING = ("revolute", "continuous", "prismatic")

PACKAGES = {
    "example-robot-data": "URDF", "jvrc-description": "URDF", "gymnasium": "MJCF",
    "dm-control": "MJCF",
}  # fmt: skip
"""Packages of PyPI with robots, and the format of their files."""


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


def packages_table() -> str:
    """Return how many files of each installed package load, and why others do not, in Markdown."""
    lines = ["| package | format | files | load | others |", "|---|---|---:|---:|---|"]
    for package, kind in PACKAGES.items():
        try:
            installed = distribution(package)
        except PackageNotFoundError:
            continue
        ending = ".urdf" if kind == "URDF" else ".xml"
        paths = [str(file.locate()) for file in installed.files or () if file.suffix == ending]
        if package == "example-robot-data":
            paths = [str(path) for path in robots_folder().rglob("*.urdf")]
        reasons = [reason for path in sorted(paths) if (reason := load(path)) is not None]
        refused = Counter(reason for reason in reasons if reason)
        others = "; ".join(f"{count} {reason}" for reason, count in refused.most_common())
        loaded = len(reasons) - refused.total()
        version = f"{package} {installed.version}"
        lines.append(f"| {version} | {kind} | {len(reasons)} | {loaded} | {others} |")
    return "\n".join(lines)


def load(path: str) -> str | None:
    """Return why a file is refused, empty if it loads; None for a file without moving joints.

    MJCF files that MuJoCo itself does not read from their folder are not counted.
    """
    if path.endswith(".urdf"):
        joints = ElementTree.parse(path).getroot().findall("joint")
        ends = [j.find("child") for j in joints if j.get("type") in MOVING]
        frame = "" if not ends or ends[-1] is None else ends[-1].get("link", "")
        read = kd.Leg.from_urdf
    else:
        frame, read = _last_body(path), kd.Leg.from_mjcf
    if not frame:
        return None
    try:
        read(path, frame)
    except kd.InvalidInput as error:
        return error.faults[0].partition(":")[0].partition(" (mass")[0].partition(" (princ")[0]
    return ""


def _last_body(path: str) -> str:
    """Return the body that the last hinge or slide of an MJCF file moves; empty without one."""
    import mujoco

    try:
        with quiet_mujoco():
            model = mujoco.MjModel.from_xml_path(path)
    except ValueError:
        return ""
    bodies = model.jnt_bodyid[model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE)]
    return str(model.body(int(bodies[-1])).name) if bodies.size else ""


if __name__ == "__main__":
    if sys.argv[1:] == ["--packages"]:
        print(packages_table())
        sys.exit()
    found = list(readings())
    print(summary(found))
    print(whole_table(found) if sys.argv[1:] == ["--all"] else refused_table(found))
