"""The strike: everything about the instant when foot meets ball."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kickdyn import checks
from kickdyn.ball import Ball, BallState
from kickdyn.checks import Array
from kickdyn.contact import Contact
from kickdyn.errors import InvalidInput, NoImpact
from kickdyn.impact.joint_impulses import joint_impulses
from kickdyn.impact.laws import LAWS, ContactProblem, Solution
from kickdyn.impact.sensitivity import Sensitivity, sensitivity
from kickdyn.impact.uncertainty import Uncertainty, uncertainty
from kickdyn.leg import Leg
from kickdyn.posture import Posture

MAX_SPEED = 1e140


@dataclass(frozen=True, eq=False)
class Impact:
    """What a strike does, with the residuals that prove it.

    Attributes:
        posture: the leg, as it struck.
        struck: the ball's mass and radius.
        touch: the contact.
        law: name of the impact law.
        impulse: on the ball, shape `(3,)` [N s, world frame]; the leg takes the opposite.
        effective_mass: of the leg along the normal [kg]; inf where it is immovable.
        foot_velocity: of the contact point just before, shape `(3,)` [m/s, world frame].
        approach_speed: of foot towards ball along the normal [m/s].
        ball_before, ball: just before and just after.
        v_before, v_after: joint velocity, shape `(nv,)` [rad/s].
        joint_impulses: by the parent on the child, linear then angular, about the joint's origin
            and in its frame, shape `(njoints, 6)` [N s, N m s], joints as in `leg.joint_names`.
        energy_lost: by leg and ball together [J]; never negative for a passive law.
        sticking: whether friction held the contact points together.
        restitution_residual: |u_n+ + e u_n-| / |u_n-|, from the velocities after. Law `paper`
            restitutes along the attack direction: where that is not the normal, this shows it.
        momentum_residual: joint-space momentum that Newton-Euler cannot account for, relative to
            the impulse times the Jacobian's norm.
        condition: of the joint-space inertia, 1-norm; about log10 of it digits can be lost.
    """

    posture: Posture
    struck: Ball
    touch: Contact
    law: str
    impulse: Array
    effective_mass: float
    foot_velocity: Array
    approach_speed: float
    ball_before: BallState
    ball: BallState
    v_before: Array
    v_after: Array
    joint_impulses: Array
    energy_lost: float
    sticking: bool
    restitution_residual: float
    momentum_residual: float
    condition: float

    @property
    def speed_ratio(self) -> float:
        """Ball speed just after over foot speed just before; inf where the foot was at rest."""
        foot = math.hypot(*self.foot_velocity)
        return float(self.ball.speed) / foot if foot else math.inf

    @property
    def worst_joint(self) -> tuple[str, float]:
        """The joint that transmits the largest linear impulse, and how much [N s]."""
        sizes = np.linalg.norm(self.joint_impulses[:, :3], axis=1)
        worst = int(np.argmax(sizes))
        return self.posture.leg.joint_names[worst], float(sizes[worst])

    def sensitivity(self) -> Sensitivity:
        """Return the derivatives of this strike, law `newton` only: see `Sensitivity`."""
        return sensitivity(self)

    def uncertainty(self, **spread: ArrayLike) -> Uncertainty:
        """Return covariances and the budget of what is not known exactly: see `uncertainty`.

        `hit.uncertainty(q=0.02, v=0.1, restitution=0.03)` takes standard deviations by source.
        """
        return uncertainty(self, **spread)


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
) -> Impact:
    """Strike a ball, in closed form (Eqs. 1-11 and 15-21).

    Args:
        leg: with the frame that touches the ball.
        q: configuration, shape `(nq,)` [rad; m for prismatic joints].
        v: joint velocity just before, shape `(nv,)` [rad/s].
        ball: its centre is at `contact point + radius * normal`.
        touch: normal, restitution and friction.
        law: `newton` (restitution along the normal, exact Coulomb cone) or `paper`.
        ball_velocity: of its centre just before, shape `(3,)` [m/s, world frame].
        ball_spin: just before, shape `(3,)` [rad/s, world frame].

    Raises:
        NoImpact: foot and ball do not approach each other along the normal.
        InvalidInput: a wrong shape, an entry that is not finite, or an unknown law.
    """
    return strike_at(
        leg.posture(q), v, ball, touch, law, ball_velocity=ball_velocity, ball_spin=ball_spin
    )


def strike_at(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    touch: Contact,
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ball_spin: ArrayLike = (0.0, 0.0, 0.0),
) -> Impact:
    """Strike a ball from a posture that is already there; else as `strike`."""
    if not isinstance(law, str) or law not in LAWS:
        raise InvalidInput(f"impact law {law!r} is unknown: choose {', '.join(LAWS)}")
    v = checks.vector("v", v, posture.leg.nv)
    before = BallState(posture.contact_point + ball.radius * touch.normal, ball_velocity, ball_spin)
    n = touch.normal
    with np.errstate(over="ignore", invalid="ignore"):  # said by `approach`
        foot_velocity = posture.jacobian @ v
        approach_speed = approach(posture, foot_velocity, before, touch)
    sliding = max(np.abs(before.spin).max() * ball.radius, np.abs(before.velocity).max())
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
    return _outcome(posture, v, foot_velocity, approach_speed, ball, before, touch, law, solution)


def approach(posture: Posture, foot_velocity: Array, before: BallState, touch: Contact) -> float:
    """Return the speed of foot towards ball along the normal [m/s]; raise `NoImpact` if none."""
    speed = float(touch.normal @ (foot_velocity - before.velocity))
    fastest = float(np.abs(foot_velocity - before.velocity).max())
    if not fastest < MAX_SPEED:
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
    jump = posture.solve(-(posture.jacobian.T @ impulse))
    transmitted, left_over = joint_impulses(posture, jump, -impulse)
    after = BallState(
        before.position,
        before.velocity + impulse / ball.mass,
        before.spin - np.cross(n, impulse) * (ball.radius / ball.inertia),
    )
    v_after = v + jump
    for array in (impulse, v, v_after, foot_velocity, transmitted):
        array.setflags(write=False)
    parting = float(n @ (after.velocity - posture.jacobian @ v_after))
    lever = float(np.linalg.norm(posture.jacobian) * np.linalg.norm(impulse))
    return Impact(
        posture=posture,
        struck=ball,
        touch=touch,
        law=law,
        impulse=impulse,
        effective_mass=posture.effective_mass(n),
        foot_velocity=foot_velocity,
        approach_speed=approach_speed,
        ball_before=before,
        ball=after,
        v_before=v,
        v_after=v_after,
        joint_impulses=transmitted,
        energy_lost=solution.energy_lost,
        sticking=solution.sticking,
        restitution_residual=abs(parting - touch.restitution * approach_speed) / approach_speed,
        momentum_residual=float(np.abs(left_over).max()) / lever if lever else 0.0,
        condition=posture.condition,
    )
