"""From a launch back to the impact: impulse, normal, and the foot's velocity."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.representation import ReadOnlyArrays, freeze_arrays
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.restitution import approach_speed, check_invertible, restitution_at, restitution_slope
from kickdyn.robot.leg import Posture

STICKING = 1e-9
"""Share of the friction that a trap leaves unused, so that the foot sticks."""


@dataclass(frozen=True, eq=False)
class ImpactTarget(ReadOnlyArrays):
    r"""What the foot must do to a ball, at rest or not.

    Attributes:
        impulse: on the ball, shape `(3,)` [N s, world frame].
        contact: its normal gives the impulse and the spin; the foot sticks. With its restitution
            over the speed of approach, u (1 + e) increases with the speed u; else `InvalidInput`.
        ball: that is struck.
        before: the ball's motion just before; its position does not count.
    """

    impulse: Array
    contact: Contact
    ball: Ball
    before: BallState = field(default_factory=BallState)

    def __post_init__(self) -> None:
        """Make the arrays read-only; raise `InvalidInput` where foot speeds are not unique."""
        check_invertible(self.contact.restitution)
        freeze_arrays(vars(self))

    @property
    def contact_offset(self) -> tuple[float, float]:
        """Contact point on the ball, from its centre: upwards, and to the left as it flies [m]."""
        level = np.array([self.impulse[0], self.impulse[1], 0.0])
        left = np.cross((0.0, 0.0, 1.0), level / (np.linalg.norm(level) or 1.0))
        from_centre = -self.ball.radius * self.contact.normal
        return float(from_centre[2]), float(from_centre @ left)

    def velocity_change(self, posture: Posture) -> Array:
        r"""Return the change :math:`W p` of the contact points' relative velocity, `(3,)` [m/s].

        W is the Delassus matrix of foot and ball.
        """
        impulse, normal, ball = self.impulse, self.contact.normal, self.ball
        tangential = impulse - normal * (normal @ impulse)
        of_ball = impulse / ball.mass + ball.turning * tangential
        return np.asarray(posture.delassus() @ impulse + of_ball)

    @cached_property
    def surface_velocity(self) -> Array:
        """Velocity of the ball's surface at the contact before it, shape `(3,)` [m/s]."""
        spinning = np.cross(self.before.spin, self.contact.normal)
        return validation.read_only(self.before.velocity - self.ball.radius * spinning)

    def foot_velocity(self, posture: Posture, share: float = 1.0) -> Array:
        r"""Return the contact point's velocity just before, shape `(3,)` [m/s, world frame].

        Along the normal it is the speed u with :math:`u\,(1 + e(u)) = s\, n \cdot W p` for a share
        s of the impulse: restitution, Eq. (1). Across it there is no sliding just after. Without
        friction the part across the normal is free, and 0 here. The `surface_velocity` of a ball
        that moves is added.
        """
        return self.foot_velocity_for(self.velocity_change(posture), share)

    def foot_velocity_for(self, change: Array, share: float = 1.0) -> Array:
        """Return the foot's velocity for a `velocity_change`, both of shape `(3,)` [m/s]."""
        return self.closing_velocity_for(change, share) + self.surface_velocity

    def closing_velocity_for(self, change: Array, share: float = 1.0) -> Array:
        """Return the same relative to the ball's surface."""
        contact = self.contact
        speed = approach_speed(contact.restitution, share * float(contact.normal @ change))
        gain = self._gain(1.0 + restitution_at(contact.restitution, speed))
        return np.asarray(share * (gain @ change))

    def foot_gain(self, change: Array) -> Array:
        r"""Return :math:`G = n n^T / (1 + e + u\, de/du) + (I - n n^T)`, shape `(3, 3)`.

        It is the derivative of the foot's velocity by the change of the contact points' relative
        velocity, shape `(3,)` [m/s]; without friction its second term is left out.
        """
        contact = self.contact
        speed = approach_speed(contact.restitution, float(contact.normal @ change))
        slope = restitution_slope(contact.restitution, speed)
        return self._gain(1.0 + restitution_at(contact.restitution, speed) + speed * slope)

    def _gain(self, divisor: float) -> Array:
        """Return the foot's velocity per change of velocity, `(3, 3)`; the divisor is along n.

        Without friction, there is none across n.
        """
        along = np.outer(self.contact.normal, self.contact.normal)
        return along / divisor + (0.0 if self.contact.friction == 0.0 else np.eye(3) - along)


def spin_change_limit(impulse: float, ball: Ball, contact: Contact) -> float:
    r"""Return :math:`r p \sin(\arctan\mu) / I`, the largest change of spin that sticks [rad/s]."""
    return math.sin(math.atan(contact.friction)) * ball.radius * impulse / ball.inertia


def trapped_ball(wish: BallState, before: BallState, ball: Ball, contact: Contact) -> BallState:
    """Return a ball with a wished velocity and the spin that is nearest to the wished one.

    The impulse changes the spin across it only, and not by more than friction allows.
    """
    impulse = ball.mass * (wish.velocity - before.velocity)
    size = math.hypot(*impulse)
    direction, change = impulse / (size or 1.0), wish.spin - before.spin
    change = change - (change @ direction) * direction
    most = (1.0 - STICKING) * spin_change_limit(size, ball, contact)
    change *= min(1.0, most / (math.hypot(*change) or 1.0))
    return BallState(before.position, wish.velocity, before.spin + change, before.time)


def impact_target_for(
    velocity: Array, spin: Array, ball: Ball, contact: Contact, before: BallState | None = None
) -> ImpactTarget:
    r"""Return the impact that gives a ball a velocity and a spin [m/s, rad/s].

    Of a ball at rest, the impulse is :math:`p = m v`, and :math:`\omega` is the spin; of a ball
    that moves `before`, both are the changes, and :math:`\omega` is across p. The normal is turned
    from it by the angle :math:`\alpha` about the spin, with :math:`\sin\alpha = I \omega / (r p)`,
    no more than friction allows: :math:`\tan\alpha \le \mu`; a spin for which friction is too low
    raises `InvalidInput`. The contact has no normal yet.
    """
    before = BallState() if before is None else before
    impulse, spin = ball.mass * (velocity - before.velocity), spin - before.spin
    size, turn = math.hypot(*impulse), math.hypot(*spin)
    if not size > 1e-9 * ball.mass * math.hypot(*velocity):
        raise InvalidInput("the ball has the velocity that it needs: there is nothing to strike")
    along = impulse / size
    normal = along
    if turn > 0.0:
        sine = ball.inertia * turn / (ball.radius * size)
        most = spin_change_limit(size, ball, contact)
        if not turn <= most:
            raise InvalidInput(
                f"spin is {turn:.4g} rad/s: with friction {contact.friction:g} the foot gives this "
                f"launch at most {most:.4g} rad/s"
            )
        normal = math.sqrt(1.0 - sine * sine) * along + sine * np.cross(spin / turn, along)
    return ImpactTarget(impulse, replace(contact.for_ball(ball), normal=normal), ball, before)
