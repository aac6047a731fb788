"""Quantities that the paper does not give: coefficients of drag and lift, restitution, launch."""

import math
from dataclasses import dataclass

import numpy as np

from kickdyn.aerodynamics.coefficient_model import Coefficient
from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.impact.contact_problem import BallBody
from kickdyn.impact.laws import limit_friction

BALL = Ball.paper()
FRICTION = 0.4
"""Between foot and ball, in all of the paper's simulations."""

RESTITUTION = 0.8
"""Not printed; needed by Table 2."""


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
"""Models of `Air.paper()` and of all items; the defaults of `Air()` are the first alternative."""

LIFT_WITHOUT_CRISIS = Coefficients("lift wang", lift="wang")
ALTERNATIVES = (
    Coefficients("drag supercritical", "supercritical"),
    Coefficients("drag supercritical, lift wang", "supercritical", "wang"),
    *(Coefficients(f"drag {name}", name) for name in ("tango12", "teamgeist", "jabulani")),
    Coefficients("drag sphere", "sphere"),
    LIFT_WITHOUT_CRISIS,
    *(Coefficients(f"C_D = {value:g}", constant(value)) for value in (0.2, 0.25, 0.47)),
)
"""Every other choice that can hold at a soccer ball's speeds, and three constants."""


def direction(elevation_deg: float, left_deg: float = 0.0) -> Array:
    """Return the unit vector at angles above the horizontal and to the left of x."""
    up, left = math.radians(elevation_deg), math.radians(left_deg)
    return np.array([math.cos(up) * math.cos(left), math.cos(up) * math.sin(left), math.sin(up)])


def launch_from_force(force: Array, normal: Array) -> tuple[BallState, bool]:
    """Return the launch by Eqs. (18)-(21) and a force [N s], and whether the contact sticks."""
    impulse, tangential, sticking = limit_friction(force, normal, FRICTION)
    ball = BallBody(BALL, (normal,))
    return ball.after(BallState(), impulse[None], tangential[None]), sticking


def warnings_of(*paths: Flight) -> tuple[str, ...]:
    """Return every warning of the flights once."""
    return tuple(dict.fromkeys(line for path in paths for line in path.warnings))
