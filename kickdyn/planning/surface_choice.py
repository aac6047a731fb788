"""The surface of a foot whose kick depends least on where exactly the ball lies."""

from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.errors import InvalidInput
from kickdyn.ground import Surface
from kickdyn.planning.goal import Goal, PlanStatus
from kickdyn.planning.kick import plan_kick
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.robot.foot_surfaces import kick_with
from kickdyn.robot.leg import Leg

CANDIDATES = ("inside", "instep", "outside", "toe")
"""Surfaces that are compared."""


@validation.check_arguments
def choose_surface(
    leg: Leg,
    goal: Goal,
    ball: Ball,
    air: Air | None = None,
    *,
    contact: Contact | None = None,
    surface: str | Surface | None = None,
) -> Leg:
    """Return a leg that kicks with the surface for which the place of the ball matters least.

    A kick without a motion is planned with the inside, the instep, the outside and the toe of the
    foot. Of the kicks that meet the goal, the one with the least
    `sensitivity_to_ball.velocity_change` is chosen; if none meets it, the one with the largest
    `share` of the launch. A round toe is thus chosen only where no flatter surface meets the goal.

    Args:
        leg: whose contact frame is on the foot, as for `kick_with`.
        goal: as for `plan_kick`, as are all of the following.
        ball: the ball.
        air: the air; None is the vacuum.
        contact: restitution and friction.
        surface: surface of the ground, for a ball that is played along it.

    Returns:
        The leg, for `plan_kick`; its `frame` has the name of the surface.

    Raises:
        InvalidInput: no surface can give the ball the launch, or as for `kick_with` and
            `plan_kick`.

    Example:
        >>> import kickdyn as kd
        >>> talos = kd.Leg.from_robot("talos", legs_only=True)  # whose toe is flat
        >>> kd.choose_surface(talos, kd.Goal(3, time=0.6), kd.Ball()).frame
        'toe'
    """
    ranks, fault = dict[Leg, tuple[bool, float, float]](), InvalidInput("")
    for name in CANDIDATES:
        try:
            kicking = kick_with(leg, name)
            plan = plan_kick(kicking, goal, ball, air, contact=contact, surface=surface)
            ranks[kicking] = _rank(plan)
        except InvalidInput as error:
            fault = error
    if not ranks:
        raise fault
    return min(ranks, key=ranks.__getitem__)


def _rank(plan: KickPlan) -> tuple[bool, float, float]:
    """Return what is less for a better plan: whether it misses the goal, then its sensitivity."""
    met, change = plan.status == PlanStatus.MET, plan.sensitivity_to_ball
    assert change is not None  # a kick to a goal
    return not met, 0.0 if met else -plan.share, change.velocity_change
