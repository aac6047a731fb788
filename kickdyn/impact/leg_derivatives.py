"""What small changes do to a leg in a strike, while the impulse on the ball is held.

Supports and loops, A v = 0, hold before and after: where A changes, velocities follow by the least
change, by kinetic energy, that keeps it so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.joint_impulses import at_joint
from kickdyn.robot.constraints import INDEPENDENT
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.model_validation import listed

ELSEWHERE, STEADY = 0.7, 1e-9
"""Joint angles [rad, m] and the change of their axes up to which these count as fixed."""

LINEAR, ANGULAR = slice(0, 3), slice(3, 6)


class LegSlopes(NamedTuple):
    """Derivatives of a leg's velocities.

    Attributes:
        let: of v by itself: what supports and loops let of it, shape `(nv, nv)`.
        foot_q, foot_q_after: of the contact point's velocity by q, before, and after while v_after
            stays, shape `(3, nv)` [m/s per rad].
        v_after_q: of v_after by q, shape `(nv, nv)`.
    """

    let: Array
    foot_q: Array
    foot_q_after: Array
    v_after_q: Array


class _Load(NamedTuple):
    """An impulse and its moment on a joint's body, at a point of it.

    Attributes:
        joint: where.
        turn: from the joint's axes to the world's, shape `(3, 3)`.
        lever: of the point, from the joint's origin, in its axes [m].
        given: shape `(6,)` [N s, N m s, world axes].
    """

    joint: int
    turn: Array
    lever: Array
    given: Array


def leg_slopes(
    posture: Posture, v: Array, v_after: Array, impulse: Array, held: Array
) -> LegSlopes:
    """Differentiate the leg's velocities.

    Args:
        posture: of the leg.
        v: joint velocity before, shape `(nv,)` [rad/s].
        v_after: and after.
        impulse: on the ball, shape `(3,)` [N s].
        held: impulses of supports and loops, as `Impact.constraint_impulses`.

    Raises:
        InvalidInput: a joint whose axes depend on its own angles (universal, composite, Euler).
    """
    leg, space = posture.leg, posture.leg.workspace
    check_steady(leg)
    model, data, nv, still = space.model, space.data, leg.nv, space.still
    push = np.concatenate([-impulse, np.zeros(3)])
    foot = _Load(leg.contact_joint, posture.rotation_world_joint, posture.contact_lever, push)
    loads = [foot, *(load for _, load in _carried(posture, held))]
    jacobians = [_jacobian(posture, load) for load in loads]
    space.pushes.fill(0.0)
    for load in loads:
        space.pushes[load.joint] += at_joint(load.turn.T, load.lever, load.given)
    jump = v_after - v
    by_q = pin.computeRNEADerivatives(model, data, posture.q, still, jump, space.external)[0]
    left_over = np.array(by_q).reshape(nv, nv)
    for load, jacobian in zip(loads, jacobians, strict=True):
        # Pinocchio turns the impulse with the body; ours stays as it is in the world.
        for part in (LINEAR, ANGULAR):
            left_over -= jacobian[part].T @ pin.skew(load.given[part]) @ jacobian[ANGULAR]

    answer, let, closed = response(posture), _let(posture), _closed(posture)
    before, after = (_moved(posture, foot, jacobians[0], one)[LINEAR] for one in (v, v_after))
    before = before + posture.jacobian @ _followed(posture, v, let)
    return LegSlopes(
        let=let,
        foot_q=before @ closed,
        foot_q_after=after @ closed,
        v_after_q=(_followed(posture, v_after, let) - answer @ left_over) @ closed,
    )


def inertia_slopes(posture: Posture, jump: Array) -> Array:
    """Return d(v_after)/d(links' inertias), shape `(nv, 10 * links)`.

    Args:
        posture: of the leg.
        jump: v_after - v, shape `(nv,)` [rad/s].
    """
    space, nv = posture.leg.workspace, posture.leg.nv
    rows = pin.computeJointTorqueRegressor(space.model, space.data, posture.q, space.still, jump)
    return np.asarray(-response(posture) @ np.reshape(rows, (nv, -1)))


def check_steady(leg: Leg) -> None:
    """Raise `InvalidInput` for joints whose axes turn with their own angles, as of a cardan joint.

    Pinocchio's derivatives by q leave out how the axes turn, and do not say so.
    """
    model, data, found = leg.workspace.model, leg.workspace.data, []
    neutral = pin.neutral(model)
    for q in (neutral, pin.integrate(model, neutral, ELSEWHERE * np.ones(leg.nv))):
        pin.forwardKinematics(model, data, q)
        found.append([np.array(joint.S) for joint in list(data.joints)[1:]])
    turning = [
        name
        for name, one, other in zip(leg.joint_names, *found, strict=True)
        if np.abs(one - other).max() > STEADY
    ]
    if turning:
        raise InvalidInput(
            f"axes of {listed(turning)} depend on the joint's own angles: Pinocchio's derivatives "
            "by q are wrong there (joints of one axis in a row move alike, and theirs are right)"
        )


def response(posture: Posture) -> Array:
    """Return M^-1, less what supports and loops block of it, shape `(nv, nv)`."""
    units = np.eye(posture.leg.nv)
    if posture.constraint_projector is None:
        return posture.solve(units)
    return np.column_stack([posture.solve(unit) for unit in units])


def per_mass(posture: Posture) -> Array:
    """Return d(inertias)/d(mass) of each link, centre of mass and radii of gyration held."""
    inertias = list(posture.leg.workspace.model.inertias)[1:]
    matrix = np.zeros((10 * len(inertias), len(inertias)))
    for i, inertia in enumerate(inertias):
        if inertia.mass > 0.0:  # a virtual link between joints has none to scale
            matrix[10 * i : 10 * i + 10, i] = inertia.toDynamicParameters() / inertia.mass
    return matrix


def _carried(posture: Posture, held: Array) -> list[tuple[slice, _Load]]:
    """Return what supports and loops give to the bodies at their ends, with its rows of A."""
    loads = []
    for block in posture.constraint_projector.blocks if posture.constraint_projector else ():
        for end, joint in enumerate((block.joint, block.other)):
            if joint:
                given = np.zeros(6)
                given[: block.at.stop - block.at.start] = held[block.at] * (1.0, -1.0)[end]
                load = _Load(joint, block.turns[end].T, block.levers[end], given)
                loads.append((block.at, load))
    return loads


def _jacobian(posture: Posture, load: _Load) -> Array:
    """Return the Jacobian of a load's point, linear then angular, `(6, nv)` [world axes]."""
    model, data = posture.leg.workspace.model, posture.leg.workspace.data
    local = pin.computeJointJacobian(model, data, posture.q, load.joint).reshape(6, model.nv)
    moving = local[LINEAR] - pin.skew(load.lever) @ local[ANGULAR]
    return np.vstack([load.turn @ moving, load.turn @ local[ANGULAR]])


def _moved(posture: Posture, load: _Load, jacobian: Array, velocity: Array) -> Array:
    """Return d(J velocity)/dq of a load's point, linear then angular, `(6, nv)` [world axes]."""
    model, data = posture.leg.workspace.model, posture.leg.workspace.data
    # In the joint's axes, then turned with them: Pinocchio's answer in aligned axes is another.
    pin.computeForwardKinematicsDerivatives(model, data, posture.q, velocity, 0.0 * velocity)
    point = pin.SE3(np.eye(3), load.lever)
    by_q, _ = pin.getFrameVelocityDerivatives(model, data, load.joint, point, pin.LOCAL)
    by_q, speed = np.reshape(by_q, (6, model.nv)), jacobian @ velocity
    return np.vstack(
        [
            load.turn @ by_q[part] - pin.skew(speed[part]) @ jacobian[ANGULAR]
            for part in (LINEAR, ANGULAR)
        ]
    )


def _followed(posture: Posture, velocity: Array, let: Array) -> Array:
    """Return the least change of a velocity that keeps A v = 0 while q changes, `(nv, nv)`."""
    hold, nv = posture.constraint_projector, posture.leg.nv
    if hold is None:
        return np.zeros((nv, nv))
    rows_q = np.zeros((len(hold.rows), nv))
    # one in every row: the sign with which each end counts
    for at, load in _carried(posture, np.ones(len(hold.rows))):
        moved = _moved(posture, load, _jacobian(posture, load), velocity)
        rows_q[at] += load.given[0] * moved[: at.stop - at.start]
    some = np.linalg.lstsq(hold.rows, -rows_q, rcond=INDEPENDENT)[0]
    return np.asarray(some - let @ some)


def _let(posture: Posture) -> Array:
    """Return the projector on what supports and loops let, by kinetic energy, `(nv, nv)`."""
    units = np.eye(posture.leg.nv)
    if posture.constraint_projector is None:
        return units
    return np.column_stack([posture.admissible(unit) for unit in units])


def _closed(posture: Posture) -> Array:
    """Return the projector on the changes of q that leave the loops closed, `(nv, nv)`."""
    hold, nv = posture.constraint_projector, posture.leg.nv
    if hold is None or not hold.constraints.loops:
        return np.eye(nv)
    rows = hold.rows[sum(support.size for support in hold.constraints.supports) :]
    return np.asarray(np.eye(nv) - np.linalg.pinv(rows, rcond=INDEPENDENT) @ rows)
