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
from kickdyn.errors import EnergyCreated, InvalidInput, KickdynError, NoImpact
from kickdyn.impact.footing import judged
from kickdyn.impact.held import named_impulses, residuals
from kickdyn.impact.joint_impulses import joint_digits, joint_impulses, struck
from kickdyn.impact.laws import LAWS, ContactProblem, Solution
from kickdyn.impact.problem import cross
from kickdyn.impact.sensitivity import Sensitivity, sensitivity
from kickdyn.impact.uncertainty import Uncertainty, uncertainty
from kickdyn.leg import Leg
from kickdyn.posture import Posture

MAX_SPEED = 1e140

ENERGY_ROUNDING = 1e-12
"""Share of impulse times contact speed below which energy gained is rounding."""


@dataclass(frozen=True, eq=False)
class Impact:
    """What a strike does, with the residuals that prove it.

    Attributes:
        posture: the leg, as it struck; its contact point is that of the contact.
        struck: the ball.
        touch: the contact.
        law: name of the impact law.
        impulse: on the ball, shape `(3,)` [N s, world frame]; the leg takes the opposite.
        effective_mass: of the leg along the normal [kg]; inf where it is immovable.
        foot_velocity: of the contact point just before, shape `(3,)` [m/s, world frame].
        approach_speed: of foot towards ball along the normal [m/s].
        ball_before, ball: just before and just after.
        v_before, v_after: joint velocity, shape `(nv,)` [rad/s; m/s for prismatic joints].
        joint_impulses: by the parent on the child, linear then angular, about the joint's origin
            and in its frame, shape `(njoints, 6)` [N s, N m s], joints as in `leg.joint_names`.
        energy_lost: by leg and ball together [J]; negative where the law creates energy.
        sticking: whether friction could hold the contact points together: by `newton` and
            `stronge` they then part without sliding; `paper` leaves the ball's turning out, so
            that they slide all the same. False without friction.
        restitution_residual: |u_n+ + e u_n-| / |u_n-|, from the velocities after. Law `paper`
            restitutes along the attack direction and law `stronge` restitutes work: where that
            makes a difference, this shows it.
        constraint_impulses: of supports and loops, stacked as in `posture.hold.rows` [N s, N m s,
            world axes], empty without; `support_impulses` and `loop_impulses` give them by name.
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
    constraint_impulses: Array
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
    def creates_energy(self) -> bool:
        """Whether the law gave leg and ball energy they did not have, beyond rounding.

        Law `newton` can, with friction at an eccentric contact; law `paper` can, through the spin;
        law `stronge` never does.
        """
        before, radius = self.ball_before, self.posture.contact_point - self.ball_before.position
        speeds = (self.foot_velocity, before.velocity, np.abs(radius).max() * before.spin)
        fastest = max(float(np.abs(speed).max()) for speed in speeds)
        return self.energy_lost < -ENERGY_ROUNDING * float(np.abs(self.impulse).max()) * fastest

    @property
    def support_impulses(self) -> dict[str, Array]:
        """What each support gives the robot, linear then angular, about its frame, world axes.

        Shape `(6,)`, of a point foot `(3,)` [N s, N m s].
        """
        return named_impulses(self.posture.hold, self.constraint_impulses)[0]

    @property
    def loop_impulses(self) -> dict[tuple[str, str], Array]:
        """What each loop gives its second frame, shape `(3,)` [N s, world axes].

        The first frame takes the opposite.
        """
        return named_impulses(self.posture.hold, self.constraint_impulses)[1]

    @property
    def footing(self) -> dict[str, str]:
        """What the ground, which only pushes, would let each support do; see `footing`.

        `stands`, or `lifts off`, `slips`, `tips`: then `unilateral_strike` says what happens.
        """
        return judged(self.posture.hold, self.constraint_impulses, math.hypot(*self.impulse))

    @property
    def support_residual(self) -> float:
        """The largest velocity of a held frame just after [m/s, rad/s]: 0 but for rounding."""
        return residuals(self.posture.hold, self.v_after)[0]

    @property
    def loop_residual(self) -> float:
        """The largest velocity at which a loop opens just after [m/s]: 0 but for rounding."""
        return residuals(self.posture.hold, self.v_after)[1]

    @property
    def worst_joint(self) -> tuple[str, float]:
        """The joint that transmits the largest linear impulse, and how much [N s]."""
        sizes = np.linalg.norm(self.joint_impulses[:, :3], axis=1)
        worst = int(np.argmax(sizes))
        return self.posture.leg.joint_names[worst], float(sizes[worst])

    @property
    def joint_digits(self) -> Array:
        """Digits that rounding leaves of each joint's linear impulse, at least, `(njoints,)`."""
        return joint_digits(self.joint_impulses, self.impulse)

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
