"""Fig. 1: the posture changes the external impulse, at one contact point, by self-motion."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from kickdyn.contact import Contact
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.paper.assumptions import BALL, RESTITUTION, direction
from kickdyn.paper.item import Item, shape
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.self_motion import self_motion

NAME = "Fig. 1"
START_DEG = (25.0, 40.0, 10.0)
"""A posture whose toe is the contact point; the paper prints none."""

ATTACK_DEG, SPEED = 30.0, 1.0


def items() -> list[Item]:
    """Return the largest and the smallest impulse that self-motion gives."""
    impacts = kicks()
    most, least = max(impacts, key=size), min(impacts, key=size)
    ratio = size(most) / size(least)
    source = "Eq. (10) along the null space of the KIC, contact point and foot velocity fixed"
    result = []
    for label, impact in (("most", most), ("least", least)):
        angles = impact.posture.leg.angles_deg(impact.posture.q)
        where = ", ".join(f"{name} {angle:.1f}" for name, angle in angles.items())
        why = f"at {where} deg; self-motion changes the impulse {ratio:.2f}-fold"
        name, verdict = f"{NAME} {label} impulse", shape(ratio > 1.05)
        result.append(Item(name, None, size(impact), "N s", verdict, why, source))
    return result


def size(impact: Impact) -> float:
    """Return the magnitude of the impulse [N s]."""
    return float(np.linalg.norm(impact.impulse))


def kicks() -> list[Impact]:
    """Return the impacts of the same kick from every posture of the self-motion, in order."""
    leg, attack = Leg.human(), direction(ATTACK_DEG)
    contact = Contact(attack, RESTITUTION)

    def kick(posture: Posture) -> Impact:
        return strike(posture, posture.joint_velocity(SPEED * attack), BALL, contact)

    return [kick(posture) for posture in self_motion(leg, np.radians(START_DEG))]


def draw(figure: Figure) -> None:
    """Draw postures that share a contact point, and the impulse along the way."""
    left, right = figure.subplots(1, 2)
    impacts = kicks()
    most, least = max(impacts, key=size), min(impacts, key=size)
    for label, impact, colour in (("most", most, "tab:red"), ("least", least, "tab:blue")):
        x, z = np.array([*joints(impact.posture), impact.posture.contact_point])[:, [0, 2]].T
        left.plot(x, z, "o-", color=colour, label=f"{label}: {size(impact):.3f} N s")
    left.set(xlabel="X [m]", ylabel="Y [m]", title="two postures, one contact point")
    left.set_aspect("equal", adjustable="datalim")
    left.legend(loc="upper right")
    right.plot(np.degrees([impact.posture.q[1] for impact in impacts]), [*map(size, impacts)])
    right.set(xlabel="knee along the self-motion [deg]", ylabel="impulse on the ball [N s]")


def joints(posture: Posture) -> list[np.ndarray]:
    """Return the origins of the joints [m, world frame]."""
    import pinocchio as pin

    space = posture.leg.workspace
    pin.forwardKinematics(space.model, space.data, posture.q)
    return [placement.translation.copy() for placement in list(space.data.oMi)[1:]]
