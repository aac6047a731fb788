"""The strike: everything about the instant when foot meets ball."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.core.vectors import cross3
from kickdyn.errors import EnergyCreated, InvalidInput, KickdynError
from kickdyn.impact.approach import AT_REST, approach
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.laws import LAWS, ContactProblem
from kickdyn.robot.leg import Posture


def strike(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    strict: bool = False,
) -> Impact:
    """Strike a ball, in closed form (Eqs. 1-11 and 15-21).

    Args:
        posture: of the leg, whose contact frame touches the ball.
        v: joint velocity just before, shape `(nv,)` [rad/s].
        ball: its centre is at `contact point + radius * normal`.
        contact: normal, restitution and friction, and where on the foot.
        law: `newton` (kinematic restitution, exact Coulomb cone), `stronge` (energetic restitution,
            the sliding followed through the contact) or `paper`.
        ball_velocity: of its centre just before, shape `(3,)` [m/s, world frame].
        ball_spin: just before, shape `(3,)` [rad/s, world frame].
        strict: refuse a result that creates energy.

    Raises:
        NoImpact: foot and ball do not approach each other along the normal, or by no more than 4
            times the rounding of terms that cancel.
        EnergyCreated: `strict`, and the law gains energy here.
        InvalidInput: a wrong shape, an entry that is not finite, or an unknown law.
    """
    validation.flag("strict", strict)
    if not isinstance(law, str) or law not in LAWS:
        raise InvalidInput(f"impact law {law!r} is unknown: choose {', '.join(LAWS)}")
    met = approach(posture, v, ball, contact, ball_velocity, ball_spin)
    posture, v, foot_velocity, before, approach_speed = met
    try:
        impulse, sticking, energy_lost, tangential_impulse = LAWS[law](
            ContactProblem(
                normal=contact.normal,
                leg_rows=posture.delassus_factor(),
                ball=ball,
                centre_velocity=before.velocity - foot_velocity,
                spin=before.spin,
                restitution=contact.restitution,
                friction=contact.friction,
            )
        )
    except np.linalg.LinAlgError:  # leg and ball too unlike for one matrix
        energy_lost = math.nan
    if not math.isfinite(energy_lost):
        raise KickdynError(
            f"law {law!r} finds no impulse in {posture!r} (restitution {contact.restitution:g}, "
            f"friction {contact.friction:g})"
        )
    for array in (impulse, v, foot_velocity):
        array.setflags(write=False)
    hit = Impact.known(
        posture=posture,
        ball=ball,
        contact=contact,
        law=law,
        impulse=impulse,
        foot_velocity=foot_velocity,
        approach_speed=approach_speed,
        ball_before=before,
        ball_after=_kicked(ball, before, contact.normal, impulse, tangential_impulse),
        v_before=v,
        energy_lost=energy_lost,
        sticking=sticking,
    )
    if strict:
        check_energy(hit)
    return hit


def check_energy(hit: Impact) -> None:
    """Raise `EnergyCreated` if the law gained energy."""
    if hit.creates_energy:
        raise EnergyCreated(
            f"law {hit.law!r} creates {-hit.energy_lost:.3g} J in {hit.posture!r} (restitution "
            f"{hit.contact.restitution:g}, friction {hit.contact.friction:g}): law 'stronge' "
            "never does"
        )


def _kicked(
    ball: Ball, before: BallState, normal: Array, impulse: Array, tangential_impulse: Array
) -> BallState:
    """Return the ball just after an impulse at the foot's end of the normal; only rub turns it."""
    px, py, pz = impulse.tolist()
    vx, vy, vz = before.velocity.tolist()
    wx, wy, wz = before.spin.tolist()
    tx, ty, tz = cross3(normal.tolist(), tangential_impulse.tolist())
    mass, gain = ball.mass, ball.radius / ball.inertia
    return BallState.computed(
        before.position,
        np.array((vx + px / mass, vy + py / mass, vz + pz / mass)),
        np.array((wx - gain * tx, wy - gain * ty, wz - gain * tz)),
    )
