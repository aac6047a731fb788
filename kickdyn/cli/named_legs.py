"""Legs by the names that command lines have for them."""

import os
from collections.abc import Sequence
from pathlib import Path

import click

from kickdyn.errors import InvalidInput, UrdfError
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.kicking_chain import kicking_chain
from kickdyn.robot.leg import Leg
from kickdyn.robot.urdf_file import shipped_urdf

SHIPPED = {"human": "leg_human.urdf", "testbed": "leg_testbed.urdf"}

LEGS = tuple(dict.fromkeys([*SHIPPED, *ROBOTS]))
"""Names of legs: ours first, which hide a robot of the same name."""


package_dir_option = click.option(
    "--package-dir", "package_dirs", multiple=True, metavar="DIR",
    type=click.Path(exists=True, file_okay=False),
    help="ROS package of a URDF file's meshes, or a folder that contains it; repeatable.",
)  # fmt: skip


def load_leg(name: str, frame: str | None = None, package_dirs: Sequence[str] = ()) -> Leg:
    """Return a leg by one of the names `LEGS` (a robot's kicking leg), or that of a URDF file.

    The contact frame is by default a robot's toe, or the frame `toe` of a file; a file's meshes may
    be in the folders `package_dirs`. Raises `InvalidInput`, or `UrdfError` if the file is refused.
    """
    if package_dirs and name in LEGS:
        raise InvalidInput(f"package-dir is {package_dirs[0]!r}: it is for a URDF file, not {name}")
    if name in SHIPPED:
        return Leg.from_urdf(shipped_urdf(SHIPPED[name]), frame or "toe")
    if name in ROBOTS:
        return kicking_chain(Leg.from_robot(name, frame, legs_only=True)).leg
    if not os.path.exists(name) and not Path(name).suffix:  # noqa: PTH110 any text may be a name
        raise InvalidInput(f"leg {name!r} is neither {', '.join(LEGS)} nor a file")
    try:
        return Leg.from_urdf(name, frame or "toe", package_dirs=package_dirs)
    except UrdfError:
        raise
    except InvalidInput as error:  # what else can be wrong is the frame
        fault = str(error) if frame else f"no --frame is named, and {error}"
        raise InvalidInput(fault) from None
