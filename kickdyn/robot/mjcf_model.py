"""From an MJCF model that MuJoCo compiled to a Pinocchio model.

Pinocchio has a reader of MJCF of its own, which tests use as a peer. It is not used here because it
merges the joints of a body into one without names, ignores settings such as `settotalmass`, takes
ranges of sliding joints for degrees, and reads one tree of bodies only, all without a word.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from kickdyn.core.validation import Array, check_type
from kickdyn.errors import InvalidInput, MjcfError
from kickdyn.robot.joint_table import Mimic, resolve_mimics
from kickdyn.robot.mjcf_file import MjcfFile, body_name, find_body, mujoco_pose
from kickdyn.robot.model_validation import MAX_MAGNITUDE
from kickdyn.robot.names import expand_patterns, listed
from kickdyn.robot.urdf_file import check_base

FREE, BALL, SLIDE, HINGE = range(4)
"""Values of MuJoCo's `jnt_type`."""

JOINTS = {SLIDE: pin.JointModelPrismaticUnaligned, HINGE: pin.JointModelRevoluteUnaligned}
"""Pinocchio's joints with an axis by `jnt_type`."""

ACTUATED_JOINTS = (0, 1)
"""MuJoCo's `mjTRN_JOINT` and `mjTRN_JOINTINPARENT`, of actuators that act on a joint."""


def build_mjcf_model(
    file: MjcfFile, frame: str, base: str, locked: Mapping[str, float] | None
) -> tuple[MjcfFile, Any, list[tuple[str, str]]]:
    """Return the file with what was read of it, its `pin.Model`, and the ends of its loops.

    The model has the tree of bodies that moves a body, site or geom, the `frame`; all bodies
    without one of this name that moves. How joints are constrained that are to be `locked` does not
    matter.
    """
    check_base(base)
    check_type(str, frame=frame)  # MuJoCo crashes on None
    compiled = file.compile()
    bodies, body = range(1, compiled.nbody), find_body(compiled, frame)
    root = compiled.body_rootid[body] if body >= 0 and compiled.body_weldid[body] else None
    robot_bodies = [body for body in bodies if root in (None, compiled.body_rootid[body])]
    try:
        builder = _Builder(compiled, file.name, base, robot_bodies, locked or ())
    except InvalidInput as fault:
        raise MjcfError(file.source, [str(fault)]) from None
    moving = (body for body in bodies if body not in robot_bodies and compiled.body_weldid[body])
    left_out = listed([body_name(compiled, body) for body in moving], 5)
    warning = f"bodies attached to another root are left out: {left_out}"
    passive = set[int]()
    if compiled.nu and np.isin(compiled.actuator_trntype, ACTUATED_JOINTS).all():
        passive = set(range(compiled.njnt)).difference(compiled.actuator_trnid[:, 0].tolist())
    read = replace(
        file,
        mimics=tuple(builder.mimics),
        warnings=(warning,) if left_out else (),
        passive_joints=tuple(compiled.joint(joint).name for joint in sorted(passive)),
    )
    return read, builder.model, builder.loops


