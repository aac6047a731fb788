"""What a leg is made of: model, contact frame, supports, loops, drives; and legs that differ."""

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
import pinocchio as pin
from numpy.lib.stride_tricks import as_strided

from kickdyn.core import validation
from kickdyn.core.files import read_toml, shipped
from kickdyn.core.validation import Array, ArrayLike, read_only
from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.robot.constraints import Constraints, Support
from kickdyn.robot.joint_table import DEGREES, InDegrees, JointTable
from kickdyn.robot.model_validation import check_is_model, frame_id
from kickdyn.robot.names import listed
from kickdyn.robot.robot_file import RobotFile
from kickdyn.robot.surgery import has_floating_base, reduce_model

MAX_REFLECTED_INERTIA = 10.0
"""Largest inertia of a rotor as seen from its joint [kg m2; kg for prismatic joints]."""


@dataclass(frozen=True)
class Drive:
    r"""The motor of a joint, behind a gear.

    The rotor turns n times as fast as the joint, and adds the reflected inertia :math:`J n^2` to
    the joint's entry of M. Its small angular momentum along other axes is neglected.

    Attributes:
        rotor_inertia: J, of the rotor about its own axis [kg m2].
        gear: n, turns of the rotor per turn of the joint; 1 if the inertia is that at the joint [1;
            rad/m for prismatic joints].
        torque_limit: largest torque at the joint [N m; N if prismatic]; None keeps the file's.
        speed_limit: largest speed of the joint [rad/s; m/s if prismatic]; None keeps the file's.
        friction: of the gear, a torque against the joint's motion, which holds a joint at rest up
            to this size [N m; N if prismatic]; it acts in a contact that takes time, `collide`.
        stiffness: of position control, whose reference moves on with the velocity before the impact
            [N m/rad; N/m if prismatic]; likewise.

    Raises:
        InvalidInput: a value that is not finite, negative, a gear of 0, or a reflected inertia
            above 10 kg m2.
    """

    rotor_inertia: float
    gear: float = 1.0
    torque_limit: float | None = None
    speed_limit: float | None = None
    friction: float = 0.0
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        validation.number("rotor inertia", self.rotor_inertia, at_least=0, unit="kg m2")
        if not validation.number("gear", self.gear):
            raise InvalidInput(
                "gear is 0: it must be the number of rotor turns per turn of the joint"
            )
        if self.reflected_inertia > MAX_REFLECTED_INERTIA:
            raise InvalidInput(
                f"rotor inertia times gear squared is {self.reflected_inertia:g} kg m2: it must be "
                f"at most {MAX_REFLECTED_INERTIA:g} kg m2; is the gear already in the inertia?"
            )
        for name in ("torque_limit", "speed_limit"):
            if getattr(self, name) is not None:
                validation.number(name.replace("_", " "), getattr(self, name), at_least=0)
        validation.number("friction", self.friction, at_least=0, unit="N m")
        validation.number("stiffness", self.stiffness, at_least=0, unit="N m/rad")

    @property
    def reflected_inertia(self) -> float:
        r"""Inertia of the rotor as seen from the joint, :math:`J n^2` [kg m2; kg if prismatic]."""
        return self.rotor_inertia * self.gear * self.gear  # a power overflows with an exception


KEYS = {
    "rotor_inertia_kg_m2": "rotor_inertia",
    "gear": "gear",
    "torque_limit_n_m": "torque_limit",
    "speed_limit_rad_s": "speed_limit",
    "friction_n_m": "friction",
    "stiffness_n_m_rad": "stiffness",
}
"""Keys of a joint in a file of drives, and the attributes of `Drive` that they set."""


