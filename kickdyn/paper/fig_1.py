"""Fig. 1: postures with one contact point (self-motion) change the impulse on ball and obstacle."""

import math

import numpy as np
import pinocchio as pin

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.paper.assumptions import BALL, RESTITUTION, direction
from kickdyn.paper.item import Item, shape
from kickdyn.robot.leg import Leg, Posture

NAME = "Fig. 1"
START_DEG = (25.0, 40.0, 10.0)
"""A posture whose toe is the contact point; the paper prints none."""

ATTACK_DEG, SPEED = 30.0, 1.0
OBSTACLE = Ball(mass=math.inf, radius=BALL.radius)
STRUCK = {"a ball": BALL, "an obstacle": OBSTACLE}
"""Parts (a), an impact in sports, and (b), a collision with the environment."""

STEP = 0.01
"""Distance between neighbouring postures, in joint space [rad]."""

TOLERANCE = 1e-12
"""Largest distance of a contact point from the first one, over the leg's lever [1]."""


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
    attack = direction(ATTACK_DEG)
    contact = Contact(attack, RESTITUTION)
    return [
        strike(posture, posture.joint_velocity(SPEED * attack), ball, contact)
        for posture in self_motion(Leg.human(), np.radians(START_DEG))
    ]


def extremes(impacts: list[Impact]) -> dict[str, Impact]:
    """Return the impacts with the largest and the smallest impulse."""
    return {"most": max(impacts, key=size), "least": min(impacts, key=size)}


def self_motion(leg: Leg, q: ArrayLike) -> list[Posture]:
    """Return the postures that share a contact point, a family of one parameter.

    Each step from q goes along the null space of the contact point's Jacobian, and is then
    corrected back to the point. The postures are in order along the motion, from one end of a
    joint's range to the other, at steps of 0.01 rad in joint space, at most 10,000 in each
    direction. Raises `InvalidInput` if q is out of range, if the leg has constraints, or if it does
    not have exactly one degree of self-motion at q.
    """
    start = leg.posture(q)
    freedom = leg.nv - int(np.linalg.matrix_rank(start.jacobian, tol=1e-9))
    if leg.constraints is not None or freedom != 1:
        raise InvalidInput(
            f"{start!r} has {freedom} degrees of self-motion: one is followed, of a leg without "
            "supports, loops and mimic joints"
        )
    if leg.outside_range(start.q):
        raise InvalidInput(f"{start!r} is outside the joints' range")
    ahead, back = (_follow(start, sign * _null(start)) for sign in (1.0, -1.0))
    return [*reversed(back), start, *ahead]


def _null(posture: Posture) -> Array:
    return np.asarray(np.linalg.svd(posture.jacobian)[2][-1])


def _follow(start: Posture, direction: Array) -> list[Posture]:
    leg, postures, current = start.leg, list[Posture](), start
    for _ in range(10_000):
        along = _null(current)
        direction = along if along @ direction > 0 else -along  # a null vector has no sign
        q = pin.integrate(leg.workspace.model, current.q, STEP * direction)
        following = _corrected(leg, q, start.contact_point)
        if following is None or leg.outside_range(following.q):
            break
        postures.append(following)
        current = following
    return postures


def _corrected(leg: Leg, q: Array, point: Array) -> Posture | None:
    for _ in range(20):
        posture = leg.posture(q)
        astray = point - posture.contact_point
        if np.abs(astray).max() <= TOLERANCE * np.abs(posture.jacobian).max():
            return posture
        step = np.linalg.lstsq(posture.jacobian, astray, rcond=1e-9)[0]
        q = pin.integrate(leg.workspace.model, q, step)
    return None
