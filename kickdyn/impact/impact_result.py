"""What a strike does, with the residuals that prove it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.core.vectors import largest
from kickdyn.impact.constraint_impulses import named_impulses, residuals
from kickdyn.impact.digits import impulse_rounding, joint_digits, left
from kickdyn.impact.footing import judged
from kickdyn.impact.joint_impulses import joint_impulses, struck
from kickdyn.impact.sensitivity import Sensitivity, sensitivity
from kickdyn.impact.uncertainty import Uncertainty, uncertainty
from kickdyn.robot.leg import Posture

ENERGY_ROUNDING = 1e-12
"""Share of impulse times contact speed below which energy gained is rounding."""


RESIDUAL_ROUNDING = 1e-14
"""Residuals below it are rounding, whose digits differ from processor to processor."""


@dataclass(frozen=True, eq=False, repr=False)
class Impact(ReprMixin):
    """What a strike does, with the residuals that prove it.

    What the leg does after the impulse is computed when it is first read, and kept.

    Attributes:
        posture: the leg, as it struck; its contact point is that of the contact.
        ball: the ball.
        contact: the contact.
        law: name of the impact law.
        impulse: on the ball, shape `(3,)` [N s, world frame]; the leg takes the opposite.
        effective_mass: of the leg along the normal [kg]; inf where it is immovable.
        foot_velocity: of the contact point just before, shape `(3,)` [m/s, world frame].
        approach_speed: of foot towards ball along the normal [m/s].
        ball_before, ball_after: just before and just after.
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
        constraint_impulses: of supports and loops, stacked as in
        `posture.constraint_projector.rows` [N s, N m s,
            world axes], empty without; `support_impulses` and `loop_impulses` give them by name.
        momentum_residual: joint-space momentum that Newton-Euler cannot account for, relative to
            the impulse times the Jacobian's norm.
        condition: of the joint-space inertia, 1-norm; about log10 of it digits can be lost.
    """

    posture: Posture
    ball: Ball
    contact: Contact
    law: str
    impulse: Array
    effective_mass: float
    foot_velocity: Array
    approach_speed: float
    ball_before: BallState
    ball_after: BallState
    v_before: Array
    v_after: Array
    joint_impulses: Array
    constraint_impulses: Array
    energy_lost: float
    sticking: bool
    restitution_residual: float
    momentum_residual: float
    condition: float

    @classmethod
    def known(cls, **fields: Any) -> Impact:
        """Return an impact from what is known at once; the rest follows from it when read."""
        hit = cls.__new__(cls)  # past the constructor, which takes as long as a law
        hit.__dict__.update(fields)
        return hit

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Compute what is read for the first time."""
            if name in LEG_AFTER:
                self.__dict__.update(_leg_after(self))
            elif name == "effective_mass":
                self.__dict__[name] = self.posture.mass_along(self.contact.normal)
            elif name == "condition":
                self.__dict__[name] = self.posture.condition
            else:
                raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
            return self.__dict__[name]

    def __getstate__(self) -> dict[str, Any]:
        """Pickle all of it, read or not, so that a copy has the same digits."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def _rows(self) -> Iterable[Row]:
        joint, most = self.worst_joint
        yield "law", self.law + (", sticks" if self.sticking else ""), ""
        yield "impulse on the ball", self.impulse, "N s"
        yield "effective mass", self.effective_mass, "kg"
        yield "foot before", self.foot_velocity, "m/s"
        yield "ball after", self.ball_after.velocity, "m/s"
        yield "spin after", self.ball_after.spin, "rad/s"
        yield "ball over foot speed", self.speed_ratio, ""
        yield f"worst joint, {joint}", most, "N s"
        yield "energy lost", self.energy_lost, "J"
        found = np.array([self.restitution_residual, self.momentum_residual])
        rounding = bool((found < RESIDUAL_ROUNDING).all())
        yield "residuals", f"below {RESIDUAL_ROUNDING:g}" if rounding else found, ""
        yield "condition", self.condition, ""
        yield "digits at least", math.floor(self.digits), ""
        yield from warned(self.warnings)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line for each joint outside its range, or faster before the impact than its limit."""
        return (*self.posture.warnings, *self.posture.leg.too_fast(self.v_before))

    @property
    def speed_ratio(self) -> float:
        """Ball speed just after over foot speed just before; inf where the foot was at rest."""
        foot = math.hypot(*self.foot_velocity)
        return float(self.ball_after.speed) / foot if foot else math.inf

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
        return named_impulses(self.posture.constraint_projector, self.constraint_impulses)[0]

    @property
    def loop_impulses(self) -> dict[tuple[str, str], Array]:
        """What each loop gives its second frame, shape `(3,)` [N s, world axes].

        The first frame takes the opposite.
        """
        return named_impulses(self.posture.constraint_projector, self.constraint_impulses)[1]

    @property
    def footing(self) -> dict[str, str]:
        """What the ground, which only pushes, would let each support do; see `footing`.

        `stands`, or `lifts off`, `slips`, `tips`: then `unilateral_strike` says what happens; or
        `is tilted`, of a sole that is not level.
        """
        return judged(
            self.posture.constraint_projector, self.constraint_impulses, math.hypot(*self.impulse)
        )

    @property
    def support_residual(self) -> float:
        """The largest velocity of a held frame just after [m/s, rad/s]: 0 but for rounding."""
        return residuals(self.posture.constraint_projector, self.v_after)[0]

    @property
    def loop_residual(self) -> float:
        """The largest velocity at which a loop opens just after [m/s]: 0 but for rounding."""
        return residuals(self.posture.constraint_projector, self.v_after)[1]

    @property
    def worst_joint(self) -> tuple[str, float]:
        """The joint that transmits the largest linear impulse, and how much [N s]."""
        sizes = np.linalg.norm(self.joint_impulses[:, :3], axis=1)
        worst = int(np.argmax(sizes))
        return self.posture.leg.joint_names[worst], float(sizes[worst])

    @property
    def digits(self) -> float:
        """Digits that rounding leaves of the impulse, about; velocities after may cancel more.

        Few, where the approach is hardly more than the rounding of what it is the sum of, or where
        the ball is many times heavier than the leg that it sticks to.
        """
        return float(left(impulse_rounding(self)))

    @property
    def joint_digits(self) -> Array:
        """Digits that rounding leaves of each joint's linear impulse, an estimate, `(njoints,)`."""
        return joint_digits(self.joint_impulses, self.impulse, impulse_rounding(self))

    def sensitivity(self) -> Sensitivity:
        """Return the derivatives of this strike, law `newton` only: see `Sensitivity`."""
        return sensitivity(self)

    def uncertainty(self, **spread: ArrayLike) -> Uncertainty:
        """Return covariances and the budget of what is not known exactly: see `uncertainty`.

        `hit.uncertainty(q=0.02, v=0.1, restitution=0.03)` takes standard deviations by source.
        """
        return uncertainty(self, **spread)


