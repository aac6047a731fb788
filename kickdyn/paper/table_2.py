"""Table 2: the external impulse of three postures of the human leg."""

from __future__ import annotations

import math

import numpy as np

from kickdyn.contact import Contact
from kickdyn.impact.laws import normal_impulse
from kickdyn.impact.strike import strike
from kickdyn.paper.assumptions import BALL, RESTITUTION, direction
from kickdyn.paper.item import FITTED, Item, Verdict, near
from kickdyn.robot.leg import Leg, Posture

NAME = "Table 2"
SPEED = 1.0  # [m/s]
ATTACK_DEG = 30.0
ROWS = {
    "a": (-5.0, 1.346, 0.777, 1.554),
    "b": (15.0, 0.817, 0.472, 0.944),
    "c": (40.0, 0.559, 0.323, 0.646),
}
"""Ankle [deg] that puts the foot at 0, 20 and 45 deg; X, Y and total [N s]."""


def items() -> list[Item]:
    """Return the table without the ball's term, and the bound that excludes it with it."""
    leg, attack = Leg.human(), direction(ATTACK_DEG)
    why = "the obstacle is immovable; hip, knee and e are fitted to three totals"
    source = "Eq. (10) without the ball's term, e = 0.8, hip 5 and knee 10 deg"
    result = []
    for name, (ankle, *printed) in ROWS.items():
        posture = leg.posture(np.radians([5, 10, ankle]))
        total = normal_impulse(SPEED, RESTITUTION, posture.effective_mass(attack))
        parts = ((" X", attack[0]), (" Y", attack[2]), ("", 1.0))
        for (part, share), paper in zip(parts, printed, strict=True):
            ours = total * float(share)
            verdict = near(ours, paper, FITTED, Verdict.FITTED)
            result.append(Item(f"{NAME} {name}{part}", paper, ours, "N s", verdict, why, source))
        result.append(_with_ball(name, posture, printed[-1]))
    return result


def _with_ball(name: str, posture: Posture, paper: float) -> Item:
    """Return the total with the ball's term, and what excludes the printed one."""
    attack = direction(ATTACK_DEG)
    v = posture.joint_velocity(SPEED * attack)
    impact = strike(posture, v, BALL, Contact(attack, RESTITUTION))
    here = normal_impulse(SPEED, 1.0, impact.effective_mass, BALL.mass)
    anywhere = normal_impulse(SPEED, 1.0, math.inf, BALL.mass)
    why = (
        f"this posture gives at most {here:.3g} N s and no leg more than (1 + e) m_B v = "
        f"{anywhere:.3g} N s, both at e = 1"
    )
    ours, title = float(np.linalg.norm(impact.impulse)), f"{NAME} {name} with the ball"
    verdict = Verdict.REPRODUCED if paper <= here else Verdict.NOT_REACHABLE
    return Item(title, paper, ours, "N s", verdict, why, "Eq. (10) as printed, e = 0.8")
