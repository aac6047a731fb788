"""The leg's response to the impulse: velocity jump, joint impulses, and the footing of supports."""

from enum import StrEnum
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.mechanics import cross3
from kickdyn.core.validation import Array, protect, read_only
from kickdyn.robot.constraints import Support
from kickdyn.robot.leg import Posture

NO_CONSTRAINTS = read_only(np.zeros(0))
"""Constraint impulses of a leg without supports and loops."""

NEGLIGIBLE_IMPULSE = 1e-12
"""Impulse on a support, relative to the impulse on the ball, that counts as 0."""

LEVEL_SLOPE = 0.01
"""Height difference of a sole's corners over their distance up to which the sole is level."""

CONE_EDGES = 64
"""Edges of the pyramid that stands for a friction cone: its error is 0.1 %."""


class LegResponse(NamedTuple):
    """What an impulse at the foot does to the leg: attributes of `Impact` of the same names.

    In `unbalanced` is the joint-space momentum that Newton-Euler does not account for, `(nv,)`.
    """

    v_after: Array
    joint_impulses: Array
    constraint_impulses: Array
    unbalanced: Array


def leg_response(posture: Posture, v: Array, impulse: Array) -> LegResponse:
    """Return the response of a leg that strikes the ball with an impulse p, `(3,)` [N s].

    The velocity jump is :math:`-M^{-1} J^T p`, less what supports and loops block.
    """
    if posture.constraint_projector is not None:
        jump, constraint_impulses = posture.respond(-impulse.dot(posture.jacobian))
        return response_to_jump(posture, v, jump, impulse, constraint_impulses)
    space, q = posture.leg.workspace, posture.q
    model, data, zero, external = space.model, space.data, space.zero_velocity, space.external
    wrenches = space.external_wrenches
    wrenches.fill(0.0)  # of the impact before
    wrenches[posture.leg.contact_joint] = foot_wrench(posture, -impulse)
    jump = pin.aba(model, data, q, zero, zero, external)
    unbalanced = pin.rnea(model, data, q, zero, jump, external)
    v_after, transmitted, unbalanced = v + jump, space.forces.copy(), unbalanced.copy()
    protect(v_after, transmitted, unbalanced)
    return LegResponse(v_after, transmitted, NO_CONSTRAINTS, unbalanced)


def response_to_jump(
    posture: Posture, v: Array, jump: Array, impulse: Array, constraint_impulses: Array
) -> LegResponse:
    """Return the response of a leg whose velocity jump and constraint impulses are known."""
    transmitted, unbalanced = joint_impulses(posture, jump, -impulse, constraint_impulses)
    v_after = v + jump
    protect(v_after, transmitted, constraint_impulses, unbalanced)
    return LegResponse(v_after, transmitted, constraint_impulses, unbalanced)


class ImpulsiveLoad(NamedTuple):
    """An impulse and its moment on a joint's body, at a point of it."""

    joint: int
    rotation: Array  # from the joint's axes to the world's, shape `(3, 3)`
    lever: Array  # of the point, from the joint's origin, in its axes [m]
    wrench: Array  # shape `(6,)` [N s, N m s, world axes]


def constraint_loads(posture: Posture, impulses: Array) -> list[tuple[slice, ImpulsiveLoad]]:
    """Return the loads of supports and loops on the bodies at their ends, with their rows of A."""
    loads = []
    for block in posture.constraint_projector.blocks if posture.constraint_projector else ():
        for joint, sign, rotation, lever in zip(
            (block.joint, block.other), (1.0, -1.0), block.rotations_joint_world, block.levers,
            strict=True,
        ):  # fmt: skip
            if joint:  # else the ground
                wrench = np.zeros(6)
                wrench[: block.rows.stop - block.rows.start] = sign * impulses[block.rows]
                loads.append((block.rows, ImpulsiveLoad(joint, rotation.T, lever, wrench)))
    return loads


