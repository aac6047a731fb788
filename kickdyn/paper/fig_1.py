"""Fig. 1: the posture changes the impulse, at one contact point, on a ball and on an obstacle."""

import math

import numpy as np
from matplotlib.figure import Figure

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.paper.assumptions import BALL, RESTITUTION, direction
from kickdyn.paper.item import Item, shape
from kickdyn.paper.self_motion import self_motion
from kickdyn.robot.leg import Leg, Posture

NAME = "Fig. 1"
START_DEG = (25.0, 40.0, 10.0)
"""A posture whose toe is the contact point; the paper prints none."""

ATTACK_DEG, SPEED = 30.0, 1.0
OBSTACLE = Ball(mass=math.inf, radius=BALL.radius)
STRUCK = {"a ball": BALL, "an obstacle": OBSTACLE}
"""Parts (a), an impact in sports, and (b), a collision with the environment."""


def items() -> list[Item]:
    """Return the largest and the smallest impulse that self-motion gives, and inside the joints."""
    source = "Eq. (10) along the null space of J, contact point and foot velocity fixed"
    result = []
    for struck, ball in STRUCK.items():
        impacts = kicks(ball)
        ratio = max(map(size, impacts)) / min(map(size, impacts))
        for label, impact in extremes(impacts).items():
            angles = impact.posture.leg.angles_deg(impact.posture.q)
            where = ", ".join(f"{name} {angle:.1f}" for name, angle in angles.items())
            why = (
                f"at {where} deg; over the postures with the same contact point (self-motion) the "
                f"impulse changes by a factor of {ratio:.2f}"
            )
            joint, inside = impact.worst_joint
            for what, ours in (("", size(impact)), (f", in the {joint}", inside)):
                name = f"{NAME} {label} impulse on {struck}{what}"
                result.append(Item(name, None, ours, "N s", shape(ratio > 1.05), why, source))
    return result


def size(impact: Impact) -> float:
    """Return the magnitude of the impulse [N s]."""
    return float(np.linalg.norm(impact.impulse))


def kicks(ball: Ball = BALL) -> list[Impact]:
    """Return the impacts of the same kick from every posture of the self-motion, in order."""
    leg, attack = Leg.human(), direction(ATTACK_DEG)
    contact = Contact(attack, RESTITUTION)

    def kick(posture: Posture) -> Impact:
        return strike(posture, posture.joint_velocity(SPEED * attack), ball, contact)

    return [kick(posture) for posture in self_motion(leg, np.radians(START_DEG))]


def extremes(impacts: list[Impact]) -> dict[str, Impact]:
    """Return the impacts with the largest and the smallest impulse."""
    return {"most": max(impacts, key=size), "least": min(impacts, key=size)}


def draw(figure: Figure) -> None:
    """Draw postures that share a contact point, and the impulse along the way."""
    left, right = figure.subplots(1, 2)
    for label, impact in extremes(kicks()).items():
        x, z = np.array([*joints(impact.posture), impact.posture.contact_point])[:, [0, 2]].T
        left.plot(x, z, "o-", label=f"{label}: {size(impact):.3f} N s on the ball")
    left.set(xlabel="X [m]", ylabel="Y [m]", title="two postures, one contact point")
    left.set_aspect("equal", adjustable="datalim")
    left.legend(loc="upper right")
    for struck, ball in STRUCK.items():
        impacts = kicks(ball)
        knees = [np.degrees(impact.posture.q[1]) for impact in impacts]
        right.plot(knees, [*map(size, impacts)], label=f"on {struck}")
    right.set(xlabel="knee along the self-motion [deg]", ylabel="impulse [N s]")
    right.legend()


def joints(posture: Posture) -> list[np.ndarray]:
    """Return the origins of the joints [m, world frame]."""
    import pinocchio as pin

    space = posture.leg.workspace
    pin.forwardKinematics(space.model, space.data, posture.q)
    return [placement.translation.copy() for placement in list(space.data.oMi)[1:]]
