"""The robots of the package example-robot-data, by name."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn import checks
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.sound_model import listed
from kickdyn.urdf_file import UrdfFile, read_document
from kickdyn.urdf_model import BASES, build_model, reduced_model

PACKAGE = "example-robot-data"


@dataclass(frozen=True)
class Robot:
    """Where a robot's file is, and what its names mean.

    Attributes:
        file: its URDF, below the package's folder of robots.
        foot: the right foot's frame, with which it kicks unless told otherwise.
        stance: the left foot's.
        legs: how the names of the legs' joints begin.
        turn: roll, pitch and yaw [rad] that bring its base's axes to x forward, z up.
    """

    file: str
    foot: str
    stance: str
    legs: tuple[str, ...]
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)


_WORDS = tuple(f"{side}_{part}_" for side in ("left", "right") for part in ("hip", "knee", "ankle"))
_ICUB = tuple(f"{side}_{part}" for side in "lr" for part in ("hip", "knee", "ankle"))
_ROMEO = tuple(f"{side}{part}" for side in "LR" for part in ("Hip", "Knee", "Ankle"))
_BACKWARDS = (0.0, 0.0, np.pi)  # iCub looks along -x

ROBOTS = {
    "g1": Robot(
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        *("right_ankle_roll_link", "left_ankle_roll_link", _WORDS),
    ),
    "talos": Robot(
        "talos_data/robots/talos_reduced.urdf", "right_sole_link", "left_sole_link", ("leg_",)
    ),
    "icub": Robot(
        "icub_description/robots/icub.urdf", *("r_sole", "l_sole", _ICUB), turn=_BACKWARDS
    ),
    "icub_reduced": Robot(
        "icub_description/robots/icub_reduced.urdf", *("r_sole", "l_sole", _ICUB), turn=_BACKWARDS
    ),
    "romeo": Robot("romeo_description/urdf/romeo.urdf", "r_sole", "l_sole", _ROMEO),
    "human": Robot(
        "human_description/robots/human.urdf",
        *("right_foot", "left_foot", _WORDS),
        turn=(np.pi / 2, 0.0, 0.0),  # its y axis points up
    ),
    "simple_humanoid": Robot(
        "simple_humanoid_description/urdf/simple_humanoid.urdf",
        *("r_ankle", "l_ankle", ("LLEG_", "RLEG_")),
    ),
    "bolt": Robot("bolt_description/robots/bolt.urdf", "FR_FOOT", "FL_FOOT", ("FL_", "FR_")),
}
"""Every robot that `Leg.from_robot` knows."""


def robot(name: str) -> Robot:
    """Return a robot by name; raise `InvalidInput` with those there are."""
    if not isinstance(name, str) or name not in ROBOTS:
        raise InvalidInput(f"robot {name!r} is unknown: choose {', '.join(ROBOTS)}")
    return ROBOTS[name]


def robot_model(name: str, base: str, *, legs_only: bool) -> Any:
    """Return the `pin.Model` of a robot, its base turned to x forward, z up.

    The files are published ones and read as they are: mass at a point, or none on the virtual
    links between joints in a row, is no fault there; `check_model` judges what moves together.

    Args:
        name: of the robot.
        base: `fixed` or `floating`.
        legs_only: lock every joint outside the legs at its zero.

    Raises:
        InvalidInput: unknown robot or base, no flag, or the package is not installed.
    """
    checks.flag("legs_only", legs_only)
    if base not in BASES:
        raise InvalidInput(f"base is {base!r}: it must be {' or '.join(BASES)}")
    known, file = robot(name), robot_file(name)
    model = build_model(file.text, file.source, "floating")
    model.name = name
    _turn_base(model, pin.rpy.rpyToMatrix(*known.turn))
    names = list(model.names)
    locked = names[1:2] if base == "fixed" else []
    if legs_only:
        locked += [name for name in names[2:] if not name.startswith(known.legs)]
    return reduced_model(model, locked, pin.neutral(model)) if locked else model


def robot_file(name: str) -> UrdfFile:
    """Return a robot's URDF; its meshes are looked up in the robot's own folder.

    Raises:
        InvalidInput: unknown robot, or the package is not installed.
    """
    known = robot(name)
    path = robots_folder() / known.file
    read = read_document(path)
    own = robots_folder() / Path(known.file).parts[0]
    return UrdfFile(read.text.replace(f"package://{PACKAGE}/robots/", "package://"), own, str(path))


def robots_folder() -> Path:
    """Return the folder of the package's robots; raise `InvalidInput` if it is not installed."""
    try:
        files = metadata.files(PACKAGE) or []
    except metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.as_posix().endswith("share/example-robot-data/package.xml"):
            return Path(str(file.locate())).resolve().parent / "robots"
    raise InvalidInput(
        f'robots need the package {PACKAGE}: install it with pip install "kickdyn[robots]" '
        f"(there are {listed(list(ROBOTS))})"
    )


def _turn_base(model: Any, turn: Array) -> None:
    """Turn all that hangs on the floating base, so that its pose stays one in our world's axes."""
    to_ours = pin.SE3(turn, np.zeros(3))
    model.inertias[1] = to_ours.act(model.inertias[1])
    for joint in range(2, model.njoints):
        if model.parents[joint] == 1:
            model.jointPlacements[joint] = to_ours * model.jointPlacements[joint]
    for frame in model.frames:
        if frame.parentJoint == 1 and frame.type != pin.FrameType.JOINT:
            frame.placement = to_ours * frame.placement
