"""The registry of impact laws, each of which maps a contact problem to impulses; the paper's law.

A new law is a module like `stronge_law.py`, which ends with its `ImpactLaw`, and a line in `LAWS`.
"""

import math

import numpy as np

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.contact_problem import ContactProblem, ImpactLaw, Solution
from kickdyn.impact.newton_law import NEWTON
from kickdyn.impact.stronge_law import STRONGE


def solve_paper(problem: ContactProblem) -> Solution:
    r"""Return the impulse of the paper's Eqs. (15)-(21).

    The paper does not print the size of the force F of a leg with friction. In kickdyn it is
    Eq. (10) with a particle for a ball,

    .. math:: F = (1 + e)\, |u| \left(a^T J M^{-1} J^T a + \tfrac{1}{m}\right)^{-1} a

    along the attack direction a, the direction of the foot's velocity relative to the ball's
    centre; `kickdyn.paper.tables_4_5` has another reading. The ball's rotation takes no part in
    finding F: the spin can have energy that nothing supplied, and `energy_lost` be negative.
    """
    (contact,) = problem.contacts
    normal, centre_velocity = contact.normal, np.array(contact.centre_velocity)
    speed = math.hypot(*contact.centre_velocity)
    attack = -centre_velocity / speed
    full = (1.0 + contact.restitution) * speed / problem.inverse_mass(attack) * attack
    impulse, tangential, sticking = limit_friction(full, normal, contact.friction)
    before = float(tangential.dot(contact.velocity) - impulse.dot(normal) * contact.approach_speed)
    axes, _ = problem.in_contact_axes()
    in_axes = axes[0].T.dot(impulse)
    lost = -before - 0.5 * float(in_axes.dot(problem.delassus(axes)).dot(in_axes))
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

LAWS: dict[str, ImpactLaw] = {law.name: law for law in (NEWTON, STRONGE, PAPER)}
"""Impact laws by name.

`newton` has kinematic restitution and the exact Coulomb cone, `stronge` has energetic restitution
and follows the sliding through the contact, and `paper` is the law of the ICRA 2005 paper.
"""


def find_law(value: object, what: str = "impact law") -> ImpactLaw:
    """Return the law of a name, or raise `InvalidInput`; `what` is for the message."""
    if isinstance(value, str) and value in LAWS:
        return LAWS[value]
    raise InvalidInput(f"{what} is {validation.brief(value)}: it must be one of {', '.join(LAWS)}")


def names_of_laws(ability: str) -> str:
    """Return the quoted names of the laws with an ability, an attribute of `ImpactLaw`."""
    return " or ".join(repr(law.name) for law in LAWS.values() if getattr(law, ability))


def solve_contacts(problem: ContactProblem, law: ImpactLaw) -> Solution:
    """Return the solution of a contact problem by an impact law.

    `InvalidInput` is raised for several contacts that the law cannot solve at once, `KickdynError`
    if the law finds no impulse, as for masses that are too different.
    """
    contacts = problem.contacts
    solve = law.solve if len(contacts) == 1 else law.solve_several
    if solve is None:
        raise InvalidInput(
            f"impact law is {law.name!r}, which is defined for one contact: {len(contacts)} "
            "simultaneous contacts, as of feet that may lift off, need "
            f"{names_of_laws('solve_several')}"
        )
    try:
        solution = solve(problem)
    except np.linalg.LinAlgError:
        solution = None
    if solution is None or not math.isfinite(solution.energy_lost):
        raise KickdynError(
            f"law {law.name!r} finds no impulse (restitution {contacts[0].restitution:g}, friction "
            f"{contacts[0].friction:g}, relative velocity {list(contacts[0].velocity)} m/s)"
        )
    validation.protect(solution.impulses, solution.tangential_impulses)
    return solution


def normal_impulse(
    approach_speed: float, restitution: float, leg_mass: float, ball_mass: float = math.inf
) -> float:
    r"""Return the frictionless impulse of Eq. (10), :math:`(1 + e)\, u / (1/M + 1/m)` [N s].

    Args:
        approach_speed: speed u of the foot towards the ball along the normal [m/s], 0 or more.
        restitution: coefficient e, 0 to 1.
        leg_mass: effective mass M of the leg along the normal [kg], above 0; inf is an immovable
            leg.
        ball_mass: mass m of the ball [kg], above 0; inf, the default, is an obstacle that does not
            move, as in Table 2.

    Raises:
        InvalidInput: a value outside its range, or two immovable bodies.

    Example:
        >>> import kickdyn as kd
        >>> p = kd.normal_impulse(10.0, restitution=0.8, leg_mass=2.0, ball_mass=0.43)  # at 10 m/s
        >>> round(p, 2)
        6.37
    """
    speed = validation.number("approach speed", approach_speed, at_least=0, unit="m/s")
    e = validation.number("restitution", restitution, at_least=0, at_most=1)
    inverse_mass = 0.0
    for name, mass in (("leg mass", leg_mass), ("ball mass", ball_mass)):
        if not (isinstance(mass, float) and mass == math.inf):
            inverse_mass += 1.0 / validation.number(name, mass, above=0, unit="kg")
    if inverse_mass == 0.0:
        raise InvalidInput("leg mass and ball mass are both inf: one of them must move")
    return (1.0 + e) * speed / inverse_mass
