"""The paper's law: restitution along the attack direction, friction from a cone test."""

import math

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.impact.contact_problem import ContactProblem, ImpactLaw, Solution


def solve_paper(problem: ContactProblem) -> Solution:
    r"""Return the impulse of the paper's Eqs. (15)-(21).

    The paper does not print the size of the force F of a leg with friction. In kickdyn it is
    Eq. (10) with a particle for a ball,

    .. math:: F = (1 + e)\, |u| \left(a^T J M^{-1} J^T a + \tfrac{1}{m}\right)^{-1} a

    along the attack direction a, the direction of the foot's velocity relative to the ball's
    centre. Eq. (10) along the normal, as `kickdyn.paper.tables_4_5` has it, is another reading.

    The ball's rotation takes no part in finding F, so restitution holds along the attack direction
    and not along the normal, and the spin can hold energy that nothing supplied: `energy_lost` can
    then be less than by a passive law, even negative.
    """
    (contact,) = problem.contacts
    normal, centre_velocity = contact.normal, np.array(contact.centre_velocity)
    speed = math.hypot(*contact.centre_velocity)
    attack = -centre_velocity / speed
    full = (1.0 + contact.restitution) * speed / problem.inverse_mass(attack) * attack
    impulse, tangential, sticking = limit_friction(full, normal, contact.friction)
    before = float(tangential.dot(contact.velocity) - impulse.dot(normal) * contact.approach_speed)
    size = math.hypot(*impulse.tolist())
    gained = size * size * problem.inverse_mass(impulse / size)
    gained += float(tangential.dot(tangential)) * sum(body.turning for body in problem.bodies)
    lost = -before - 0.5 * gained
    return Solution(impulse[None], (sticking,), lost, tangential[None])


def limit_friction(force: Array, normal: Array, friction: float) -> tuple[Array, Array, bool]:
    r"""Return the impulse on the ball, its part across the normal, and whether the contact sticks.

    The part of F across the normal is transmitted in full inside the friction cone (stick, Eq. 18);
    else mu times the part along it is (slip, Eq. 20), in the plane of F and n (Eqs. 15-17). Shapes
    `(3,)` [N s].
    """
    along = float(force.dot(normal))
    tangential = force - along * normal
    size = math.hypot(*tangential.tolist())
    sticking = size <= friction * along
    if not sticking:
        tangential *= friction * along / size
    return force if sticking else along * normal + tangential, tangential, sticking


PAPER = ImpactLaw("paper", solve_paper)
"""The law of the ICRA 2005 paper."""
