"""From an MJCF model that MuJoCo compiled to a Pinocchio model, with MuJoCo's inertia.

Pinocchio has a reader of MJCF of its own, which tests use as a peer. It is not used here because it
merges the joints of a body into one without names, ignores settings such as `settotalmass`, takes
ranges of sliding joints for degrees, and reads one tree of bodies only, all without a word.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core.gravity import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.mjcf_file import body_name
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.urdf_file import check_base

SAME = 1e-9
"""Largest relative difference of a joint-space inertia from MuJoCo's."""


def build_mjcf_model(compiled: Any, name: str, frame: str, base: str) -> Any:
    """Return the `pin.Model` of the tree of bodies that moves a frame.

    Its q is MuJoCo's `qpos` of these joints with quaternions in the order xyzw. The linear velocity
    of a free joint is in the base's axes (in MuJoCo the world's).

    Args:
        compiled: a `mujoco.MjModel`.
        name: of the robot.
        frame: a body, site or geom.
        base: `fixed` welds the root body to the world where the file places it, `floating` gives it
            a free joint, `root_joint` if the file has none.

    Raises:
        InvalidInput: no such frame or base, the frame does not move, gravity is not the ball's, or
            the model is none that MuJoCo's mass matrix confirms.
    """
    check_base(base)
    builder = _Builder(compiled, name, base)
    root = _root_of(compiled, frame)
    if root is None:  # the error names all frames
        model = builder.build(range(1, compiled.nbody))
        number = frame_id(model, frame)
        raise InvalidInput(
            f"frame {model.frames[number].name!r} is fixed to the base: a kick must move it"
        )
    model = builder.build([b for b in range(1, compiled.nbody) if compiled.body_rootid[b] == root])
    builder.compare(model)
    return model


def _root_of(compiled: Any, frame: str) -> int | None:
    """Return the root of the tree that moves a body, site or geom; None if there is no such one."""
    import mujoco

    for kind, bodies in (
        (mujoco.mjtObj.mjOBJ_BODY, range(compiled.nbody)),
        (mujoco.mjtObj.mjOBJ_SITE, compiled.site_bodyid),
        (mujoco.mjtObj.mjOBJ_GEOM, compiled.geom_bodyid),
    ):
        number = mujoco.mj_name2id(compiled, kind, frame)
        if number >= 0:
            body = int(bodies[number])
            return int(compiled.body_rootid[body]) if compiled.body_weldid[body] else None
    return None


