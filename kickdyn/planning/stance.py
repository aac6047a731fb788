r"""What a robot that stands on one foot must keep in a kick, as functions of its posture.

- Static balance: the centre of mass is above the sole.
- The kicking foot is above the ground. Where the kick must have a backswing, it is so high that it
  can come there from above the ground: a point of height :math:`z` that rises with
  :math:`\dot z > 0` and has the upward acceleration :math:`a` was not below
  :math:`z - \dot z^2 / (2 a)` before.
- The trunk, which is the body of the floating base, is at most `TILT` from upright.
- The support's impulse :math:`\lambda` in the strike, which follows from the posture and from the
  impulse on the ball alone, is one that the ground can supply:
  :math:`\lambda_z \ge 0, |\lambda_t| \le \mu \lambda_z`, its centre of pressure in the sole.
"""

import math
from enum import StrEnum

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from kickdyn.core.validation import Array
from kickdyn.robot.ground_clearance import Spheres
from kickdyn.robot.leg import Posture
from kickdyn.robot.standing import StandingRobot, joint_spheres

LENGTH = 0.1
"""Scale of distances from the ground and from the edge of the sole [m]."""

TILT = math.radians(30)
"""Largest angle between the trunk and its direction in the robot that stands upright [rad].

It is a choice: between the trunk of a walking robot, which is nearly upright, and that of a player
who leans over the ball.
"""

UPRIGHT = 1.0 - math.cos(TILT)
"""Scale of the height of the trunk's axis over that at the largest tilt."""

CLEARANCE = 1e-3
"""Least height of the kicking foot [m]: the solver keeps its conditions within a tolerance."""

CORNERS, DIRECTIONS = 24, 400
"""Number of spheres that stand for the kicking foot at most, and of directions, evenly over the
unit sphere, in which the foot is at most a known distance larger than these."""

STEP = 1e-6
"""Step of the differences that stand for the derivatives of the support's impulse [rad, m]."""


class Condition(StrEnum):
    """What a posture must keep, whatever the impulse on the ball."""

    UPRIGHT = f"its trunk is at most {math.degrees(TILT):.0f} deg from upright"
    CLEARANCE = "its kicking foot is above the ground"
    BALANCE = "its centre of mass is above the sole"


