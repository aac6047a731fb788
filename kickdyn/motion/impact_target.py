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
"""Share of the friction that is left unused by a limited spin, so that the foot sticks."""

MOST_TURNS, SPIN_ROUNDING = 50, 1e-14
"""Of the search for the direction of a foot's plane: largest number of steps, and the relative
change of the spin that ends it."""


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
        from_centre = -self.ball.radius * self.contact.normal
        return float(from_centre[2]), float(from_centre @ _left_of(self.impulse))

    @property
    def facing(self) -> Array:
        """The impulse without its part across the vertical plane of the normal, `(3,)` [N s].

        A leg whose foot moves in a plane is turned so that this is in it.
        """
        across = _left_of(self.contact.normal)
        return np.asarray(self.impulse - (self.impulse @ across) * across)

    def velocity_change(self, posture: Posture) -> Array:
        r"""Return the change :math:`W p` of the contact points' relative velocity, `(3,)` [m/s].

        W is the Delassus matrix of foot and ball.
        """
        return np.asarray(posture.delassus() @ self.impulse + self.surface_change)

    @cached_property
    def surface_change(self) -> Array:
        """Change of the velocity of the ball's surface at the contact, shape `(3,)` [m/s]."""
        impulse, normal, ball = self.impulse, self.contact.normal, self.ball
        tangential = impulse - normal * (normal @ impulse)
        return validation.read_only(impulse / ball.mass + ball.turning * tangential)

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


def _left_of(vector: Array) -> Array:
    """Return the horizontal unit vector to the left of a vector; 0 of a vertical one."""
    x, y, _ = vector.tolist()
    return np.array([-y, x, 0.0]) / (math.hypot(x, y) or 1.0)


def _contact_normal(along: Array, axis: Array, sine: float) -> Array:
    """Return a direction that is turned about an axis across it, by the sine of the angle."""
    return np.asarray(math.sqrt(1.0 - sine * sine) * along + sine * np.cross(axis, along))


def struck_spin(
    velocity: Array, spin: Array, ball: Ball, contact: Contact, before: BallState, *, limited: bool
) -> Array:
    """Return the spin, nearest to a wished one, of a ball that is struck and has a velocity then.

    The impulse changes the spin across it only, and if this is `limited`, by no more than friction
    allows.
    """
    impulse = ball.mass * (velocity - before.velocity)
    size = math.hypot(*impulse)
    direction, change = impulse / (size or 1.0), spin - before.spin
    change = change - (change @ direction) * direction
    if limited:
        most = (1.0 - STICKING) * spin_change_limit(size, ball, contact)
        change *= min(1.0, most / (math.hypot(*change) or 1.0))
    return np.asarray(before.spin + change)


def planar_spin(
    velocity: Array,
    spin: Array,
    ball: Ball,
    contact: Contact,
    before: BallState,
    base: Array,
    *,
    limited: bool,
) -> Array:
    r"""Return the `struck_spin` of a ball that is struck by a foot which moves in a vertical plane.

    It is nearest to the wished one about the horizontal axis a across the plane. Along a, the foot
    moves as its base only, at the velocity b, and sticks: the ball's surface, of velocity s before,
    has this velocity after it, by the part of the impulse p along a,

    .. math:: a \cdot p = -a \cdot (s - b) / (1 / m + r^2 / I),

    which gives the spin about an axis in the plane. The direction of the plane follows from it.
    """
    impulse = ball.mass * (velocity - before.velocity)
    lateral_mass = 1.0 / (1.0 / ball.mass + ball.turning)
    per_impulse = ball.radius / ball.inertia  # spin that an impulse across the normal gives
    most = (1.0 - STICKING) * spin_change_limit(math.hypot(*impulse), ball, contact)
    change, normal = np.zeros(3), impulse / (math.hypot(*impulse) or 1.0)
    for _ in range(MOST_TURNS):
        slides = before.velocity - ball.radius * np.cross(before.spin, normal) - base
        across = _left_of(impulse + lateral_mass * slides)
        in_plane = impulse - (impulse @ across) * across
        size = math.hypot(*in_plane) or 1.0
        beside = per_impulse * float(impulse @ across)
        wished = float((spin - before.spin) @ across)
        if limited:
            room = math.sqrt(max(most * most - beside * beside, 0.0))
            wished = min(max(wished, -room), room)
        sine = min(max(wished / (per_impulse * size), -1.0), 1.0)
        last, normal = change, _contact_normal(in_plane / size, across, sine)
        change = wished * across + beside * np.cross(across, normal)
        if math.dist(change, last) <= SPIN_ROUNDING * math.hypot(*change, *before.spin):
            break
    return np.asarray(before.spin + change)


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
            remedy = "; a foot without friction (friction=0, --friction 0) leaves the ball's spin"
            remedy = remedy if before.spin.any() and contact.friction > 0.0 else ""
            raise InvalidInput(
                f"spin is {turn:.4g} rad/s: with friction {contact.friction:g} the foot gives this "
                f"launch at most {most:.4g} rad/s{remedy}"
            )
        normal = _contact_normal(along, spin / turn, sine)
    return ImpactTarget(impulse, replace(contact.for_ball(ball), normal=normal), ball, before)
