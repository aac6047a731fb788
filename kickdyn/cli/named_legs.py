"""Legs by the names that command lines have for them."""

import math
import os
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.robot.catalog import ROBOTS, robot_file
from kickdyn.robot.descriptions import DESCRIPTION
from kickdyn.robot.kicking_chain import kicking_chain
from kickdyn.robot.leg import Leg
from kickdyn.robot.leg_file import read_leg
from kickdyn.robot.mjcf_file import is_mjcf
from kickdyn.robot.urdf_file import read_document, shipped_urdf
from kickdyn.robot.visuals import RobotFile

SHIPPED = {"human": "leg_human.urdf", "testbed": "leg_testbed.urdf"}

LEGS = tuple(dict.fromkeys([*SHIPPED, *ROBOTS]))
"""Names of legs: ours first, which hide a robot of the same name."""


def load_leg(
    name: str,
    frame: str | None = None,
    base: str = "fixed",
    package_dirs: Sequence[str] = (),
    locked: Mapping[str, float] | None = None,
) -> Leg:
    """Return a leg by one of the names `LEGS` or of robot_descriptions, or of a URDF or MJCF file.

    On a `fixed` base, a robot is its kicking leg; on a `floating` one, both legs and the base. The
    contact frame is by default a robot's toe, or the frame `toe` of a file; a file's meshes may be
    in the folders `package_dirs`; `locked` has values of joints that do not move [deg; m for
    prismatic joints]. Raises `InvalidInput`, or `FaultyFile` if the file is refused.
    """
    described = name.endswith(DESCRIPTION)
    if package_dirs and (name in LEGS or described):
        raise InvalidInput(f"package-dir is {package_dirs[0]!r}: it is for a URDF file, not {name}")
    if name in SHIPPED:
        path = shipped_urdf(SHIPPED[name])
        angles = _in_radians(locked, _slides(read_document(path))) if locked else None
        return Leg.from_urdf(path, frame or "toe", base=base, locked=angles)
    if name in ROBOTS:
        angles = _in_radians(locked, _slides(robot_file(name))) if locked else None
        robot = Leg.from_robot(name, frame, base=base, legs_only=True, locked=angles)
        return robot if base == "floating" else kicking_chain(robot).leg
    if described and not os.path.exists(name):  # noqa: PTH110
        return _locked(Leg.from_robot(name, frame, base=base), locked)
    if not os.path.exists(name) and not Path(name).suffix:  # noqa: PTH110 any text may be a name
        raise InvalidInput(f"leg {name!r} is neither {', '.join(LEGS)} nor a file")
    try:
        if not locked:
            return read_leg(name, frame or "toe", base, package_dirs)
        if is_mjcf(name):
            return _locked(read_leg(name, frame or "toe", base, package_dirs), locked)
        angles = _in_radians(locked, _slides(read_document(name)))
        return Leg.from_urdf(
            name, frame or "toe", base=base, package_dirs=package_dirs, locked=angles
        )
    except FaultyFile:
        raise
    except InvalidInput as error:  # what else can be wrong is the frame
        fault = str(error) if frame else f"no --frame is named, and {error}"
        raise InvalidInput(fault) from None


def _locked(leg: Leg, values: Mapping[str, float] | None) -> Leg:
    """Return a leg with joints locked at their values [deg; m for prismatic joints]."""
    if not values:
        return leg
    slides = {joint for joint in values if leg.joint_unit(joint) == "m"}
    return leg.locked(_in_radians(values, slides))


def _slides(urdf: RobotFile) -> set[str]:
    """Return the names of a URDF's prismatic joints."""
    joints = ElementTree.fromstring(urdf.text).iter("joint")
    return {joint.get("name", "") for joint in joints if joint.get("type") == "prismatic"}


def _in_radians(values: Mapping[str, float], slides: Container[str]) -> dict[str, float]:
    """Return values of joints [rad; m] from those in degrees, of joints that slide in m."""
    return {
        name: value if name in slides else math.radians(value) for name, value in values.items()
    }
