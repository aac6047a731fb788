"""Robots by name, of example-robot-data, with their feet, and of robot_descriptions."""

import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core.files import read_toml, shipped
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.names import listed
from kickdyn.robot.surgery import reduce_model, turn_body
from kickdyn.robot.urdf_file import UrdfFile, build_model, check_base, read_urdf

PACKAGE = "example-robot-data"

DESCRIPTION = "_description"
"""How the names of robots of the package robot_descriptions end."""

INSTALL = 'pip install "kickdyn[descriptions]"'

TOE = "toe"

SURFACES = {
    TOE: (0.0, 0.0, 60.0),
    "instep": (0.0, 60.0, 80.0),
    "sole_edge": (0.0, -90.0, 0.0),
    "inside": (90.0, 0.0, 15.0),
    "outside": (-90.0, 0.0, 15.0),
    "heel": (180.0, 0.0, 15.0),
}
"""Surfaces of the right foot, frames whose x is forward and z up, and the normals with which each
can meet a ball: their direction to the left of x, and the range of their rise [deg]."""

SIDE = np.radians(15.0)
"""How far normals are to either side of the direction of a surface [rad]."""


@dataclass(frozen=True)
class Robot:
    """A robot's file, and the meaning of its names.

    Attributes:
        file: its URDF, below the package's folder of robots.
        foot, stance: frames of the right and of the left foot.
        legs: how the names of the legs' joints begin.
        contact_points: of the `SURFACES` that the right foot has, from the origin of `foot` [m,
            world axes, straight leg]: there a ball of size 5 overlaps least with the visual mesh.
            No instep where a motor fills that place, no edge of the sole where it is bevelled or
            round.
        steepest: of the toe's normals [deg], above which the ball would reach into instep or shank.
        aside: joints of the arms that are not at 0 where only the legs move [rad].
        turn_deg: roll, pitch and yaw that bring its base's axes to x forward, z up.
    """

    file: str
    foot: str
    stance: str
    legs: Sequence[str]
    contact_points: Mapping[str, Sequence[float]] = field(default_factory=dict)
    steepest: float = SURFACES[TOE][2]
    aside: Mapping[str, float] = field(default_factory=dict)
    turn_deg: Sequence[float] = (0.0, 0.0, 0.0)

    def contact(self, frame: str | None) -> tuple[str, Array | None]:
        """Return the contact frame, the toe if None is named, and its `contact_normal_cone`."""
        if frame is None:
            frame = TOE if TOE in self.contact_points else self.foot
        if frame not in self.contact_points:
            return frame, None
        direction, low, high = SURFACES[frame]
        high = self.steepest if frame == TOE else high
        return frame, normal_cone(*np.radians([direction, low, high]))


def normal_cone(direction: float, low: float, high: float) -> Array:
    """Return rows a of the cone of normals n, a n >= 0, that meet a ball, shape `(4, 3)`.

    Normals are up to `SIDE` to either side of a direction, and rise from `low` to `high` [rad].
    """
    rows = np.array([
        (np.sin(SIDE), np.cos(SIDE), 0.0),
        (np.sin(SIDE), -np.cos(SIDE), 0.0),
        (-np.sin(low), 0.0, np.cos(low)),
        (np.sin(high), 0.0, -np.cos(high)),
    ])  # fmt: skip
    return np.asarray(rows @ pin.rpy.rpyToMatrix(0.0, 0.0, direction).T)


ROBOTS = {
    name: Robot(**robot)
    for name, robot in read_toml(shipped("robots") / "example_robot_data.toml").items()
}
"""Every robot of the package that `Leg.from_robot` reads."""


def read_robot(name: str, base: str) -> tuple[UrdfFile, Any]:
    """Return the URDF of a robot and its `pin.Model`, its base turned to x forward, z up."""
    check_base(base)
    entry = ROBOTS[name]
    file = read_urdf(robots_folder() / entry.file)
    model = build_model(file.text, file.source, "floating")
    model.name = name
    model = turn_body(model, 1, pin.rpy.rpyToMatrix(*np.radians(entry.turn_deg)))
    if base == "fixed":
        model = reduce_model(model, [model.names[1]], pin.neutral(model))
    add_contact_points(model, entry.foot, entry.contact_points)
    return file, model


def add_contact_points(model: Any, frame: str, points: Mapping[str, ArrayLike]) -> None:
    """Add frames at points of a foot [m], from a frame, in axes of the world for a straight leg."""
    number = frame_id(model, frame)
    foot = model.frames[number]
    joint, pose = foot.parentJoint, foot.placement.copy()  # a reference dies with the next frame
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    back = pin.updateFramePlacement(model, data, number).rotation.T
    for name, point in points.items():
        place = pose * pin.SE3(back, back @ np.array(point))
        model.addFrame(pin.Frame(name, joint, number, place, pin.FrameType.OP_FRAME), False)


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
        f"(there are {listed([*ROBOTS])})"
    )


def find_description(name: str) -> tuple[Path, tuple[Path, ...]]:
    """Return the file of a robot of robot_descriptions, downloaded at first, and mesh folders."""
    try:
        available = import_module("robot_descriptions").DESCRIPTIONS
    except ImportError:
        available = {}
    if name not in available:
        matches = get_close_matches(str(name)[:200], [*ROBOTS, *available], 1)
        hint = f"did you mean {matches[0]!r}? " if matches else ""
        more = "a name of robot_descriptions" if available else f"install more with {INSTALL}"
        raise InvalidInput(
            f"robot {name!r} is unknown: {hint}choose {', '.join(ROBOTS)}, or {more}"
        )
    reason = None
    try:
        with redirect_stdout(sys.stderr):  # it prints what it downloads
            module = import_module(f"robot_descriptions.{name}")
    except Exception as error:  # of git, of files, of a network
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        # git's own line before that of its wrapper
        fatal = [line.partition("fatal: ")[2].rstrip("'") for line in lines if "fatal: " in line]
        reason = (fatal or lines or [type(error).__name__])[0][:200]
    if reason is not None:  # not raised above: the line of its progress ends with the exception
        raise InvalidInput(
            f"robot {name!r} is not on this machine, and cannot be downloaded ({reason}): "
            "the download needs git and, once, the network; or set ROBOT_DESCRIPTIONS_CACHE to a "
            "folder that has it"
        )
    path = getattr(module, "URDF_PATH", None) or getattr(module, "MJCF_PATH", None)
    if path is None:
        raise InvalidInput(
            f"robot {name!r} has neither a URDF nor an MJCF file: make a URDF file of its xacro "
            "file, and read it with Leg.from_urdf"
        )
    package, repository = Path(module.PACKAGE_PATH), Path(module.REPOSITORY_PATH)
    return Path(path), (package, repository, package.parent)