class _Builder:
    """Turns compiled bodies into a `pin.Model`."""

    def __init__(self, compiled: Any, name: str, base: str) -> None:
        self.compiled, self.name, self.base = compiled, name, base

    def build(self, bodies: Sequence[int]) -> Any:
        """Return the model of some bodies, each after the one that carries it."""
        compiled, model = self.compiled, pin.Model()
        model.name = self.name
        model.gravity = pin.Motion(np.array([*_gravity(compiled), 0.0, 0.0, 0.0]))
        self.columns: list[tuple[int, int, int, int]] = []  # joint: kind, qpos, dof, number
        self.names = {compiled.joint(j).name for j in range(compiled.njnt)}
        places: dict[int, tuple[int, Any]] = {0: (0, pin.SE3.Identity())}  # joint, body in it
        frames: dict[int, int] = {0: 0}
        for body in bodies:
            parent = int(compiled.body_parentid[body])
            joint, place = places.get(parent, places[0])
            place = place * _pose(compiled.body_pos[body], compiled.body_quat[body])
            joint, place = self._add_joints(model, body, joint, place)
            places[body] = joint, place
            inertia = pin.Inertia(
                float(compiled.body_mass[body]), np.zeros(3), np.diag(compiled.body_inertia[body])
            )
            centre = _pose(compiled.body_ipos[body], compiled.body_iquat[body])
            model.appendBodyToJoint(joint, inertia, place * centre)
            frames[body] = model.addBodyFrame(
                body_name(compiled, body), joint, place, frames.get(parent, 0)
            )
        self._add_frames(model, places, frames)
        self._set_limits(model)
        return model

    def _add_joints(self, model: Any, body: int, joint: int, place: Any) -> tuple[int, Any]:
        """Add the joints of a body; return the last one and the body's pose in it."""
        compiled = self.compiled
        first = int(compiled.body_jntadr[body])
        numbers = range(first, first + int(compiled.body_jntnum[body]))
        root = not compiled.body_parentid[body]
        free = any(compiled.jnt_type[number] == 0 for number in numbers)
        if root and self.base == "floating" and not free:
            name = self._free_name("root_joint")
            joint = model.addJoint(joint, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
            model.addJointFrame(joint)
            self.columns.append((0, -1, -1, joint))
            place = pin.SE3.Identity()
        for number in numbers:
            kind = int(compiled.jnt_type[number])
            if kind == 0 and self.base == "fixed":
                continue
            anchor = pin.SE3(np.eye(3), compiled.jnt_pos[number].copy())
            at = int(compiled.jnt_qposadr[number])
            axis, start = compiled.jnt_axis[number].copy(), 0.0
            if kind == 0:
                place, anchor = pin.SE3.Identity(), pin.SE3.Identity()
            elif kind != 1:
                start = float(compiled.qpos0[at])
            before = place * anchor
            if kind == 2:
                before = before * pin.SE3(np.eye(3), -start * axis)
            elif kind == 3:
                before = before * pin.SE3(pin.exp3(-start * axis), np.zeros(3))
            name = compiled.joint(number).name or self._free_name(
                "root_joint" if kind == 0 else f"{body_name(compiled, body)}_joint"
            )
            joint = model.addJoint(joint, _JOINTS[kind](axis), before, name)
            model.addJointFrame(joint)
            self.columns.append((kind, at, int(compiled.jnt_dofadr[number]), joint))
            place = anchor.inverse()
        return joint, place

    def _free_name(self, wish: str) -> str:
        """Return a joint name that is not in use."""
        name, count = wish, 1
        while name in self.names:
            count += 1
            name = f"{wish}{count}"
        self.names.add(name)
        return name

    def _add_frames(
        self, model: Any, places: dict[int, tuple[int, Any]], frames: dict[int, int]
    ) -> None:
        """Add a frame for each site and geom that has a name of its own."""
        compiled = self.compiled
        taken = {frame.name for frame in model.frames if frame.type != pin.FrameType.JOINT}
        for kind, count in (("site", compiled.nsite), ("geom", compiled.ngeom)):
            for number in range(count):
                one = getattr(compiled, kind)(number)
                body = int(one.bodyid[0])
                if not one.name or one.name in taken or body not in frames:
                    continue
                taken.add(one.name)
                joint, place = places[body]
                place = place * _pose(one.pos, one.quat)
                frame = pin.Frame(one.name, joint, frames[body], place, pin.FrameType.OP_FRAME)
                model.addFrame(frame, False)

    def _set_limits(self, model: Any) -> None:
        """Set ranges, torque limits and rotor inertias."""
        compiled = self.compiled
        lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
        effort, armature = np.full(model.nv, math.inf), np.zeros(model.nv)
        limits = effort_limits(compiled)
        for kind, _, dof, joint in self.columns:
            q, v, size = model.idx_qs[joint], model.idx_vs[joint], model.nvs[joint]
            if dof < 0:
                continue
            armature[v : v + size] = compiled.dof_armature[dof : dof + size]
            if kind in (2, 3):
                number = int(compiled.dof_jntid[dof])
                ends = compiled.jnt_range[number] if compiled.jnt_limited[number] else _UNLIMITED
                lower[q], upper[q] = ends
                effort[v] = limits[number]
        model.lowerPositionLimit, model.upperPositionLimit = lower, upper
        model.velocityLimit, model.effortLimit = np.full(model.nv, math.inf), effort
        model.armature = armature

    def compare(self, model: Any) -> None:
        """Raise `InvalidInput` unless mass and joint-space inertia are those that MuJoCo computes.

        At three configurations of all joints, always the same ones.
        """
        import mujoco

        compiled, data = self.compiled, mujoco.MjData(self.compiled)
        dofs = [d + k for _, _, d, j in self.columns if d >= 0 for k in range(model.nvs[j])]
        known = [
            model.idx_vs[j] + k
            for _, _, d, j in self.columns
            if d >= 0
            for k in range(model.nvs[j])
        ]
        draw = np.random.default_rng(0)
        for _ in range(3):
            q = pin.integrate(model, pin.neutral(model), draw.uniform(-1.0, 1.0, model.nv))
            data.qpos[:] = compiled.qpos0
            turns = np.eye(model.nv)
            for kind, at, _, joint in self.columns:
                part = q[model.idx_qs[joint] : model.idx_qs[joint] + model.nqs[joint]]
                if kind == 0:
                    v = model.idx_vs[joint]
                    turns[v : v + 3, v : v + 3] = pin.Quaternion(part[3:]).matrix()
                    part = np.array([*part[:3], part[6], *part[3:6]])
                elif kind == 1:
                    part = np.array([part[3], *part[:3]])
                if at >= 0:
                    data.qpos[at : at + len(part)] = part
            mujoco.mj_kinematics(compiled, data)
            mujoco.mj_comPos(compiled, data)
            mujoco.mj_crb(compiled, data)
            theirs = np.zeros((len(dofs), len(dofs)))
            for column, dof in enumerate(dofs):
                unit, moved = np.zeros(compiled.nv), np.zeros(compiled.nv)
                unit[dof] = 1.0
                mujoco.mj_mulM(compiled, data, moved, unit)
                theirs[:, column] = moved[dofs]
            # MuJoCo's linear velocity of a free joint is in world axes, Pinocchio's in the body's
            turn = turns[np.ix_(known, known)]
            theirs = turn.T @ theirs @ turn
            ours = pin.crba(model, pin.Data(model), q, pin.Convention.LOCAL)[np.ix_(known, known)]
            scale = np.sqrt(np.outer(theirs.diagonal(), theirs.diagonal()))
            wrong = ~(np.abs(ours - theirs) <= SAME * scale)
            if wrong.any():
                first = known[int(np.argwhere(wrong)[0][0])]
                joint = [n for n, v in zip(model.names, model.idx_vs, strict=True) if v <= first][
                    -1
                ]
                raise InvalidInput(
                    f"the joint-space inertia differs from MuJoCo's, at joint {joint!r} first: the "
                    "model has something that this reader does not know (such as the armature of "
                    "a tendon)"
                )


def effort_limits(compiled: Any) -> Array:
    """Return the largest torque or force at every joint, shape `(njnt,)` [N m or N].

    It is the smaller one of what the joint allows (`actuatorfrcrange`) and what its actuators
    can exert: gear times `forcerange`, or for motors without one, gear times gain times
    `ctrlrange`. A range with unequal ends counts with the smaller one; inf is no limit.
    """
    import mujoco

    reach = np.zeros(compiled.njnt)
    driven = np.zeros(compiled.njnt, dtype=bool)
    joints = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    direct = (
        int(mujoco.mjtGain.mjGAIN_FIXED),
        int(mujoco.mjtBias.mjBIAS_NONE),
        int(mujoco.mjtDyn.mjDYN_NONE),
    )
    for number in range(compiled.nu):
        if compiled.actuator_trntype[number] not in joints:
            continue
        joint = int(compiled.actuator_trnid[number, 0])
        force = math.inf
        if compiled.actuator_forcelimited[number]:
            force = float(np.abs(compiled.actuator_forcerange[number]).min())
        kinds = (compiled.actuator_gaintype, compiled.actuator_biastype, compiled.actuator_dyntype)
        if (
            tuple(int(kind[number]) for kind in kinds) == direct
            and compiled.actuator_ctrllimited[number]
        ):
            control = float(np.abs(compiled.actuator_ctrlrange[number]).min())
            force = min(force, abs(float(compiled.actuator_gainprm[number, 0])) * control)
        driven[joint] = True
        reach[joint] += force * abs(float(compiled.actuator_gear[number, 0]))
    reach[~driven] = math.inf
    allowed = np.abs(compiled.jnt_actfrcrange).min(axis=1)
    return np.where(compiled.jnt_actfrclimited, np.minimum(reach, allowed), reach)


_UNLIMITED = (-math.inf, math.inf)


def _aligned(unaligned: Any, *aligned: Any) -> Callable[[Array], Any]:
    """Return a function from an axis to a joint, one along x, y or z if the axis is."""

    def joint(axis: Array) -> Any:
        """Return the joint about or along an axis."""
        along = np.flatnonzero(axis)
        if len(along) == 1 and axis[along[0]] == 1.0:
            return aligned[along[0]]()
        return unaligned(axis)

    return joint


_JOINTS: dict[int, Callable[[Array], Any]] = {
    0: lambda _: pin.JointModelFreeFlyer(),
    1: lambda _: pin.JointModelSpherical(),
    2: _aligned(
        pin.JointModelPrismaticUnaligned, pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ
    ),
    3: _aligned(
        pin.JointModelRevoluteUnaligned, pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
    ),
}
"""Joints by MuJoCo's `jnt_type`: free, ball, slide, hinge."""


def _pose(position: Array, quaternion: Array) -> Any:
    """Return a placement from a position [m] and MuJoCo's quaternion (wxyz)."""
    w, x, y, z = (float(part) for part in quaternion)
    turn = pin.Quaternion(w, x, y, z)
    turn.normalize()
    return pin.SE3(turn.matrix(), np.array(position, dtype=float))


def _gravity(compiled: Any) -> list[float]:
    """Return the acceleration of gravity, the ball's or zero; raise `InvalidInput` for another."""
    import mujoco

    disabled = int(compiled.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity = [0.0] * 3 if disabled else [float(part) + 0.0 for part in compiled.opt.gravity]
    if gravity not in ([0.0, 0.0, -GRAVITY], [0.0] * 3):
        raise InvalidInput(
            f"gravity of the model is {gravity}: it must be (0, 0, -{GRAVITY:g}) m/s2, with which "
            "the ball flies, or zero (<option gravity=...>)"
        )
    return gravity