class Stance:
    """The margins of a standing robot, 0 or more where they are kept, and their derivatives.

    Postures are those of `standing.leg`.

    Attributes:
        standing: the robot.
        normals, offsets: of the sole's edges, outwards, shapes `(k, 2)` and `(k,)` [m]: x is above
            the sole where `normals @ x <= offsets`.
        impulse: on the ball, shape `(3,)` [N s]; None does not ask what the ground can supply.
        without: a condition that is left out.
        lift: largest upward acceleration of the kicking foot before the impact [m/s2]; None does
            not ask how the foot comes to its place.
    """

    def __init__(
        self,
        standing: StandingRobot,
        impulse: Array | None = None,
        without: Condition | None = None,
        lift: float | None = None,
    ) -> None:
        self.standing, self.impulse, self.without = standing, impulse, without
        self.lift = lift
        self._size = 1.0 if impulse is None else float(np.linalg.norm(impulse))
        leg, robot = standing.leg, standing.robot
        hull = ConvexHull(standing.sole)
        self.normals, self.offsets = hull.equations[:, :2], -hull.equations[:, 2]
        foot = joint_spheres(robot, robot.contact_joint)
        ends, self._left = _extremes(foot)
        # the pose of the kicking foot's joint in its frame is that in the leg's
        own = robot.workspace.model.frames[robot.frame_id].placement
        new = leg.workspace.model.frames[leg.frame_id].placement
        self._centres = np.array([(new * own.inverse()).act(x) for x in foot.centres[ends]])
        self._radii = foot.radii[ends]
        self._friction = standing.support.friction

    def margins(self, posture: Posture, v: Array) -> Array:
        """Return how far all is inside its bounds, about 1 for a good distance, shape `(k,)`.

        The joint velocity of the leg counts where there is a `lift`.
        """
        rise = 0.0 if self.lift is None else self._rise(posture, v)[0]
        centre = self.centre_of_mass(posture)[:2]  # it brings the joints' placements up to date
        known = {
            Condition.BALANCE: (self.offsets - self.normals @ centre) / LENGTH,
            Condition.CLEARANCE: (self._heights(posture) - np.maximum(self._left, rise)) / LENGTH,
            Condition.UPRIGHT: (self._trunk_axis(posture)[2:] - math.cos(TILT)) / UPRIGHT,
        }
        parts = [rows for name, rows in known.items() if name != self.without]
        if self.impulse is not None:
            parts.append(self._impulse_margins(posture))
        return np.concatenate(parts)

    def slopes(self, posture: Posture, v: Array, vs: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return derivatives of the margins by q and v of joints at `vs`, shape `(k, n)` each."""
        leg = posture.leg
        by_q, by_v = np.zeros(leg.nv), np.zeros(leg.nv)
        if self.lift is not None:
            _, by_q, by_v = self._rise(posture, v)
        model, data = leg.workspace.model, leg.workspace.data
        moved = pin.jacobianCenterOfMass(model, data, posture.q)
        moved *= data.mass[0] / (data.mass[0] + model.inertias[0].mass)
        pin.computeJointJacobians(model, data, posture.q)
        joint = leg.contact_joint
        own = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
        arms = self._centres @ posture.rotation_world_joint.T
        # z of v + w x arm
        raised = own[2] + np.outer(arms[:, 1], own[3]) - np.outer(arms[:, 0], own[4])
        trunk = self._trunk_joint(posture)
        turned = pin.getJointJacobian(model, data, trunk, pin.LOCAL_WORLD_ALIGNED)
        axis = self._trunk_axis(posture)
        known = {
            Condition.BALANCE: -self.normals @ moved[:2] / LENGTH,
            Condition.CLEARANCE: (raised - by_q) / LENGTH,
            Condition.UPRIGHT: (axis[1] * turned[3:4] - axis[0] * turned[4:5]) / UPRIGHT,
        }
        rising = {name: np.zeros_like(rows) for name, rows in known.items()}
        rising[Condition.CLEARANCE] -= by_v / LENGTH
        slopes = [
            np.vstack([rows for name, rows in each.items() if name != self.without])[:, vs]
            for each in (known, rising)
        ]
        if self.impulse is not None:
            here, columns = self._impulse_margins(posture), []
            for i in vs:
                step = np.zeros(leg.nv)
                step[i] = STEP
                there = leg.posture(pin.integrate(model, posture.q, step))
                columns.append((self._impulse_margins(there) - here) / STEP)
            impulsive = np.column_stack(columns)
            slopes = [
                np.vstack([slopes[0], impulsive]),
                np.vstack([slopes[1], np.zeros_like(impulsive)]),
            ]
        return slopes[0], slopes[1]

    def rows(self, condition: Condition) -> slice:
        """Return the rows of `margins` and `slopes` that belong to a condition."""
        sizes = {
            Condition.BALANCE: len(self.normals),
            Condition.CLEARANCE: len(self._centres),
            Condition.UPRIGHT: 1,
        }
        kept = [name for name in sizes if name != self.without]
        start = sum(sizes[name] for name in kept[: kept.index(condition)])
        return slice(start, start + sizes[condition])

    def balance(self, posture: Posture) -> float:
        """Return how far the centre of mass is inside the edge of the sole [m]."""
        at = self.centre_of_mass(posture)[:2]
        return float((self.offsets - self.normals @ at).min())

    def centre_of_mass(self, posture: Posture) -> Array:
        """Return the centre of mass of the whole robot, shape `(3,)` [m, world frame]."""
        model, data = posture.leg.workspace.model, posture.leg.workspace.data
        others, root = pin.centerOfMass(model, data, posture.q), model.inertias[0]
        moment = data.mass[0] * others + root.mass * root.lever
        return np.asarray(moment / (data.mass[0] + root.mass))

    def support_impulse(self, posture: Posture) -> Array:
        """Return the ground's impulse on the robot, shape `(6,)` [N s, N m s, world frame].

        Linear, then angular about the world's origin: with the impulse p on the ball, the robot's
        momentum changes by this less p.
        """
        impulse = np.zeros(3) if self.impulse is None else self.impulse
        jump = posture.solve(-impulse @ posture.jacobian)
        model, data = posture.leg.workspace.model, posture.leg.workspace.data
        pin.computeCentroidalMomentum(model, data, posture.q, jump)
        change = data.hg.vector
        centre = data.com[0]
        about = change[3:] + np.cross(centre, change[:3])
        return np.concatenate([
            change[:3] + impulse,
            about + np.cross(posture.contact_point, impulse),
        ])  # fmt: skip

    def _impulse_margins(self, posture: Posture) -> Array:
        """Return how far the support's impulse is inside what the ground can supply."""
        p = self.support_impulse(posture)
        pressed = np.array([-p[4], p[3]])  # the centre of pressure times the normal impulse
        inside = (self.offsets * p[2] - self.normals @ pressed) / LENGTH
        parts = [[p[2]], inside]
        if self._friction is not None:
            parts.append([self._friction * p[2] - np.hypot(p[0], p[1])])
        return np.concatenate(parts) / self._size

    def _rise(self, posture: Posture, v: Array) -> tuple[Array, Array, Array]:
        r"""Return how high each corner of the foot must be to rise as it does, `(k,)` [m].

        That is :math:`\dot z^2 / (2 a)` where it rises, which counts where it is more than the
        foot reaches beyond its corners; with its derivatives by q and v, shape `(k, nv)`.
        """
        assert self.lift is not None
        leg, lift = posture.leg, self.lift
        model, data, world = leg.workspace.model, leg.workspace.data, pin.LOCAL_WORLD_ALIGNED
        pin.computeForwardKinematicsDerivatives(model, data, posture.q, v, np.zeros(leg.nv))
        found = [
            pin.getPointVelocityDerivatives(
                model, data, leg.contact_joint, pin.SE3(np.eye(3), centre), world
            )
            for centre in self._centres
        ]
        by_q, by_v = (np.array([part[side][2] for part in found]) for side in (0, 1))
        up = (by_v @ v).clip(min=0.0)
        rise = up**2 / (2 * lift)
        gain = (up / lift * (rise > self._left))[:, None]
        return rise, gain * by_q, gain * by_v

    def _trunk_joint(self, posture: Posture) -> int:
        """Return the number of the joint that carries the trunk; 0 if none does."""
        model, name = posture.leg.workspace.model, self.standing.trunk_joint
        return int(model.getJointId(name)) if name and model.existJointName(name) else 0

    def _trunk_axis(self, posture: Posture) -> Array:
        """Return the trunk's axis that is vertical while it is upright, shape `(3,)` [world frame].

        The data of the leg must be those of the posture.
        """
        number = self._trunk_joint(posture)
        if number == 0:  # it does not move
            return np.array([0.0, 0.0, 1.0])
        return np.asarray(
            posture.leg.workspace.data.oMi[number].rotation @ self.standing.trunk_axis
        )

    def _heights(self, posture: Posture) -> Array:
        """Return how far the kicking foot's spheres are above `CLEARANCE`, shape `(k,)` [m]."""
        turn = posture.rotation_world_joint
        origin = posture.contact_point - turn @ posture.contact_lever
        lowest = self._centres @ turn[2] + origin[2] - self._radii
        return np.asarray(lowest - CLEARANCE)


def _extremes(body: Spheres) -> tuple[NDArray[np.int64], float]:
    """Return indices of at most `CORNERS` spheres, and how far the body reaches beyond them [m].

    Each next one is farthest outside of the hull of those before, in one of `DIRECTIONS`.
    """
    count = np.arange(DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * count / DIRECTIONS, math.pi * (1.0 + math.sqrt(5.0)) * count
    ring = np.sqrt(1.0 - height**2)
    directions = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
    reach = body.centres @ directions.T + body.radii[:, None]
    most, known = reach.max(axis=0), [int(np.argmax(reach[:, 0]))]
    while True:
        left = most - reach[known].max(axis=0)
        worst = int(np.argmax(left))
        if left[worst] < 1e-9 or len(known) == CORNERS:
            return np.array(known), float(left[worst])
        known.append(int(np.argmax(reach[:, worst])))
