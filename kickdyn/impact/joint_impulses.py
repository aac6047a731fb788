"""Impulses inside the joints, by Newton-Euler over the velocity jump."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.core.vectors import cross3
from kickdyn.robot.leg import Posture


def joint_impulses(
    posture: Posture, jump: Array, impulse: Array, held: Array | None = None
) -> tuple[Array, Array]:
    """Return what each joint transmits when an impulse acts on the foot.

    Args:
        posture: of the leg.
        jump: change of the joint velocity, shape `(nv,)` [rad/s].
        impulse: on the foot at its contact point, shape `(3,)` [N s, world frame].
        held: impulses of supports and loops, from `Posture.respond`.

    Returns:
        The 6-D impulse that each joint's parent exerts on its child, linear then angular, about
        the joint's origin and in its frame, shape `(njoints, 6)` [N s, N m s]; and the joint-space
        momentum left over, shape `(nv,)`, which is 0 but for rounding.
    """
    leg, space = posture.leg, posture.leg.workspace
    pushes = space.pushes
    pushes.fill(0.0)  # of the impact before
    pushes[leg.contact_joint] = on_foot(posture, impulse)
    if posture.constraint_projector is not None and held is not None:
        for block in posture.constraint_projector.blocks:
            given = held[block.at]
            pushes[block.joint] += at_joint(block.turns[0], block.levers[0], given)
            if block.other:
                pushes[block.other] -= at_joint(block.turns[1], block.levers[1], given)
    left_over = pin.rnea(space.model, space.data, posture.q, space.still, jump, space.external)
    return space.forces.copy(), left_over.copy()


def struck(posture: Posture, impulse: Array) -> tuple[Array, Array, Array]:
    """Return the velocity jump after an impulse on the foot, and `joint_impulses`' answers.

    For legs that nothing but their joints holds. The jump is the articulated-body algorithm's: a
    Cholesky factor of M loses digits with M's condition, five of them at 500 joints.
    """
    leg, space = posture.leg, posture.leg.workspace
    if posture.is_ill_conditioned:
        return posture.articulated_bodies.respond(
            leg.contact_joint, np.array(on_foot(posture, impulse))
        )
    model, data, still = space.model, space.data, space.still
    space.pushes.fill(0.0)  # of the impact before
    space.pushes[leg.contact_joint] = on_foot(posture, impulse)
    jump = pin.aba(model, data, posture.q, still, still, space.external).copy()
    left_over = pin.rnea(model, data, posture.q, still, jump, space.external)
    return jump, space.forces.copy(), left_over.copy()


def on_foot(posture: Posture, impulse: Array) -> tuple[float, ...]:
    """Return what `at_joint` does, of an impulse at the contact point, shape `(3,)` [N s]."""
    push = impulse.dot(posture.rotation_world_joint).tolist()
    return (*push, *cross3(posture.contact_lever.tolist(), push))


def at_joint(turn: Array, lever: Array, impulse: Array) -> Array:
    """Return an impulse at a point as Newton-Euler takes it: about the joint, in its axes.

    Args:
        turn: from world axes to the joint's, shape `(3, 3)`.
        lever: from the joint's origin to the point, in its axes, shape `(3,)` [m].
        impulse: shape `(3,)`, or with its moment about the point `(6,)` [world axes].

    Returns:
        Linear, then angular, shape `(6,)`.
    """
    push = turn.dot(impulse[:3]).tolist()
    there = np.array((*push, *cross3(lever.tolist(), push)))
    if len(impulse) == 6:
        there[3:] += turn.dot(impulse[3:])
    return there
