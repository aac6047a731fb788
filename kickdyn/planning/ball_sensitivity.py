"""How the launch of a planned kick changes if the ball does not lie exactly where it is planned."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

from kickdyn.core.representation import Row
from kickdyn.core.validation import Array
from kickdyn.errors import NoImpact
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.motion.motion import Motion
from kickdyn.robot.collisions import (
    FootKind,
    Proximity,
    StrikingShape,
    ball_proximity,
    contact_in_joint,
    striking_shapes,
)

DISPLACEMENT = 0.01
"""Displacement of the ball [m]. It is larger than a facet of a mesh, to which alone a derivative
would refer, and smaller than the face of a box."""

SWEPT = 0.05
"""Distance that the foot moves along the normal before and after the planned impact, in which the
contact with a displaced ball is sought [m]."""

TIMES = 21
"""Number of times, evenly spaced, between which the first contact is sought."""


class LaunchChange(NamedTuple):
    """Change of a launch by a displacement of the ball of 1 cm, the larger one of both directions.

    Attributes:
        direction_deg: angle between the two velocities [deg/cm].
        speed_percent: change of the speed, regardless of its sign [%/cm].
    """

    direction_deg: float
    speed_percent: float


class BallSensitivity(NamedTuple):
    """How much the launch of a kick changes if the ball is displaced by 1 cm.

    Values are infinite where the foot misses the displaced ball.

    Attributes:
        along: displacement ahead and back, in the horizontal direction of the launch.
        across: displacement to the left and to the right of it.
        foot: what strikes the ball, `shapes` of the robot's file or a flat `plate`.
    """

    along: LaunchChange
    across: LaunchChange
    foot: str

    @property
    def velocity_change(self) -> float:
        r"""Change of the velocity over the speed of the launch [1/cm].

        It is :math:`\sqrt{\sum (\delta^2 + \sigma^2)}` of the angles :math:`\delta` [rad] and
        the relative changes of speed :math:`\sigma` of both displacements.
        """
        return math.hypot(*(
            value
            for direction, speed in (self.along, self.across)
            for value in (math.radians(direction), 0.01 * speed)
        ))  # fmt: skip

    @property
    def rows(self) -> list[Row]:
        """Name, direction and speed of both displacements, for tables."""
        return [
            (f"ball displaced {name}", direction, f"deg/cm, {speed:.4g} %/cm ({self.foot})")
            for name, (direction, speed) in (("along", self.along), ("across", self.across))
        ]


def sensitivity_to_ball(impact: Impact, motion: Motion | None) -> BallSensitivity:
    """Return how the launch of an impact, in a motion, depends on the place of the ball.

    Without a motion, the joints keep their velocities.
    """
    acceleration = np.zeros(impact.posture.leg.nv) if motion is None else motion.a(0.0)
    robot = impact.posture.leg if motion is None else motion.robot
    planned = contact_in_joint(impact.posture, impact.contact.normal)
    shapes, _ = striking_shapes(robot, *planned, impact.ball.radius)
    foot = SwingingFoot(impact, acceleration, shapes)
    velocity = foot.launch(np.zeros(3)) if shapes else None
    if velocity is None:  # no shapes, or the ball is not where they pass
        foot, velocity = replace(foot, shapes=()), impact.ball_after.velocity
    level = velocity * [1.0, 1.0, 0.0]
    ahead = level / np.linalg.norm(level) if level.any() else np.array([1.0, 0.0, 0.0])
    changes = []
    for axis in (ahead, np.cross((0.0, 0.0, 1.0), ahead)):
        launches = (foot.launch(side * DISPLACEMENT * axis) for side in (1.0, -1.0))
        changes.append(LaunchChange(*map(max, *(_change(velocity, x) for x in launches))))
    along, across = changes
    return BallSensitivity(along, across, str(FootKind.SHAPES if foot.shapes else FootKind.PLATE))


def _change(velocity: Array, other: Array | None) -> LaunchChange:
    """Return the change from one velocity of the ball to another, infinite for a missed ball."""
    if other is None:
        return LaunchChange(math.inf, math.inf)
    sine = float(np.linalg.norm(np.cross(velocity, other)))
    angle = math.degrees(math.atan2(sine, float(velocity @ other)))
    ratio = float(np.linalg.norm(other) / np.linalg.norm(velocity))
    return LaunchChange(angle, 100.0 * abs(ratio - 1.0))


@dataclass(frozen=True, eq=False)
class SwingingFoot:
    r"""A foot near the impact, as it moves without a ball.

    At a time t from the planned impact, the configuration is :math:`q \oplus (v t + a t^2 / 2)`,
    and the velocity :math:`v + a t`, with v and a just before the planned impact, also after it.

    Attributes:
        impact: the planned one.
        acceleration: a, shape `(nv,)` [rad/s2; m/s2 for prismatic joints].
        shapes: that strike the ball; without any, a plane through the contact point does, across
            the normal.
    """

    impact: Impact
    acceleration: Array
    shapes: Sequence[StrikingShape]

    def launch(self, displacement: Array) -> Array | None:
        """Return the velocity of a ball displaced by a vector `(3,)` [m], `(3,)` [m/s].

        None if the foot misses the ball.
        """
        impact, t = self.impact, self._contact_time(displacement)
        if t is None:
            return None
        before, frame = impact.ball_before, impact.posture.leg.frame_id
        _, point, normal = self._meet(displacement, t)
        posture = impact.posture.leg.posture(self._configuration(t))
        placement = posture.leg.workspace.model.frames[frame].placement
        contact = replace(
            impact.contact,
            normal=posture.rotation_world_joint @ normal,
            offset=placement.actInv(point),
        )
        v = posture.admissible(impact.v_before + t * self.acceleration)
        try:
            hit = strike(
                posture, v, impact.ball, contact, impact.law, ball_velocity=before.velocity,
                ball_spin=before.spin,
            )  # fmt: skip
        except NoImpact:
            return None
        return hit.ball_after.velocity

    def _configuration(self, t: float) -> Array:
        """Return q at a time [s]."""
        step = t * self.impact.v_before + 0.5 * t * t * self.acceleration
        return np.asarray(
            pin.integrate(self.impact.posture.leg.workspace.model, self.impact.posture.q, step)
        )

    def _meet(self, displacement: Array, t: float) -> Proximity:
        """Return how the foot is beside a displaced ball at a time [s], in the joint's axes."""
        impact, leg = self.impact, self.impact.posture.leg
        before, radius = impact.ball_before, impact.ball.radius
        velocity = before.velocity - impact.posture.transport_velocity
        pin.forwardKinematics(leg.workspace.model, leg.workspace.data, self._configuration(t))
        centre = before.position + displacement + t * velocity
        centre = leg.workspace.data.oMi[leg.contact_joint].actInv(centre)
        if self.shapes:
            meets = [ball_proximity(shape.body, centre, radius) for shape in self.shapes]
            return max(meets, key=lambda meet: meet.depth)
        point, normal = contact_in_joint(impact.posture, impact.contact.normal)
        height = float(normal @ (centre - point))
        return Proximity(radius - height, centre - height * normal, normal)

    def _contact_time(self, displacement: Array) -> float | None:
        """Return when the foot meets a displaced ball [s]; None if it does not."""
        last = SWEPT / self.impact.approach_speed
        times = np.linspace(-last, last, TIMES).tolist()
        depths = [self._meet(displacement, t).depth for t in times]
        for begin, end, before, after in zip(times, times[1:], depths, depths[1:], strict=False):
            if before < 0.0 <= after:
                depth = lambda t: self._meet(displacement, t).depth  # noqa: E731
                return float(brentq(depth, begin, end, xtol=1e-9))
        return None
