"""Legs by the names that command lines have for them."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.descriptions import DESCRIPTION
from kickdyn.robot.kicking_chain import kicking_chain
from kickdyn.robot.leg import Leg
from kickdyn.robot.leg_file import read_leg, read_robot
from kickdyn.robot.urdf_file import shipped_urdf

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
        return read_leg(shipped_urdf(SHIPPED[name]), frame or "toe", base, locked=locked)
    if name in ROBOTS:
        robot = read_robot(name, frame, base, legs_only=True, locked=locked)
        return robot if base == "floating" else kicking_chain(robot).leg
    if described and not os.path.exists(name):  # noqa: PTH110
        return read_robot(name, frame, base, locked=locked)
    if not os.path.exists(name) and not Path(name).suffix:  # noqa: PTH110 any text may be a name
        raise InvalidInput(f"leg {name!r} is neither {', '.join(LEGS)} nor a file")
    try:
        return read_leg(name, frame or "toe", base, package_dirs, locked)
    except FaultyFile:
        raise
    except InvalidInput as error:
        if frame or not str(error).startswith("frame "):
            raise
        raise InvalidInput(f"no --frame is named, and {error}") from None
