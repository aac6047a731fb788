"""The same impact by Pinocchio's own solver, with leg and free ball as one model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.approach import AT_REST, find_approach
from kickdyn.robot.leg import Posture


@dataclass(frozen=True, eq=False)
class EngineImpact:
    """The result of a frictionless strike by Pinocchio's solver.

    Attributes:
        impulse: on the ball, shape `(3,)` [N s, world frame].
        ball_after: just after.
        v_after: joint velocity, shape `(nv,)` [rad/s].
    """

    impulse: Array
    ball_after: BallState
    v_after: Array


def engine_strike(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
) -> EngineImpact:
    r"""Strike a ball by `pin.impulseDynamics`; arguments and errors as for `strike`.

    The solver knows no friction, so `contact.friction` must be 0. It is given one constraint row,
    :math:`n^T (J_\mathrm{ball} - J_\mathrm{foot})`, which always has rank one because of the ball,
    and those rows of supports and loops that are independent; with rows of lower rank its answer
    would be wrong without a warning.
    """
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin)
    ball.check_movable("Pinocchio's impulseDynamics")
    posture, before, n = approach.posture, approach.ball_before, contact.normal
    if contact.friction != 0.0:
        raise InvalidInput(
            f"friction is {contact.friction:g}: Pinocchio's impulseDynamics knows only 0"
        )

    leg = posture.leg
    model = leg.workspace.model.copy()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "kickdyn_ball")
    inertia = min(ball.inertia, ball.mass * ball.radius**2)  # nothing turns it, not even a particle
    rigid = pin.Inertia(ball.mass, np.zeros(3), inertia * np.eye(3))
    model.appendBodyToJoint(joint, rigid, pin.SE3.Identity())
    data = pin.Data(model)

    q = np.concatenate([posture.q, before.position, [0.0, 0.0, 0.0, 1.0]])
    velocity = np.concatenate([approach.v, before.velocity, before.spin])
    pin.computeJointJacobians(model, data, q)
    on_ball = pin.SE3(np.eye(3), -ball.radius * n)
    on_foot = pin.SE3(np.eye(3), posture.contact_lever.copy())
    ball_jacobian, foot_jacobian = (
        pin.getFrameJacobian(model, data, parent, placement, pin.LOCAL_WORLD_ALIGNED)[:3]
        for parent, placement in ((joint, on_ball), (leg.contact_joint, on_foot))
    )
    rows = n[None] @ (ball_jacobian - foot_jacobian)
    projector = posture.constraint_projector
    if projector is not None:  # as many rows as their rank; they are at rest before
        independent = projector.rows[projector.independent]
        rows = np.vstack([rows, np.hstack([independent, np.zeros((len(independent), 6))])])
    after = pin.impulseDynamics(model, data, q, velocity, rows, contact.restitution, 0.0)
    impulse = float(data.impulse_c[0]) * n
    ball_after = BallState(before.position, after[leg.nv : leg.nv + 3], after[leg.nv + 3 :])
    return EngineImpact(impulse, ball_after, after[: leg.nv])
