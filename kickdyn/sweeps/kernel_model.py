"""What the kernels must know of a leg and a kick, read from the loaded model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.sweeps import planar_kernel as flat
from kickdyn.sweeps import spatial_kernel as spatial
from kickdyn.sweeps.kick import Kick

PARALLEL = 1e-12
"""Sine of the angle below which axes count as parallel."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A fixed-base tree of hinges and slides that kicks; joints count from 1, 0 is the base.

    Attributes:
        planar: whether all motion is in one plane, that of the normal.
        axes: first tangent, second tangent and normal of the contact as columns [world frame].
        parent: of each joint, shape `(n + 1,)`.
        slides: whether it is prismatic.
        carries: whether the foot moves with it.
        constants: per joint; columns as in `spatial` or `planar`.
        foot: the joint that carries the contact point.
        lever: from its origin to that point, in its axes, shape `(3,)` [m].
        give: what the ball adds to the Delassus matrix, along tangents and normal [1/kg].
        speed, restitution, friction: of the kick.
    """

    planar: bool
    axes: Array
    parent: NDArray[np.int64]
    slides: NDArray[np.bool_]
    carries: NDArray[np.bool_]
    constants: Array
    foot: int
    lever: Array
    give: tuple[float, float]
    speed: float
    restitution: float
    friction: float


def scene_of(leg: Leg, kick: Kick, planar: bool | None = None) -> Scene | None:
    """Read a scene, or return None for a floating base, supports, loops: no kernel serves those.

    Args:
        leg: the leg.
        kick: foot speed, contact and ball.
        planar: False takes the general kernel for a planar leg too.
    """
    model = leg.workspace.model
    if leg.constraints is not None or any(nv != 1 for nv in list(model.nvs)[1:]):
        return None
    data = model.createData()
    q = pin.neutral(model)
    pin.computeJointJacobians(model, data, q)
    n = model.njoints - 1
    columns = [
        np.reshape(pin.getJointJacobian(model, data, k, pin.LOCAL), (6, -1))[:, model.idx_vs[k]]
        for k in range(1, n + 1)  # of a single joint it is a vector
    ]
    slides = np.array([False, *(not column[3:].any() for column in columns)])
    if any(column[:3].any() and column[3:].any() for column in columns):
        return None  # a screw
    axes = [
        column[:3] if slide else column[3:]
        for column, slide in zip(columns, slides[1:], strict=True)
    ]
    turns = [data.oMi[k].rotation for k in range(1, n + 1)]
    lying = [turn @ axis for turn, axis in zip(turns, axes, strict=True)]
    across = _plane(lying, slides[1:], kick.direction)
    if planar is not False and across is not None:
        third = across
        is_planar = True
    else:
        third = np.zeros(3)
        third[int(np.argmin(np.abs(kick.direction)))] = 1.0
        third -= kick.direction * (third @ kick.direction)
        third /= np.linalg.norm(third)
        is_planar = False
    contact = np.column_stack([np.cross(third, kick.direction), third, kick.direction])
    parent = np.array(list(model.parents), dtype=np.int64)
    carries = np.zeros(n + 1, bool)
    k = leg.contact_joint
    while k > 0:
        carries[k], k = True, int(parent[k])
    carried = np.array([inertia.mass for inertia in model.inertias])
    for k in range(n, 0, -1):
        carried[parent[k]] += carried[k] if parent[k] else 0.0
    limits = leg.velocity_limit
    made = _flat if is_planar else _spatial
    constants, lever = made(model, data, leg, contact, axes, slides)
    v = [model.idx_vs[k] for k in range(1, n + 1)]
    constants[1:, spatial.MASS] = [inertia.mass for inertia in list(model.inertias)[1:]]
    constants[1:, spatial.CARRIED] = carried[1:]
    constants[1:, spatial.ARMATURE] = model.armature[v]
    constants[1:, spatial.LIMIT] = limits[v]
    ball = kick.ball
    give = 1.0 / ball.mass + ball.radius**2 / ball.inertia, 1.0 / ball.mass
    return Scene(
        is_planar, contact, parent, slides, carries, constants, leg.contact_joint, lever, give,
        kick.speed, kick.restitution, kick.friction,
    )  # fmt: skip


def _plane(axes: list[Array], slides: NDArray[np.bool_], normal: Array) -> Array | None:
    """Return the direction across the plane that all motion is in, if there is one."""
    hinges = [axis for axis, slide in zip(axes, slides, strict=True) if not slide]
    if not hinges:
        return None
    across = hinges[0]
    in_plane = all(np.linalg.norm(np.cross(axis, across)) < PARALLEL for axis in hinges)
    rest = [normal, *(axis for axis, slide in zip(axes, slides, strict=True) if slide)]
    in_plane = in_plane and all(abs(axis @ across) < PARALLEL for axis in rest)
    if not in_plane:
        return None
    across = across - normal * (across @ normal)
    return np.asarray(across / np.linalg.norm(across))


def _spatial(
    model: pin.Model, data: pin.Data, leg: Leg, contact: Array, axes: list[Array],
    slides: NDArray[np.bool_],
) -> tuple[Array, Array]:  # fmt: skip
    """Return the constants of `spatial`, and the lever: every joint's z is its axis."""
    n = model.njoints - 1
    constants = np.zeros((n + 1, spatial.CONSTANTS))
    upright = np.array([0.0, 0.0, 1.0])
    frames = [contact, *(pin.Quaternion.FromTwoVectors(upright, axis).matrix() for axis in axes)]
    first = model.jointPlacements[1].translation
    for k in range(1, n + 1):
        placement, above, own = model.jointPlacements[k], frames[model.parents[k]], frames[k]
        away = placement.translation - (0.0 if model.parents[k] else first)
        inertia = model.inertias[k]
        moments = own.T @ _second(inertia) @ own
        row = constants[k]
        row[spatial.H : spatial.H + 3] = own.T @ (inertia.mass * inertia.lever)
        row[spatial.INERTIA : spatial.INERTIA + 6] = moments[np.triu_indices(3)]
        row[spatial.PLACE : spatial.PLACE + 3] = above.T @ away
        row[spatial.TURN : spatial.TURN + 9] = (above.T @ placement.rotation @ own).ravel()
    return constants, frames[leg.contact_joint].T @ leg.contact_lever


