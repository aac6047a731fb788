"""Impact laws: from the velocities before to the impulse on the ball, with friction, in 3-D."""

from __future__ import annotations

import math

from kickdyn.core import validation
from kickdyn.errors import InvalidInput
from kickdyn.impact.contact_problem import ContactProblem as ContactProblem
from kickdyn.impact.contact_problem import Law
from kickdyn.impact.contact_problem import Solution as Solution
from kickdyn.impact.newton_law import newton as newton
from kickdyn.impact.stronge_law import stronge as stronge


def normal_impulse(
    approach_speed: float, restitution: float, leg_mass: float, ball_mass: float = math.inf
) -> float:
    """Return the frictionless impulse of Eq. (10) [N s].

    Args:
        approach_speed: of the foot towards the ball along the normal [m/s], 0 or more.
        restitution: coefficient e, 0 to 1.
        leg_mass: the leg's effective mass along the normal [kg], above 0; inf is immovable.
        ball_mass: [kg], above 0; inf, when not named, is an obstacle that does not move: the case
            of Table 2.

    Raises:
        InvalidInput: a value outside its range, or two immovable bodies.
    """
    speed = validation.number("approach speed", approach_speed, at_least=0, unit="m/s")
    e = validation.number("restitution", restitution, at_least=0, at_most=1)
    give = 0.0
    for name, mass in (("leg mass", leg_mass), ("ball mass", ball_mass)):
        if mass != math.inf:
            give += 1.0 / validation.number(name, mass, above=0, unit="kg")
    if give == 0.0:
        raise InvalidInput("leg mass and ball mass are both inf: one of them must move")
    return (1.0 + e) * speed / give


def paper(problem: ContactProblem) -> Solution:
    """Return the impulse of the paper's Eqs. (15)-(21).

    Eq. (10) with a particle for a ball gives the impulse F along the attack direction, the foot's
    velocity relative to the ball. Its part across the normal is transmitted in full if it lies
    inside the friction cone (stick, Eq. 18); else mu times the normal part is (slip, Eq. 19),
    along T, the direction in the plane of F and n (Eqs. 15-17).

    The turning of the ball takes no part in finding F, so restitution holds along the attack
    direction and not along the normal, and the spin can hold energy that nothing paid for:
    `energy_lost` is then below what a passive law gives, even negative.
    """
    n, u, e, mu = problem.normal, problem.centre_velocity, problem.restitution, problem.friction
    speed = math.hypot(*u)
    attack = -u / speed
    row = attack @ problem.leg_rows
    leg_give = float(row @ row)
    full = (1.0 + e) * speed / (leg_give + 1.0 / problem.ball.mass) * attack
    normal = float(full @ n)
    across = full - normal * n
    size = math.hypot(*across)
    sticking = size <= mu * normal
    tangential_impulse = across if sticking else mu * normal / size * across
    impulse = full if sticking else normal * n + tangential_impulse
    change = problem.leg_rows @ (impulse @ problem.leg_rows) + impulse / problem.ball.mass
    mean = problem.velocity + 0.5 * (change + problem.ball.turning * tangential_impulse)
    return Solution(impulse, sticking, -float(impulse @ mean), tangential_impulse)


LAWS: dict[str, Law] = {"newton": newton, "stronge": stronge, "paper": paper}
"""Every impact law by name."""
