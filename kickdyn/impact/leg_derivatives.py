"""Derivatives of a leg's motion in an impact, at a fixed impulse on the ball.

Supports and loops, A v = 0, hold before and after: where A changes, velocities change by the least,
in kinetic energy, that keeps it so.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.leg_response import ImpulsiveLoad, LegResponse, constraint_loads, joint_impulses
from kickdyn.robot.constraints import RANK_TOLERANCE, ConstraintProjector
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
    v_before_q: Array  # by which supports and loops change v while q changes
    closed: Array  # projector of a change of q on those that leave loops closed


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
    foot = ImpulsiveLoad(
        leg.contact_joint, posture.rotation_world_joint, posture.contact_lever, wrench
    )
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
    unbalanced -= _gear_slopes(posture, constraint_impulses)
    inverse = constrained_inverse_inertia(posture)
    admissible = np.column_stack([posture.admissible(unit) for unit in np.eye(nv)])
    free = posture.without_stiff_joints
    closed = _closed(free)
    before, after = (
        _velocity_by_q(posture, foot, jacobians[0], velocity)[LINEAR] for velocity in (v, v_after)
    )
    if posture.leg.base_velocity is not None:
        transport = pin.skew(posture.leg.base_velocity[3:]) @ posture.jacobian
        before, after = before + transport, after + transport
    change = _constraint_change(free, v, admissible)
    before = before + posture.jacobian @ change
    change_after = change + _constraint_change(posture, jump, inverse @ posture.inertia)
    return LegDerivatives(
        admissible=admissible,
        foot_q=before @ closed,
        foot_q_after=after @ closed,
        v_after_q=(change_after - inverse @ unbalanced) @ closed,
        v_before_q=change @ closed,
        closed=closed,
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


class ResponseSlopes(NamedTuple):
    """Derivatives of the terms of the joint impulses, n columns."""

    jump: Array  # of the velocity jump, `(nv, n)`
    impulse: Array  # of the impulse on the ball, `(3, n)`
    q: Array  # of q, `(nv, n)`
    mass: Array  # of the masses of the links at fixed shape, `(links, n)`


def joint_impulse_derivatives(
    posture: Posture, impulse: Array, response: LegResponse, jump: Array, slopes: ResponseSlopes
) -> Array:
    r"""Differentiate the impulses that joints transmit, shape `(njoints, 6, n)`, without universe.

    In world axes about a fixed point, the impulse on the subtree of joint j is :math:`F_j = \sum_i
    (I_i A_i - W_i)`, with the inertias :math:`I_i` of its bodies, their jumps :math:`A_i` and the
    impulses :math:`W_i` from outside. A change of q along column m of the Jacobian, :math:`J_m`,
    moves the bodies behind that joint as one: there

    .. math:: \frac{d (I A)}{dq_m} = J_m \times^* I A - I\, (J_m \times A_{p(m)}) ,

    where p(m) is the body before the joint. The impulse in the joint's own axes is
    :math:`X_j^T F_j`. Where supports and loops take part, their impulses change so that the balance
    of the joints remains, :math:`A^T d\lambda = S^T df |_\lambda`. The leg's response to the
    impulse on the ball, `(3,)` [N s], is a velocity jump, `(nv,)`, with slopes of both.
    """
    tree = _Tree(posture, jump)
    foot = ImpulsiveLoad(
        posture.leg.contact_joint, posture.rotation_world_joint, posture.contact_lever,
        np.concatenate([-impulse, np.zeros(3)]),
    )  # fmt: skip
    loads = [foot, *(load for _, load in constraint_loads(posture, response.constraint_impulses))]
    bodies = tree.momentum_slopes(slopes)
    for load in loads:
        bodies[load.joint] -= tree.moving_load(load, slopes.q)
    bodies[foot.joint] += tree.wrench_at(foot)[:, :3] @ slopes.impulse
    transmitted = np.array(response.joint_impulses)
    joints = tree.to_joints(bodies, transmitted, slopes.q)
    projector = posture.constraint_projector
    if projector is None:
        return joints
    least = np.linalg.pinv(projector.rows.T, rcond=RANK_TOLERANCE)
    rotors = posture.leg.workspace.model.armature[:, None] * slopes.jump
    gears = _gear_slopes(posture, response.constraint_impulses) @ slopes.q
    change = least @ (tree.along_axes(joints) + rotors - gears)
    if projector.rank < len(projector.rows):  # the smallest of several sets changes with A, too
        rates = _constraint_rates(posture, projector, least.T @ response.constraint_impulses)
        free = np.eye(len(projector.rows)) - projector.rows @ least.T
        change += free @ rates @ slopes.q
    reactions = np.zeros_like(bodies)
    for rows, load in constraint_loads(posture, np.ones(len(projector.rows))):
        size = rows.stop - rows.start
        reactions[load.joint] -= load.wrench[0] * tree.wrench_at(load)[:, :size] @ change[rows]
    return np.asarray(joints + tree.to_joints(reactions, 0.0 * transmitted, slopes.q))


class _Tree:
    """The bodies of a leg in world axes about its contact point, at a jump of the velocity."""

    def __init__(self, posture: Posture, jump: Array) -> None:
        model, data = posture.leg.workspace.model, posture.leg.workspace.data
        pin.forwardKinematics(model, data, posture.q)
        count = model.njoints
        self.parents = list(model.parents)
        self.poses = [
            pin.SE3(place.rotation, place.translation - posture.contact_point) for place in data.oMi
        ]
        self.inertias = [
            pose.act(inertia).matrix()
            for pose, inertia in zip(self.poses, list(model.inertias), strict=True)
        ]
        self.masses = [inertia.mass for inertia in list(model.inertias)]
        self.columns, self.axes = np.zeros((6, model.nv)), np.zeros((model.nv, 6))
        joint_of = np.zeros(model.nv, dtype=int)
        for joint in range(1, count):
            places = slice(model.idx_vs[joint], model.idx_vs[joint] + model.nvs[joint])
            axes = np.array(data.joints[joint].S).reshape(6, -1)
            self.axes[places], joint_of[places] = axes.T, joint
            self.columns[:, places] = self.poses[joint].toActionMatrix() @ axes
        self.joint_of = joint_of
        self.moves = [np.isin(joint_of, list(model.supports[joint])) for joint in range(count)]
        self.jumps = [self.columns[:, on] @ jump[on] for on in self.moves]
        self.turns = [_motion_cross(column) for column in self.columns.T]

    def momentum_slopes(self, slopes: ResponseSlopes) -> Array:
        """Return the derivatives of each body's momentum jump I A, shape `(bodies, 6, n)`."""
        answer = np.zeros((len(self.poses), 6, slopes.jump.shape[1]))
        for body in range(1, len(answer)):
            on, inertia = np.flatnonzero(self.moves[body]), self.inertias[body]
            momentum = inertia @ self.jumps[body]
            by_q = [
                -self.turns[m].T @ momentum
                - inertia @ self.turns[m] @ self.jumps[self.parents[self.joint_of[m]]]
                for m in on
            ]
            answer[body] = inertia @ self.columns[:, on] @ slopes.jump[on]
            answer[body] += np.array(by_q).T @ slopes.q[on]
            if self.masses[body]:
                answer[body] += np.outer(momentum / self.masses[body], slopes.mass[body - 1])
        return answer

    def wrench_at(self, load: ImpulsiveLoad) -> Array:
        """Return the map of a load's wrench to one about the contact point, shape `(6, 6)`."""
        transform = np.eye(6)
        transform[ANGULAR, LINEAR] = pin.skew(self.poses[load.joint].act(load.lever))
        return transform

    def moving_load(self, load: ImpulsiveLoad, q_slopes: Array) -> Array:
        """Return the derivative of a load that stays as it is while its point moves, `(6, n)`."""
        on, answer = self.moves[load.joint], np.zeros((6, q_slopes.shape[1]))
        columns, point = self.columns[:, on], self.poses[load.joint].act(load.lever)
        moving = (columns[LINEAR] - pin.skew(point) @ columns[ANGULAR]) @ q_slopes[on]
        answer[ANGULAR] = -pin.skew(load.wrench[LINEAR]) @ moving
        return answer

    def to_joints(self, bodies: Array, transmitted: Array, q_slopes: Array) -> Array:
        """Return derivatives of impulses in joints, in their axes, from those on bodies.

        `transmitted` has the impulses themselves, `(njoints, 6)`, whose axes turn with q.
        """
        sums, answer = bodies.copy(), np.zeros_like(bodies[1:])
        for joint in range(len(bodies) - 1, 0, -1):
            pose = self.poses[joint]
            wrench = pose.toDualActionMatrix() @ transmitted[joint - 1]
            on = np.flatnonzero(self.moves[joint])
            rotated = np.array([self.turns[m].T @ wrench for m in on]).T @ q_slopes[on]
            answer[joint - 1] = pose.toActionMatrix().T @ (sums[joint] + rotated)
            sums[self.parents[joint]] += sums[joint]
        return answer

    def along_axes(self, joints: Array) -> Array:
        """Return the components along the degrees of freedom, shape `(nv, n)`."""
        return np.asarray(np.einsum("ki,kin->kn", self.axes, joints[self.joint_of - 1]))


