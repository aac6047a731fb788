"""Legs by the names that command lines have for them."""

import os
from collections.abc import Sequence
from pathlib import Path

from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.kicking_chain import kicking_chain
from kickdyn.robot.leg import Leg
from kickdyn.robot.leg_file import read_leg
from kickdyn.robot.urdf_file import shipped_urdf

SHIPPED = {"human": "leg_human.urdf", "testbed": "leg_testbed.urdf"}

LEGS = tuple(dict.fromkeys([*SHIPPED, *ROBOTS]))
"""Names of legs: ours first, which hide a robot of the same name."""


def load_leg(
    name: str, frame: str | None = None, base: str = "fixed", package_dirs: Sequence[str] = ()
) -> Leg:
    """Return a leg by one of the names `LEGS`, or that of a URDF or MJCF file.

    On a `fixed` base, a robot is its kicking leg; on a `floating` one, both legs and the base. The
    contact frame is by default a robot's toe, or the frame `toe` of a file; a file's meshes may be
    in the folders `package_dirs`. Raises `InvalidInput`, or `FaultyFile` if the file is refused.
    """
    if package_dirs and name in LEGS:
        raise InvalidInput(f"package-dir is {package_dirs[0]!r}: it is for a URDF file, not {name}")
    if name in SHIPPED:
        return Leg.from_urdf(shipped_urdf(SHIPPED[name]), frame or "toe", base=base)
    if name in ROBOTS:
        robot = Leg.from_robot(name, frame, base=base, legs_only=True)
        return robot if base == "floating" else kicking_chain(robot).leg
    if not os.path.exists(name) and not Path(name).suffix:  # noqa: PTH110 any text may be a name
        raise InvalidInput(f"leg {name!r} is neither {', '.join(LEGS)} nor a file")
    try:
        return read_leg(name, frame or "toe", base, package_dirs)
    except FaultyFile:
        raise
    except InvalidInput as error:  # what else can be wrong is the frame
        fault = str(error) if frame else f"no --frame is named, and {error}"
        raise InvalidInput(fault) from None
