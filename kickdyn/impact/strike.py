"""The strike: everything about the instant when the foot hits the ball."""

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.validation import ArrayLike
from kickdyn.impact.approach import AT_REST, find_approach
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.laws import find_law, solve_contacts
from kickdyn.robot.leg import Posture


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