def joint_impulses(
    posture: Posture, jump: Array, impulse: Array, constraint_impulses: Array
) -> tuple[Array, Array]:
    """Return the impulses that joints transmit when one acts on the foot, by Newton-Euler.

    The jump of the joint velocity, `(nv,)` [rad/s], takes the place of the acceleration; gravity
    and velocity are 0. The impulse acts at the contact point, `(3,)` [N s, world frame]. The first
    result is `LegResponse.joint_impulses`; the second is the joint-space momentum left over,
    `(nv,)`, which is 0 but for rounding.
    """
    leg, space = posture.leg, posture.leg.workspace
    wrenches = space.external_wrenches
    wrenches.fill(0.0)  # of the impact before
    wrenches[leg.contact_joint] = foot_wrench(posture, impulse)
    for _, load in constraint_loads(posture, constraint_impulses):
        linear = load.wrench[:3].dot(load.rotation).tolist()
        moment = load.wrench[3:].dot(load.rotation) + cross3(load.lever.tolist(), linear)
        wrenches[load.joint] += (*linear, *moment)
    unbalanced = pin.rnea(
        space.model, space.data, posture.q, space.zero_velocity, jump, space.external
    )
    projector = posture.constraint_projector
    if projector is None:
        return space.forces.copy(), unbalanced.copy()
    # Impulses of mimic and stiff joints, the last rows, act between parent and child of a joint,
    # along its axis: `pin.rnea` already counts them in what the joints transmit.
    start = projector.blocks[-1].rows.stop if projector.blocks else 0
    unbalanced = unbalanced - constraint_impulses[start:] @ projector.rows[start:]
    return space.forces.copy(), np.asarray(unbalanced)


def axis_projectors(posture: Posture) -> Array:
    """Return the projector of each joint's impulse on its degrees of freedom, `(njoints, 6, 6)`.

    They are in the axes of the joint; the rest of the impulse is on its structure.
    """
    space = posture.leg.workspace
    pin.forwardKinematics(space.model, space.data, posture.q)  # joint axes may depend on q
    axes = (np.array(joint.S).reshape(6, -1) for joint in list(space.data.joints)[1:])
    return np.array([columns @ np.linalg.pinv(columns) for columns in axes])


def foot_wrench(posture: Posture, impulse: Array) -> tuple[float, ...]:
    """Return an impulse at the contact point, `(3,)` [N s], in the axes of its joint, `(6,)`."""
    linear = impulse.dot(posture.rotation_world_joint).tolist()
    return (*linear, *cross3(posture.contact_lever.tolist(), linear))


class Footing(StrEnum):
    """Motion of a support in an impact, on ground that can push but not pull.

    It lifts off if the ground would have to pull, slips if the impulse is outside the friction
    cone, tips if it acts outside the sole, turns if friction cannot supply its moment about the
    vertical, and is tilted (not judged) if its sole is not level.
    """

    STANDS = "stands"
    LIFTS_OFF = "lifts-off"
    SLIPS = "slips"
    TIPS = "tips"
    TURNS = "turns"
    TILTED = "tilted"


def footing(support: Support, impulse: Array, rotation: Array, scale: float) -> Footing:
    """Return the `Footing` of a support, which the impact takes for fixed.

    The impulse alone presses the foot down: an impact is too short for weight. The foot stands if
    the impulse is a sum of impulses in the friction cones of the corners of its sole. The impulse
    on the robot is at the support's frame, `(3,)` or `(6,)` [N s, N m s, world axes], z the
    ground's normal; the rotation is from the frame's axes to the world's, and the scale is the size
    of the impulse on the ball [N s].
    """
    from scipy.optimize import nnls  # here, because it takes long to import

    negligible = NEGLIGIBLE_IMPULSE * scale
    normal = float(impulse[2])
    if normal < -negligible:
        return Footing.LIFTS_OFF
    tangential = float(np.hypot(impulse[0], impulse[1]))
    if support.friction is not None and tangential > support.friction * normal + negligible:
        return Footing.SLIPS
    if support.sole is None:
        return Footing.STANDS
    corners = support.sole @ rotation.T
    if not is_level(corners):
        return Footing.TILTED
    height, size = corners[:, 2].mean(), float(np.abs(corners[:, :2]).max())
    moment = (impulse[3:] - np.cross([0.0, 0.0, height], impulse[:3])) / size
    wrench = np.concatenate([impulse[:3], moment])
    tolerance = max(negligible, 1e-9 * normal)
    x, y = corners[:, :2].T / size
    pressing = np.array([np.ones_like(x), y, -x])
    if nnls(pressing, wrench[2:5])[1] > tolerance:
        return Footing.TIPS
    if support.friction is None:
        return Footing.STANDS
    angles = np.linspace(0.0, 2.0 * np.pi, CONE_EDGES, endpoint=False)[:, None]
    coefficient = support.friction / np.cos(np.pi / CONE_EDGES)  # the pyramid is around the cone
    fx, fy = coefficient * np.cos(angles), coefficient * np.sin(angles)
    edges = np.broadcast_arrays(fx, fy, *pressing, x * fy - y * fx)
    cones = np.reshape(edges, (6, -1))
    return Footing.STANDS if nnls(cones, wrench)[1] <= tolerance else Footing.TURNS


def is_level(corners: Array) -> bool:
    """Return whether the corners of a sole, shape `(k, 3)` [m, world axes], are level."""
    return bool(np.ptp(corners[:, 2]) <= LEVEL_SLOPE * np.ptp(corners[:, :2], axis=0).max())
