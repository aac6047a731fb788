"""From a launch back to the impact: impulse, normal, and the foot's velocity."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kickdyn.ball import Ball
from kickdyn.contact import Contact
from kickdyn.core.representation import ReadOnlyArrays, freeze_arrays
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Posture


@dataclass(frozen=True, eq=False)
class ImpactTarget(ReadOnlyArrays):
    r"""What the foot must do to a ball at rest.

    Attributes:
        impulse: on the ball, shape `(3,)` [N s, world frame].
        contact: its normal gives the impulse and the spin; the foot sticks.
        ball: that is struck.
    """

    impulse: Array
    contact: Contact
    ball: Ball

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        freeze_arrays(vars(self))

    @property
    def contact_offset(self) -> tuple[float, float]:
        """Contact point on the ball, from its centre: upwards, and to the left as it flies [m]."""
        level = np.array([self.impulse[0], self.impulse[1], 0.0])
        left = np.cross((0.0, 0.0, 1.0), level / (np.linalg.norm(level) or 1.0))
        from_centre = -self.ball.radius * self.contact.normal
        return float(from_centre[2]), float(from_centre @ left)

    def foot_velocity(self, posture: Posture) -> Array:
        r"""Return the contact point's velocity just before, shape `(3,)` [m/s, world frame].

        With the Delassus matrix :math:`W` of foot and ball, :math:`u = G\, W p`: restitution along
        the normal, Eq. (1), and no sliding just after across it. Without friction the part across
        the normal is free, and 0 here.
        """
        impulse, normal, ball = self.impulse, self.contact.normal, self.ball
        across = impulse - normal * (normal @ impulse)
        of_ball = impulse / ball.mass + ball.turning * across
        return np.asarray(self.foot_gain @ (posture.delassus() @ impulse + of_ball))

    @cached_property
    def foot_gain(self) -> Array:
        r"""Matrix :math:`G = n n^T / (1 + e) + (I - n n^T)`, shape `(3, 3)`.

        From the change of the contact points' relative velocity to the foot's velocity; without
        friction its second term is left out.
        """
        along = np.outer(self.contact.normal, self.contact.normal)
        gain = along / (1.0 + self.contact.restitution)
        return gain if self.contact.friction == 0.0 else gain + np.eye(3) - along


def impact_target_for(
    velocity: Array,
    spin: Array,
    ball: Ball,
    restitution: float,
    friction: float,
    offset: Array | None = None,
) -> ImpactTarget:
    r"""Return the impact that gives a ball at rest a velocity and a spin across it [m/s, rad/s].

    The impulse is :math:`p = m v`. The normal is turned from it by the angle :math:`\alpha` about
    the spin, with :math:`\sin\alpha = I \omega / (r p)`, no more than friction allows:
    :math:`\tan\alpha \le \mu`; a spin for which friction is too low raises `InvalidInput`.
    """
    impulse = ball.mass * velocity
    size, turn = math.hypot(*impulse), math.hypot(*spin)
    along = impulse / size
    normal = along
    if turn > 0.0:
        sine = ball.inertia * turn / (ball.radius * size)
        most = math.sin(math.atan(friction))
        if not sine <= most:
            raise InvalidInput(
                f"spin is {turn:g} rad/s: with friction {friction:g} this launch takes at most "
                f"{most * ball.radius * size / ball.inertia:g} rad/s"
            )
        normal = math.sqrt(1.0 - sine * sine) * along + sine * np.cross(spin / turn, along)
    return ImpactTarget(impulse, Contact(normal, restitution, friction, offset), ball)
