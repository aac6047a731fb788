"""What the paper leaves open, and how it is filled in: coefficients, and launch from contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kickdyn.aerodynamics.coefficient_model import Coefficient
from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.impact.contact_problem import ContactProblem
from kickdyn.impact.paper_law import solve_paper
from kickdyn.paper.item import Item

BALL = Ball.paper()
FRICTION = 0.4
"""Between foot and ball, in all of the paper's simulations."""

RESTITUTION = 0.8
"""Not printed; what Table 2 needs."""


@dataclass(frozen=True)
class Coefficients:
    """A named choice of the models of C_D and C_L, as the paper prints none."""

    name: str
    drag: str | Coefficient = "brazuca"
    lift: str | Coefficient = "saturating"

    def air(self, *, lift: bool = True) -> Air:
        """Return the air of Table 3 with these coefficients."""
        return Air.paper(drag=self.drag, lift=self.lift if lift else None)


DEFAULT = Coefficients("drag brazuca, lift saturating")
LIFT_WITHOUT_CRISIS = Coefficients("lift wang", lift="wang")
ALTERNATIVES = (
    *(Coefficients(f"drag {name}", name) for name in ("tango12", "teamgeist", "jabulani")),
    Coefficients("drag sphere", "sphere"),
    LIFT_WITHOUT_CRISIS,
    *(Coefficients(f"C_D = {value:g}", constant(value)) for value in (0.2, 0.25, 0.47)),
)
"""Every other choice that can hold at a soccer ball's speeds, and three constants."""


def with_others(items: Callable[[Coefficients], list[Item]]) -> list[Item]:
    """Return a figure's items with every other choice of coefficients."""
    return [replace(item, variant=choice.name) for choice in ALTERNATIVES for item in items(choice)]


def direction(elevation_deg: float, left_deg: float = 0.0) -> Array:
    """Return the unit vector at angles above the horizontal and to the left of x."""
    up, left = math.radians(elevation_deg), math.radians(left_deg)
    return np.array([math.cos(up) * math.cos(left), math.cos(up) * math.sin(left), math.sin(up)])


def launch_from_contact(speed: float, attack: Array, normal: Array) -> tuple[BallState, bool]:
    """Return the launch by Eqs. (15)-(21) and whether the contact sticks.

    Args:
        speed: of the ball if the contact sticks [m/s]; a foot of infinite mass gives it,
            as no foot speed of the paper can.
        attack: unit vector of the foot's motion, shape `(3,)`.
        normal: unit vector from foot to ball, shape `(3,)`.
    """
    heavy = ContactProblem(
        normal=normal,
        delassus_factor=np.zeros((3, 0)),
        ball=BALL,
        centre_velocity=-speed / (1 + RESTITUTION) * attack,
        spin=np.zeros(3),
        restitution=RESTITUTION,
        friction=FRICTION,
    )
    impulse, sticking, _, _ = solve_paper(heavy)
    spin = np.cross(-BALL.radius * normal, impulse) / BALL.inertia
    return BallState(velocity=impulse / BALL.mass, spin=spin), sticking
