"""The constants of a leg and a kick that the compiled kernels work with."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.sweep_kick import Kick

PARALLEL = 1e-12
"""Sine of the angle below which axes count as parallel."""

MASS, CARRIED, ARMATURE, LIMIT, MOMENT = 0, 1, 2, 3, 4
"""Columns of a joint's constants that both kernels have: mass of its body [kg], mass of all bodies
it carries [kg], armature, velocity limit, and the first of the first moment of mass [kg m]."""

SPATIAL_INERTIA, SPATIAL_PLACE, SPATIAL_TURN, SPATIAL_COLUMNS = 7, 13, 16, 25
"""Columns of the spatial kernel: first moment of mass (3) before, second moment of mass (6)
[kg m2], origin in the parent's frame (3) [m], rotation from it (9); and their number."""

PLANAR_INERTIA, PLANAR_PLACE, PLANAR_SENSE, PLANAR_AXIS, PLANAR_COLUMNS = 6, 7, 9, 10, 12
"""Columns of the planar kernel: first moment of mass (2) before, second moment of mass [kg m2],
origin in the parent's frame (2) [m], sense of a hinge (1, -1), axis of a slide (2)."""


@dataclass(frozen=True, eq=False)
class KernelModel:
    """A fixed-base tree of hinges and slides that kicks; joints count from 1, 0 is the base.

    Attributes:
        planar: whether all motion is in one plane, which contains the normal.
        axes: first tangent, second tangent and normal of the contact as columns [world frame].
        parent: parent of each joint, shape `(n + 1,)`.
        slides: whether each joint is prismatic.
        carries_foot: whether the foot moves with each joint.
        constants: constants of each joint, shape `(n + 1, columns)`, columns as above.
        foot: the joint that carries the contact point.
        lever: from its origin to the contact point, in the joint's axes, shape `(3,)` [m].
        kick: the kick.
    """

    planar: bool
    axes: Array
    parent: NDArray[np.int64]
    slides: NDArray[np.bool_]
    carries_foot: NDArray[np.bool_]
    constants: Array
    foot: int
    lever: Array
    kick: Kick

    @classmethod
    def of(cls, leg: Leg, kick: Kick, planar: bool | None = None) -> "KernelModel | None":
        """Return the model of a leg and a kick, or None where no kernel serves them.

        Kernels serve no floating base, no supports, no loops and no helical joints. `planar=False`
        takes the spatial kernel for a planar leg too.
        """
        model = leg.workspace.model
        if leg.constraints is not None or any(nv != 1 for nv in list(model.nvs)[1:]):
            return None
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        n = model.njoints - 1
        columns = [np.ravel(data.joints[k].S) for k in range(1, n + 1)]
        slides = np.array([False, *(not column[3:].any() for column in columns)])
        if any(column[:3].any() and column[3:].any() for column in columns):
            return None  # helical
        axes = [
            column[:3] if slide else column[3:]
            for column, slide in zip(columns, slides[1:], strict=True)
        ]
        world_axes = [data.oMi[k].rotation @ axis for k, axis in enumerate(axes, 1)]
        across = _plane_normal(world_axes, slides[1:], kick.direction)
        is_planar = planar is not False and across is not None
        contact_axes = _contact_axes(kick.direction, across if is_planar else None)
        constants, lever = (_planar_constants if is_planar else _spatial_constants)(
            model, data, leg, contact_axes, axes, slides
        )
        parent = np.array(list(model.parents), dtype=np.int64)
        v = [model.idx_vs[k] for k in range(1, n + 1)]
        pin.computeSubtreeMasses(model, data)
        constants[1:, MASS] = [inertia.mass for inertia in list(model.inertias)[1:]]
        constants[1:, CARRIED] = list(data.mass)[1:]
        constants[1:, ARMATURE], constants[1:, LIMIT] = model.armature[v], leg.velocity_limit[v]
        carries = np.isin(np.arange(n + 1), list(model.supports[leg.contact_joint])[1:])
        return cls(
            is_planar,
            contact_axes,
            parent,
            slides,
            carries,
            constants,
            leg.contact_joint,
            lever,
            kick,
        )


