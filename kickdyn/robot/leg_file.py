"""A leg from a URDF or MJCF file, with joints locked at values in degrees."""

from collections.abc import Mapping, Sequence
from os import PathLike

from kickdyn.errors import InvalidInput
from kickdyn.robot.joint_table import InDegrees
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import is_mjcf


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
    values = InDegrees(locked or {})
    if not is_mjcf(path):
        return Leg.from_urdf(path, frame, base=base, package_dirs=package_dirs, locked=values)
    if package_dirs:
        raise InvalidInput(
            f"package-dir is {str(package_dirs[0])!r}: it is for a URDF file, an MJCF names its "
            "meshes from its own folder"
        )
    return Leg.from_mjcf(path, frame, base=base, locked=values)
