"""A leg from a robot's file or name, with joints locked at values in degrees."""

from collections.abc import Mapping, Sequence, Set
from math import radians
from os import PathLike
from xml.etree import ElementTree

from kickdyn.errors import InvalidInput
from kickdyn.robot.catalog import ROBOTS, robot_file
from kickdyn.robot.descriptions import find_description
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import is_mjcf, read_mjcf
from kickdyn.robot.mjcf_model import sliding_joints
from kickdyn.robot.names import expand_patterns
from kickdyn.robot.urdf_file import UrdfFile, read_document


def read_leg(
    path: str | PathLike[str],
    frame: str,
    base: str,
    package_dirs: Sequence[str | PathLike[str]] = (),
    locked: Mapping[str, float] | None = None,
) -> Leg:
    """Return the leg of a URDF or MJCF file, which its root element tells apart.

    Joints are `locked` at their values [deg; m for prismatic joints]. Raises `InvalidInput` as
    `Leg.from_urdf` and `Leg.from_mjcf` do, and for `package_dirs` of an MJCF.
    """
    if not is_mjcf(path):
        angles = _in_radians(locked, _prismatic(read_document(path))) if locked else None
        return Leg.from_urdf(path, frame, base=base, package_dirs=package_dirs, locked=angles)
    if package_dirs:
        raise InvalidInput(
            f"package-dir is {str(package_dirs[0])!r}: it is for a URDF file, an MJCF names its "
            "meshes from its own folder"
        )
    angles = _in_radians(locked, sliding_joints(read_mjcf(path))) if locked else None
    return Leg.from_mjcf(path, frame, base=base, locked=angles)


def read_robot(
    name: str,
    frame: str | None,
    base: str,
    *,
    legs_only: bool = False,
    locked: Mapping[str, float] | None = None,
) -> Leg:
    """Return a robot as `Leg.from_robot` does, its joints locked as by `read_leg`."""
    angles = None
    if locked and name in ROBOTS:
        angles = _in_radians(locked, _prismatic(robot_file(name)))
    elif locked and not legs_only:  # which is refused for these robots
        found = find_description(name, list(ROBOTS))
        if found.is_mjcf:
            slides = sliding_joints(read_mjcf(found.file, found.folders))
        else:
            slides = _prismatic(read_document(found.file))
        angles = _in_radians(locked, slides)
    return Leg.from_robot(name, frame, base=base, legs_only=legs_only, locked=angles)


def _prismatic(urdf: UrdfFile) -> set[str]:
    """Return the names of a URDF's prismatic joints."""
    joints = ElementTree.fromstring(urdf.text).iter("joint")
    return {joint.get("name", "") for joint in joints if joint.get("type") == "prismatic"}


def _in_radians(values: Mapping[str, float], slides: Set[str]) -> dict[str, float]:
    """Return values of joints [rad; m] from those in degrees, of the joints `slides` in m.

    What a pattern matches of `slides` is named beside the pattern, with its value in m.
    """
    metres = expand_patterns(values, sorted(slides))
    return {name: radians(x) for name, x in values.items() if name not in slides} | metres
