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
from kickdyn.impact.joint_impulses import joint_impulses, struck
from kickdyn.impact.laws import LAWS, ContactProblem, Solution
from kickdyn.impact.problem import cross
from kickdyn.impact.result import Impact
from kickdyn.leg import Leg
from kickdyn.posture import Posture

MAX_SPEED = 1e140


def strike(
    leg: Leg,
    q: ArrayLike,
    v: ArrayLike,
    ball: Ball,
    touch: Contact,
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ball_spin: ArrayLike = (0.0, 0.0, 0.0),
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
        NoImpact: foot and ball do not approach each other along the normal.
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
    ball_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ball_spin: ArrayLike = (0.0, 0.0, 0.0),
    strict: bool = False,
) -> Impact:
    """Strike a ball from a posture that is already there; else as `strike`."""
    checks.made_of(Posture, posture=posture)
    checks.made_of(Ball, ball=ball)
    checks.made_of(Contact, touch=touch)
    if not isinstance(law, str) or law not in LAWS:
        raise InvalidInput(f"impact law {law!r} is unknown: choose {', '.join(LAWS)}")
    v = checks.vector("v", v, posture.leg.nv)
    posture.check_velocity(v)
    if touch.offset is not None:
        posture = posture.touched_at(touch.offset)
    n = touch.normal
    before = BallState.computed(
        posture.contact_point + ball.radius * n,
        checks.vector("ball velocity", ball_velocity, 3, unit="m/s"),
        checks.vector("ball spin", ball_spin, 3, unit="rad/s"),
    )
    # Here and below `dot`, for `@` takes twice as long on three numbers.
    with np.errstate(over="ignore", invalid="ignore"):  # said by `approach`
        foot_velocity = posture.jacobian.dot(v)
        approach_speed = approach(posture, foot_velocity, before, touch)
    sliding = max(largest(before.spin) * ball.radius, largest(before.velocity))
    if not sliding < MAX_SPEED:
        raise InvalidInput(f"the ball moves at {sliding:g} m/s: it must be below {MAX_SPEED:g} m/s")
    problem = ContactProblem(
        normal=n,
        leg_delassus=posture.delassus(),
        ball=ball,
        centre_velocity=before.velocity - foot_velocity,
        spin=before.spin,
        restitution=touch.restitution,
        friction=touch.friction,
    )
    solution = LAWS[law](problem)
    if not math.isfinite(solution.energy_lost):
        raise KickdynError(
            f"law {law!r} finds no impulse in {posture!r} (restitution {touch.restitution:g}, "
            f"friction {touch.friction:g})"
        )
    hit = _outcome(posture, v, foot_velocity, approach_speed, ball, before, touch, law, solution)
    if strict and hit.creates_energy:
        raise EnergyCreated(
            f"law {law!r} creates {-hit.energy_lost:.3g} J in {posture!r} (restitution "
            f"{touch.restitution:g}, friction {touch.friction:g}): law 'stronge' never does"
        )
    return hit


def approach(posture: Posture, foot_velocity: Array, before: BallState, touch: Contact) -> float:
    """Return the speed of foot towards ball along the normal [m/s]; raise `NoImpact` if none."""
    relative = foot_velocity - before.velocity
    speed = float(touch.normal.dot(relative))
    if not all(abs(part) < MAX_SPEED for part in relative.tolist()):  # or NaN
        fastest = float(np.abs(relative).max())
        raise InvalidInput(
            f"foot and ball meet at {fastest:g} m/s in {posture!r}: it must be below {MAX_SPEED:g} "
            "m/s, else energies leave double precision"
        )
    if speed <= 0.0:
        raise NoImpact(
            f"the foot moves along the normal at {-speed:.6g} m/s away from the ball in "
            f"{posture!r}: the normal points from foot to ball, the foot must approach along it"
            if speed < 0
            else f"foot and ball do not approach along the normal in {posture!r}"
        )
    return speed


def largest(array: Array) -> float:
    """Return the largest absolute entry of a short, finite array."""
    return float(max(map(abs, array.tolist())))


def _outcome(
    posture: Posture,
    v: Array,
    foot_velocity: Array,
    approach_speed: float,
    ball: Ball,
    before: BallState,
    touch: Contact,
    law: str,
    solution: Solution,
) -> Impact:
    n, impulse = touch.normal, solution.impulse
    if posture.hold is None:
        held = np.zeros(0)
        jump, transmitted, left_over = struck(posture, -impulse)
    else:
        jump, held = posture.respond(-impulse.dot(posture.jacobian))
        transmitted, left_over = joint_impulses(posture, jump, -impulse, held)
    after = BallState.computed(
        before.position,
        before.velocity + impulse / ball.mass,
        before.spin - cross(n, impulse) * (ball.radius / ball.inertia),
    )
    v_after = v + jump
    for array in (impulse, v, v_after, foot_velocity, transmitted, held):
        array.setflags(write=False)
    parting = float(n.dot(after.velocity - posture.jacobian.dot(v_after)))
    lever = math.sqrt(np.vdot(posture.jacobian, posture.jacobian)) * math.hypot(*impulse.tolist())
    return Impact(
        posture=posture,
        struck=ball,
        touch=touch,
        law=law,
        impulse=impulse,
        effective_mass=posture.mass_along(n),
        foot_velocity=foot_velocity,
        approach_speed=approach_speed,
        ball_before=before,
        ball=after,
        v_before=v,
        v_after=v_after,
        joint_impulses=transmitted,
        constraint_impulses=held,
        energy_lost=solution.energy_lost,
        sticking=solution.sticking,
        restitution_residual=abs(parting - touch.restitution * approach_speed) / approach_speed,
        momentum_residual=largest(left_over) / lever if lever else 0.0,
        condition=posture.condition,
    )
