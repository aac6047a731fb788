"""Changed copies of Pinocchio models: joints locked, turned, rerooted, or with other coordinates.

The joints of each subtree keep consecutive indices: for another order, Pinocchio returns wrong
inertias without an error.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.core.mechanics import rotation_between
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput

PRISMATIC, REVOLUTE = "JointModelP", "JointModelR"
"""Beginnings of the names of Pinocchio's joints that slide along an axis or turn about one."""


def reduce_model(model: Any, joints: Iterable[str], q: Array) -> Any:
    """Return a model with joints, by name, locked as they are at `q`, shape `(nq,)`.

    `pin.buildReducedModel` wants one frame of each joint's name: a link of that name has another
    meanwhile, and a joint without a frame, with which it would crash, gets one. These frames must
    come before those that move with their joints. It also refuses a lower limit of velocity above
    the upper one, although Pinocchio 4.1 itself starts with that.
    """
    prepared = model.copy()
    prepared.lowerVelocityLimit = -prepared.velocityLimit
    names, of_joint = list(prepared.names), pin.FrameType.JOINT
    framed = {frame.name for frame in prepared.frames if frame.type == of_joint}
    for joint, name in enumerate(names):
        if joint and name not in framed:
            prepared.addJointFrame(joint)
    _put_joint_frames_first(prepared)
    renamed = {}
    for number, frame in enumerate(prepared.frames):
        if frame.name in names and frame.type != of_joint:
            renamed[f"{frame.name}/{number}"] = frame.name
            frame.name = f"{frame.name}/{number}"
    reduced = pin.buildReducedModel(prepared, [names.index(joint) for joint in joints], q)
    for frame in reduced.frames:
        frame.name = renamed.get(frame.name, frame.name)
    return reduced


def _put_joint_frames_first(model: Any) -> None:
    """Put the frames of joints first, unless each precedes the frames that it moves."""
    frames = [pin.Frame(frame) for frame in model.frames]
    moving = {f.parentJoint: n for n, f in enumerate(frames) if f.type == pin.FrameType.JOINT}
    if all(moving.get(frame.parentJoint, 0) <= n for n, frame in enumerate(frames)):
        return
    fixed = [n for n in range(1, len(frames)) if frames[n].type != pin.FrameType.JOINT]
    order = [0, *(moving[joint] for joint in sorted(moving)), *fixed]
    for new, old in enumerate(order):
        frames[old].parentFrame = order.index(frames[old].parentFrame)
        model.frames[new] = frames[old]


def turn_body(model: Any, joint: int, rotation: Array, centre: ArrayLike = (0.0, 0.0, 0.0)) -> Any:
    """Return a model in which the body of a joint, and all that hangs from it, is turned.

    The joint 0 is the world. `rotation` is from the body's new axes to the joint's, `(3, 3)`,
    and `centre` is the point that stays where it is, `(3,)` [m, joint frame].
    """
    centre = np.asarray(centre)
    return place_body(model, joint, pin.SE3(rotation, centre - rotation @ centre))


def place_body(model: Any, joint: int, placement: Any) -> Any:
    """Return a model in which a body is moved by an SE3 in the joint's frame, see `turn_body`."""
    placed = model.copy()
    placed.inertias[joint] = placement.act(placed.inertias[joint])
    for child in range(1, placed.njoints):
        if placed.parents[child] == joint:
            placed.jointPlacements[child] = placement * placed.jointPlacements[child]
    for number, frame in enumerate(placed.frames):
        if number and frame.parentJoint == joint and frame.type != pin.FrameType.JOINT:
            frame.placement = placement * frame.placement
    return placed


