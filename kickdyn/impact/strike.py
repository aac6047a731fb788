"""The strike: everything about the instant when the foot hits the ball; and a peer by Pinocchio."""

from functools import lru_cache

import numpy as np
import pinocchio as pin

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.impact.approach import AT_REST, Approach, find_approach
from kickdyn.impact.contact_problem import Solution
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.laws import find_law, solve_contacts
from kickdyn.impact.leg_response import NO_CONSTRAINTS, response_to_jump
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.leg_model import Workspace


def strike(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
) -> Impact:
    r"""Strike a ball, in closed form (Eqs. 1-11 and 15-21).

    The relative velocity of the contact points before the impact and the Delassus matrix of leg and
    ball make a `ContactProblem`; an impact law solves it for the impulse p on the ball. Then

    .. math:: v^+ = v - M^{-1} J^T p, \qquad
              v_b^+ = v_b + p / m, \qquad \omega_b^+ = \omega_b - \frac{r}{I_b}\, n \times p .

    Args:
        posture: posture of the leg, whose contact frame touches the ball.
        v: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: the ball; its centre is at `contact point + radius * normal`.
        contact: normal, restitution, friction and offset of the contact.
        law: `newton` (kinematic restitution, exact Coulomb cone), `stronge` (energetic restitution;
            the sliding is followed through the contact) or `paper` (the ICRA 2005 paper's law).
        ball_velocity: velocity of its centre just before, shape `(3,)` [m/s, world frame].
        ball_spin: angular velocity just before, shape `(3,)` [rad/s, world frame].

    Raises:
        NoImpact: foot and ball do not approach each other along the normal, or by no more than 4
            times the rounding of terms that cancel.
        InvalidInput: a wrong shape, an entry that is not finite, or an unknown law.

    Example:
        >>> import kickdyn as kd
        >>> leg = kd.Leg.human()
        >>> posture = leg.posture([0.7, 0.5, -0.3])
        >>> contact = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
        >>> impact = kd.strike(posture, [6.6, -14.5, 6.6], kd.Ball(), contact)
        >>> round(impact.ball_after.speed, 2)  # [m/s]
        16.94
    """
    impact_law = find_law(law)
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin)
    solution = solve_contacts(approach.contact_problem(), impact_law)
    return Impact(approach, impact_law.name, solution)


def strike_by_pinocchio(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
) -> Impact:
    r"""Strike a ball without friction by `pin.impulseDynamics`: a peer of `strike`.

    The solver has a row A of constraints for leg and ball together, :math:`n^T (J_\mathrm{ball} -
    J_\mathrm{foot})`, and solves

    .. math:: A v^+ = -e A v, \qquad M (v^+ - v) = A^T \lambda .

    Of supports and loops, the independent rows are added; with rows of lower rank its answer would
    be wrong without a warning. The joint impulses follow from the velocity jump. The arguments are
    those of `strike`; friction and an obstacle raise `InvalidInput`.
    """
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin)
    posture, before = approach.posture, approach.ball_before
    contact, leg = approach.contact, posture.leg
    if contact.friction != 0.0:
        raise InvalidInput(
            f"friction is {contact.friction:g}: Pinocchio's impulseDynamics has none, it must be 0"
        )
    ball.check_movable("Pinocchio's impulseDynamics")
    n, e = contact.normal, approach.restitution
    inertia = min(ball.inertia, ball.mass * ball.radius**2)  # nothing turns it, not even a particle
    space, joint = with_ball(leg, ball.mass, inertia)
    q, velocity = joined_state(approach)
    rows = contact_row(approach, space, joint, q)
    projector = posture.constraint_projector
    if projector is not None:  # as many rows as their rank; they are at rest before
        independent = projector.rows[projector.independent]
        rows = np.vstack([rows, np.hstack([independent, np.zeros((len(independent), 6))])])
    # stiff joints keep their velocity: seen from a velocity that has it, they are at rest
    shared = np.linalg.lstsq(rows, np.append(0.0, rows[1:] @ velocity), rcond=None)[0]
    after = pin.impulseDynamics(space.model, space.data, q, velocity - shared, rows, e, 0.0)
    after = after + shared
    p, *constraint_impulses = space.data.impulse_c.tolist()
    reaction = NO_CONSTRAINTS
    if projector is not None:
        reaction = np.zeros(len(projector.rows))
        reaction[projector.independent] = constraint_impulses

    lost = 0.5 * p * (1.0 - e) * approach.speed
    solution = Solution((p * n).reshape(1, 3), (False,), lost, np.zeros((1, 3)))
    jump, of_ball = after[: leg.nv] - approach.v, after[leg.nv :]
    response = response_to_jump(posture, approach.v, jump, p * n, reaction)
    velocity_after = of_ball[:3] + posture.transport_velocity
    ball_after = BallState.computed(before.position, velocity_after, of_ball[3:].copy())
    return Impact(approach, "newton", solution, response=response, _ball_after=ball_after)


@lru_cache(maxsize=4)
def with_ball(leg: Leg, mass: float, inertia: float) -> tuple[Workspace, int]:
    """Return the model of a leg and a free ball, without gravity, and the ball's joint."""
    model = leg.model
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "kickdyn_ball")
    rigid = pin.Inertia(mass, np.zeros(3), inertia * np.eye(3))
    model.appendBodyToJoint(joint, rigid, pin.SE3.Identity())
    return Workspace(model), joint


def joined_state(approach: Approach) -> tuple[Array, Array]:
    """Return configuration and velocity of leg and ball as one model, seen from the base."""
    before = approach.ball_before
    q = np.concatenate([approach.posture.q, before.position, [0.0, 0.0, 0.0, 1.0]])
    velocity = before.velocity - approach.posture.transport_velocity
    return q, np.concatenate([approach.v, velocity, before.spin])


def contact_row(approach: Approach, space: Workspace, ball_joint: int, q: Array) -> Array:
    """Return the row of the contact in the model of leg and ball, shape `(1, nv + 6)`."""
    posture, n = approach.posture, approach.contact.normal
    pin.computeJointJacobians(space.model, space.data, q)
    points = (
        (ball_joint, -approach.ball.radius * n),
        (posture.leg.contact_joint, posture.contact_lever.copy()),
    )
    ball, foot = (
        pin.getFrameJacobian(
            space.model, space.data, joint, pin.SE3(np.eye(3), lever), pin.LOCAL_WORLD_ALIGNED
        )[:3]
        for joint, lever in points
    )
    return np.asarray(n[None] @ (ball - foot))