def _motion_cross(column: Array) -> Array:
    """Return the matrix of the cross product of motions; less its transpose, the one of forces."""
    matrix = np.zeros((6, 6))
    matrix[LINEAR, LINEAR] = matrix[ANGULAR, ANGULAR] = pin.skew(column[ANGULAR])
    matrix[LINEAR, ANGULAR] = pin.skew(column[LINEAR])
    return matrix


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
            "with respect to q are wrong there; model the joint as a chain of single-axis "
            "joints, which has the same motion and correct derivatives"
        )


def constrained_inverse_inertia(posture: Posture) -> Array:
    """Return M^-1, less what supports and loops block of it, shape `(nv, nv)`."""
    columns = posture.whiten(np.eye(posture.leg.nv))
    return columns.T @ columns


def _jacobian(posture: Posture, load: ImpulsiveLoad) -> Array:
    """Return the Jacobian of a load's point, linear then angular, `(6, nv)` [world axes]."""
    model, data = posture.leg.workspace.model, posture.leg.workspace.data
    pin.computeJointJacobians(model, data, posture.q)
    point = pin.SE3(np.eye(3), load.lever)
    rows = pin.getFrameJacobian(model, data, load.joint, point, pin.LOCAL_WORLD_ALIGNED)
    return np.reshape(rows, (6, model.nv))


