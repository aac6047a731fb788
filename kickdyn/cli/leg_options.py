"""The options of command lines that describe the leg: its name or file, locked joints, supports."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from kickdyn.cli.commands import warn
from kickdyn.cli.option_groups import Vector, option
from kickdyn.core import validation
from kickdyn.core.files import read_toml
from kickdyn.errors import InvalidInput
from kickdyn.robot.catalog import DESCRIPTION, ROBOTS
from kickdyn.robot.constraints import Support, read_support
from kickdyn.robot.foot_surfaces import load_with_surface
from kickdyn.robot.joint_table import InDegrees
from kickdyn.robot.leg import Leg, read_leg
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.standing import kicking_chain
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
    drives: str | bool = True,
    facing: str = "x",
    *,
    legs_only: bool = True,
) -> Leg:
    """Return a leg by one of the names `LEGS` or of robot_descriptions, or of a URDF or MJCF file.

    On a `fixed` base, a robot is its kicking leg; on a `floating` one, both legs and the base.
    The contact frame is by default `toe`. Values of `locked` joints are in degrees or metres;
    all else is as for `Leg.from_robot` and `Leg.from_urdf`.
    """
    degrees = InDegrees(locked or {})
    if name.startswith("human:"):
        leg = Leg.human(**_read_size(name), frame=frame or "toe", base=base).locked(degrees)
        return leg if isinstance(drives, bool) else leg.with_drives(drives)
    known, described = name in LEGS, name.endswith(DESCRIPTION)
    if facing != "x" and known:
        raise InvalidInput(f"facing is {facing!r}: it is for a file, and {name} faces x already")
    if package_dirs and (known or described):
        raise InvalidInput(f"package-dir is {package_dirs[0]!r}: it is for a file, not {name}")
    how: Any = {"base": base, "drives": drives}
    if name in ROBOTS and name not in SHIPPED:
        robot = Leg.from_robot(name, frame, legs_only=legs_only, locked=degrees, **how)
        return robot if base == "floating" or not legs_only else kicking_chain(robot).leg
    file = shipped_urdf(SHIPPED[name]) if name in SHIPPED else Path(name)
    if not os.path.exists(file):  # noqa: PTH110 any text may be a name
        if described:
            return Leg.from_robot(name, frame, locked=degrees, facing=facing, **how)
        if not file.suffix:
            raise InvalidInput(f"leg {name!r} is neither {', '.join(LEGS)} nor a file")
    return read_leg(file, frame, package_dirs=package_dirs, locked=locked, facing=facing, **how)


def _read_size(name: str) -> dict[str, Any]:
    """Return the arguments of `Leg.human` in a text such as human:height=1.65,mass=58,side=left."""
    size: dict[str, Any] = {}
    for setting in name.removeprefix("human:").split(","):
        key, _equals, value = setting.partition("=")
        try:
            if key not in ("height", "mass", "sex", "side", "model", "segments") or key in size:
                raise ValueError
            size[key] = float(value) if key in ("height", "mass") else value
        except ValueError:
            raise InvalidInput(
                f"--leg is {name!r}: {setting!r} must be height=METRES, mass=KG, sex=female|male, "
                "side=left|right, model=paper|3d or segments=Dumas, once each"
            ) from None
    return size


@dataclass(frozen=True)
class LegOptions:
    """A leg, and how it is supported."""

    leg_name: str = option(
        "--leg", default="human", metavar="human|testbed|FILE|ROBOT", type=click.Path(), help="A "
        "leg of kickdyn, a URDF or MJCF file, or the leg of a robot of the extra kickdyn[robots] "
        "on a fixed base (g1, talos, ...). human:height=1.65,mass=58,sex=female,side=left,model=3d "
        "is the leg of a person of this size.",
    )  # fmt: skip
    frame: str | None = option(
        "--frame", metavar="NAME[:SURFACE]", help="Link or joint whose origin strikes the ball, or "
        "with a surface of this foot: toe, instep, inside, outside, heel, sole_edge, or "
        "X,Y,Z:NX,NY,NZ [m], its point and normal.  [default: toe; for a robot, its right foot]",
    )  # fmt: skip
    locked: tuple[str, ...] = option(
        "--lock", multiple=True, metavar="JOINT=VALUE",
        help="Lock a joint at a value [deg; m for prismatic joints], or all joints that a pattern "
        "matches, such as 'LFinger*=0'; repeatable.",
    )  # fmt: skip
    loops: tuple[str, ...] = option(
        "--loop", multiple=True, metavar="A:B", help="Close a kinematic loop, which a URDF file "
        "cannot have, by a ball joint between the origins of two frames; repeatable.",
    )  # fmt: skip
    supports: tuple[str, ...] = option(
        "--support", multiple=True, metavar="FRAME[:FRICTION[:CORNERS]]",
        help="Foot that stands on the ground, its coefficient of friction there, and the corners "
        "of its sole, X,Y,Z/X,Y,Z/... [m, its axes], or a .toml file with all three. The base then "
        "floats, and a robot has both legs; repeatable.",
    )  # fmt: skip
    stiff_joints: tuple[str, ...] = option(
        "--stiff", multiple=True, metavar="JOINT", help="Joint whose velocity the impact does not "
        "change, as with a high gear ratio; repeatable.",
    )  # fmt: skip
    drives: str | None = option(
        "--drives", metavar="FILE|none", type=click.Path(), help="TOML file with the rotor "
        "inertias and limits of joints' drives; none for no rotors.  [default: the robot's own]",
    )  # fmt: skip
    base_velocity: Vector = option(
        "--base-velocity",
        help="Velocity of the fixed base, such as a hip in a run-up, at the world's origin [m/s].",
    )  # fmt: skip
    base_angular_velocity: Vector = option(
        "--base-angular-velocity", help="Angular velocity of the fixed base [rad/s]."
    )
    package_dirs: tuple[str, ...] = option(
        "--package-dir", multiple=True, metavar="DIR",
        type=click.Path(exists=True, file_okay=False),
        help="ROS package with meshes of a file, or a folder that contains it; repeatable.",
    )  # fmt: skip
    facing: str = option(
        "--facing", default="x", type=click.Choice(["x", "y", "-x", "-y"]),
        help="Axis along which the robot of a file faces; its base is turned to face x.",
    )  # fmt: skip

    def load(self, *, whole: bool = False, base: str | None = None) -> Leg:
        """Return the leg, on a floating base if it stands on a support; write its warnings.

        A `whole` robot has all its joints and a floating base; `base` replaces the usual
        one.
        """
        supports, loops, locked = self._read_supports(), list[tuple[str, str]](), dict[str, float]()
        for text in self.locked:
            name, _equals, value = text.rpartition("=")
            try:
                if not name or name in locked:
                    raise ValueError
                locked[name] = validation.number(name, float(value))
            except ValueError:
                once = ", once for each joint" if name in locked else " [deg; m]"
                raise InvalidInput(f"--lock is {text!r}: it must be JOINT=VALUE{once}") from None
        for text in self.loops:
            first, _colon, second = text.partition(":")
            if not (first and second):
                raise InvalidInput(f"--loop is {text!r}: it must be two frames, A:B")
            loops.append((first, second))
        is_robot = self.leg_name not in SHIPPED and not self.leg_name.startswith("human:")
        base = base or ("floating" if supports or (whole and is_robot) else "fixed")
        read = partial(load_leg, self.leg_name, package_dirs=self.package_dirs, locked=locked)
        how: Any = {"base": base, "facing": self.facing, "legs_only": not whole}
        how["drives"] = self.drives != "none" and (self.drives or True)
        try:
            leg = load_with_surface(self.frame, partial(read, **how))
        except InvalidInput:
            if supports:  # a support that the leg has not explains more than a floating base
                fixed = load_with_surface(self.frame, read)
                for support in supports:
                    frame_id(fixed.model, support.frame)
            raise
        leg = leg.with_supports(*supports).with_loops(*leg.loops, *loops)
        leg = leg.with_stiff_joints(*self.stiff_joints)
        zero = (0.0, 0.0, 0.0)
        leg = leg.with_base_velocity(self.base_velocity or zero, self.base_angular_velocity or zero)
        warn(leg.warnings)
        return leg

    def _read_supports(self) -> list[Support]:
        supports = []
        for text in self.supports:
            if text.endswith(".toml"):
                supports.append(read_support(read_toml(text)))
                continue
            words = text.split(":")  # the first one after the frame's that is a number, or empty
            starts = [k for k, word in enumerate(words) if k and not word.strip("+-.0123456789e")]
            end = starts[0] if starts else 1
            frame, values = ":".join(words[:end]), words[end:]
            try:
                friction = float(values[0]) if values and values[0] else None
                sole = None
                if len(values) > 1:
                    corners = [corner.split(",") for corner in values[1].split("/")]
                    sole = np.array(corners, dtype=float)
                supports.append(Support(frame, friction=friction, sole=sole))
            except ValueError as error:
                detail = f" ({error})" if isinstance(error, InvalidInput) else ""
                raise InvalidInput(
                    f"--support is {text!r}: it must be a frame, FRAME:FRICTION such as foot:0.6, "
                    "or with corners foot:0.6:0.1,0.05,0/0.1,-0.05,0/-0.1,0,0, with a finite "
                    f"friction of at least 0{detail}"
                ) from None
        return supports
