"""Derivatives of a leg's motion in an impact, at a fixed impulse on the ball.

Supports and loops, A v = 0, hold before and after: where A changes, velocities change by the least,
in kinetic energy, that keeps it so.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.leg_response import Load, constraint_loads, joint_impulses
from kickdyn.robot.constraints import RANK_TOLERANCE
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.names import listed

LINEAR, ANGULAR = slice(0, 3), slice(3, 6)

TURNING_AXES = {"Composite", "Ellipsoid", "SphericalZYX", "Universal"}
"""Pinocchio's joints whose axes depend on their own angles, in its derivatives without warning."""


class LegDerivatives(NamedTuple):
    """Derivatives of a leg's velocities by q, `(3, nv)` and `(nv, nv)` [m/s or rad/s per rad]."""

    admissible: Array  # projector of v on what supports and loops allow, `(nv, nv)`
    foot_q: Array  # of the contact point's velocity before
    foot_q_after: Array  # and after, at a fixed v_after
    v_after_q: Array


def leg_derivatives(
    posture: Posture, v: Array, v_after: Array, impulse: Array, constraint_impulses: Array
) -> LegDerivatives:
    r"""Differentiate the leg's velocities before and after an impulse p on the ball, `(3,)` [N s].

    From :math:`M(q)\, (v^+ - v) = -J(q)^T p + A(q)^T \lambda`, at a fixed p, with the impulses
    :math:`\lambda` of supports and loops. A joint whose axes depend on its own angles (universal,
    composite, Euler) raises `InvalidInput`.
    """
    leg, space = posture.leg, posture.leg.workspace
    check_fixed_axes(leg)
    model, data, nv, zero = space.model, space.data, leg.nv, space.zero_velocity
    wrench = np.concatenate([-impulse, np.zeros(3)])
    foot = Load(leg.contact_joint, posture.rotation_world_joint, posture.contact_lever, wrench)
    loads = [foot, *(load for _, load in constraint_loads(posture, constraint_impulses))]
    jacobians = [_jacobian(posture, load) for load in loads]
    jump = v_after - v
    joint_impulses(posture, jump, -impulse, constraint_impulses)  # sets the external wrenches
    by_q = pin.computeRNEADerivatives(model, data, posture.q, zero, jump, space.external)[0]
    unbalanced = np.array(by_q).reshape(nv, nv)
    for load, jacobian in zip(loads, jacobians, strict=True):
        # Pinocchio rotates the impulse with the body; this one is fixed in the world.
        for axes in (LINEAR, ANGULAR):
            unbalanced -= jacobian[axes].T @ pin.skew(load.wrench[axes]) @ jacobian[ANGULAR]

    inverse = constrained_inverse_inertia(posture)
    admissible = np.column_stack([posture.admissible(unit) for unit in np.eye(nv)])
    free = posture.without_stiff_joints
    closed = _closed(free)
    before, after = (
        _velocity_by_q(posture, foot, jacobians[0], velocity)[LINEAR] for velocity in (v, v_after)
    )
    if posture.leg.base_velocity is not None:
        turned = pin.skew(posture.leg.base_velocity[3:]) @ posture.jacobian
        before, after = before + turned, after + turned
    change = _constraint_change(free, v, admissible)
    before = before + posture.jacobian @ change
    change_after = change + _constraint_change(posture, jump, inverse @ posture.inertia)
    return LegDerivatives(
        admissible=admissible,
        foot_q=before @ closed,
        foot_q_after=after @ closed,
        v_after_q=(change_after - inverse @ unbalanced) @ closed,
    )


def mass_derivatives(posture: Posture, jump: Array) -> Array:
    """Return d(v_after)/d(mass) of each link at fixed shape, `(nv, links)`, for a jump of v."""
    space = posture.leg.workspace
    links = list(space.model.inertias)[1:]
    by_inertia = pin.computeJointTorqueRegressor(
        space.model, space.data, posture.q, space.zero_velocity, jump
    )
    per_mass = [  # a virtual link between joints has no mass to scale
        link.toDynamicParameters() / link.mass if link.mass > 0.0 else np.zeros(10)
        for link in links
    ]
    torques = np.einsum("ilk,lk->il", np.reshape(by_inertia, (-1, len(links), 10)), per_mass)
    return np.asarray(-constrained_inverse_inertia(posture) @ torques)


