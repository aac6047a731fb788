"""The leg's response to the impulse: velocity jump, joint impulses, constraint impulses."""

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.mechanics import cross3, largest
from kickdyn.core.validation import Array, protect
from kickdyn.robot.leg import Posture

NO_CONSTRAINTS = np.zeros(0)
"""Constraint impulses of a leg without supports and loops."""


class LegResponse(NamedTuple):
    """What an impulse at the foot does to the leg.

    Attributes:
        v_after: joint velocity just after, shape `(nv,)` [rad/s; m/s for prismatic joints].
        joint_impulses: by the parent on the child, linear then angular, about the joint's origin
            and in its frame, shape `(njoints, 6)` [N s, N m s].
        constraint_impulses: of supports and loops, stacked as in
            `posture.constraint_projector.rows` [N s, N m s, world axes].
        momentum_residual: joint-space momentum that Newton-Euler cannot account for, relative to
            the impulse times the Jacobian's norm.
    """

    v_after: Array
    joint_impulses: Array
    constraint_impulses: Array
    momentum_residual: float


def leg_response(posture: Posture, v: Array, impulse: Array) -> LegResponse:
    """Return the response of a leg that strikes the ball with an impulse p, `(3,)` [N s].

    The velocity jump is :math:`-M^{-1} J^T p`, less what supports and loops block.
    """
    if posture.constraint_projector is None:
        jump, transmitted, unbalanced = free_response(posture, -impulse)
        return as_response(posture, impulse, v + jump, transmitted, NO_CONSTRAINTS, unbalanced)
    jump, constraint_impulses = posture.respond(-impulse.dot(posture.jacobian))
    transmitted, unbalanced = joint_impulses(posture, jump, -impulse, constraint_impulses)
    return as_response(posture, impulse, v + jump, transmitted, constraint_impulses, unbalanced)


def as_response(
    posture: Posture,
    impulse: Array,
    v_after: Array,
    transmitted: Array,
    constraint_impulses: Array,
    unbalanced: Array,
) -> LegResponse:
    """Return a response of read-only arrays; `unbalanced` is the momentum left over."""
    protect(v_after, transmitted, constraint_impulses)
    scale = posture.jacobian_norm * math.hypot(*impulse.tolist())
    residual = largest(unbalanced) / scale if scale else 0.0
    return LegResponse(v_after, transmitted, constraint_impulses, residual)


def joint_impulses(
    posture: Posture, jump: Array, impulse: Array, constraint_impulses: Array = NO_CONSTRAINTS
) -> tuple[Array, Array]:
    """Return what each joint transmits when an impulse acts on the foot, by Newton-Euler.

    The equations of motion, integrated over the impact, are the recursive Newton-Euler algorithm
    without gravity and velocity, with the jump of the joint velocity, `(nv,)` [rad/s], for the
    acceleration. The impulse acts at the contact point, `(3,)` [N s, world frame]. The first result
    is the impulse that each joint's parent exerts on its child, linear then angular, about the
    joint's origin and in its frame, `(njoints, 6)` [N s, N m s]; the second is the joint-space
    momentum left over, `(nv,)`, which is 0 but for rounding.
    """
    leg, space = posture.leg, posture.leg.workspace
    wrenches = space.external_wrenches
    wrenches.fill(0.0)  # of the impact before
    wrenches[leg.contact_joint] = foot_wrench(posture, impulse)
    if posture.constraint_projector is not None and len(constraint_impulses):
        for block in posture.constraint_projector.blocks:
            transmitted = constraint_impulses[block.rows]
            wrenches[block.joint] += joint_wrench(
                block.rotations_joint_world[0], block.levers[0], transmitted
            )
            if block.other:
                wrenches[block.other] -= joint_wrench(
                    block.rotations_joint_world[1], block.levers[1], transmitted
                )
    unbalanced = pin.rnea(
        space.model, space.data, posture.q, space.zero_velocity, jump, space.external
    )
    return space.forces.copy(), _without_axes(posture, unbalanced, constraint_impulses)


def _without_axes(posture: Posture, unbalanced: Array, constraint_impulses: Array) -> Array:
    """Return joint-space impulses without those of mimic and stiff joints, shape `(nv,)`.

    Both act between parent and child of a joint, along the joint's axis, so that `pin.rnea` already
    counts them in what the joints transmit.
    """
    projector = posture.constraint_projector
    if projector is None or not len(constraint_impulses):
        return unbalanced.copy()
    start = projector.blocks[-1].rows.stop if projector.blocks else 0
    if start == len(constraint_impulses):
        return unbalanced.copy()
    return np.asarray(unbalanced - constraint_impulses[start:] @ projector.rows[start:])


def free_response(posture: Posture, impulse: Array) -> tuple[Array, Array, Array]:
    """Return the velocity jump after an impulse on the foot, and what `joint_impulses` returns.

    For legs without supports and loops. The jump is the articulated-body algorithm's: a Cholesky
    factor of M loses digits with M's condition, five of them at 500 joints.
    """
    leg, space = posture.leg, posture.leg.workspace
    wrench = foot_wrench(posture, impulse)
    if posture.is_ill_conditioned:
        return posture.articulated_bodies.respond(leg.contact_joint, np.array(wrench))
    model, data, zero = space.model, space.data, space.zero_velocity
    space.external_wrenches.fill(0.0)  # of the impact before
    space.external_wrenches[leg.contact_joint] = wrench
    jump = pin.aba(model, data, posture.q, zero, zero, space.external).copy()
    unbalanced = pin.rnea(model, data, posture.q, zero, jump, space.external)
    return jump, space.forces.copy(), unbalanced.copy()


def foot_wrench(posture: Posture, impulse: Array) -> tuple[float, ...]:
    """Return `joint_wrench` of an impulse at the contact point, shape `(3,)` [N s]."""
    linear = impulse.dot(posture.rotation_world_joint).tolist()
    return (*linear, *cross3(posture.contact_lever.tolist(), linear))


def joint_wrench(rotation: Array, lever: Array, impulse: Array) -> Array:
    """Return an impulse at a point of a body about its joint's origin, in the joint's axes, `(6,)`.

    The rotation is from world axes to the joint's, the lever from the joint's origin to the point,
    in its axes [m]; the impulse is linear, `(3,)`, or with its moment about the point `(6,)`.
    """
    linear = rotation.dot(impulse[:3]).tolist()
    wrench = np.array((*linear, *cross3(lever.tolist(), linear)))
    if len(impulse) == 6:
        wrench[3:] += rotation.dot(impulse[3:])
    return wrench
