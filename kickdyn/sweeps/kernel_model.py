"""The constants of a leg and a kick that the compiled kernel works with."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.sweep_kick import Kick

PARALLEL = 1e-12
"""Sine of the angle below which axes count as parallel."""

ALIGNED = 1e-15
"""Largest entry of a rotation minus the identity that is taken for rounding."""

JOINT = np.dtype(
    [
        ("parent", np.int64),  # the joint that carries this one, 0 for the base
        ("slides", np.bool_),  # whether the joint is prismatic
        ("carries_foot", np.bool_),  # whether the foot moves with the joint
        ("aligned", np.bool_),  # whether `rotation` is the identity
        ("rotation", float, (3, 3)),  # from the parent's frame to this one's, the joint at 0
        ("origin", float, 3),  # in the parent's frame [m]
        ("mass", float),  # of the joint's body [kg]
        ("moment", float, 3),  # first moment of mass of the body about the joint's origin [kg m]
        ("inertia", float, 6),  # second moment xx, xy, xz, yy, yz, zz [kg m2]
        ("carried_mass", float),  # of all bodies that the joint carries [kg]
        ("armature", float),  # inertia of the rotor [kg m2; kg]
        ("speed_limit", float),  # [rad/s; m/s]
    ],
    align=True,
)
"""The constants of a joint and its body, in a frame whose z axis is that of the joint.

The frame of the base has the contact's axes, and the origin of the first joint.
"""

TASK = np.dtype(
    [
        ("foot", np.int64),  # the joint that carries the contact point
        ("lever", float, 3),  # from its origin to the contact point, in its frame [m]
        ("planar", np.bool_),  # whether all motion is in one plane
        ("joint_impulses", np.bool_),  # whether these are computed, and the use of speed limits
        ("tangent_mobility", float),  # what the ball adds to the Delassus matrix [1/kg]
        ("normal_mobility", float),  # the same along the normal [1/kg]
        ("speed", float),  # of the foot [m/s]
        ("restitution", float),
        ("friction", float),
    ],
    align=True,
)
"""What is asked of the kernel."""


@dataclass(frozen=True, eq=False)
class KernelModel:
    """A fixed-base tree of hinges and slides that kicks; joints count from 1, 0 is the base.

    Attributes:
        planar: whether all motion is in one plane, which contains the normal.
        axes: first tangent, second tangent and normal of the contact as columns [world frame]; of
            planar motion, the second tangent is the normal of the plane.
        tree: constants of each joint, dtype `JOINT`, shape `(n + 1,)`.
        senses: -1 for each joint whose axis is turned round in its frame, because its largest
            component is negative, else 1: parallel joints have aligned frames.
        task: the kick, dtype `TASK`, shape `(1,)`.
        kick: the kick.
    """

    planar: bool
    axes: Array
    tree: NDArray[Any]
    senses: Array
    task: NDArray[Any]
    kick: Kick

    @classmethod
    def of(cls, leg: Leg, kick: Kick) -> "KernelModel | None":
        """Return the model of a leg and a kick, or None where the kernel does not serve them.

        It serves no floating base, no supports, no loops and no helical joints.
        """
        model = leg.workspace.model
        if leg.constraints is not None or any(nv != 1 for nv in list(model.nvs)[1:]):
            return None
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        columns = [np.ravel(data.joints[k].S) for k in range(1, model.njoints)]
        if any(column[:3].any() and column[3:].any() for column in columns):
            return None  # helical
        slides = np.array([not column[3:].any() for column in columns])
        axes = [column[:3] + column[3:] for column in columns]
        world_axes = [data.oMi[k].rotation @ axis for k, axis in enumerate(axes, 1)]
        across = _plane_normal(world_axes, slides, kick.direction)
        contact_axes = _contact_axes(kick.direction, across)
        senses = np.array([1.0, *(np.sign(axis[np.argmax(np.abs(axis))]) for axis in axes)])
        frames = [contact_axes, *map(_frame, senses[1:, None] * axes)]
        tree = _tree(model, frames)
        pin.computeSubtreeMasses(model, data)
        v = [model.idx_vs[k] for k in range(1, model.njoints)]
        tree["slides"][1:] = slides
        tree["carries_foot"][list(model.supports[leg.contact_joint])[1:]] = True
        tree["carried_mass"][1:] = list(data.mass)[1:]
        tree["armature"][1:], tree["speed_limit"][1:] = model.armature[v], leg.velocity_limit[v]
        task = _task(kick, across is not None)
        task["foot"] = leg.contact_joint
        task["lever"] = frames[leg.contact_joint].T @ leg.contact_lever
        return cls(across is not None, contact_axes, tree, senses, task, kick)


def _plane_normal(axes: list[Array], slides: NDArray[np.bool_], normal: Array) -> Array | None:
    """Return the unit vector across the plane that all motion is in, if there is one."""
    hinges = [axis for axis, slide in zip(axes, slides, strict=True) if not slide]
    if not hinges:
        return None
    across = hinges[0]
    in_plane = all(np.linalg.norm(np.cross(axis, across)) < PARALLEL for axis in hinges)
    directions = [normal, *(axis for axis, slide in zip(axes, slides, strict=True) if slide)]
    if not in_plane or any(abs(axis @ across) >= PARALLEL for axis in directions):
        return None
    across = across - normal * (across @ normal)
    return np.asarray(across / np.linalg.norm(across))


def _contact_axes(normal: Array, across: Array | None) -> Array:
    """Return tangents and normal as columns; the second tangent is `across`, where it is given."""
    if across is None:
        across = np.zeros(3)
        across[int(np.argmin(np.abs(normal)))] = 1.0
        across -= normal * (across @ normal)
        across /= np.linalg.norm(across)
    return np.column_stack([np.cross(across, normal), across, normal])


def _frame(axis: Array) -> Array:
    """Return a frame as columns, whose z is along the axis."""
    return np.asarray(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix())


def _tree(model: pin.Model, frames: list[Array]) -> NDArray[Any]:
    """Return the geometry and inertia of the joints, whose frames are given in the joints' axes."""
    tree = np.zeros(model.njoints, JOINT)
    tree["parent"] = list(model.parents)
    first = model.jointPlacements[1].translation
    for k in range(1, model.njoints):
        joint, placement, inertia = tree[k], model.jointPlacements[k], model.inertias[k]
        parent, frame = frames[model.parents[k]], frames[k]
        rotation = parent.T @ placement.rotation @ frame
        joint["aligned"] = np.abs(rotation - np.eye(3)).max() < ALIGNED
        joint["rotation"] = rotation
        joint["origin"] = parent.T @ (placement.translation - (0 if model.parents[k] else first))
        joint["mass"] = inertia.mass
        joint["moment"] = frame.T @ (inertia.mass * inertia.lever)
        skew = pin.skew(inertia.lever)
        second = inertia.inertia - inertia.mass * skew @ skew
        joint["inertia"] = (frame.T @ second @ frame)[np.triu_indices(3)]
    return tree


def _task(kick: Kick, planar: bool) -> NDArray[Any]:
    """Return what is asked of the kernel for a kick, without the foot."""
    ball, task = kick.ball, np.zeros(1, TASK)
    task["planar"], task["normal_mobility"] = planar, 1.0 / ball.mass
    task["tangent_mobility"] = 1.0 / ball.mass + ball.radius**2 / ball.inertia
    task["speed"], task["friction"] = kick.speed, kick.friction
    task["restitution"] = kick.restitution_used
    return task
