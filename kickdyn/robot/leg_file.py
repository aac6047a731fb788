"""A leg from a robot's file or name, with joints locked at values in degrees."""

from collections.abc import Mapping, Sequence
from math import radians
from os import PathLike
from xml.etree import ElementTree

from kickdyn.errors import InvalidInput
from kickdyn.robot.catalog import ROBOTS, robot_file
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import is_mjcf
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
        angles = _in_radians(locked, read_document(path)) if locked else None
        return Leg.from_urdf(path, frame, base=base, package_dirs=package_dirs, locked=angles)
    if package_dirs:
        raise InvalidInput(
            f"package-dir is {str(package_dirs[0])!r}: it is for a URDF file, an MJCF names its "
            "meshes from its own folder"
        )
    return _locked(Leg.from_mjcf(path, frame, base=base), locked)


def read_robot(
    name: str,
    frame: str | None,
    base: str,
    *,
    legs_only: bool = False,
    locked: Mapping[str, float] | None = None,
) -> Leg:
    """Return a robot as `Leg.from_robot` does, its joints locked as by `read_leg`."""
    if name not in ROBOTS:
        return _locked(Leg.from_robot(name, frame, base=base, legs_only=legs_only), locked)
    angles = _in_radians(locked, robot_file(name)) if locked else None
    return Leg.from_robot(name, frame, base=base, legs_only=legs_only, locked=angles)


def _locked(leg: Leg, values: Mapping[str, float] | None) -> Leg:
    """Return a leg with joints locked at their values [deg; m for prismatic joints]."""
    if not values:
        return leg
    return leg.locked(
        {
            joint: value if leg.joint_unit(joint) == "m" else radians(value)
            for joint, value in values.items()
        }
    )


def _in_radians(values: Mapping[str, float], urdf: UrdfFile) -> dict[str, float]:
    """Return values of a URDF's joints [rad; m] from those in degrees, of prismatic ones in m."""
    joints = ElementTree.fromstring(urdf.text).iter("joint")
    slides = {joint.get("name") for joint in joints if joint.get("type") == "prismatic"}
    return {name: x if name in slides else radians(x) for name, x in values.items()}
