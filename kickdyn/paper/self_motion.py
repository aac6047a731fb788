"""Self-motion: how a redundant leg can move while its contact point stays."""

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg, Posture

TOLERANCE = 1e-12
"""How far the contact point may stray, over the leg's lever [1]."""


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
    """Return the unit vector of joint velocity that does not move the contact point."""
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
    """Return whether a configuration is within the joints' range."""
    return bool((q >= leg.lower - 1e-9).all() and (q <= leg.upper + 1e-9).all())