def _contact_axes(normal: Array, across: Array | None) -> Array:
    """Return tangents and normal as columns; the second tangent is `across`, where it is given."""
    if across is None:
        across = np.zeros(3)
        across[int(np.argmin(np.abs(normal)))] = 1.0
        across -= normal * (across @ normal)
        across /= np.linalg.norm(across)
    return np.column_stack([np.cross(across, normal), across, normal])


def _plane_normal(axes: list[Array], slides: NDArray[np.bool_], normal: Array) -> Array | None:
    """Return the unit vector across the plane that all motion is in, if there is one."""
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


def _spatial_constants(
    model: pin.Model, data: pin.Data, leg: Leg, contact: Array, axes: list[Array],
    slides: NDArray[np.bool_],
) -> tuple[Array, Array]:  # fmt: skip
    """Return constants and lever in frames whose z is the joint's axis; the base's is `contact`."""
    constants = np.zeros((model.njoints, SPATIAL_COLUMNS))
    upright = np.array([0.0, 0.0, 1.0])
    frames = [contact, *(pin.Quaternion.FromTwoVectors(upright, axis).matrix() for axis in axes)]
    first = model.jointPlacements[1].translation
    for k in range(1, model.njoints):
        placement, above, own = model.jointPlacements[k], frames[model.parents[k]], frames[k]
        offset = placement.translation - (0.0 if model.parents[k] else first)
        inertia = model.inertias[k]
        moments = own.T @ _second_moment(inertia) @ own
        row = constants[k]
        row[MOMENT : MOMENT + 3] = own.T @ (inertia.mass * inertia.lever)
        row[SPATIAL_INERTIA : SPATIAL_INERTIA + 6] = moments[np.triu_indices(3)]
        row[SPATIAL_PLACE : SPATIAL_PLACE + 3] = above.T @ offset
        row[SPATIAL_TURN : SPATIAL_TURN + 9] = (above.T @ placement.rotation @ own).ravel()
    return constants, frames[leg.contact_joint].T @ leg.contact_lever


def _planar_constants(
    model: pin.Model, data: pin.Data, leg: Leg, contact: Array, axes: list[Array],
    slides: NDArray[np.bool_],
) -> tuple[Array, Array]:  # fmt: skip
    """Return constants and lever along normal and tangent, all joints at 0."""
    constants = np.zeros((model.njoints, PLANAR_COLUMNS))
    across, plane = contact[:, 1], contact[:, [2, 0]]
    first = model.jointPlacements[1].translation
    for k in range(1, model.njoints):
        turn, above = data.oMi[k].rotation, model.parents[k]
        offset, inertia = model.jointPlacements[k].translation, model.inertias[k]
        offset = data.oMi[above].rotation @ offset if above else offset - first
        axis, row = turn @ axes[k - 1], constants[k]
        row[MOMENT : MOMENT + 2] = plane.T @ (turn @ (inertia.mass * inertia.lever))
        row[PLANAR_INERTIA] = across @ turn @ _second_moment(inertia) @ turn.T @ across
        row[PLANAR_PLACE : PLANAR_PLACE + 2] = plane.T @ offset
        row[PLANAR_SENSE] = 0.0 if slides[k] else np.sign(axis @ across)
        row[PLANAR_AXIS : PLANAR_AXIS + 2] = plane.T @ axis if slides[k] else 0.0
    lever = plane.T @ (data.oMi[leg.contact_joint].rotation @ leg.contact_lever)
    return constants, np.append(lever, 0.0)


def _second_moment(inertia: pin.Inertia) -> Array:
    """Return the second moment of mass about the joint's origin, shape `(3, 3)` [kg m2]."""
    skew = pin.skew(inertia.lever)
    return np.asarray(inertia.inertia - inertia.mass * skew @ skew)
