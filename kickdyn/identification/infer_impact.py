r"""`infer_impact`: the impulse of a kick from how the ball moved before and after it.

The ball alone gives the impulse, without a coefficient of restitution or friction:

.. math:: p = m (v_b^+ - v_b), \qquad L = I_b (\omega_b^+ - \omega_b).

If it acted at one point of the ball's surface, with the normal n from that point to the centre,
then :math:`L = -r\, n \times p`, so that

.. math::

    n = \sqrt{1 - \frac{|a|^2}{|p|^2}}\, \frac{p}{|p|} + \frac{p \times a}{|p|^2},
    \qquad a = -\frac{L - (L \cdot \hat p)\, \hat p}{r} .

A part of L along p, or one longer than r |p|, cannot come from one point: it is the residual.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, NoImpact
from kickdyn.impact.leg_response import LegResponse, leg_response
from kickdyn.robot.leg import Posture

EXPLAINED = 0.05
"""Residual, relative to radius times impulse, up to which a point contact explains an impact; a
larger one is warned of."""


@dataclass(frozen=True, eq=False, repr=False)
class InferredImpact(ReprMixin):
    """What a measured change of the ball's motion says of an impact.

    Attributes:
        posture: of the leg; its contact point is where the leg takes the impulse.
        v_before: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: mass, radius and inertia.
        ball_before, ball_after: motion of the ball just before and after.
        impulse: on the ball, shape `(3,)` [N s, world frame].
        normal: unit vector from the contact point to the ball's centre, shape `(3,)`.
        residual: part of the change of spin that no impulse at one point explains, relative to
            radius times impulse.
        deviations: standard deviations of `restitution`, `friction`, `normal` (as an angle [rad])
            and `residual` that follow from those of the measured velocities; empty without them.
    """

    posture: Posture
    v_before: Array
    ball: Ball
    ball_before: BallState
    ball_after: BallState
    impulse: Array
    normal: Array
    residual: float
    deviations: dict[str, float]

    @cached_property
    def leg_response(self) -> LegResponse:
        """What the impulse does to the leg."""
        return leg_response(self.posture, self.v_before, self.impulse)

    @property
    def joint_impulses(self) -> Array:
        """Impulse of each joint's parent on its child, shape `(njoints, 6)` [N s, N m s].

        As `Impact.joint_impulses`.
        """
        return self.leg_response.joint_impulses

    @property
    def v_after(self) -> Array:
        """Joint velocity just after, shape `(nv,)` [rad/s; m/s for prismatic joints]."""
        return self.leg_response.v_after

    @property
    def contact_point(self) -> Array:
        """Where on the ball the impulse acted, shape `(3,)` [m, world frame]."""
        return np.asarray(self.ball_before.position - self.ball.radius * self.normal)

    @property
    def restitution(self) -> float:
        r"""Ratio :math:`-u_n^+ / u_n^-` of the contact points' relative velocities along n."""
        before = float(self.normal @ self._sliding(self.v_before, self.ball_before))
        return -float(self.normal @ self._sliding(self.v_after, self.ball_after)) / before

    @property
    def friction(self) -> float:
        """Impulse across the normal over that along it: the least coefficient that allows it."""
        along = float(self.normal @ self.impulse)
        return float(np.linalg.norm(self.impulse - along * self.normal)) / along

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before using the numbers."""
        lines = []
        limit = max(EXPLAINED, 3.0 * self.deviations.get("residual", 0.0))
        if self.residual > limit:
            lines.append(
                f"{100 * self.residual:.1f} % of the ball's change of spin cannot come from an "
                "impulse at one point: the contact was an area, or a velocity is wrong"
            )
        if not 0.0 <= self.restitution <= 1.0:
            lines.append(
                f"restitution is {self.restitution:.3g}, outside 0 to 1: posture, joint velocity "
                "and ball do not go together"
            )
        return (*lines, *self.posture.warnings)

    def _sliding(self, v: Array, state: BallState) -> Array:
        """Return the velocity of the ball's contact point less that of the foot's [m/s]."""
        surface = state.velocity - self.ball.radius * np.cross(state.spin, self.normal)
        return np.asarray(surface - self.posture.point_velocity(v))

    def _rows(self) -> Iterable[Row]:
        yield "impulse on the ball", self.impulse, "N s"
        yield "normal", self.normal, ""
        yield "contact point", self.contact_point, "m"
        for name in ("restitution", "friction"):
            spread = f" +- {self.deviations[name]:.2g}" if name in self.deviations else ""
            yield name, f"{getattr(self, name):.4g}{spread}", ""
        sizes = np.linalg.norm(self.joint_impulses[:, :3], axis=1)
        worst = int(np.argmax(sizes))
        yield f"worst joint, {self.posture.leg.joint_names[worst]}", float(sizes[worst]), "N s"
        yield "residual", self.residual, ""
        yield from warned(self.warnings)


def infer_impact(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    ball_before: BallState,
    ball_after: BallState,
    *,
    velocity_deviation: float = 0.0,
    spin_deviation: float = 0.0,
) -> InferredImpact:
    """Return the impulse of a kick, and the contact that explains it, from the ball's motion.

    Args:
        posture: of the leg in the impact; its contact point touched the ball.
        v: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: mass, radius and inertia.
        ball_before: measured motion just before; its position is that of the centre.
        ball_after: measured motion just after.
        velocity_deviation: standard deviation of each component of both velocities [m/s].
        spin_deviation: of each component of both spins [rad/s].

    Raises:
        NoImpact: the ball's velocity did not change, or foot and ball do not approach each other.
        InvalidInput: a wrong argument.
    """
    validation.check_type(Posture, posture=posture)
    validation.check_type(Ball, ball=ball)
    validation.check_type(BallState, ball_before=ball_before, ball_after=ball_after)
    for name, state in (("ball_before", ball_before), ("ball_after", ball_after)):
        if state.position.shape != (3,):
            raise InvalidInput(f"{name} has shape {state.position.shape}: it must be one state")
    speed = validation.vector("v", v, posture.leg.model.nv, unit="rad/s or m/s")
    noise = np.repeat(
        [
            validation.number("velocity deviation", velocity_deviation, at_least=0, unit="m/s"),
            validation.number("spin deviation", spin_deviation, at_least=0, unit="rad/s"),
        ],
        3,
    )

    def inferred(nudge: Array) -> InferredImpact:
        after = BallState(
            ball_after.position, ball_after.velocity + nudge[:3], ball_after.spin + nudge[3:]
        )
        change = after.velocity - ball_before.velocity
        impulse = ball.mass * change
        normal, residual = _point_contact(
            impulse, ball.inertia * (after.spin - ball_before.spin), ball.radius
        )
        return InferredImpact(
            posture, speed, ball, ball_before, after, impulse, normal, residual, {}
        )

    if np.array_equal(ball_after.velocity, ball_before.velocity):
        raise NoImpact("the ball's velocity is the same before and after: there was no impulse")
    found = inferred(np.zeros(6))
    closing = -float(found.normal @ found._sliding(speed, ball_before))
    if closing <= 0.0:
        raise NoImpact(
            f"foot and ball separate at {-closing:.3g} m/s along the normal that the impulse asks "
            "for: before an impact they approach each other"
        )
    if not noise.any():
        return found
    # both velocities are measured, hence the root of two
    steps = np.sqrt(2.0) * np.diag(noise)
    shifted = [(inferred(step), inferred(-step)) for step in steps[noise > 0.0]]
    deviations = {
        name: math.hypot(*(0.5 * (getattr(a, name) - getattr(b, name)) for a, b in shifted))
        for name in ("restitution", "friction", "residual")
    }
    deviations["normal"] = math.hypot(
        *(0.5 * float(np.linalg.norm(a.normal - b.normal)) for a, b in shifted)
    )
    return InferredImpact(
        posture, speed, ball, ball_before, ball_after, found.impulse, found.normal,
        found.residual, deviations,
    )  # fmt: skip


def _point_contact(impulse: Array, turning: Array, radius: float) -> tuple[Array, float]:
    """Return the normal of a point contact, and what of the change of spin it leaves unexplained.

    Args:
        impulse: on the ball, shape `(3,)` [N s].
        turning: change of the ball's angular momentum, shape `(3,)` [N m s].
        radius: of the ball [m].
    """
    size = float(np.linalg.norm(impulse))
    along = impulse / size
    if not math.isfinite(radius * size):
        raise InvalidInput(f"the impulse is {size:g} N s: it must be finite")
    arm = -turning / (radius * size)  # n x p / |p|
    twist = float(arm @ along)
    arm = arm - twist * along
    longest = float(np.linalg.norm(arm))
    excess = max(longest - 1.0, 0.0)
    if excess:
        arm = arm / longest
    normal = math.sqrt(max(1.0 - float(arm @ arm), 0.0)) * along + np.cross(along, arm)
    return normal, math.hypot(twist, excess)