def check_fixed_axes(leg: Leg) -> None:
    """Raise `InvalidInput` for joints of `TURNING_AXES`."""
    joints = list(leg.workspace.model.joints)[1:]
    turning = [
        name
        for name, joint in zip(leg.joint_names, joints, strict=True)
        if joint.shortname().removeprefix("JointModel") in TURNING_AXES
    ]
    if turning:
        raise InvalidInput(
            f"axes of {listed(turning)} depend on the joint's own angles: Pinocchio's derivatives "
            "with respect to q are wrong there; model the joint as single-axis joints in a row, "
            "which move alike and have correct derivatives"
        )


def constrained_inverse_inertia(posture: Posture) -> Array:
    """Return M^-1, less what supports and loops block of it, shape `(nv, nv)`."""
    columns = posture.whiten(np.eye(posture.leg.nv))
    return columns.T @ columns


def _jacobian(posture: Posture, load: Load) -> Array:
    """Return the Jacobian of a load's point, linear then angular, `(6, nv)` [world axes]."""
    model, data = posture.leg.workspace.model, posture.leg.workspace.data
    pin.computeJointJacobians(model, data, posture.q)
    point = pin.SE3(np.eye(3), load.lever)
    rows = pin.getFrameJacobian(model, data, load.joint, point, pin.LOCAL_WORLD_ALIGNED)
    return np.reshape(rows, (6, model.nv))


def _velocity_by_q(posture: Posture, load: Load, jacobian: Array, velocity: Array) -> Array:
    """Return d(J velocity)/dq of a load's point, linear then angular, `(6, nv)` [world axes]."""
    model, data = posture.leg.workspace.model, posture.leg.workspace.data
    # In the joint's axes, then turned with them: Pinocchio's answer in aligned axes is another.
    pin.computeForwardKinematicsDerivatives(model, data, posture.q, velocity, 0.0 * velocity)
    point = pin.SE3(np.eye(3), load.lever)
    by_q, _ = pin.getFrameVelocityDerivatives(model, data, load.joint, point, pin.LOCAL)
    by_q, speed = np.reshape(by_q, (6, model.nv)), jacobian @ velocity
    return np.vstack(
        [
            load.rotation @ by_q[axes] - pin.skew(speed[axes]) @ jacobian[ANGULAR]
            for axes in (LINEAR, ANGULAR)
        ]
    )


def _constraint_change(posture: Posture, velocity: Array, admissible: Array) -> Array:
    """Return the least change of a velocity that keeps A v = 0 while q changes, `(nv, nv)`.

    `admissible` is the projector on the velocities with A v = 0, `(nv, nv)`.
    """
    projector, nv = posture.constraint_projector, posture.leg.nv
    if projector is None:
        return np.zeros((nv, nv))
    rows_q = np.zeros((len(projector.rows), nv))
    # Ones give the sign with which each end counts.
    for rows, load in constraint_loads(posture, np.ones(len(projector.rows))):
        by_q = _velocity_by_q(posture, load, _jacobian(posture, load), velocity)
        rows_q[rows] += load.wrench[0] * by_q[: rows.stop - rows.start]
    change = np.linalg.lstsq(projector.rows, -rows_q, rcond=RANK_TOLERANCE)[0]
    return np.asarray(change - admissible @ change)


def _closed(posture: Posture) -> Array:
    """Return the projector on the changes of q that leave the loops closed, `(nv, nv)`."""
    projector, identity = posture.constraint_projector, np.eye(posture.leg.nv)
    if projector is None:
        return identity
    rows = projector.rows[projector.constraints.loop_rows.start :]
    return np.asarray(identity - np.linalg.pinv(rows, rcond=RANK_TOLERANCE) @ rows)
