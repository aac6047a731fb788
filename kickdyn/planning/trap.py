"""Planning the first touch: the foot's motion that leaves a moving ball at rest."""

import math

from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import ArrayLike
from kickdyn.planning.intercepting_kick import KickSettings
from kickdyn.planning.interception import FASTEST_BALL, IncomingBall
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.planning.kick_steps import checked_contact, checked_leg, checked_objective
from kickdyn.planning.moving_kick import plan_interception
from kickdyn.robot.leg import Leg


@validation.check_arguments
def plan_trap(
    leg: Leg,
    incoming: BallState | IncomingBall,
    ball: Ball,
    air: Air | None = None,
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    objective: str | None = None,
    contact: Contact | None = None,
    limits: bool | str = True,
    solver: str = "slsqp",
) -> KickPlan:
    r"""Find posture and joint velocity with which the foot leaves a moving ball at rest.

    It is a kick with another goal, a velocity v of the ball just after it: the impulse is
    :math:`p = m (v - v_0)`, and along its normal the foot has the velocity
    :math:`n \cdot v_0 + n \cdot W p / (1 + e)`. With restitution e, it retreats from the ball. The
    spin is braked as far as friction can do so; after a ball that rolls, some of it is left.

    Args:
        leg: the leg that kicks, as for `plan_kick`.
        incoming: the ball that moves, as for `plan_kick`.
        ball: the ball; its mass and radius count.
        air: the air; None is the vacuum.
        velocity: of the ball just after the contact, shape `(3,)` [m/s, world frame].
        objective: a `KickObjective` of the impact; None is `joint-speed`.
        contact: restitution, friction and offset of the contact, as for `plan_kick`.
        limits: whether limits of speed and torque hold, as for `plan_kick`.
        solver: name of the solver, as for `plan_kick`.

    Returns:
        The plan. Its `goal` is the ball with the wished velocity, without spin; `launch` is the
        ball with the spin that is left; `path` is followed to rest, each flight and the rolling for
        10 s at most.

    Raises:
        InvalidInput: a ball that moves so already, and as for `plan_kick`.

    Example:
        >>> import kickdyn as kd
        >>> rolls = kd.BallState((2, 0, -0.7042), (-2.5, 0, 0), (0, -22.77, 0))
        >>> plan = kd.plan_trap(kd.Leg.human(), rolls, kd.Ball(), kd.Air())
        >>> str(plan.status), bool(plan.impact.ball_after.speed < 1e-9)
        ('met', True)
    """
    moving_ball = incoming if isinstance(incoming, IncomingBall) else IncomingBall(incoming)
    wish = validation.vector("velocity", velocity, 3, unit="m/s")
    validation.number(
        "speed after the contact", math.hypot(*wish), at_most=FASTEST_BALL, unit="m/s"
    )
    settings = KickSettings(
        BallState(velocity=wish),
        ball,
        air,
        checked_contact(contact),
        checked_objective(objective),
        limits,
        None,
        solver,
    )
    return plan_interception(checked_leg(leg), moving_ball, settings)
