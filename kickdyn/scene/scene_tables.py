"""The tables of a scene file: what each key takes, what it means, and what it is an argument of.

Keys end in their unit; those without one are dimensionless, or names. The reader, its messages and
`docs/reference/scene-file.md` follow from `TABLES`. A new key is a `Key` and an argument of its
table's constructor.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kickdyn.aerodynamics import drag, lift, spin_decay
from kickdyn.aerodynamics.coefficient_model import constant_limits
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.ground import SURFACES, Ground
from kickdyn.impact.laws import LAWS
from kickdyn.plane import Plane, ReachedBy
from kickdyn.restitution import MODELS as RESTITUTIONS
from kickdyn.robot.catalog import DESCRIPTION, ROBOTS
from kickdyn.robot.constraints import read_support
from kickdyn.robot.foot_surfaces import load_with_surface
from kickdyn.robot.joint_table import InDegrees
from kickdyn.robot.leg import Leg, Posture, read_leg
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.scene.scene import Compliance, Wall

MOST_NAMES = 100
"""Most entries of a list of names: each one adds rows to the constraints of the leg."""

ZERO = (0.0, 0.0, 0.0)


class Key(NamedTuple):
    """A key of a table.

    Attributes:
        name: of the key in the file, with its unit.
        argument: of the table's constructor that the value is passed to.
        takes: what is valid, for the reference page; or the names of which the value is one.
        meaning: of the key, and what holds without it, for the reference page.
        check: raises `InvalidInput` for values whose kind the constructor does not check.
        needs: other keys, without all of which this one has no meaning.
    """

    name: str
    argument: str
    takes: str | Collection[str]
    meaning: str
    check: Callable[[Any], object] | None = None
    needs: tuple[str, ...] = ()


class Table(NamedTuple):
    """A table of a scene file.

    Attributes:
        name: of the table; "" is the top of the file.
        constructor: takes the arguments of the keys and checks them.
        keys: every key.
        is_required: whether each file must have the table.
        required: groups of keys, with a valid value for each. A table has exactly one key of every
            group. Beside these values, each other key is checked alone.
    """

    name: str
    constructor: Callable[..., Any]
    keys: tuple[Key, ...]
    is_required: bool = False
    required: tuple[Mapping[str, Any], ...] = ()


def _check_text(value: object) -> None:
    if not (isinstance(value, str) and value and value.isprintable()):
        raise InvalidInput(f"{validation.brief(value)}: it must be printable text")


def _check_list(value: object) -> None:
    if not (isinstance(value, list) and len(value) <= MOST_NAMES):
        shown = validation.brief(value)
        raise InvalidInput(f"{shown}: it must be a list, with at most {MOST_NAMES} entries")


def _check_joints(value: object, unit: str, **limits: float) -> None:
    if not isinstance(value, dict):
        shown = validation.brief(value)
        raise InvalidInput(f"{shown}: it must be a table, joint = number [{unit}]")
    faults: list[str] = []
    for joint, number in value.items():
        try:
            validation.number(joint, number, unit=unit, **limits)
        except InvalidInput as error:
            faults += error.faults
    if faults:
        raise InvalidInput(*faults)


@dataclass(frozen=True)
class LegTable:
    """The keys of `[leg]`."""

    model: str | None = None
    file: str = ""
    robot: str | None = None
    frame: str | None = None
    base: str = "fixed"
    package_dirs: tuple[str, ...] = ()
    facing: str = "x"
    legs_only: bool = False
    locked: Mapping[str, float] = field(default_factory=dict)
    supports: tuple[str | Mapping[str, Any], ...] = ()
    loops: tuple[tuple[str, str], ...] = ()
    stiff_joints: tuple[str, ...] = ()
    armature: Mapping[str, float] = field(default_factory=dict)
    drives: str | None = None
    base_velocity: ArrayLike = ZERO
    base_angular_velocity: ArrayLike = ZERO

    def read(self, folder: Path) -> Leg:
        """Return the leg without what `change` adds."""
        drives = True if self.drives is None else self.drives != "none" and folder / self.drives
        options: dict[str, Any] = {"base": self.base, "drives": drives}
        if self.robot is not None:
            options |= {"legs_only": self.legs_only, "locked": InDegrees(self.locked)}
            return load_with_surface(self.frame, partial(Leg.from_robot, self.robot, **options))
        file = folder / self.file
        if self.model is not None:
            file = shipped_urdf(f"leg_{self.model}.urdf")
        packages = [folder / str(package) for package in self.package_dirs]
        options |= {"package_dirs": packages, "locked": self.locked, "facing": self.facing}
        return load_with_surface(self.frame, partial(read_leg, file, **options))

    def change(self, leg: Leg) -> Leg:
        """Return a leg with the rotors, supports, loops, stiff joints and velocity of the base."""
        leg = leg.with_armature(self.armature).with_supports(*map(read_support, self.supports))
        leg = leg.with_loops(*leg.loops, *self.loops)  # an MJCF file has loops, too
        leg = leg.with_stiff_joints(*self.stiff_joints)
        return leg.with_base_velocity(self.base_velocity, self.base_angular_velocity)


@dataclass(frozen=True)
class PostureTable:
    """The keys of `[posture]`."""

    angles_deg: Mapping[str, float] = field(default_factory=dict)
    positions_m: Mapping[str, float] = field(default_factory=dict)
    foot_velocity: ArrayLike | None = None
    joint_velocity: Mapping[str, float] = field(default_factory=dict)

    def configuration(self, leg: Leg) -> Array:
        """Return q, all loops closed by the joints that are not named."""
        named = {joint: math.radians(angle) for joint, angle in self.angles_deg.items()}
        named |= self.positions_m
        return leg.close_loops(leg.configuration(named), keep=named)

    def velocity(self, posture: Posture) -> Array:
        """Return v from the velocity of the contact point, or from the velocities of joints."""
        if self.foot_velocity is not None:
            return posture.joint_velocity(self.foot_velocity)
        v = np.zeros(posture.leg.nv)
        for joint, speed in self.joint_velocity.items():
            v[posture.leg.velocity_index(joint)] = speed
        return v


def joint_faults(leg: Leg, of_leg: LegTable, of_posture: PostureTable) -> list[str]:
    """Return a line for each joint that the leg lacks, or that moves in another unit."""
    faults = []
    for table, key, values, unit in (
        ("leg", "armature_kg_m2", of_leg.armature, ""),
        ("posture", "angles_deg", of_posture.angles_deg, "rad"),
        ("posture", "positions_m", of_posture.positions_m, "m"),
        ("posture", "joint_velocity_rad_s", of_posture.joint_velocity, ""),
    ):
        for joint in values:
            try:
                moves_in = leg.joint_unit(joint)
            except InvalidInput as error:
                faults.append(f"{table}: {error}")
            else:
                if unit and moves_in != unit:
                    faults.append(f"{table}: {key} names {joint}, which moves in {moves_in}")
    return faults


def _ball(
    model: str = "size-5", velocity: ArrayLike = ZERO, spin: ArrayLike = ZERO, **values: Any
) -> tuple[Ball, BallState]:
    usual = Ball.paper() if model == "paper" else Ball()
    return replace(usual, **values), BallState(velocity=velocity, spin=spin)


def _contact(
    normal: ArrayLike | None = None,
    attack_deg: float = 0.0,
    side_deg: float = 0.0,
    law: str | None = None,
    **values: Any,
) -> tuple[Contact, str | Compliance]:
    timed = {name: values.pop(name) for name in ("contact_time", "stiffness") if name in values}
    if normal is None:
        attack = validation.number("attack", attack_deg, at_least=-90, at_most=90, unit="deg")
        side = validation.number("side", side_deg, at_least=-180, at_most=180, unit="deg")
        up, left = math.radians(attack), math.radians(side)
        normal = (math.cos(up) * math.cos(left), math.cos(up) * math.sin(left), math.sin(up))
    contact = Contact(normal, **values)
    if not timed:
        return contact, law or "newton"
    if law is not None:
        raise InvalidInput(
            f"law is {law!r}: a contact that takes time has no impact law; leave out law, or the "
            "contact time and the stiffness"
        )
    return contact, Compliance(**timed)


def _air(model: str = "standard", **values: Any) -> Air:
    options = {"drag": None, "lift": None, "torque": None, "buoyancy": False, **values}
    if model == "standard":
        return Air.at(**options)
    fixed = values.keys() - {entry.name for entry in fields(Air)}
    if fixed:
        names = ", ".join(sorted(fixed))
        raise InvalidInput(f"the air of model 'paper' is fixed: leave out the model, or {names}")
    return replace(Air.paper(), **options)


def _ground(height: float | None = None, surface: str | None = None) -> tuple[bool, Ground]:
    """Return whether the height of the ground is given, and the ground."""
    return height is not None, Ground(0.0 if height is None else height, surface)


def _uncertainty(**deviations: Any) -> dict[str, float]:
    """Return standard deviations by their names in `Impact.uncertainty`; angles are in degrees."""
    checked = {
        source: validation.number("standard deviation", deviation, at_least=0)
        for source, deviation in deviations.items()
    }
    angles = checked.keys() & {"q", "normal"}
    return checked | {source: math.radians(checked[source]) for source in angles}


def _number_or(kind: str, models: Collection[str]) -> str:
    low, high = constant_limits(kind).values()
    return f"number, at least {low:g} and at most {high:g}, or {quoted(models)}"


def quoted(names: Collection[str]) -> str:
    """Return names in quotes, as code."""
    return ", ".join(f'`"{name}"`' for name in names)


TABLES = (
    Table("", dict, (
        Key("name", "name", "text", "of the scene; without it, the name of the file", _check_text),
    )),
    Table("leg", LegTable, (
        Key("model", "model", ("human", "testbed"), "a leg of kickdyn"),
        Key("file", "file", "text", "a URDF or MJCF file, relative to the folder of the scene",
            _check_text),
        Key("robot", "robot",
            f'{quoted(ROBOTS)}, or a name of robot_descriptions, `"NAME{DESCRIPTION}"`',
            "a robot by name; needs the extra `robots` or `descriptions`", _check_text),
        Key("frame", "frame", "text", "link, joint, body, site or geom whose origin strikes the "
            "ball, or with a surface of this foot, `FRAME:SURFACE`; without it `toe`, or the foot "
            "of a `robot`", _check_text),
        Key("base", "base", ("fixed", "floating"),
            "whether the root of the robot is fixed, as without this key, or moves freely"),
        Key("package_dirs", "package_dirs", "list of names", "folders in which the meshes of "
            "`file` are looked for, relative to the scene", _check_list, needs=("file",)),
        Key("facing", "facing", ("x", "y", "-x", "-y"), "axis along which the robot of `file` "
            "faces; without it `x`", needs=("file",)),
        Key("legs_only", "legs_only", "`true` or `false`", "whether to lock all joints of a "
            "`robot` except its legs; without it `false`",
            partial(validation.flag, "value"), needs=("robot",)),
        Key("locked", "locked", "table, joint = number [deg; m]",
            "joints that are fixed, and where", partial(_check_joints, unit="deg; m")),
        Key("supports", "supports", "list of names or tables", "frames that are at rest during the "
            "impact, such as the foot on the ground; a table has the key `frame`, and may have "
            "`friction` and `sole`, corners `[[x, y, z], ...]` [m]", _check_list),
        Key("loops", "loops", "list of pairs of names", "pairs of frames that coincide, which "
            "closes a kinematic loop", _check_list),
        Key("stiff_joints", "stiff_joints", "list of names",
            "joints whose velocity does not change in the impact", _check_list),
        Key("armature_kg_m2", "armature", "table, joint = number, at least 0 [kg m2]",
            "inertia of the rotors, seen from the joint",
            partial(_check_joints, unit="kg m2", at_least=0.0)),
        Key("drives", "drives", 'text, or `"none"`', "a file of drives, relative to the folder of "
            "the scene, or no rotors; without it the robot's own", _check_text),
        Key("base_velocity_m_s", "base_velocity", "vector [m/s]", "velocity of the fixed base at "
            "the world's origin, as of a hip in a run-up; 0 without it",
            partial(validation.vector, "base velocity", size=3, unit="m/s")),
        Key("base_angular_velocity_rad_s", "base_angular_velocity", "vector [rad/s]",
            "angular velocity of the fixed base; 0 without it",
            partial(validation.vector, "base angular velocity", size=3, unit="rad/s")),
    ), is_required=True, required=({"model": "human", "file": "", "robot": ""},)),
    Table("posture", PostureTable, (
        Key("angles_deg", "angles_deg", "table, joint = number [deg]",
            "positions of joints that turn; 0 for those left out",
            partial(_check_joints, unit="deg")),
        Key("positions_m", "positions_m", "table, joint = number [m]",
            "positions of prismatic joints; 0 for those left out",
            partial(_check_joints, unit="m")),
        Key("foot_velocity_m_s", "foot_velocity", "vector [m/s]",
            "of the contact point; the joint velocity is the one of least kinetic energy",
            partial(validation.vector, "foot velocity", size=3, unit="m/s")),
        Key("joint_velocity_rad_s", "joint_velocity", "table, joint = number [rad/s]",
            "velocities of the joints, in m/s for prismatic ones; 0 for those left out",
            partial(_check_joints, unit="rad/s")),
    ), is_required=True, required=({"foot_velocity_m_s": ZERO, "joint_velocity_rad_s": {}},)),
    Table("ball", _ball, (
        Key("model", "model", ("size-5", "paper"), "the ball whose values hold for the keys left "
            "out; without it a football of size 5"),
        Key("mass_kg", "mass", "number, above 0 [kg]", "mass"),
        Key("radius_m", "radius", "number, above 0 [m]", "radius"),
        Key("inertia_factor", "inertia_factor", "number, above 0 and at most 2/3",
            "moment of inertia over m r^2; 2/3 of a shell without it"),
        Key("pressure_pa", "pressure", "number, at least 2000 and at most 1e6 [Pa]",
            "gauge pressure, for the `stiffness` and the restitution `inflated` of the contact"),
        Key("shell_share", "shell_share", "number, at least 0 and at most 1",
            "share of the mass in the shell, for the restitution `inflated`; 1 without it"),
        Key("velocity_m_s", "velocity", "vector [m/s]", "before the contact; 0 without it"),
        Key("spin_rad_s", "spin", "vector [rad/s]", "before the contact; 0 without it"),
    )),
    Table("contact", _contact, (
        Key("normal", "normal", "vector of any length but 0", "from the foot into the ball"),
        Key("attack_deg", "attack_deg", "number, at least -90 and at most 90 [deg]",
            "angle of the normal above the horizontal, instead of `normal`"),
        Key("side_deg", "side_deg", "number, at least -180 and at most 180 [deg]",
            "angle of the normal to the left; 0 without it", needs=("attack_deg",)),
        Key("restitution", "restitution", "number from 0 to 1, rows `[[speed, e], ...]` [m/s, 1], "
            f"or {quoted(RESTITUTIONS)}", "coefficient of restitution e"),
        Key("friction", "friction", "number, at least 0",
            "coefficient of friction between foot and ball; 0 without it"),
        Key("law", "law", LAWS,
            "impact law of an instantaneous contact; without it `newton`"),
        Key("offset_m", "offset", "vector [m]",
            "contact point in the axes of `frame`; without it its origin"),
        Key("contact_time_s", "contact_time", "number, above 0 and at most 0.1 [s]", "duration of "
            "a contact that takes time; without it and `stiffness` the contact is instantaneous"),
        Key("stiffness", "stiffness", ("pressure", "inflated"), "stiffness of a contact that takes "
            "time, from the pressure of the ball, instead of `contact_time_s`; with `inflated` the "
            "force that the restitution `inflated` is derived from"),
    ), is_required=True, required=({"attack_deg": 0.0, "normal": (1, 0, 0)}, {"restitution": 1.0})),
    Table("air", _air, (
        Key("model", "model", ("standard", "paper"),
            "the standard atmosphere, as without this key, or the air of the paper"),
        Key("altitude_m", "altitude", "number, at least -1000 and at most 11000 [m]",
            "above the sea; 0 without it"),
        Key("temperature_c", "temperature_c", "number, at least -80 and at most 60 [degC]",
            "the default is the temperature of the standard atmosphere"),
        Key("pressure_pa", "pressure", "number, at least 10000 and at most 200000 [Pa]",
            "the default is the pressure of the standard atmosphere"),
        Key("drag", "drag", _number_or("drag", drag.MODELS),
            "drag coefficient; no drag without it"),
        Key("lift", "lift", _number_or("lift", lift.MODELS),
            "lift coefficient; no lift without it"),
        Key("torque", "torque", _number_or("torque", spin_decay.MODELS),
            "coefficient of spin decay; constant spin without it"),
        Key("wind_m_s", "wind", "vector [m/s]", "velocity of the air; 0 without it"),
        Key("buoyancy", "buoyancy", "`true` or `false`",
            "whether the weight of the displaced air acts; without it `false`"),
    )),
    Table("ground", _ground, (
        Key("height_m", "height", "number [m]",
            "height of the ground; without it, directly under the ball at the contact"),
        Key("surface", "surface", SURFACES, "with it, the ball bounces and rolls until it is at "
            "rest; without it, the path ends where the ball lands"),
    )),
    Table("plane", Plane, (
        Key("point_m", "point", "vector [m]", "a point of the plane"),
        Key("normal", "normal", "vector of any length but 0",
            "normal of the plane, on the side from which the ball comes"),
        Key("reached_by", "reached_by", tuple(ReachedBy), "part of the ball that ends the path "
            "where it reaches the plane; without it `front`. An upright plane that is reached by "
            "`centre` or `back` is a goal line: a goal, 7.32 m wide and 2.44 m high, stands around "
            "`point_m`"),
    ), required=({"point_m": ZERO}, {"normal": (1, 0, 0)})),
    Table("wall", Wall, (
        Key("distance_m", "distance", "number, above 0 [m]", "from the ball along the line to "
            "`point_m` of the plane, on which the middle of a wall of players stands"),
        Key("height_m", "height", "number, above 0 [m]", "height of the wall"),
        Key("width_m", "width", "number, above 0 [m]", "width of the wall; 2.5 without it"),
    ), required=({"distance_m": 1.0}, {"height_m": 1.0})),
    Table("uncertainty", _uncertainty, tuple(
        Key(name, source, f"number, at least 0{unit}", f"standard deviation of {quantity}")
        for name, source, unit, quantity in (
            ("angles_deg", "q", " [deg]", "the angle of each joint"),
            ("joint_velocity_rad_s", "v", " [rad/s]", "the velocity of each joint"),
            ("normal_deg", "normal", " [deg]", "the direction of the contact normal"),
            ("restitution", "restitution", "", "the coefficient of restitution"),
            ("friction", "friction", "", "the coefficient of friction"),
            ("ball_mass_kg", "ball_mass", " [kg]", "the mass of the ball"),
            ("ball_radius_m", "ball_radius", " [m]", "the radius of the ball"),
            ("ball_velocity_m_s", "ball_velocity", " [m/s]",
             "each component of the ball's velocity"),
            ("ball_spin_rad_s", "ball_spin", " [rad/s]", "each component of the ball's spin"),
        )
    )),
)  # fmt: skip
"""Every table, in the order of the reference page."""
