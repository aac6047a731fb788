"""The same impact by Pinocchio's own solver: leg and free ball as one model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.approach import AT_REST, approach
from kickdyn.robot.leg import Posture


@dataclass(frozen=True, eq=False)
class EngineImpact:
    """What Pinocchio's solver says of a frictionless strike.

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
    """Strike a ball by `pin.impulseDynamics`; arguments and errors as for `strike`.

    The solver knows no friction: `contact.friction` must be 0. It gets one row, n^T (J_ball -
    J_foot), which always has rank one thanks to the ball, and those rows of supports and loops
    that are independent; with rows of lower rank it would answer wrongly without a word.
    """
    posture, v, _, before, _ = approach(posture, v, ball, contact, ball_velocity, ball_spin)
    if contact.friction != 0.0:
        raise InvalidInput(
            f"friction is {contact.friction:g}: Pinocchio's impulseDynamics knows only 0"
        )

    leg = posture.leg
    model = leg.workspace.model.copy()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "kickdyn_ball")
    inertia = min(ball.inertia, ball.mass * ball.radius**2)  # it will not turn, a particle neither
    rigid = pin.Inertia(ball.mass, np.zeros(3), inertia * np.eye(3))
    model.appendBodyToJoint(joint, rigid, pin.SE3.Identity())
    lever = pin.SE3(np.eye(3), -ball.radius * contact.normal)
    frame = pin.Frame("kickdyn_contact", joint, 0, lever, pin.FrameType.OP_FRAME)
    ball_frame = model.addFrame(frame)
    patch = pin.SE3(np.eye(3), np.zeros(3) if contact.offset is None else contact.offset.copy())
    foot = model.frames[leg.frame_id].placement * patch
    frame = pin.Frame("kickdyn_patch", leg.contact_joint, 0, foot, pin.FrameType.OP_FRAME)
    foot_frame = model.addFrame(frame)
    data = pin.Data(model)

    both_q = np.concatenate([posture.q, before.position, [0.0, 0.0, 0.0, 1.0]])
    both_v = np.concatenate([v, before.velocity, before.spin])
    pin.computeJointJacobians(model, data, both_q)
    foot_row, ball_row = (
        contact.normal @ pin.getFrameJacobian(model, data, frame_id, pin.LOCAL_WORLD_ALIGNED)[:3]
        for frame_id in (foot_frame, ball_frame)
    )
    rows = (ball_row - foot_row).reshape(1, model.nv)
    if posture.constraint_projector is not None:  # as many as their rank; before, they are at rest
        held = posture.constraint_projector.rows[posture.constraint_projector.independent]
        rows = np.vstack([rows, np.hstack([held, np.zeros((len(held), 6))])])
    after = pin.impulseDynamics(model, data, both_q, both_v, rows, contact.restitution, 0.0)
    impulse = float(data.impulse_c[0]) * contact.normal
    kicked = BallState(before.position, after[leg.nv : leg.nv + 3], after[leg.nv + 3 :])
    return EngineImpact(impulse, kicked, after[: leg.nv])