class _Builder:
    """Turns compiled bodies, each after the one that carries it, into a `pin.Model`.

    Placements are differences of the poses that MuJoCo computes with all joints at 0, and free
    joints and ball joints where the file places them.
    """

    def __init__(
        self, compiled: Any, name: str, base: str, bodies: Sequence[int], locked: Iterable[str]
    ) -> None:
        import mujoco

        self.compiled, self.base, self.data = compiled, base, mujoco.MjData(compiled)
        self.data.qpos[compiled.jnt_qposadr[compiled.jnt_type >= SLIDE]] = 0.0
        mujoco.mj_kinematics(compiled, self.data)
        self.model = pin.Model()
        self.model.name = name
        if compiled.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
            self.model.gravity = pin.Motion.Zero()
        else:
            self.model.gravity = pin.Motion(compiled.opt.gravity.copy(), np.zeros(3))
        self.origins = [pin.SE3.Identity()]  # of each joint of the model in the world
        self.numbers: dict[int, int] = {}  # MuJoCo's number of a joint by the model's
        self.taken = {compiled.joint(joint).name for joint in range(compiled.njnt)}
        self.frames: dict[int, int] = {}  # of a body
        self.framed: set[str] = set()
        for body in bodies:
            self._add_body(body)
        for kind, size in (("site", compiled.nsite), ("geom", compiled.ngeom)):
            for element in map(getattr(compiled, kind), range(size)):
                body, seen = int(element.bodyid[0]), getattr(self.data, kind)(element.id)
                if element.name and body in self.frames:
                    self._add_frame(element.name, body, seen.xpos, seen.xmat)
        self._set_limits()
        self.locked = expand_patterns(dict.fromkeys(locked, 0.0), sorted(self.taken))
        added = len(self.numbers) < self.model.njoints - 1  # a floating base
        roots = [
            str(self.model.names[joint])
            for joint, theirs in self.numbers.items()
            if added and not compiled.body_parentid[compiled.jnt_bodyid[theirs]]
        ]
        if moving := [name for name in roots if name not in self.locked]:
            raise InvalidInput(
                f"base is 'floating', but joints of the file ({', '.join(moving)}) move its root "
                "body already, and are its base: read it with base='fixed' (in commands, without "
                "--support), or lock them (locked=, --lock)"
            )
        self.loops: list[tuple[str, str]] = []
        self.mimics: list[Mimic] = []
        self._add_constraints()
        resolve_mimics(self.mimics)  # refuses joints that mimic each other

    def _place(self, joint: int, position: Array, rotation: Array) -> Any:
        return self.origins[joint].actInv(_pose(position, rotation))

    def _add_body(self, body: int) -> None:
        compiled, data = self.compiled, self.data
        parent, name = int(compiled.body_parentid[body]), body_name(compiled, body)
        for key in ("mass", "inertia", "ipos", "pos"):  # pin.Inertia refuses larger ones
            if not np.abs(getattr(compiled, f"body_{key}")[body]).max() < MAX_MAGNITUDE:
                raise InvalidInput(
                    f"body {name!r} has a mass, moment or position that is not below "
                    f"{MAX_MAGNITUDE:g}"
                )
        joint = self._add_joints(body, self._joint_of(parent) if parent in self.frames else 0)
        moments = np.diag(compiled.body_inertia[body])
        inertia = pin.Inertia(float(compiled.body_mass[body]), np.zeros(3), moments)
        centre = self._place(joint, data.xipos[body], data.ximat[body])
        self.model.appendBodyToJoint(joint, inertia, centre)
        if name in self.framed:
            raise InvalidInput(f"two bodies are called {name!r}: name all bodies")
        self.framed.add(name)
        place = self._place(joint, data.xpos[body], data.xmat[body])
        self.frames[body] = self.model.addBodyFrame(name, joint, place, self.frames.get(parent, 0))

    def _joint_of(self, body: int) -> int:
        return int(self.model.frames[self.frames[body]].parentJoint)

    def _add_joints(self, body: int, joint: int) -> int:
        """Add the joints of a body, which the given one carries; return the last one."""
        compiled, name = self.compiled, body_name(self.compiled, body)
        index = int(compiled.body_jntadr[body])
        numbers = range(index, index + int(compiled.body_jntnum[body]))
        kinds = [int(compiled.jnt_type[number]) for number in numbers]
        if self.base == "floating" and not compiled.body_parentid[body]:
            theirs = index if FREE in kinds else -1
            start = mujoco_pose(compiled.body_pos[body], compiled.body_quat[body])
            turn = pin.SE3(start.rotation, np.zeros(3))  # at q = 0, it is turned as in the file
            base = pin.JointModelFreeFlyer(), turn, "root_joint"
            joint = self._add_joint(joint, theirs, start, *base)
        for number, kind in zip(numbers, kinds, strict=True):
            if kind == FREE:
                continue
            start = float(compiled.qpos0[compiled.jnt_qposadr[number]])  # `ref`, where it is drawn
            if not abs(start) < MAX_MAGNITUDE:
                raise InvalidInput(f"a joint of body {name!r} has ref {start:g}")
            origin = _pose(self.data.xanchor[number], self.data.xmat[body])
            axis = origin.rotation.T @ self.data.xaxis[number]
            described = pin.JointModelSpherical() if kind == BALL else JOINTS[kind](axis)
            place = self.origins[joint].actInv(origin)
            joint = self._add_joint(joint, number, origin, described, place, f"{name}_joint")
        return joint

    def _add_joint(
        self, parent: int, theirs: int, origin: Any, described: Any, place: Any, wish: str
    ) -> int:
        """Add a joint under its own name, or the wish if it has none; return its number."""
        own_name = self.compiled.joint(theirs).name if theirs >= 0 else ""
        numbered = (f"{wish}{k}" for k in count(2))
        name = own_name or next(name for name in chain((wish,), numbered) if name not in self.taken)
        self.taken.add(name)
        number = int(self.model.addJoint(parent, described, place, name))
        self.model.addJointFrame(number)
        self.origins.append(origin)
        if theirs >= 0:
            self.numbers[number] = theirs
        return number

    def _add_frame(self, name: str, body: int, position: Array, rotation: Array) -> None:
        """Add a frame fixed to a body at a pose in the world, unless its name is taken."""
        if name not in self.framed:
            self.framed.add(name)
            joint = self._joint_of(body)
            place = self._place(joint, position, rotation)
            frame = pin.Frame(name, joint, self.frames[body], place, pin.FrameType.OP_FRAME)
            self.model.addFrame(frame, False)

    def _set_limits(self) -> None:
        compiled, model = self.compiled, self.model
        lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
        effort, armature = np.full(model.nv, math.inf), np.zeros(model.nv)
        limits = effort_limits(compiled)
        for joint, theirs in self.numbers.items():
            q, v, size = model.idx_qs[joint], model.idx_vs[joint], model.nvs[joint]
            dof = int(compiled.jnt_dofadr[theirs])
            armature[v : v + size] = compiled.dof_armature[dof : dof + size]
            if size == 1:
                limited = compiled.jnt_limited[theirs]
                lower[q], upper[q] = (
                    compiled.jnt_range[theirs] if limited else (-math.inf, math.inf)
                )
                effort[v] = limits[theirs]
        model.lowerPositionLimit, model.upperPositionLimit = lower, upper
        model.velocityLimit, model.effortLimit = np.full(model.nv, math.inf), effort
        model.armature = armature

    def _add_constraints(self) -> None:
        """Add loops and mimics; raise `InvalidInput` for others on joints that are not locked."""
        import mujoco

        compiled = self.compiled
        if compiled.tendon_armature.any():
            raise InvalidInput("a tendon has an armature, which is not read: remove it")
        for number in range(compiled.neq):
            kind = mujoco.mjtEq(int(compiled.eq_type[number]))
            first, second = int(compiled.eq_obj1id[number]), int(compiled.eq_obj2id[number])
            name = compiled.equality(number).name or f"equality{number}"
            sites = int(compiled.eq_objtype[number]) == int(mujoco.mjtObj.mjOBJ_SITE)
            if kind == mujoco.mjtEq.mjEQ_JOINT:
                ends = [end for end in (first, second) if end >= 0]
                bodies = [int(compiled.jnt_bodyid[end]) for end in ends]
                idle = all(compiled.joint(end).name in self.locked for end in ends)
            else:
                idle = False
                bodies = [int(compiled.site_bodyid[e]) if sites else e for e in (first, second)]
            kinds = (mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
            robot_bodies = [body for body in bodies if body in self.frames or kind not in kinds]
            if idle or not robot_bodies or not compiled.eq_active0[number]:
                continue
            values = compiled.eq_data[number]
            if kind == mujoco.mjtEq.mjEQ_CONNECT and len(robot_bodies) == 2:
                self.loops.append((f"{name}_1", f"{name}_2"))
                for k, (end, body) in enumerate(zip((first, second), bodies, strict=True)):
                    seen = self.data.site(end) if sites else self.data.body(body)
                    offset = np.zeros(3) if sites else values[3 * k : 3 * k + 3]
                    anchor = seen.xpos + seen.xmat.reshape(3, 3) @ offset
                    self._add_frame(f"{name}_{k + 1}", body, anchor, seen.xmat)
            elif kind == mujoco.mjtEq.mjEQ_JOINT and len(robot_bodies) == 2:
                self._couple(first, second, Polynomial(values[:5]))
            else:
                what = kind.name.removeprefix("mjEQ_").lower()
                remedy = "lock its joints (locked=, --lock), " if "joint" in what else ""
                raise InvalidInput(
                    f"equality constraint {name!r} ({what}) is not read: only <connect> of two "
                    "bodies of the robot and <joint> with two joints are; "
                    f'{remedy}remove it, or set active="false"'
                )

    def _couple(self, first: int, second: int, polynomial: Polynomial) -> None:
        """Let a joint follow another one; both count from their `ref` in MuJoCo."""
        start, address = self.compiled.qpos0, self.compiled.jnt_qposadr
        joint, driver = (str(self.compiled.joint(number).name) for number in (first, second))
        others = [mimic.driver for mimic in self.mimics if mimic.joint == joint]
        if not joint or not driver or others:
            what = f"joint {joint!r} mimics {' and '.join(map(repr, [*others, driver]))}"
            valid = "a joint can mimic one" if others else "both must have a name"
            ends = [f"{name!r}: 0" for name in (joint, *others, driver) if name]
            lock = f"lock them, locked={{{', '.join(ends)}}} or --lock NAME=VALUE each"
            raise InvalidInput(f"{what}: {valid}; {lock if joint and driver else 'name them'}")
        since_ref = Polynomial([-float(start[address[second]]), 1.0])
        follows = polynomial(since_ref) + float(start[address[first]])
        self.mimics.append(Mimic.of(joint, driver, follows))


def _pose(position: Array, rotation: Array) -> Any:
    return pin.SE3(rotation.reshape(3, 3), position)


def effort_limits(compiled: Any) -> Array:
    """Return the largest torque of each joint, `(njnt,)` [N m or N], as `Leg.from_mjcf` says."""
    reach, driven = np.zeros(compiled.njnt), np.zeros(compiled.njnt, dtype=bool)
    for number in range(compiled.nu):
        if compiled.actuator_trntype[number] not in ACTUATED_JOINTS:
            continue
        joint, force = int(compiled.actuator_trnid[number, 0]), math.inf
        if compiled.actuator_forcelimited[number]:
            force = float(np.abs(compiled.actuator_forcerange[number]).min())
        kinds = (compiled.actuator_gaintype, compiled.actuator_biastype, compiled.actuator_dyntype)
        is_motor = not any(kind[number] for kind in kinds)  # mjGAIN_FIXED, mjBIAS_NONE, mjDYN_NONE
        if is_motor and compiled.actuator_ctrllimited[number]:
            control = float(np.abs(compiled.actuator_ctrlrange[number]).min())
            force = min(force, abs(float(compiled.actuator_gainprm[number, 0])) * control)
        driven[joint] = True
        reach[joint] += force * abs(float(compiled.actuator_gear[number, 0]))
    reach[~driven] = math.inf
    allowed = np.abs(compiled.jnt_actfrcrange).min(axis=1)
    return np.where(compiled.jnt_actfrclimited, np.minimum(reach, allowed), reach)


def mujoco_state(model: Any, q: Array, v: Array, compiled: Any = None) -> tuple[Array, Array]:
    """Return `qpos` and `qvel` of MuJoCo for q and v of a `pin.Model`.

    Quaternions are wxyz there, a floating base moves in the world's axes, and joints without limits
    have one angle. `compiled` is a `mujoco.MjModel` with joints of the same names, whose other
    joints are where it begins with them. Without it, joints follow each other as in the model,
    depth first, as MuJoCo numbers them where a file has the model's bodies.
    """
    states: dict[int, tuple[Array, Array]] = {}
    for joint in range(1, model.njoints):
        positions = q[model.idx_qs[joint] : model.idx_qs[joint] + model.nqs[joint]]
        velocities = v[model.idx_vs[joint] : model.idx_vs[joint] + model.nvs[joint]]
        if model.nqs[joint] == 7:
            place = model.jointPlacements[joint] * pin.XYZQUATToSE3(positions)
            positions = pin.SE3ToXYZQUAT(place)[[0, 1, 2, 6, 3, 4, 5]]
            velocities = np.concatenate([place.rotation @ velocities[:3], velocities[3:]])
        elif model.nqs[joint] == 4:
            positions = positions[[3, 0, 1, 2]]
        elif model.nqs[joint] == 2:  # cosine and sine of a continuous joint
            positions = np.array([math.atan2(positions[1], positions[0])])
        states[joint] = positions, velocities
    if compiled is None:
        qpos, qvel = (np.concatenate(parts) for parts in zip(*states.values(), strict=True))
        return qpos, qvel
    qpos, qvel = compiled.qpos0.copy(), np.zeros(compiled.nv)
    for joint, (positions, velocities) in states.items():
        number = compiled.joint(model.names[joint]).id
        q_start, v_start = compiled.jnt_qposadr[number], compiled.jnt_dofadr[number]
        qpos[q_start : q_start + len(positions)] = positions
        qvel[v_start : v_start + len(velocities)] = velocities
    return qpos, qvel
