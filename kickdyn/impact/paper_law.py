"""The paper's law: restitution along the attack direction, friction from a cone test."""

from __future__ import annotations

import math

from kickdyn.impact.contact_problem import ContactProblem, Solution


def solve_paper(problem: ContactProblem) -> Solution:
    r"""Return the impulse of the paper's Eqs. (15)-(21).

    Eq. (10) with a particle for a ball gives the impulse

    .. math:: F = (1 + e)\, |u| \left(a^T J M^{-1} J^T a + \tfrac{1}{m}\right)^{-1} a

    along the attack direction a, that of the foot's velocity relative to the ball's centre. Its
    tangential part is transmitted in full if it lies inside the friction cone (stick, Eq. 18);
    else mu times the normal part is (slip, Eq. 19), in the plane of F and n (Eqs. 15-17).

    The ball's rotation takes no part in finding F, so restitution holds along the attack direction
    and not along the normal, and the spin can hold energy that nothing supplied: `energy_lost` can
    then be below that of a passive law, even negative.
    """
    n, u, e, mu = problem.normal, problem.centre_velocity, problem.restitution, problem.friction
    factor, ball = problem.delassus_factor, problem.ball
    speed = math.hypot(*u)
    attack = -u / speed
    row = attack @ factor
    full = (1.0 + e) * speed / (float(row @ row) + 1.0 / ball.mass) * attack
    normal = float(full @ n)
    tangential = full - normal * n
    size = math.hypot(*tangential)
    sticking = size <= mu * normal
    if not sticking:
        tangential *= mu * normal / size
    impulse = full if sticking else normal * n + tangential
    change = factor @ (impulse @ factor) + impulse / ball.mass + ball.turning * tangential
    mean_velocity = problem.velocity + 0.5 * change
    return Solution(impulse, sticking, -float(impulse @ mean_velocity), tangential)
