"""What the paper prints (Tables 1, 3, 6), and what it leaves open: coefficients, launch."""

import math
from dataclasses import dataclass

import numpy as np

from kickdyn.aerodynamics.coefficient_model import Coefficient
from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.impact.laws import limit_friction
from kickdyn.paper.item import Item, Verdict, near
from kickdyn.robot.leg import Leg

BALL = Ball.paper()
FRICTION = 0.4
"""Between foot and ball, in all of the paper's simulations."""

RESTITUTION = 0.8
"""Not printed; what Table 2 needs."""


COLUMNS = {"length": "m", "mass": "kg", "inertia": "kg m2", "mass centre": "m"}
TABLE_1 = ((0.371, 7, 0.08), (0.443, 3, 0.049), (0.145, 1, 0.0018))
TABLE_6 = (
    (0.4, 1.712, 0.02305, 0.2),
    (0.396, 1.074, 0.01413, 0.198),
    (0.22, 0.57, 0.00055, 0.073),
)
"""Thigh, shank and foot, as printed."""


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
    """Return the launch of a ball at rest by Eqs. (18)-(21) and whether the contact sticks.

    The force F is that before its part across the normal is limited, shape `(3,)` [N s].
    """
    impulse, tangential, sticking = limit_friction(force, normal, FRICTION)
    spin = -BALL.radius / BALL.inertia * np.cross(normal, tangential)
    return BallState(velocity=impulse / BALL.mass, spin=spin), sticking


def warnings_of(*paths: Flight) -> tuple[str, ...]:
    """Return every warning of the flights once."""
    return tuple(dict.fromkeys(line for path in paths for line in path.warnings))


def items() -> list[Item]:
    """Return every printed number beside kickdyn's."""
    air = Air.paper()
    rows = [
        ("air density", 1.22, air.density, "kg/m3"),
        ("ball radius", 0.1, BALL.radius, "m"),
        ("ball mass", 0.45, BALL.mass, "kg"),
        ("viscosity", 1.8e-5, air.viscosity, "Pa s"),
        ("gravity", 9.81, GRAVITY, "m/s2"),
    ]
    why = "values of kd.Ball.paper() and kd.Air.paper(), which has no wind"
    result = [_input("Table 3", *row, why) for row in rows]
    for table, leg, printed in (
        ("Table 1", Leg.human(), TABLE_1),
        ("Table 6", Leg.testbed(), TABLE_6),
    ):
        model, why = leg.model, "values of the leg's URDF file in kickdyn"
        ends = [*list(model.jointPlacements)[2:], model.frames[leg.frame_id].placement]
        for name, link, end, papers in zip(
            ("thigh", "shank", "foot"), list(model.inertias)[1:], ends, printed, strict=True
        ):
            length, centre = np.linalg.norm(end.translation), np.linalg.norm(link.lever)
            ours = (length, link.mass, link.inertia[1, 1], centre)
            for (column, unit), paper, value in zip(COLUMNS.items(), papers, ours, strict=False):
                result.append(_input(table, f"{name} {column}", paper, float(value), unit, why))
    return sorted(result, key=lambda item: item.source)


def _input(table: str, name: str, paper: float, ours: float, unit: str, why: str) -> Item:
    verdict = near(ours, paper, 1e-12, Verdict.INPUT)
    return Item(f"{table} {name}", paper, ours, unit, verdict, why, table)
