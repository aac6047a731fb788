"""Foot and ball just before they touch: what they are told, checked, and how fast they meet."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.core.vectors import largest
from kickdyn.errors import InvalidInput, NoImpact
from kickdyn.impact.digits import approach_rounding
from kickdyn.robot.leg import Posture

MAX_SPEED = 1e140
"""[m/s]. Squares of it, times a mass, are energies that a float64 still holds."""

FAINT = 1e-9
"""Share of the speeds at hand below which an approach is looked at more closely."""

UNSURE = 4.0
"""Times its rounding up to which an approach may be none at all."""

AT_REST = (0.0, 0.0, 0.0)
_AT_REST: Array = np.frombuffer(bytes(24))
"""The same as an array that nobody can write to, so that it need not be checked anew."""


def approach(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    ball_velocity: ArrayLike,
    ball_spin: ArrayLike,
) -> tuple[Posture, Array, Array, BallState, float]:
    """Return what meets, and how fast; arguments as for `strike`.

    Returns:
        The posture, its contact point where the contact has it; a copy of v, shape `(nv,)` [rad/s];
        the foot's velocity there, shape `(3,)` [m/s, world frame]; the ball as it is struck; and
        the speed of foot towards ball along the normal [m/s], above 0.

    Raises:
        NoImpact: they do not, or no faster than the rounding of what their speed is the sum of.
        InvalidInput: a wrong kind or shape, a velocity that moves what is held, or speeds beyond
            double precision.
    """
    validation.check_type(Posture, posture=posture)
    validation.check_type(Ball, ball=ball)
    validation.check_type(Contact, contact=contact)
    v = validation.vector("v", v, posture.leg.nv)
    if posture.constraint_projector is not None:
        posture.check_velocity(v)
    posture = posture.with_contact_offset(contact.offset)
    velocity, spin, moves = _AT_REST, _AT_REST, 0.0
    if ball_velocity is not AT_REST:
        velocity = validation.vector("ball velocity", ball_velocity, 3, unit="m/s")
        moves = largest(velocity)
    if ball_spin is not AT_REST:
        spin = validation.vector("ball spin", ball_spin, 3, unit="rad/s")
        moves = max(moves, largest(spin) * ball.radius)
    before = BallState.computed(
        posture.contact_point + ball.radius * contact.normal, velocity, spin
    )
    # `dot`, for `@` takes twice as long on three numbers
    if math.hypot(*v.tolist()) < MAX_SPEED:
        foot_velocity = posture.jacobian.dot(v)
    else:
        with np.errstate(over="ignore", invalid="ignore"):  # said by `_speed`
            foot_velocity = posture.jacobian.dot(v)
    speed = _speed(posture, v, foot_velocity, before, contact)
    if not moves < MAX_SPEED:
        raise InvalidInput(f"the ball moves at {moves:g} m/s: it must be below {MAX_SPEED:g} m/s")
    return posture, v, foot_velocity, before, speed


def _speed(
    posture: Posture, v: Array, foot_velocity: Array, before: BallState, contact: Contact
) -> float:
    fx, fy, fz = foot_velocity.tolist()
    bx, by, bz = before.velocity.tolist()
    nx, ny, nz = contact.normal.tolist()
    ux, uy, uz = fx - bx, fy - by, fz - bz
    if not (abs(ux) < MAX_SPEED and abs(uy) < MAX_SPEED and abs(uz) < MAX_SPEED):  # or NaN
        fastest = float(np.abs([ux, uy, uz]).max())
        raise InvalidInput(
            f"foot and ball meet at {fastest:g} m/s in {posture!r}: it must be below {MAX_SPEED:g} "
            "m/s, else energies leave double precision"
        )
    speed = nx * ux + ny * uy + nz * uz
    if speed <= 0.0:
        raise NoImpact(
            f"the foot moves along the normal at {-speed:.6g} m/s away from the ball in "
            f"{posture!r}: the normal points from foot to ball, the foot must approach along it"
            if speed < 0
            else f"foot and ball do not approach along the normal in {posture!r}"
        )
    if speed < FAINT * (math.sqrt(np.vdot(v, v)) + abs(ux) + abs(uy) + abs(uz)):
        rounding = approach_rounding(posture, v, foot_velocity, before, contact.normal)
        if speed <= UNSURE * rounding:
            raise NoImpact(
                f"foot and ball approach along the normal at {speed:.3g} m/s in {posture!r}: that "
                f"is rounding, of {rounding:.1g} m/s in what cancels there"
            )
    return float(speed)