def _flat(
    model: pin.Model, data: pin.Data, leg: Leg, contact: Array, axes: list[Array],
    slides: NDArray[np.bool_],
) -> tuple[Array, Array]:  # fmt: skip
    """Return the constants of `planar`, and the lever: every body's axes are the contact's."""
    constants = np.zeros((model.njoints, flat.CONSTANTS))
    across, plane = contact[:, 1], contact[:, [2, 0]]
    for k in range(1, model.njoints):
        turn, above = data.oMi[k].rotation, model.parents[k]
        placement, inertia = model.jointPlacements[k], model.inertias[k]
        first = model.jointPlacements[1].translation
        away = (
            data.oMi[above].rotation @ placement.translation
            if above
            else placement.translation - first
        )
        axis, row = turn @ axes[k - 1], constants[k]
        row[flat.H : flat.H + 2] = plane.T @ (turn @ (inertia.mass * inertia.lever))
        row[flat.INERTIA] = across @ turn @ _second(inertia) @ turn.T @ across
        row[flat.PLACE : flat.PLACE + 2] = plane.T @ away
        row[flat.SENSE] = 0.0 if slides[k] else np.sign(axis @ across)
        row[flat.AXIS : flat.AXIS + 2] = plane.T @ axis if slides[k] else 0.0
    lever = plane.T @ (data.oMi[leg.contact_joint].rotation @ leg.contact_lever)
    return constants, np.append(lever, 0.0)


def _second(inertia: pin.Inertia) -> Array:
    """Return the second moment of mass about the joint's origin, shape `(3, 3)` [kg m2]."""
    skew = pin.skew(inertia.lever)
    return np.asarray(inertia.inertia - inertia.mass * skew @ skew)
