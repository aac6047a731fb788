"""How many digits rounding leaves of an impact: an estimate by first-order error analysis.

The constant is no proven bound: it was measured against 50 digits by law `newton` on random chains,
light feet, grazing contacts and slips near jamming (`tools/digits.py`).
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array, length
from kickdyn.impact.approach import EPS, Approach
from kickdyn.impact.contact_problem import Solution
from kickdyn.impact.leg_response import NO_CONSTRAINTS, joint_impulses, leg_response
from kickdyn.impact.sensitivity import impulse_by_velocity
from kickdyn.restitution import restitution_slope
from kickdyn.robot.leg import Posture

ROUNDINGS = 4.0
"""Number of roundings of each term of a sum; measured, see above."""


class Rounding(NamedTuple):
    """Shares that may be rounding: of the impulse, and of each joint's linear one, `(njoints,)`."""

    impulse: float
    joints: Array


def digits_left(share: float | Array) -> Array:
    """Return the number of digits that a share of rounding leaves, 0 to 16."""
    return np.asarray(np.clip(-np.log10(np.maximum(share, 1e-17)), 0.0, 16.0))


def estimate_rounding(approach: Approach, solution: Solution, joints: Array) -> Rounding:
    r"""Estimate which shares of the impulses are rounding.

    The relative velocity u, the Jacobian and M carry rounding. With the leg's responses to unit
    impulses along contact axes, it changes the velocity after the impact by at most :math:`\delta =
    \Delta G\,|p| + \Delta u`, and this changes the impulse by :math:`|C|\,\delta` with the
    derivative C of the contact law. Joints' impulses have shape `(njoints, 6)` [N s, N m s].
    """
    posture, problem, before = approach.posture, approach.contact_problem(), approach.ball_before
    (contact,) = problem.contacts
    rotations, relative = problem.in_contact_axes()
    (axes,), matrix = rotations, problem.delassus(rotations)
    still = np.zeros(posture.leg.nv)
    responses = [leg_response(posture, still, axis) for axis in axes.T]
    jumps = np.column_stack([response.v_after for response in responses])
    roots, sums = np.sqrt(matrix.diagonal()), np.sqrt(posture.inertia.diagonal()) @ abs(jumps)
    spread = _spread(posture, jumps)
    by_matrices = np.outer(roots, roots) + np.outer(sums, sums)
    matrix_error = np.hypot(by_matrices, spread[:, None] + spread)
    terms = abs(posture.jacobian).dot(abs(approach.v)) + abs(before.velocity)
    terms += abs(posture.transport_velocity)
    error = abs(axes.T).dot(terms) + _spread(posture, approach.v[:, None])
    error[:2] += approach.ball.radius * float(length(before.spin))
    impulse, tangential = solution.impulses[0], solution.tangential_impulses[0]
    p = np.append(axes[:, :2].T @ tangential, contact.normal @ impulse)
    turn = restitution_slope(approach.contact.restitution, approach.speed) * approach.speed
    error = np.hypot(length(matrix_error * p), (1.0 + contact.restitution + abs(turn)) * error)
    sliding = None if solution.sticking[0] else (relative + matrix @ p)[:2]
    slope = impulse_by_velocity(contact.friction, matrix, sliding, p)
    change = ROUNDINGS * EPS * length(slope * error)
    size = max(float(length(p)), np.finfo(float).tiny)  # below, float64 has fewer digits
    transmitted = np.column_stack(
        [length(response.joint_impulses[:, :3]) for response in responses]
    )
    lost = transmitted @ change + _of_joints(posture, impulse, joints)
    sizes = np.maximum(length(joints[:, :3]), np.finfo(float).tiny)
    return Rounding(float(length(change)) / size, lost / sizes)


def _of_joints(posture: Posture, impulse: Array, joints: Array) -> Array:
    """Return the rounding of joints' linear impulses where the impulse has none, `(njoints,)`.

    It shows in the difference between the answers of M and of `pin.aba`.
    """
    share = 32.0 * len(joints) * EPS
    lost = share * float(length(impulse))
    if posture.constraint_projector is not None:
        return np.full(len(joints), lost * posture.rounding_gain)
    jump = posture.solve(-impulse.dot(posture.jacobian))
    other, _ = joint_impulses(posture, jump, -impulse, NO_CONSTRAINTS)
    return np.asarray(lost + 2.0 * length((joints - other)[:, :3]))


def _spread(posture: Posture, velocities: Array) -> Array:
    """Return the sum of the speeds that joints give the foot, however much of it cancels [m/s].

    Velocities of the joints are columns, `(nv, n)`.
    """
    leg, space = posture.leg, posture.leg.workspace
    model, data = space.model, space.data
    pin.forwardKinematics(model, data, posture.q)
    total, reach = np.zeros(velocities.shape[1]), float(length(posture.contact_lever))
    joint = leg.contact_joint
    while joint:
        index = model.idx_vs[joint]
        motion = (
            np.reshape(data.joints[joint].S, (6, -1)) @ velocities[index : index + model.nvs[joint]]
        )
        total += length(motion[:3].T) + reach * length(motion[3:].T)
        reach += float(length(data.liMi[joint].translation))
        joint = model.parents[joint]
    return total
