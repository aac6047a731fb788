"""Planned kicks corrected by what a contact that takes time makes of them."""

from enum import StrEnum

import numpy as np

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.collide import collide
from kickdyn.planning.kick import replan_motion
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.simulators.run_in_mujoco import run_in_mujoco


class Observer(StrEnum):
    """What gives the ball of a planned kick: `collide`, or the motion in MuJoCo."""

    COLLIDE = "collide"
    MUJOCO = "mujoco"


@validation.check_arguments
def refine_kick(plan: KickPlan, rounds: int = 2, by: str = Observer.COLLIDE) -> KickPlan:
    r"""Correct the commanded launch of a plan by the ball that a contact of 10 ms gives.

    `strike`, by which kicks are planned, has no duration. In a real contact the foot turns under
    the ball, and the robot does not follow its motion exactly. In each round the motion is planned
    again, from the one before, for the launch

    .. math:: v_{k+1} = v_k + v^* - \hat v_k

    with the launch :math:`v^*` of the goal and the ball :math:`\hat v_k` that was observed.

    Args:
        plan: with a `motion`.
        rounds: number of corrections, 1 to 10.
        by: `collide`, or `mujoco` for `run_in_mujoco` with its default contact.

    Returns:
        The plan, of all rounds and the first one, whose ball is nearest to the launch of the goal.
        Its `impact`, `path` and `landing_error` belong to the commanded launch by `strike`,
        which misses the target by what the contact is expected to add; `run_in_mujoco(...).miss`
        is the distance of the simulated ball from the target.

    Raises:
        InvalidInput: a plan without a motion.
        KickdynError: a foot that misses the ball.
    """
    chosen = validation.choice("by", by, Observer)
    validation.check_type(int, rounds=rounds)
    validation.number("rounds", rounds, at_least=1, at_most=10)
    if plan.motion is None:
        raise InvalidInput("the plan has no motion: plan it with plan_kick(..., motion=True)")
    launch = plan.launch.velocity
    tried = [(plan, _observe(plan, chosen))]
    for _ in range(rounds):
        latest, velocity = tried[-1]
        command = latest.impact.ball_after.velocity + launch - velocity
        corrected = replan_motion(latest, command)
        tried.append((corrected, _observe(corrected, chosen)))
    return min(tried, key=lambda pair: float(np.linalg.norm(pair[1] - launch)))[0]


def _observe(plan: KickPlan, by: Observer) -> Array:
    """Return the velocity of the ball that a plan gives, shape `(3,)` [m/s]."""
    impact = plan.impact
    if by is Observer.COLLIDE:
        hit = collide(impact.posture, impact.v_before, impact.ball, impact.contact)
        return np.asarray(hit.ball_after.velocity)
    run = run_in_mujoco(plan)
    if run.path is None:
        raise KickdynError("the foot does not reach the ball in MuJoCo: nothing can be corrected")
    return np.asarray(run.ball_after.velocity)
