"""Fig. 1: postures with one contact point (self-motion) change the impulse on ball and obstacle."""

import math

import numpy as np
import pinocchio as pin
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
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


def draw(figure: Figure) -> None:
    """Draw postures that share a contact point, and the impulse along the way."""
    left, right = figure.subplots(1, 2)
    for label, impact in extremes(kicks()).items():
        left.plot(
            *joints(impact.posture).T, "o-", label=f"{label}: {size(impact):.3f} N s on the ball"
        )
    left.set(xlabel="X [m]", ylabel="Y [m]", title="two postures, one contact point")
    left.set_aspect("equal", adjustable="datalim")
    left.legend(loc="upper right")
    for struck, ball in STRUCK.items():
        impacts = kicks(ball)
        knees = [np.degrees(impact.posture.q[1]) for impact in impacts]
        right.plot(knees, [*map(size, impacts)], label=f"on {struck}")
    right.set(xlabel="knee along the self-motion [deg]", ylabel="impulse [N s]")
    right.legend()


def joints(posture: Posture) -> Array:
    """Return the origins of the joints and the contact point, in the plane, `(n, 2)` [m]."""
    space = posture.leg.workspace
    pin.forwardKinematics(space.model, space.data, posture.q)
    origins = [placement.translation for placement in list(space.data.oMi)[1:]]
    return np.array([*origins, posture.contact_point])[:, [0, 2]]


def self_motion(leg: Leg, q: ArrayLike, step: float = 0.01) -> list[Posture]:
    r"""Follow the postures that share a contact point, a family of one parameter.

    Each step goes along the null space of the contact point's Jacobian, :math:`J \dot q = 0`, and
    is then corrected back to the point. Fig. 1 of the paper has two such postures.

    Args:
        leg: with one joint more than its contact point has directions to move in.
        q: posture to start from, within the joints' range, shape `(nq,)` [rad].
        step: between postures, length in joint space [rad], 0.1 at most.

    Returns:
        Postures in order along the motion, from one end of a joint's range to the other; or once
        around, where the motion closes. At most 10,000 steps are made in each direction.

    Raises:
        InvalidInput: the leg has not exactly one degree of self-motion at q, q is out of range, or
            the leg has supports, loops or mimic joints.
    """
    if leg.constraints is not None:
        raise InvalidInput(
            f"{leg.name} has supports, loops or mimic joints: only a free leg is followed"
        )
    start = leg.posture(q)
    step = validation.number("step", step, above=0, at_most=0.1, unit="rad")
    if not _within(leg, start.q):
        raise InvalidInput(f"{start!r} is outside the joints' range")
    freedom = leg.nv - int(np.linalg.matrix_rank(start.jacobian, tol=1e-9))
    if freedom != 1:
        raise InvalidInput(f"{start!r} has {freedom} degrees of self-motion: one is followed")
    ahead, closed = _follow(start, _null(start), step)
    if closed:
        return [start, *ahead]
    back, _ = _follow(start, -_null(start), step)
    return [*reversed(back), start, *ahead]


def _null(posture: Posture) -> Array:
    """Return the unit vector of joint velocities that do not move the contact point."""
    return np.asarray(np.linalg.svd(posture.jacobian)[2][-1])


def _follow(start: Posture, direction: Array, step: float) -> tuple[list[Posture], bool]:
    """Return the postures in one direction, and whether they came around to the start."""
    leg, postures, current = start.leg, list[Posture](), start
    model = leg.workspace.model
    for _ in range(10_000):
        along = _null(current)
        direction = along if along @ direction > 0 else -along  # a null vector has no sign
        following = _corrected(
            leg, pin.integrate(model, current.q, step * direction), start.contact_point
        )
        if following is None or not _within(leg, following.q):
            break
        shift = pin.difference(model, start.q, following.q)
        if len(postures) > 2 and np.linalg.norm(shift) < step / 2 and shift @ direction < step / 2:
            return postures, True
        postures.append(following)
        current = following
    return postures, False


def _corrected(leg: Leg, q: Array, point: Array) -> Posture | None:
    """Bring the contact point back by Gauss-Newton; None where it cannot be."""
    for _ in range(20):
        posture = leg.posture(q)
        astray = point - posture.contact_point
        if np.abs(astray).max() <= TOLERANCE * np.abs(posture.jacobian).max():
            return posture
        q = pin.integrate(
            leg.workspace.model, q, np.linalg.lstsq(posture.jacobian, astray, rcond=1e-9)[0]
        )
    return None


def _within(leg: Leg, q: Array) -> bool:
    return bool((q >= leg.lower - 1e-9).all() and (q <= leg.upper + 1e-9).all())