def coordinate_indices(
    model: Any, joints: Sequence[int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices in q and in v of the coordinates of joints, in their order."""
    spans = ((model.idx_qs, model.nqs), (model.idx_vs, model.nvs))
    of_q, of_v = (
        np.concatenate([np.arange(first[j], first[j] + size[j]) for j in joints])
        for first, size in spans
    )
    return of_q, of_v


def has_floating_base(model: Any) -> bool:
    """Return whether the first joint of a model is a floating base."""
    return bool(model.joints[1].shortname() == "JointModelFreeFlyer")


def angle_model(model: Any) -> Any:
    """Return a model whose continuous joints have one angle in q, from -pi to pi."""
    new = pin.Model()
    new.name, new.gravity = model.name, model.gravity.copy()
    for joint in range(1, model.njoints):
        kind, limits = model.joints[joint], None
        if (kind.nq, kind.nv) == (2, 1):
            kind = pin.JointModelRevoluteUnaligned(_axis(kind))
            limits = np.array([-math.pi]), np.array([math.pi])
        parent, placement = int(model.parents[joint]), model.jointPlacements[joint]
        _copy_joint(new, parent, kind, placement, model, joint, limits)
        new.inertias[joint] = model.inertias[joint]
    new.inertias[0] = model.inertias[0]
    for frame in list(model.frames)[1:]:
        new.addFrame(frame, False)
    return new


def reroot_model(model: Any, joint: int, placement: Any) -> Any:
    r"""Return a model whose root is the body of a joint, at rest at a placement in the world.

    The first joint, a floating base, is left out. Joints between it and the new root keep their
    names, values and limits: joint `i`, which moves its child by :math:`\exp(S_i q_i)`, moves its
    parent by :math:`\exp(-S_i q_i)` as seen from its child.
    """
    new = pin.Model()
    new.name, new.gravity = model.name, model.gravity.copy()
    reversed_joints = [int(number) for number in model.supports[joint]][2:]
    # of each body, the world first: its joint in the new model, and its pose there
    carrier, offset = {0: 0, joint: 0}, {0: pin.SE3.Identity(), joint: placement}
    for number in _subtree_order(model, joint, reversed_joints):
        parent, joint_placement = int(model.parents[number]), model.jointPlacements[number]
        if number in reversed_joints:  # from the child, which has its place, to the parent
            kind, turn = _reverse_joint(model, number)
            inner, outer = number, parent
            start, pose = offset[number] * turn, turn.inverse() * joint_placement.inverse()
        else:
            kind, start = model.joints[number], offset[parent] * joint_placement
            inner, outer, pose = parent, number, pin.SE3.Identity()
        carrier[outer] = _copy_joint(new, carrier[inner], kind, start, model, number)
        new.addJointFrame(carrier[outer])
        offset[outer] = pose
    for body in range(1, model.njoints):
        new.appendBodyToJoint(carrier[body], model.inertias[body], offset[body])
    for frame in list(model.frames)[1:]:
        body = int(frame.parentJoint)
        if frame.type != pin.FrameType.JOINT:  # frames of joints are there already
            pose = offset[body] * frame.placement
            new.addFrame(pin.Frame(frame.name, carrier[body], 0, pose, frame.type), False)
    return new


def _subtree_order(model: Any, root: int, reversed_joints: list[int]) -> list[int]:
    """Return all joints but the floating base, as the new root needs them for its subtrees."""
    order, waiting = [], [(root, 0)]  # bodies, and the joint by which each is reached
    while waiting:
        body, reached_by = waiting.pop()
        order.append(reached_by)
        children = [j for j in range(2, model.njoints) if model.parents[j] == body]
        waiting += [(j, j) for j in reversed(children) if j not in (reached_by, *reversed_joints)]
        if body in reversed_joints:
            waiting.append((int(model.parents[body]), body))
    return order[1:]


def _reverse_joint(model: Any, joint: int) -> tuple[Any, Any]:
    """Return the joint along x that moves the parent as a joint moves its child, and its axes."""
    kind, name = model.joints[joint], model.joints[joint].shortname()
    if kind.nv != 1 or not name.startswith((REVOLUTE, PRISMATIC)):
        raise InvalidInput(
            f"joint {model.names[joint]!r} between the supporting foot and the base is a {name}: "
            "it must turn about or slide along one axis"
        )
    turn = rotation_between(np.array([1.0, 0.0, 0.0]), -_axis(kind))
    revolute = pin.JointModelRUBX if kind.nq == 2 else pin.JointModelRX
    opposite = pin.JointModelPX if name.startswith(PRISMATIC) else revolute
    return opposite(), pin.SE3(turn, np.zeros(3))


def _axis(kind: Any) -> Array:
    motion = np.asarray(kind.createData().S, dtype=float).ravel()
    return motion[:3] if kind.shortname().startswith(PRISMATIC) else motion[3:]


def _copy_joint(
    new: Any,
    parent: int,
    kind: Any,
    placement: Any,
    model: Any,
    joint: int,
    limits: tuple[Array, Array] | None = None,
) -> int:
    """Add a joint to a new model, with name, rotor and limits (or others) of a joint of `model`."""
    q = slice(model.idx_qs[joint], model.idx_qs[joint] + model.nqs[joint])
    v = slice(model.idx_vs[joint], model.idx_vs[joint] + model.nvs[joint])
    lower, upper = limits or (model.lowerPositionLimit[q], model.upperPositionLimit[q])
    rotors, speed = new.armature.copy(), model.velocityLimit[v]
    described = kind, placement, model.names[joint]
    number = new.addJoint(parent, *described, model.effortLimit[v], speed, lower, upper)
    new.armature = np.append(rotors, model.armature[v])
    return int(number)
