"""The leg: a Pinocchio model with a contact frame, and its posture at one configuration."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.linalg import blas, lapack

from kickdyn.core import validation
from kickdyn.core.mechanics import cross3
from kickdyn.core.representation import ReprMixin, Row, format_value, warned
from kickdyn.core.validation import Array, ArrayLike, protect, read_only
from kickdyn.errors import FaultyFile, InvalidInput, MjcfError, UrdfError
from kickdyn.robot.catalog import ROBOTS, TOE, find_description, read_robot
from kickdyn.robot.constraints import ConstraintProjector, find_open_loops
from kickdyn.robot.human_body import HumanModel, Sex, Side, human_leg
from kickdyn.robot.joint_table import DEGREES, InDegrees, look_like_degrees
from kickdyn.robot.leg_model import Drives, LegModel, catalogued_drives
from kickdyn.robot.mjcf_file import is_mjcf, read_mjcf
from kickdyn.robot.mjcf_model import build_mjcf_model
from kickdyn.robot.model_validation import (
    MAX_CONDITION,
    check_is_model,
    check_model,
    cholesky_with_condition,
    facing_doubts,
    singularity_fault,
)
from kickdyn.robot.robot_file import RobotFile
from kickdyn.robot.surgery import reduce_model, turn_body
from kickdyn.robot.urdf_file import build_model, check_base, read_urdf, shipped_urdf

NO_DRIVES = (
    "the file has no drives: with rotors behind gears, the foot's effective mass is larger; give "
    "them by Leg.with_drives (--drives FILE), or drives=False (--drives none) for a leg without"
)
"""Warning of a robot whose joints have no rotors."""

MAX_SHOWN_JOINTS = 8
"""Joints of a posture that are shown; of a robot with more, those that are not at 0."""


@dataclass(frozen=True, eq=False, repr=False)
class Leg(LegModel, ReprMixin):
    r"""A leg, or a whole robot, with the frame that touches the ball.

    A leg does not change: `locked`, `with_drives`, `with_supports` and the like return another
    one. It can be pickled and shared between threads.

    Attributes:
        model: the `pin.Model`, a copy each time: what is changed there does not change this leg.
        frame: name of the contact frame.
        file: the checked file from which the leg was read; None for `from_model`.
        supports: frames that stand on the ground.
        loops: pairs of frames whose origins stay together.
        contact_normal_cone: rows a of the cone of contact normals n with which the foot can meet a
            ball, :math:`a \cdot n \ge 0`, shape `(k, 3)` [contact frame]; None if unknown.
        stiff_joints: joints whose velocity an impact does not change.
        drives: by joint, as given; their rotors and limits are in the model.
        base_velocity: of the fixed base, at the world's origin: linear, then angular, shape `(6,)`
            [m/s, rad/s, world axes]; None if it is at rest.
        constraints: by supports, loops, mimic joints and stiff joints; None without any.
        workspace: this thread's scratch space for Pinocchio's calls; every call overwrites it.
    """

    @classmethod
    @validation.check_arguments
    def human(
        cls,
        *,
        height: float | None = None,
        mass: float | None = None,
        sex: str = "male",
        side: str = "right",
        model: str = "paper",
        frame: str = "toe",
        base: str = "fixed",
        segments: Any = "de Leva",
    ) -> "Leg":
        """Return a human leg; without arguments, the leg of the paper's Table 1.

        Segments of a person of a given size are from published tables, torques from Anderson et
        al. 2007 (J Biomech 40:3105); `kickdyn.robot.human_body` and `human_body` have the
        numbers. The last three joints of the model `3d` below have no limits of torque and speed.

        Args:
            height: of the person, 1.2 to 2.3 [m].
            mass: of the person, 30 to 200 [kg].
            sex: `female` or `male`.
            side: `left` or `right`. The left leg is the mirror image of the right one, and flexion,
                adduction, internal rotation and inversion are positive for both.
            model: `paper`, hip, knee and ankle in one plane, or `3d`, `hip`, `hip_adduction`,
                `hip_rotation`, `knee`, `ankle` and `subtalar`.
            frame: `toe`, `instep` or `inside`, the surface of the foot that touches the ball, or
                another frame of the leg, then without a cone of contact normals.
            base: `fixed`, the hip fixed at the origin, or `floating`: the hip moves with the pelvis
                (the lower trunk alone), as for `from_urdf`.
            segments: `de Leva` 1996 (J Biomech 29:1223), with segments that are symmetric about the
                line between joints; `Dumas` et al. 2007 (J Biomech 40:543), with centres beside it
                and whole inertia tensors; or a `yeadon.Human` (`pip install yeadon`), in its
                neutral configuration, with lengths and girths that are measured; its masses are
                scaled to the mass.

        Raises:
            InvalidInput: a value that is out of range or unknown, or a height without a mass.
        """
        if height is None and mass is None:
            validation.choice("sex", sex, Sex)
            validation.choice("side", side, Side)
            validation.choice("model", model, HumanModel)
            options = (sex, side, model, frame, base, validation.brief(segments))
            if options != ("male", "right", "paper", "toe", "fixed", "'de Leva'"):
                raise InvalidInput(
                    "height and mass are None: sex, side, model, frame, base and segments are for "
                    "a leg of a given height and mass"
                )
            return cls.from_urdf(shipped_urdf("leg_human.urdf"))
        file, sized, cone = human_leg(height, mass, sex, side, model, frame, base, segments)
        return cls(sized, frame, file, contact_normal_cone=cone)

    @classmethod
    def testbed(cls) -> "Leg":
        """Return the test bed of the paper's Table 6; contact at the toe, the ankle free."""
        return cls.from_urdf(shipped_urdf("leg_testbed.urdf"))

    @classmethod
    def from_urdf(
        cls,
        path: str | PathLike[str],
        frame: str = "toe",
        *,
        base: str = "fixed",
        locked: Mapping[str, float] | None = None,
        package_dirs: Iterable[str | PathLike[str]] = (),
        drives: Drives | bool = True,
        facing: str = "x",
    ) -> "Leg":
        """Load a URDF file.

        Args:
            path: the file.
            frame: link or joint of the file whose origin touches the ball.
            base: `fixed`, the root link welded to the world, or `floating`: the first joint,
                `root_joint`, then has position and quaternion (xyzw) in q, and linear and angular
                velocity in v [axes of the root link].
            locked: joints to lock at their values [rad; m for prismatic joints], before inertias
                are judged. A name may be a pattern as of a shell, such as `"LFinger*"`; the value
                of a joint that is named itself takes precedence.
            package_dirs: ROS packages, or folders that contain them, with meshes named
                `package://NAME/...`, searched before the folders around the file and of ROS.
            drives: rotors, which a URDF leaves out, and limits, as for `with_drives`; True and
                False leave them out.
            facing: axis along which the robot faces in the file: `x`, `y`, `-x` or `-y`. The base
                is turned about z, so that the leg faces x.

        Raises:
            UrdfError: the file is refused, with all its faults in one message.
            InvalidInput: there is no such frame, base, axis, joint to lock or folder.
        """
        urdf = read_urdf(path, package_dirs, validation.mapping("locked", locked))
        model = build_model(urdf.text, urdf.source, base)
        return cls._read(UrdfError, urdf, model, frame, locked, drives, facing)

    @classmethod
    def from_mjcf(
        cls,
        path: str | PathLike[str],
        frame: str,
        *,
        base: str = "fixed",
        locked: Mapping[str, float] | None = None,
        package_dirs: Iterable[str | PathLike[str]] = (),
        drives: Drives | bool = True,
        facing: str = "x",
    ) -> "Leg":
        """Load an MJCF file, the XML of MuJoCo, which compiles it: `pip install "kickdyn[mjcf]"`.

        Of the file come masses, joints, ranges, rotor inertias (`armature`), loops (two bodies that
        `<connect>` joins) and limits of torque: the smaller one of the joint's `actuatorfrcrange`
        and what its actuators can exert, gear times `forcerange` (motors without one: gear times
        `ctrlrange`). MJCF has no limits of speed. Springs, damping, tendons and contacts are left
        out.

        Args:
            path: the file.
            frame: body, site or geom whose origin touches the ball. Bodies that hang on another
                root, such as objects of a scene, are left out; `Leg.warnings` names them.
            base: `fixed`, the root body welded to the world where the file places it, or
                `floating`: then the first joint is the file's free joint, or `root_joint` if it has
                none, as for `from_urdf`; at its neutral q, the root body is at the origin, turned
                as in the file. Of other joints, q is MuJoCo's `qpos`, with quaternions in the order
                xyzw.
            locked: joints to lock at their values, as for `from_urdf`.
            package_dirs: further folders from which included files and meshes are read.
            drives: rotors and limits instead of the file's, as for `with_drives`; False
                for no rotors.
            facing: axis along which the robot faces in the file, as for `from_urdf`.

        Raises:
            MjcfError: the file is refused, or MuJoCo is not installed.
            InvalidInput: there is no such frame, base, axis, joint to lock or folder.
        """
        file = read_mjcf(path, package_dirs)
        read, model, loops = build_mjcf_model(file, frame, base, locked)
        leg = cls._read(MjcfError, read, model, frame, locked, drives, facing)
        return leg.with_loops(*loops)

    @classmethod
    def _read(
        cls,
        error: type[FaultyFile],
        file: RobotFile,
        model: Any,
        frame: str,
        locked: Mapping[str, float] | None,
        drives: Drives | bool,
        facing: str,
    ) -> "Leg":
        """Return the leg of the model of a file, with a warning if it seems not to face x."""
        axes = {"x": 0.0, "y": 0.5 * math.pi, "-x": math.pi, "-y": -0.5 * math.pi}
        if not isinstance(facing, str) or facing not in axes:
            raise InvalidInput(f"facing is {facing!r}: it must be {', '.join(axes)}")
        if facing != "x":
            model = turn_body(model, 0, np.round(pin.utils.rotate("z", -axes[facing])))
        leg = cls(model, frame, file)._with_drives_of(drives).locked(locked or {})
        if fault := _find_fault(leg):
            raise error(file.source, [fault])
        return leg.with_warnings(*facing_doubts(leg.workspace.model, leg.contact_joint))

    @classmethod
    @validation.check_arguments
    def from_robot(
        cls,
        name: str,
        frame: str | None = None,
        *,
        base: str = "fixed",
        legs_only: bool = False,
        locked: Mapping[str, float] | None = None,
        drives: Drives | bool = True,
        facing: str = "x",
    ) -> "Leg":
        """Load a robot by name.

        The robots of the package example-robot-data (`pip install "kickdyn[robots]"`) have a toe,
        and their base is turned so that it faces x with z up. Those of robot_descriptions (`pip
        install "kickdyn[descriptions]"`) are URDF and MJCF files, which it downloads the first
        time. All else is the file's own, zero configuration and joint directions included.

        Args:
            name: bolt, g1, human, icub, icub_reduced, romeo, simple_humanoid, talos; or a name of
                robot_descriptions, such as `g1_mj_description`.
            frame: frame that touches the ball. The default is `toe`, on the front of the right foot
                (for `simple_humanoid`, whose file shows no foot, at the ankle). Others are `instep`
                (g1, human, romeo), `sole_edge`, the front edge of the sole (these and icub),
                `inside`, `outside` and `heel` (these and talos), and every frame of the file. A
                robot of robot_descriptions has no default, unless its file has a frame `toe`.
            base: `fixed` or `floating`, as for `from_urdf`.
            legs_only: lock all joints but the legs' at 0 (arms of talos aside of its legs), or
                where `locked` has them; of example-robot-data only.
            locked: joints to lock at their values, as for `from_urdf`.
            drives: True for the drives of kickdyn's catalogue (g1, talos, the legs of icub, bolt)
                or of an MJCF, False for no rotors, or other ones, as for `with_drives`.
            facing: axis along which a robot of robot_descriptions faces, as for `from_urdf`.

        Raises:
            InvalidInput: no such robot, frame or base, the package is not installed, a download
                fails, or a joint moves no mass (`romeo` with its fingers).
        """
        validation.mapping("locked", locked)
        if name not in ROBOTS:
            if legs_only:
                raise InvalidInput(f"legs_only is for {', '.join(ROBOTS)}: for {name}, use locked=")
            check_base(base)
            described, folders = find_description(name)
            read = cls.from_mjcf if is_mjcf(described) else cls.from_urdf
            return read(
                described, frame or TOE, base=base, locked=locked, package_dirs=folders,
                drives=drives, facing=facing,
            )  # fmt: skip
        if facing != "x":
            raise InvalidInput(f"facing is {facing!r}: {name} faces x already")
        (file, model), (frame, cone) = read_robot(name, base), ROBOTS[name].contact(frame)
        leg = cls(model, frame, file, contact_normal_cone=cone)
        leg = leg._with_drives_of(drives, catalogued_drives(name)).locked(locked or {})
        prefixes = (*ROBOTS[name].legs, "root_joint")
        outside = [joint for joint in leg.joint_names if not joint.startswith(prefixes)]
        if legs_only and outside:
            angles = {joint: q for joint, q in ROBOTS[name].aside.items() if joint in outside}
            leg = leg.with_model(reduce_model(leg.model, outside, leg.configuration(angles)))
        if fault := _find_fault(leg):
            hint = "" if legs_only else " (legs_only=True keeps the legs' joints)"
            raise InvalidInput(f"{fault}{hint}")
        return leg

    @classmethod
    def from_model(cls, model: Any, frame: str = "") -> "Leg":
        """Return the leg of a copy of a `pin.Model`, with its `armature`.

        Args:
            model: with mass that moves with every joint, on a fixed base or with a
                `JointModelFreeFlyer` as its first joint. Its gravity is (0, 0, -9.81) m/s2, or
                zero, which leaves weight out of joint torques and of the motion in `collide`.
            frame: name of one of its frames.

        Raises:
            InvalidInput: not a model, an unsound inertia or placement, another gravity, or no such
                frame.
        """
        check_is_model(model)
        check_model(model)
        return cls(model, frame)

    def posture(self, q: ArrayLike) -> "Posture":
        """Return the posture at q, as for `check_configuration`, in the joints' range or not."""
        given, workspace, q = q, self.workspace, self.check_configuration(q)
        model, data = workspace.model, workspace.data
        pin.forwardKinematics(model, data, q)
        placement = pin.updateFramePlacement(model, data, self.frame_id)
        placed = placement.homogeneous  # one copy for both
        rotation, origin = placed[:3, :3], placed[:3, 3]
        # Local axes: about the world's origin, a leg far from it would lose its digits.
        inertia: Array = pin.crba(model, data, q, pin.Convention.LOCAL)
        frame_jacobian: Array = pin.computeFrameJacobian(model, data, q, self.frame_id, pin.LOCAL)
        frame_jacobian = frame_jacobian.reshape(6, -1)
        cholesky, bound = cholesky_with_condition(inertia)
        jacobian: Array = rotation.dot(frame_jacobian[:3])
        joint_rotation = workspace.placements[self.contact_joint].homogeneous[:3, :3]
        protect(q, inertia, origin, jacobian, joint_rotation)
        # names of the arguments would take half a microsecond
        kinematics = origin, self.contact_lever, joint_rotation, jacobian
        frame = rotation, origin, frame_jacobian
        posture = Posture(self, q, *kinematics, inertia, None, cholesky, *frame)
        if not bound < MAX_CONDITION and not posture.condition < MAX_CONDITION:
            fault = singularity_fault(model, inertia, posture.condition)
            where = f"q = {q.tolist()}" if self.nq <= MAX_SHOWN_JOINTS else "this posture"
            raise InvalidInput(f"the joint-space inertia of {self.name} at {where} {fault}")
        if self._short_form is not None and look_like_degrees(self, np.asarray(given)):
            posture._doubts = (DEGREES,)  # q itself has no turns of continuous joints
        if self.constraints is not None:
            self.constraints.check_closed(model, data, posture)
            rows, blocks = self.constraints.rows(model, data, q)
            posture.constraint_projector = ConstraintProjector(
                self.constraints, rows, blocks, posture._whiten(rows), posture
            )
        return posture

    def close_loops(self, q: ArrayLike, keep: Iterable[str] = ()) -> Array:
        """Return a configuration near `q` with all loops closed, by Newton's method.

        Only joints between a loop's ends move, in their ranges or not. If that fails, they start
        at 0, and the kept ones are led to their values in small steps.

        Args:
            q: configuration to start from, shape `(nq,)`.
            keep: joints that stay as they are.

        Raises:
            InvalidInput: it cannot be closed from there; the gap that is left, and the rank.
        """
        if isinstance(keep, str) or not isinstance(keep, Iterable):
            raise InvalidInput(f"keep is {keep!r}: it must be a list of joints' names")
        q, fixed = self.check_configuration(q), [self.velocity_index(name) for name in keep]
        if self.constraints is None or not self.constraints.loops:
            return q
        return self.constraints.close_loops(self.workspace.model, self.workspace.data, q, fixed)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines about the file and its missing drives, open loops, and speed limits of 0."""
        file = () if self.file is None else self.file.warnings
        if self.file is not None and self.file.lacks_drives and not self._model.armature.any():
            file = (*file, NO_DRIVES)
        limit = [
            f"speed limit of {name} is 0: a kick that moves it is too fast"
            for name in self.single_joints
            if self.velocity_limit[self.velocity_index(name)] == 0.0
            and 1 + self.joint_names.index(name) in list(self._model.supports[self.contact_joint])
        ]
        return (*file, *self.open_loops, *limit)

    @cached_property
    def open_loops(self) -> tuple[str, ...]:
        """A line for each pair of frames that look like the ends of a loop which is not closed."""
        closed = [] if self.constraints is None else self.constraints.loops
        pairs = {frozenset(loop) for loop in closed}
        return tuple(
            f"{a} and {b} are at one place at q = 0, each at the end of a branch: if they are the "
            f"ends of a loop, close it by with_loops(({a!r}, {b!r})) (--loop {a}:{b})"
            for a, b in find_open_loops(self.workspace.model, self.workspace.data)
            if frozenset((a, b)) not in pairs
        )

    def __repr__(self) -> str:
        return f"Leg({self.name!r}, joints={list(self.joint_names)}, frame={self.frame!r})"

    def _rows(self) -> Iterable[Row]:
        yield "robot", self.name, ""
        yield "contact frame", self.frame, ""
        yield "mass", float(pin.computeTotalMass(self._model)), "kg"
        for name in self.single_joints:
            low, high = (format_value(end) for end in self.joint_range(name))
            yield f"joint {name}", f"{low} to {high}", self.joint_unit(name)
        yield from warned(self.warnings)


@dataclass(eq=False, repr=False)  # not frozen, which would take a microsecond more
class Posture(ReprMixin):
    r"""A leg at a configuration `q`, with its kinematics and inertia; `Leg.posture` makes it.

    With the joint-space inertia M and the Jacobian J of the contact point, an impulse p on the foot
    changes the velocity of the contact point by :math:`J M^{-1} J^T p`. The matrix is named after
    Delassus. With the Cholesky factor of :math:`M = L L^T`, the columns of :math:`L^{-1} J^T` are
    whitened: their inner products are its entries, and constraints are orthogonal projections.

    Attributes:
        leg: the leg.
        q: configuration, shape `(nq,)` [rad; m for prismatic joints].
        contact_point: the contact frame's origin, or `contact_offset` from it, shape `(3,)` [m,
            world frame].
        contact_lever: vector from the contact joint's origin to that point, shape `(3,)` [m, axes
            of the contact joint].
        rotation_world_joint: from axes of the contact joint to world axes, shape `(3, 3)`.
        jacobian: J, of the contact point's velocity :math:`J v`, shape `(3, nv)` [world frame].
        inertia: joint-space inertia M, armature included, shape `(nv, nv)` [kg m2].
        constraint_projector: the leg's constraints at this configuration; None without any.
        contact_offset: position of the contact point in the contact frame [m]; None is its origin.
    """

    leg: Leg
    q: Array
    contact_point: Array
    contact_lever: Array
    rotation_world_joint: Array
    jacobian: Array
    inertia: Array
    constraint_projector: ConstraintProjector | None
    _cholesky: Array
    _frame_rotation: Array
    _frame_origin: Array
    _frame_jacobian: Array
    contact_offset: Array | None = None
    _doubts: tuple[str, ...] = ()
    _whitened: Array | None = field(default=None, init=False)

    @cached_property
    def condition(self) -> float:
        """Condition number of M in the 1-norm, scaled to unit diagonal (LAPACK's estimate).

        Neither a light toe on a heavy leg nor metres beside radians cost the factor digits. It is
        inf if M is not positive definite.
        """
        factor = self._cholesky
        if not (factor.diagonal() > 0.0).all():
            return math.inf
        scale = 1.0 / np.sqrt(self.inertia.diagonal())
        scaled, root = self.inertia * scale * scale[:, None], factor * scale[:, None]
        reciprocal, _ = lapack.dpocon(root, lapack.dlange("1", scaled), uplo="L")
        return 1.0 / float(reciprocal) if reciprocal else math.inf

    @property
    def jacobian_norm(self) -> float:
        """Frobenius norm of the Jacobian J, in its own units."""
        entries = self.jacobian.ravel()
        return math.sqrt(entries.dot(entries))

    @property
    def whitened_jacobian(self) -> Array:
        r"""Return :math:`J L^{-T}` with :math:`M = L L^T`, shape `(3, nv)` [world frame].

        With constraints, it is projected on the velocity jumps that they allow in an impact.
        """
        if self._whitened is None:  # not a cached_property: its lock would take 2 us
            columns = self._whiten(self.jacobian)
            if self.constraint_projector is not None:
                columns = self.constraint_projector.project(columns)
            protect(columns)
            self._whitened = columns.T
        return self._whitened

    def whiten(self, jacobian: ArrayLike) -> Array:
        r"""Return :math:`L^{-1} J^T` of any Jacobian, `(rows, nv)`, as for `whitened_jacobian`."""
        rows = validation.floats("jacobian", jacobian)
        if rows.ndim != 2 or rows.shape[1] != len(self.inertia):
            raise InvalidInput(
                f"jacobian has shape {rows.shape}: it must have rows of length {len(self.inertia)}"
            )
        columns, projector = self._whiten(rows), self.constraint_projector
        return columns if projector is None else projector.project(columns)

    def delassus(self) -> Array:
        r"""Return :math:`J M^{-1} J^T` at the contact point, shape `(3, 3)` [1/kg, world frame]."""
        factor = self.whitened_jacobian
        return np.asarray(factor.dot(factor.T))

    @cached_property
    def rounding_gain(self) -> float:
        r"""Factor by which the relative rounding of M can grow in `delassus`; about 1 as a rule.

        An error of M by e of its diagonal, E, changes the inverse mass along an axis by
        :math:`x^T E x` with :math:`x = M^{-1} J^T`: at most
        :math:`e\,(\sum_i \sqrt{M_{ii}}\,|x_i|)^2`.
        """
        whitened = self.whitened_jacobian.T
        x = blas.dtrsm(1.0, self._cholesky, whitened, lower=1, trans_a=1)
        sums = np.sqrt(self.inertia.diagonal()).dot(abs(x)).tolist()
        squares = (whitened * whitened).sum(axis=0).tolist()
        shares = [a * a / b for a, b in zip(sums, squares, strict=True) if b]
        return max(shares, default=1.0)

    def effective_mass(self, normal: ArrayLike) -> float:
        r"""Return :math:`1 / (n^T J M^{-1} J^T n)` [kg]; inf if the leg cannot move along n.

        Stiff joints hold; `without_stiff_joints` has the effective mass with these joints free.

        Args:
            normal: direction n, shape `(3,)` of any length but zero [world frame].
        """
        row = validation.direction("normal", normal).dot(self.whitened_jacobian)
        inverse = float(row.dot(row))
        return 1.0 / inverse if inverse else math.inf

    def solve(self, joint_impulse: ArrayLike) -> Array:
        r"""Return the velocity jump :math:`M^{-1} f` after a joint-space impulse f, shape `(nv,)`.

        Supports and loops take part. Without them, f may have n columns, and so has the result.
        """
        return self.respond(joint_impulse)[0]

    def respond(self, joint_impulse: ArrayLike) -> tuple[Array, Array]:
        """Return the velocity jump that `solve` returns, and the impulses of supports and loops.

        The impulses are stacked as in `constraint_projector.rows`, shape `(rows,)` [N s, N m s,
        world axes]. Where several sets of them have the same effect, they are the smallest ones.
        """
        free, nv = self.constraint_projector is None, len(self.inertia)
        if free and isinstance(joint_impulse, np.ndarray) and joint_impulse.shape[:-1] == (nv,):
            joint_impulse = validation.floats("joint impulse", joint_impulse)  # one per column
        else:
            joint_impulse = validation.vector("joint impulse", joint_impulse, nv)
        if self.constraint_projector is None:
            v, _ = lapack.dpotrs(self._cholesky, joint_impulse, lower=1)
            return np.asarray(v), np.zeros(0)
        whitened = blas.dtrsv(self._cholesky, joint_impulse, lower=1)
        allowed = self.constraint_projector.project(whitened)
        jump = blas.dtrsv(self._cholesky, allowed, lower=1, trans=1)
        return np.asarray(jump), self.constraint_projector.impulses(whitened)

    def _whiten(self, rows: Array) -> Array:
        # not dtrtrs: OpenBLAS runs it in threads however small, milliseconds on a busy machine;
        # of side=0 and lower=1, the names would take a fifth of the time
        whitened: Array = blas.dtrsm(1.0, self._cholesky, rows.T, 0, 1)
        return whitened

    def with_contact_offset(self, offset: ArrayLike | None) -> "Posture":
        """Return this posture with its contact point elsewhere on the foot.

        Args:
            offset: position in the contact frame, shape `(3,)` [m]; None changes nothing.

        Raises:
            InvalidInput: an entry that is not finite or larger than 1 km.
        """
        if offset is None:
            return self
        arm = validation.vector("contact offset", offset, 3, unit="m")
        for coordinate in arm.tolist():
            # largest distance of a contact point along an axis of the contact frame [m]
            validation.number("contact offset", abs(coordinate), at_most=1e3, unit="m")
        rotation, local = self._frame_rotation, self._frame_jacobian
        lever = rotation @ arm
        return replace(
            self,
            contact_point=read_only(self._frame_origin + lever),
            contact_lever=read_only(self.leg.contact_lever + self.rotation_world_joint.T @ lever),
            jacobian=read_only(rotation @ (local[:3] - pin.skew(arm) @ local[3:])),
            contact_offset=read_only(arm),
        )

    @property
    def without_stiff_joints(self) -> "Posture":
        """This posture with stiff joints free, as before an impact; itself where there are none."""
        # itself is not kept: a posture that refers to itself waits for the garbage collector
        return self._with_stiff_joints_free if self.leg.stiff_joints else self

    @cached_property
    def _with_stiff_joints_free(self) -> "Posture":
        return self.leg.with_stiff_joints().posture(self.q).with_contact_offset(self.contact_offset)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line for each open loop of the leg and for each joint outside its range."""
        outside = [*self.leg.outside_range(self.q), *self._doubts]
        return (*self.leg.open_loops, *dict.fromkeys(outside))

    def effective_mass_limits(self, normal: ArrayLike) -> dict[str, float]:
        r"""Return the effective mass [kg] in the limits between which real drives are, by name.

        `without rotors`: all joints are free, and nothing is behind them. `with rotors`: the rotors
        turn with them, as in a short contact, of a small `drive_number`. `with stiff joints`: no
        joint moves, as in a long contact or with gears that cannot be driven back; inf where the
        base or a foot is fixed.

        Args:
            normal: direction n, shape `(3,)` of any length but zero [world frame].
        """
        leg, n = self.leg, validation.direction("normal", normal)
        bare = leg.without_rotors().with_stiff_joints()
        joints = [leg.velocity_index(name) for name in leg.single_joints]
        base = np.setdiff1d(np.arange(leg.nv), joints)
        stiff = math.inf
        if base.size and not leg.supports:
            row = n @ self.jacobian[:, base]
            stiff = 1.0 / float(row @ np.linalg.solve(self.inertia[np.ix_(base, base)], row))
        without = bare.posture(self.q).with_contact_offset(self.contact_offset)
        return {
            "without rotors": without.effective_mass(n),
            "with rotors": self.without_stiff_joints.effective_mass(n),
            "with stiff joints": stiff,
        }

    def drive_number(self, contact_time: float) -> dict[str, float]:
        r"""Return the dimensionless stiffness of drives in a contact of time T, by joint.

        The number is :math:`T \sqrt{k / M_{jj}}`, the contact time times the natural frequency of
        the joint, whose `Drive` has the stiffness k, with all others at rest. Far below 1, the
        drive is a free one with its rotor; far above, a stiff one.
        """
        time = validation.number("contact time", contact_time, at_least=0, unit="s")
        inertias, index = self.inertia.diagonal(), self.leg.velocity_index
        return {
            joint: time * math.sqrt(drive.stiffness / inertias[index(joint)])
            for joint, drive in self.leg.compliant_drives.items()
        }

    @property
    def transport_velocity(self) -> Array:
        """Velocity that the base gives the contact point, shape `(3,)` [m/s, world frame]."""
        twist = self.leg.base_velocity
        if twist is None:
            return np.zeros(3)
        return twist[:3] + cross3(twist[3:].tolist(), self.contact_point.tolist())

    def point_velocity(self, v: ArrayLike) -> Array:
        """Return the velocity of the contact point, shape `(3,)` [m/s, world frame].

        It is :math:`J v`, plus the `transport_velocity` where the base of the leg moves.
        """
        velocity = self.jacobian @ validation.vector("v", v, self.leg.nv)
        return np.asarray(velocity + self.transport_velocity)

    def joint_velocity(self, point_velocity: ArrayLike) -> Array:
        r"""Return the joint velocity of least kinetic energy for a velocity of the contact point.

        It minimizes :math:`\frac12 v^T M v` under :math:`J v = w`, and is
        :math:`M^{-1} J^T (J M^{-1} J^T)^+ w`, shape `(nv,)` [rad/s; m/s for prismatic joints].
        Where the base moves, w is less by the `transport_velocity` in these formulas.

        Args:
            point_velocity: velocity w of the contact point, shape `(3,)` [m/s, world frame].

        Raises:
            InvalidInput: the contact point cannot move in that direction, or not so fast.
        """
        wish = validation.vector("point velocity", point_velocity, 3, unit="m/s")
        v, missed, is_possible = self._least_energy_velocity(wish)
        if not is_possible:
            noise = 1e-12 * np.abs(wish).max()
            nearest = [float(f"{x:.10g}") if abs(x) > noise else 0.0 for x in wish - missed]
            raise InvalidInput(
                f"point velocity {wish.tolist()} m/s is out of reach of {self!r}: its contact "
                f"point cannot move in that direction there; the nearest velocity is {nearest} m/s"
            )
        if not np.isfinite(v).all():
            raise InvalidInput(
                f"point velocity {wish.tolist()} m/s is too fast: the joint velocities of {self!r} "
                "exceed the range of float64"
            )
        return v

    def try_joint_velocity(self, wish: ArrayLike) -> Array | None:
        """Return the result of `joint_velocity`, or None if it would raise `InvalidInput`."""
        wish = validation.vector("point velocity", wish, 3, unit="m/s")
        v, _, is_possible = self._least_energy_velocity(wish)
        return v if is_possible and np.isfinite(v).all() else None

    def _least_energy_velocity(self, wish: Array) -> tuple[Array, Array, bool]:
        """Return v for the nearest possible velocity, the residual [m/s], and whether it is 0."""
        wish = wish - self.transport_velocity
        before = self.without_stiff_joints.whitened_jacobian
        left, gains, right = np.linalg.svd(before, full_matrices=False)
        usable = gains > 1e-12 * gains[0] if gains[0] > 0 else gains > 0
        with np.errstate(over="ignore", invalid="ignore"):  # callers report what is not finite
            share = np.divide(left.T @ wish, gains, out=np.zeros_like(gains), where=usable)
            v: Array = blas.dtrsv(self._cholesky, right.T @ share, lower=1, trans=1)
            missed = wish - self.jacobian @ v
            is_possible = not np.abs(missed).max() > 1e-9 * np.abs(wish).max()
        return v, missed, bool(is_possible)

    def admissible(self, v: ArrayLike) -> Array:
        """Return the velocity, `(nv,)`, that constraints allow, nearest to v by kinetic energy."""
        v = validation.vector("v", v, self.leg.nv)
        projector = self.without_stiff_joints.constraint_projector
        if projector is None:
            return v
        # M v = L L^T v: the projection of L^T v loses the constraints' share
        whitened = blas.dtrmv(self._cholesky, v, lower=1, trans=1)
        allowed = projector.project(whitened)
        return np.asarray(blas.dtrsv(self._cholesky, allowed, lower=1, trans=1))

    def check_velocity(self, v: Array) -> None:
        """Raise `InvalidInput` if a joint velocity, `(nv,)`, moves a support or opens a loop."""
        projector = self.without_stiff_joints.constraint_projector
        violation = None if projector is None else projector.find_violation(v)
        if violation is not None:
            name, speed, unit = violation
            raise InvalidInput(
                f"v moves {name}, a constraint of the leg, at {speed:.3g} {unit} in {self!r}: "
                "Posture.admissible(v) gives the nearest velocity that does not"
            )

    def __repr__(self) -> str:
        angles = ", ".join(f"{angle:.4g}" for angle in self.q)
        return f"Posture({self.leg.name}, q=[{angles}])"

    def _rows(self) -> Iterable[Row]:
        yield "leg", self.leg.name, ""
        joints = self.leg.display_values(self.q).items()
        shown = [(name, *x) for name, x in joints if x[0] or len(joints) <= MAX_SHOWN_JOINTS]
        yield from shown[:MAX_SHOWN_JOINTS]
        if len(shown) > MAX_SHOWN_JOINTS:
            yield "and", f"{len(shown) - MAX_SHOWN_JOINTS} joints more", ""
        if self.leg.stiff_joints:
            yield "stiff joints", ", ".join(self.leg.stiff_joints), ""
        yield "contact point", self.contact_point, "m"
        yield "condition", self.condition, ""
        yield from warned(self.warnings)


def read_leg(
    path: str | PathLike[str],
    frame: str | None,
    base: str,
    package_dirs: Sequence[str | PathLike[str]] = (),
    locked: Mapping[str, float] | None = None,
    drives: Drives | bool = True,
    facing: str = "x",
) -> Leg:
    """Return the leg of a URDF or MJCF file; joints are `locked` at values in degrees or metres."""
    read = Leg.from_mjcf if is_mjcf(path) else Leg.from_urdf
    return read(
        path, frame or TOE, base=base, package_dirs=package_dirs, locked=InDegrees(locked or {}),
        drives=drives, facing=facing,
    )  # fmt: skip


def _find_fault(leg: Leg) -> str:
    """Return the fault of a leg that was read; empty if it has a straight or a bent posture."""
    faults = []
    for step in (np.zeros(leg.nv), 0.3 + 0.1 * np.cos(range(leg.nv))):
        try:
            check_model(leg.model)
            leg.posture(pin.integrate(leg.workspace.model, leg.configuration(), step))
        except InvalidInput as error:
            faults.append(str(error))
        else:
            return ""
    return faults[0]
