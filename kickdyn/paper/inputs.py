"""Tables 1, 3 and 6: what is taken from the paper, as the legs, the ball and the air have it."""

import numpy as np

from kickdyn.air import Air
from kickdyn.core.gravity import GRAVITY
from kickdyn.paper.assumptions import BALL
from kickdyn.paper.item import Item, Verdict, near
from kickdyn.robot.leg import Leg

COLUMNS = {"length": "m", "mass": "kg", "inertia": "kg m2", "mass centre": "m"}
TABLE_1 = ((0.371, 7, 0.08), (0.443, 3, 0.049), (0.145, 1, 0.0018))
TABLE_6 = (
    (0.4, 1.712, 0.02305, 0.2),
    (0.396, 1.074, 0.01413, 0.198),
    (0.22, 0.57, 0.00055, 0.073),
)
"""Thigh, shank and foot, as printed."""


def items() -> list[Item]:
    """Return every printed number beside that of kickdyn."""
    air, why = Air.paper(), "values of kd.Ball.paper() and kd.Air.paper(), which has no wind"
    rows = [
        ("Table 3 air density", 1.22, air.density, "kg/m3", why),
        ("Table 3 ball radius", 0.1, BALL.radius, "m", why),
        ("Table 3 ball mass", 0.45, BALL.mass, "kg", why),
        ("Table 3 viscosity", 1.8e-5, air.viscosity, "Pa s", why),
        ("Table 3 gravity", 9.81, GRAVITY, "m/s2", why),
    ]
    for table, leg, printed in ((1, Leg.human(), TABLE_1), (6, Leg.testbed(), TABLE_6)):
        model, why = leg.model, "values of the leg's URDF file in kickdyn"
        ends = [*list(model.jointPlacements)[2:], model.frames[leg.frame_id].placement]
        for name, link, end, papers in zip(
            ("thigh", "shank", "foot"), list(model.inertias)[1:], ends, printed, strict=True
        ):
            length, centre = np.linalg.norm(end.translation), np.linalg.norm(link.lever)
            ours = (length, link.mass, link.inertia[1, 1], centre)
            for (column, unit), paper, value in zip(COLUMNS.items(), papers, ours, strict=False):
                rows.append((f"Table {table} {name} {column}", paper, float(value), unit, why))
    return [
        Item(name, paper, ours, unit, near(ours, paper, 1e-12, Verdict.INPUT), why, name[:7])
        for name, paper, ours, unit, why in sorted(rows, key=lambda row: row[0][:7])
    ]