LEG_AFTER = (
    *("v_after", "joint_impulses", "constraint_impulses"),
    *("restitution_residual", "momentum_residual"),
)


def _leg_after(hit: Impact) -> dict[str, Any]:
    """Return the fields named above, from the posture and the impulse alone."""
    posture, contact, push = hit.posture, hit.contact, -hit.impulse
    jacobian = posture.jacobian
    if posture.constraint_projector is None:
        held = NOTHING_HELD
        jump, transmitted, left_over = struck(posture, push)
    else:
        jump, held = posture.respond(push.dot(jacobian))
        transmitted, left_over = joint_impulses(posture, jump, push, held)
    v_after = hit.v_before + jump
    for array in (v_after, transmitted, held):
        array.setflags(write=False)
    parting = float(contact.normal.dot(hit.ball_after.velocity - jacobian.dot(v_after)))
    lever = math.sqrt(np.vdot(jacobian, jacobian)) * math.hypot(*push.tolist())
    approach = hit.approach_speed
    return {
        "v_after": v_after,
        "joint_impulses": transmitted,
        "constraint_impulses": held,
        "restitution_residual": abs(parting - contact.restitution * approach) / approach,
        "momentum_residual": largest(left_over) / lever if lever else 0.0,
    }


NOTHING_HELD = np.zeros(0)
