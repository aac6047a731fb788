"""The strike: everything about the instant when foot meets ball."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from kickdyn import checks
from kickdyn.ball import Ball, BallState
from kickdyn.checks import Array
from kickdyn.contact import Contact
from kickdyn.errors import EnergyCreated, InvalidInput, KickdynError, NoImpact
from kickdyn.impact.digits import approach_rounding
from kickdyn.impact.laws import LAWS, ContactProblem
from kickdyn.impact.result import Impact
from kickdyn.leg import Leg
from kickdyn.posture import Posture
from kickdyn.vectors import crossed, largest

MAX_SPEED = 1e140
"""[m/s]. Squares of it, times a mass, are energies that a float64 still holds."""

FAINT = 1e-9
"""Share of the speeds at hand below which an approach is looked at more closely."""

UNSURE = 4.0
"""Times its rounding up to which an approach may be none at all."""

AT_REST = (0.0, 0.0, 0.0)
_AT_REST: Array = np.frombuffer(bytes(24))
"""The same as an array that nobody can write to, so that it need not be checked anew."""


def strike(
    leg: Leg,
    q: ArrayLike,
    v: ArrayLike,
    ball: Ball,
    touch: Contact,
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    strict: bool = False,
) -> Impact:
    """Strike a ball, in closed form (Eqs. 1-11 and 15-21).

    Args:
        leg: with the frame that touches the ball.
        q: configuration, shape `(nq,)` [rad; m for prismatic joints].
        v: joint velocity just before, shape `(nv,)` [rad/s].
        ball: its centre is at `contact point + radius * normal`.
        touch: normal, restitution and friction, and where on the foot.
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
    checks.made_of(Leg, leg=leg)
    posture, motion = leg.posture(q), {"ball_velocity": ball_velocity, "ball_spin": ball_spin}
    return strike_at(posture, v, ball, touch, law, **motion, strict=strict)


def strike_at(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    touch: Contact,
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    strict: bool = False,
) -> Impact:
    """Strike a ball from a posture that is already there; else as `strike`."""
    checks.flag("strict", strict)
    checks.made_of(Posture, posture=posture)
    checks.made_of(Ball, ball=ball)
    checks.made_of(Contact, touch=touch)
    if not isinstance(law, str) or law not in LAWS:
        raise InvalidInput(f"impact law {law!r} is unknown: choose {', '.join(LAWS)}")
    v = checks.vector("v", v, posture.leg.nv)
    if posture.hold is not None:
        posture.check_velocity(v)
    if touch.offset is not None:
        posture = posture.touched_at(touch.offset)
    n, velocity, spin, sliding = touch.normal, _AT_REST, _AT_REST, 0.0
    if ball_velocity is not AT_REST:
        velocity = checks.vector("ball velocity", ball_velocity, 3, unit="m/s")
        sliding = largest(velocity)
    if ball_spin is not AT_REST:
        spin = checks.vector("ball spin", ball_spin, 3, unit="rad/s")
        sliding = max(sliding, largest(spin) * ball.radius)
    before = BallState.computed(posture.contact_point + ball.radius * n, velocity, spin)
    # Here and below `dot`, for `@` takes twice as long on three numbers.
    if math.hypot(*v.tolist()) < MAX_SPEED:
        foot_velocity = posture.jacobian.dot(v)
    else:
        with np.errstate(over="ignore", invalid="ignore"):  # said by `approach`
            foot_velocity = posture.jacobian.dot(v)
    approach_speed = approach(posture, v, foot_velocity, before, touch)
    if not sliding < MAX_SPEED:
        raise InvalidInput(f"the ball moves at {sliding:g} m/s: it must be below {MAX_SPEED:g} m/s")
    try:
        impulse, sticking, energy_lost, rub = LAWS[law](
            ContactProblem(
                normal=n,
                leg_rows=posture.giving(),
                ball=ball,
                centre_velocity=velocity - foot_velocity,
                spin=spin,
                restitution=touch.restitution,
                friction=touch.friction,
            )
        )
    except np.linalg.LinAlgError:  # leg and ball too unlike for one matrix
        energy_lost = math.nan
    if not math.isfinite(energy_lost):
        raise KickdynError(
            f"law {law!r} finds no impulse in {posture!r} (restitution {touch.restitution:g}, "
            f"friction {touch.friction:g})"
        )
    for array in (impulse, v, foot_velocity):
        array.setflags(write=False)
    hit = Impact.known(
        posture=posture,
        struck=ball,
        touch=touch,
        law=law,
        impulse=impulse,
        foot_velocity=foot_velocity,
        approach_speed=approach_speed,
        ball_before=before,
        ball=_kicked(ball, before, n, impulse, rub),
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
            f"{hit.touch.restitution:g}, friction {hit.touch.friction:g}): law 'stronge' never does"
        )


def check_ball_speed(ball: Ball, before: BallState) -> None:
    """Raise `InvalidInput` for a ball that moves or spins beyond double precision."""
    fastest = max(largest(before.velocity), largest(before.spin) * ball.radius)
    if not fastest < MAX_SPEED:
        raise InvalidInput(f"the ball moves at {fastest:g} m/s: it must be below {MAX_SPEED:g} m/s")


def approach(
    posture: Posture, v: Array, foot_velocity: Array, before: BallState, touch: Contact
) -> float:
    """Return the speed of foot towards ball along the normal [m/s].

    Raises:
        NoImpact: there is none, or none that is more than the rounding of what it is the sum of.
        InvalidInput: beyond double precision.
    """
    fx, fy, fz = foot_velocity.tolist()
    bx, by, bz = before.velocity.tolist()
    nx, ny, nz = touch.normal.tolist()
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
        rounding = approach_rounding(posture, v, foot_velocity, before, touch.normal)
        if speed <= UNSURE * rounding:
            raise NoImpact(
                f"foot and ball approach along the normal at {speed:.3g} m/s in {posture!r}: that "
                f"is rounding, of {rounding:.1g} m/s in what cancels there"
            )
    return float(speed)


def _kicked(ball: Ball, before: BallState, normal: Array, impulse: Array, rub: Array) -> BallState:
    """Return the ball just after an impulse at the foot's end of the normal; only rub turns it."""
    px, py, pz = impulse.tolist()
    vx, vy, vz = before.velocity.tolist()
    wx, wy, wz = before.spin.tolist()
    tx, ty, tz = crossed(normal.tolist(), rub.tolist())
    mass, gain = ball.mass, ball.radius / ball.inertia
    return BallState.computed(
        before.position,
        np.array((vx + px / mass, vy + py / mass, vz + pz / mass)),
        np.array((wx - gain * tx, wy - gain * ty, wz - gain * tz)),
    )