def read_drives(path: str | PathLike[str]) -> dict[str, Drive]:
    """Read a TOML file of drives, by names of joints or patterns as of a shell.

    The file has a table `[joints]` with a table for each joint or pattern, whose keys are `KEYS`
    (`rotor_inertia_kg_m2` is required), and may have a text `source`. Raises `FaultyFile`, with a
    line for each fault.
    """
    source, document = str(path), read_toml(path)
    faults = [
        f"{key} is unknown: the file of drives has source and [joints]"
        for key in document
        if key not in ("source", "joints")
    ]
    joints = document.get("joints")
    if not isinstance(joints, dict):
        line = 'has no [joints]: it needs lines such as "knee" = { rotor_inertia_kg_m2 = 1e-5 }'
        raise FaultyFile(source, [*faults, line])
    drives = {}
    for joint, values in joints.items():
        unknown = values.keys() - KEYS.keys() if isinstance(values, dict) else {repr(values)}
        if unknown:
            faults.append(f"{joint} has {', '.join(sorted(unknown))}: choose {', '.join(KEYS)}")
        elif "rotor_inertia_kg_m2" not in values:
            faults.append(f"{joint} has no rotor_inertia_kg_m2: 0 is valid")
        else:
            try:
                drives[joint] = Drive(**{KEYS[key]: value for key, value in values.items()})
            except InvalidInput as error:
                faults += [f"{joint}: {line}" for line in error.faults]
    if faults:
        raise FaultyFile(source, faults)
    return drives


def load_drives(drives: Mapping[str, Drive] | str | PathLike[str]) -> dict[str, Drive]:
    """Return drives by joint or pattern, from a file where one is named."""
    if isinstance(drives, str | PathLike):
        return read_drives(drives)
    checked = validation.mapping("drives", drives)
    for joint, drive in checked.items():
        validation.check_type(Drive, **{f"drive of {joint}": drive})
    return checked


def catalogued_drives(robot: str) -> Path | None:
    """Return the file of a robot's drives that comes with kickdyn; None if there is none."""
    path = shipped("drives") / f"{robot.removesuffix('_reduced')}.toml"
    return path if path.exists() else None


class Workspace(threading.local):
    """Scratch space per thread: two threads in one `pin.Data` would mix their kinematics.

    Attributes:
        model, data: the leg's model without gravity, as for an impact, read only; and its
            `pin.Data`.
        external: one `pin.Force` per joint, for `pin.rnea`; a caller sets all of them.
        external_wrenches: view of `external`, shape `(njoints, 6)`, the universe included.
        placements, velocities, accelerations: views of `data.oMi`, `data.v` and `data.a`, the
            universe included.
        forces: view of `data.f`, linear then angular, shape `(njoints, 6)`, without the universe.
        zero_velocity: of all joints, shape `(nv,)`.
    """

    def __init__(self, model: Any) -> None:
        self.model = model = model.copy()
        model.gravity = pin.Motion.Zero()  # an impact is too short for gravity
        self.data = pin.Data(model)  # createData makes two for a while, n^3 numbers each
        self.external = pin.StdVec_Force()
        self.external.extend([pin.Force.Zero() for _ in range(model.njoints)])
        self.external_wrenches = _stacked(self.external)
        self.placements = list(self.data.oMi)  # each access to oMi would copy its entry
        self.velocities, self.accelerations = list(self.data.v), list(self.data.a)
        self.forces = _stacked(self.data.f)[1:]
        self.zero_velocity: Array = np.zeros(model.nv)


def _stacked(forces: Any) -> Array:
    """Return a view of a vector of `pin.Force`, one row each: one copy then takes all of them."""
    rows = [force.vector for force in list(forces)]
    address = rows[0].__array_interface__["data"][0]
    step = 6 * rows[0].itemsize
    for k, row in enumerate(rows):
        if row.__array_interface__["data"][0] != address + k * step:
            raise RuntimeError("Pinocchio no longer keeps forces side by side")
    return as_strided(rows[0], shape=(len(rows), 6), strides=(step, rows[0].itemsize))


Drives = str | PathLike[str] | Mapping[str, Drive]
"""Drives by joint, or a file of them."""