def _velocity_by_q(
    posture: Posture, load: ImpulsiveLoad, jacobian: Array, velocity: Array
) -> Array:
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
    rows_q = _constraint_rates(posture, projector, velocity)
    change = np.linalg.lstsq(projector.rows, -rows_q, rcond=RANK_TOLERANCE)[0]
    return np.asarray(change - admissible @ change)


def _constraint_rates(posture: Posture, projector: ConstraintProjector, velocity: Array) -> Array:
    """Return the derivative of A v by q at a fixed velocity v, shape `(rows, nv)`."""
    rows_q = np.zeros((len(projector.rows), posture.leg.nv))
    # Ones give the sign with which each end counts.
    for rows, load in constraint_loads(posture, np.ones(len(projector.rows))):
        by_q = _velocity_by_q(posture, load, _jacobian(posture, load), velocity)
        rows_q[rows] += load.wrench[0] * by_q[: rows.stop - rows.start]
    constraints = projector.constraints
    rows, drivers = constraints.gear_rows, constraints.gears.driver_indices
    curvature = constraints.gears.values(posture.q, 2) * velocity[drivers]
    rows_q[range(rows.start, rows.stop), drivers] -= curvature
    return rows_q


def _gear_slopes(posture: Posture, impulses: Array) -> Array:
    """Return the derivative by q of what impulses of mimic joints do in the joints, `(nv, nv)`."""
    slopes, projector = np.zeros((posture.leg.nv, posture.leg.nv)), posture.constraint_projector
    if projector is not None:
        gears, rows = projector.constraints.gears, projector.constraints.gear_rows
        curvature = gears.values(posture.q, 2) * impulses[rows]
        np.subtract.at(slopes, (gears.driver_indices, gears.driver_indices), curvature)
    return slopes


def _closed(posture: Posture) -> Array:
    """Return the projector on the changes of q that leave the loops closed, `(nv, nv)`."""
    projector, identity = posture.constraint_projector, np.eye(posture.leg.nv)
    if projector is None:
        return identity
    rows = projector.rows[projector.constraints.loop_rows.start :]
    return np.asarray(identity - np.linalg.pinv(rows, rcond=RANK_TOLERANCE) @ rows)
