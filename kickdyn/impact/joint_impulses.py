"""Impulses inside the joints, by Newton-Euler over the velocity jump."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from kickdyn.checks import Array
from kickdyn.posture import Posture


def joint_impulses(posture: Posture, jump: Array, impulse: Array) -> tuple[Array, Array]:
    """Return what each joint transmits when an impulse acts on the foot.

    Args:
        posture: of the leg.
        jump: change of the joint velocity, shape `(nv,)` [rad/s].
        impulse: on the foot at its contact point, shape `(3,)` [N s, world frame].

    Returns:
        The 6-D impulse that each joint's parent exerts on its child, linear then angular, about
        the joint's origin and in its frame, shape `(njoints, 6)` [N s, N m s]; and the joint-space
        momentum left over, shape `(nv,)`, which is 0 but for rounding.
    """
    leg, space = posture.leg, posture.leg.workspace
    local = posture.joint_rotation.T @ impulse
    at_joint = pin.Force(local, np.cross(leg.contact_lever, local))
    space.external[leg.contact_joint] = at_joint
    still = np.zeros(leg.nv)
    left_over = pin.rnea(space.model, space.data, posture.q, still, jump, space.external)
    forces = np.array([force.vector for force in list(space.data.f)[1:]])
    return forces, left_over.copy()