class _CopiedModel:
    """The field `model` of a leg: copied when it is set and when it is read."""

    def __get__(self, leg: "LegModel | None", owner: type) -> Any:
        if leg is None:
            raise AttributeError("model")  # so that the dataclass sees no default
        return leg._model.copy()

    def __set__(self, leg: "LegModel", model: Any) -> None:
        check_is_model(model)
        vars(leg)["_model"] = model.copy()


@dataclass(frozen=True, eq=False, repr=False)
class LegModel(JointTable):
    """What a `Leg` is made of, and the legs that differ from it in one of these parts."""

    model: Any = _CopiedModel()
    frame: str = ""
    file: RobotFile | None = None
    supports: tuple[Support, ...] = ()
    loops: tuple[tuple[str, str], ...] = ()
    contact_normal_cone: Array | None = None
    stiff_joints: tuple[str, ...] = ()
    drives: Mapping[str, Drive] = field(default_factory=dict)
    base_velocity: Array | None = None
    constraints: Constraints | None = field(init=False)
    workspace: "Workspace" = field(init=False)

    def __post_init__(self) -> None:
        validation.check_type(str, frame=self.frame)
        if not self.frame:
            moving = [frame.name for frame in self._model.frames if frame.parentJoint]
            raise InvalidInput(
                "no frame is named that touches the ball: kd.Leg.from_model(model, frame) takes "
                f"one of {listed(list(dict.fromkeys(moving)))}"
            )
        validation.check_type(RobotFile, type(None), file=self.file)
        for name in ("supports", "loops", "stiff_joints"):
            validation.check_type(tuple, **{name: getattr(self, name)})
        if self.contact_normal_cone is not None:
            cone = validation.floats("contact normal cone", self.contact_normal_cone)
            vars(self).update(contact_normal_cone=read_only(cone))
        if self.base_velocity is not None:
            twist = validation.vector("base velocity", self.base_velocity, 6)
            for name, velocity, unit in (
                ("speed of the base", twist[:3], "m/s"),
                ("angular speed of the base", twist[3:], "rad/s"),
            ):
                validation.number(name, math.hypot(*velocity), at_most=100.0, unit=unit)
            vars(self).update(base_velocity=read_only(twist) if twist.any() else None)
        if self.base_velocity is not None and (self.supports or has_floating_base(self._model)):
            raise InvalidInput(
                f"base velocity is {self.base_velocity.tolist()}: {self.name} must have a fixed "
                "base and no supports; the velocity of a floating base is part of v"
            )
        if self.contact_joint == 0:
            raise InvalidInput(f"frame {self.frame!r} is fixed to the base: a kick must move it")
        constraints = None
        if self.supports or self.loops or self.stiff_joints or self.mimics:
            stiff = {joint: self.velocity_index(joint) for joint in self.stiff_joints}
            constraints = Constraints(
                self._model, self.contact_joint, self.supports, self.loops, self.gears, stiff
            )
        vars(self).update(constraints=constraints, workspace=Workspace(self._model))

    @cached_property
    def compliant_drives(self) -> dict[str, Drive]:
        """The drives with friction or stiffness, which act in a contact that takes time."""
        return {joint: x for joint, x in self.drives.items() if x.friction or x.stiffness}

    @cached_property
    def frame_id(self) -> int:
        """Number of the contact frame in the model."""
        return frame_id(self._model, self.frame)

    @cached_property
    def contact_joint(self) -> int:
        """Number of the joint that carries the contact frame."""
        return int(self._model.frames[self.frame_id].parentJoint)

    @cached_property
    def contact_lever(self) -> Array:
        """Origin of the contact frame, shape `(3,)` [m, axes of the contact joint]."""
        return read_only(self._model.frames[self.frame_id].placement.translation)

    def locked(self, joints: Mapping[str, float]) -> Self:
        """Return the leg with joints locked at their values [rad; m for prismatic joints].

        Names may be patterns, as for `from_urdf`. Joints that mimic a locked joint are locked where
        it puts them, unless they are named with a value of their own. Raises `InvalidInput` for an
        unknown joint, a value that is not finite or outside the joint's range, or if no joint moves
        the foot.
        """
        if not validation.mapping("joints", joints):
            return self
        values, leg = self._values_to_lock(joints), self
        if self.file is not None:  # a mimic joint that is locked itself follows no driver
            mimics = tuple(mimic for mimic in self.file.mimics if mimic.joint not in values)
            leg = replace(self, file=replace(self.file, mimics=mimics))
        q = leg.configuration(values)
        turned = [x for joint, x in values.items() if x and leg.joint_unit(joint) == "rad"]
        wide = min(map(abs, turned), default=0.0) > math.tau and not isinstance(joints, InDegrees)
        for line in leg.outside_range(q):
            if any(line.startswith(f"{joint} at ") for joint in values):
                hint = f"; {DEGREES}" if wide else ""
                raise InvalidInput(f"{line}: it cannot be locked there{hint}")
        if wide:
            leg = leg.with_warnings(f"of locked joints, {DEGREES}")
        fixed = {*values, *(mimic.joint for mimic in leg.mimics if mimic.driver in values)}
        if len(fixed) == len(self.joint_names):
            raise InvalidInput(f"all joints of {self.name} are locked: a kick must move one")
        return leg.with_model(reduce_model(self._model, fixed, q))

    def with_armature(self, rotors: Mapping[str, float]) -> Self:
        """Return the leg with rotors behind its joints, in place of those that it had.

        Args:
            rotors: joint name to rotor inertia times gear ratio squared [kg m2; kg if prismatic].
        """
        armature = self._model.armature.copy()
        for name, value in validation.mapping("rotors", rotors).items():
            armature[self.velocity_index(name)] = validation.number(
                f"armature of {name}", value, at_least=0, unit="kg m2"
            )
        model = self.model
        model.armature = armature
        return self.with_model(model)

    def without_rotors(self) -> Self:
        """Return the leg without rotors behind its joints."""
        return self.with_armature(dict.fromkeys(self.single_joints, 0.0))

    def with_drives(self, drives: Drives) -> Self:
        """Return the leg with drives: rotors behind gears, and limits of torque and speed.

        Args:
            drives: `Drive` by the name of a joint or a pattern, as for `from_urdf`, or a TOML file:

                .. code-block:: toml

                    [joints]
                    "*_knee" = { rotor_inertia_kg_m2 = 1e-5, gear = 100, torque_limit_n_m = 90 }

                They replace what the joints had. Other joints keep what they have.

        Raises:
            InvalidInput: no such joint, or a file with an unknown key or a value out of range.
        """
        listed = load_drives(drives)
        if not listed:
            return self
        model, entries = self.model, list(listed.values())
        numbers = self.expand_joint_names({name: k for k, name in enumerate(listed)})
        by_joint = {joint: entries[int(number)] for joint, number in numbers.items()}
        for attribute, limit in (
            ("armature", "reflected_inertia"),
            ("effortLimit", "torque_limit"),
            ("velocityLimit", "speed_limit"),
        ):
            values = getattr(model, attribute).copy()
            for joint, drive in by_joint.items():
                if (value := getattr(drive, limit)) is not None:
                    values[self.velocity_index(joint)] = value
            setattr(model, attribute, values)
        return replace(self.with_model(model), drives={**self.drives, **by_joint})

    def _with_drives_of(self, drives: Drives | bool, usual: Path | None = None) -> Self:
        """Return the leg with drives: for True the usual ones, for False none."""
        if drives is False:
            return self.without_rotors()
        listed = usual if drives is True else drives
        if listed is not None:
            return self.with_drives(listed)
        if self.file is None or self.file.folder == shipped("urdf"):
            return self
        return replace(self, file=replace(self.file, lacks_drives=True))

    def with_warnings(self, *lines: str) -> Self:
        """Return the leg with further lines in the warnings of its file, if it has one."""
        if self.file is None or not lines:
            return self
        return replace(self, file=replace(self.file, warnings=(*self.file.warnings, *lines)))

    def with_supports(self, *supports: str | Support) -> Self:
        """Return the leg with frames that stand on the ground and stay at rest in the impact.

        Args:
            supports: names of frames, for flat feet, or `Support` objects, in place of those from
                before. None may be on the kicking limb or on the fixed base.
        """
        stances = tuple(Support(s) if isinstance(s, str) else s for s in supports)
        for support in stances:
            validation.check_type(str, Support, support=support)
        return replace(self, supports=stances)

    def with_loops(self, *loops: tuple[str, str]) -> Self:
        """Return the leg with closed loops: pairs of frames whose origins stay together.

        Each joins two bodies by a ball joint: in a plane, a pin. They replace any before.
        """
        for loop in loops:
            if not isinstance(loop, tuple | list) or len(loop) != 2:
                raise InvalidInput(f"loop is {loop!r}: it must be a pair of frames' names")
        return replace(self, loops=tuple((first, second) for first, second in loops))

    def with_stiff_joints(self, *joints: str) -> Self:
        r"""Return the leg with joints that hold in an impact, as motors with high gears do.

        Such a joint may move, but the impact does not change its velocity, :math:`v_j^+ = v_j^-`.
        The impulse of its motor is part of `Impact.joint_impulses` and of `joint_loads`. A real
        joint is between this and a free one with the rotor of `with_armature`.

        Args:
            joints: names of joints of one degree of freedom, in place of those from before;
                without any name, all joints are free.
        """
        for joint in joints:
            if joints.count(joint) > 1:
                raise InvalidInput(f"joint {joint!r} is stiff twice: name it once")
        if len(joints) == self.nv:
            raise InvalidInput(f"all joints of {self.name} are stiff: one must be free")
        return replace(self, stiff_joints=joints)

    def with_base_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> Self:
        r"""Return the leg on a fixed base that moves, as the hip of a player who runs up.

        The velocity of the contact point at x is :math:`J v + v_0 + \omega_0 \times x`. An impact
        does not change the velocity of the base, as if the body were far heavier than the leg.
        Torques of plans assume a base that does not turn.

        Args:
            linear: velocity :math:`v_0` of the base at the world's origin, where the hip of our
                legs is, shape `(3,)` [m/s, world axes]; it replaces any before.
            angular: angular velocity :math:`\omega_0`, shape `(3,)` [rad/s, world axes].

        Raises:
            InvalidInput: an entry that is not finite, a speed above 100 m/s or 100 rad/s, a
                floating base, or a leg with supports.
        """
        parts = (
            validation.vector("linear", linear, 3, unit="m/s"),
            validation.vector("angular", angular, 3, unit="rad/s"),
        )
        return replace(self, base_velocity=np.concatenate(parts))

    def check_base_at_rest(self, what: str) -> None:
        """Raise `InvalidInput` where the base moves, for `what` needs it at rest."""
        if self.base_velocity is not None:
            raise InvalidInput(
                f"base velocity is {self.base_velocity.tolist()}: {what} needs a base at rest"
            )

    def with_model(self, model: Any) -> Self:
        """Return the leg with another `pin.Model`, a changed copy of its own."""
        check_is_model(model)
        names = list(model.names)
        stiff = tuple(joint for joint in self.stiff_joints if joint in names)
        drives = {joint: drive for joint, drive in self.drives.items() if joint in names}
        return replace(self, model=model, stiff_joints=stiff, drives=drives)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what the leg was made of; all else is made anew."""
        return type(self), tuple(getattr(self, made.name) for made in fields(self) if made.init)
