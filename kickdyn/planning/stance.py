r"""What a robot that stands on one foot must keep in a kick, as terms.

- Static balance: the centre of mass is above the sole.
- The kicking foot is above the ground.
- The trunk, which is the body of the floating base, is at most `TILT` from upright.
- The support's impulse :math:`\lambda` in the strike, which follows from the posture and from the
  impulse on the ball alone, is one that the ground can supply:
  :math:`\lambda_z \ge 0, |\lambda_t| \le \mu \lambda_z`, its centre of pressure in the sole.

Postures belong to `StandingRobot.leg`, whose base is the supporting foot, or of a part of it.
"""

import math
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.planning.kick_terms import KickPoint, KickTerm, slope_by_differences
from kickdyn.planning.problem import TOLERANCE, Function, Kind
from kickdyn.robot.ground_clearance import extreme_spheres
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.standing import StandingRobot, joint_spheres, sole_edges

LENGTH = 0.1
"""Scale of distances from the ground and from the edge of the sole [m]."""

TILT = math.radians(30)
"""Largest angle between the trunk and its direction in the robot that stands upright [rad].

It is a choice: between the trunk of a walking robot, which is nearly upright, and the trunk of a
player who leans over the ball.
"""

CLEARANCE = 1e-3
"""Least height of the kicking foot [m]: the solver keeps its conditions within a tolerance."""

DIFFERENCE_STEP = 1e-6
"""Step of the differences that stand for the derivatives of the support's impulse [rad, m]."""


class StanceTerm(KickTerm):
    """A condition on a robot that stands on one foot: an inequality, kept by a margin."""

    kind, margin = Kind.INEQUALITY, 2 * TOLERANCE


class Balance(StanceTerm):
    """The centre of mass is above the sole: its distances from the sole's edges [m].

    Attributes:
        normals, offsets: of the sole's edges, outwards, shapes `(k, 2)` and `(k,)` [m]: x is above
            the sole where `normals @ x <= offsets`.
    """

    scale = LENGTH
    explanation = "it has one if its centre of mass may be beside the sole"

    def __init__(self, standing: StandingRobot) -> None:
        self.normals, self.offsets = sole_edges(standing)

    def residual(self, posture: Posture, v: Array) -> Array:
        return self.offsets - self.normals @ centre_of_mass(posture)[:2]

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, None]:
        model, data = posture.leg.workspace.model, posture.leg.workspace.data
        jacobian = pin.jacobianCenterOfMass(model, data, posture.q)
        jacobian *= data.mass[0] / (data.mass[0] + model.inertias[0].mass)
        return -self.normals @ jacobian[:2], None

    def distance(self, posture: Posture) -> float:
        """Return the distance of the centre of mass inside the edge of the sole [m]."""
        return float(self.residual(posture, np.zeros(posture.leg.nv)).min())


class Clearance(StanceTerm):
    """The kicking foot is above the ground: heights of its spheres above `CLEARANCE` [m].

    Args:
        robot: with the shapes of its file.
        leg: whose postures are evaluated; its contact frame is the robot's.
        ground: height of the ground [m, world frame].
    """

    scale = LENGTH
    explanation = "it has one if its kicking foot may be under the ground"

    def __init__(self, robot: Leg, leg: Leg, ground: float = 0.0) -> None:
        foot = joint_spheres(robot, robot.contact_joint)
        extremes, beyond = extreme_spheres(foot)
        # the pose of the kicking foot's joint in its contact frame is the same in both models
        frame = robot.workspace.model.frames[robot.frame_id].placement
        in_leg = leg.workspace.model.frames[leg.frame_id].placement * frame.inverse()
        self._centres = np.array([in_leg.act(centre) for centre in foot.centres[extremes]])
        self._lowest = foot.radii[extremes] + beyond + ground + CLEARANCE

    def residual(self, posture: Posture, v: Array) -> Array:
        rotation = posture.rotation_world_joint
        origin = posture.contact_point - rotation @ posture.contact_lever
        return np.asarray(self._centres @ rotation[2] + origin[2] - self._lowest)

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, None]:
        model, data = posture.leg.workspace.model, posture.leg.workspace.data
        pin.computeJointJacobians(model, data, posture.q)
        jacobian = joint_jacobian(posture, posture.leg.contact_joint)
        arms = self._centres @ posture.rotation_world_joint.T
        # the vertical component of v + w x arm
        turning = np.outer(arms[:, 1], jacobian[3]) - np.outer(arms[:, 0], jacobian[4])
        return jacobian[2] + turning, None


class Upright(StanceTerm):
    """The trunk's tilt is at most `TILT`: the cosine of its tilt less the cosine of `TILT`."""

    scale = 1.0 - math.cos(TILT)
    explanation = (
        f"it has one if its trunk may be more than {math.degrees(TILT):.0f} deg from upright"
    )

    def __init__(self, standing: StandingRobot) -> None:
        self._joint, self._axis = standing.trunk_joint, standing.trunk_axis

    def residual(self, posture: Posture, v: Array) -> Array:
        leg = posture.leg
        pin.forwardKinematics(leg.workspace.model, leg.workspace.data, posture.q)
        return self._direction(posture)[2:] - math.cos(TILT)

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, None]:
        leg = posture.leg
        pin.computeJointJacobians(leg.workspace.model, leg.workspace.data, posture.q)
        jacobian = joint_jacobian(posture, self._trunk_joint(posture))
        axis = self._direction(posture)
        return axis[1] * jacobian[3:4] - axis[0] * jacobian[4:5], None

    def _trunk_joint(self, posture: Posture) -> int:
        """Return the number of the joint that carries the trunk; 0 if none moves it."""
        model = posture.leg.workspace.model
        return int(model.getJointId(self._joint)) if model.existJointName(self._joint) else 0

    def _direction(self, posture: Posture) -> Array:
        """Return the trunk's axis that is vertical in the upright robot, `(3,)` [world frame]."""
        if (number := self._trunk_joint(posture)) == 0:
            return np.array([0.0, 0.0, 1.0])
        return np.asarray(posture.leg.workspace.data.oMi[number].rotation @ self._axis)


class SupportImpulse(Function[KickPoint]):
    """The impulse of the ground on the supporting foot is one that the ground can supply.

    The values are the normal impulse [N s]; the same times the distances of the centre of pressure
    from the sole's edges over `LENGTH`; and, with friction, what is left of it.

    Args:
        standing: the robot.
        impulse: on the ball, shape `(3,)` [N s, world frame].
    """

    kind, margin, required = Kind.INEQUALITY, 2 * TOLERANCE, False

    def __init__(self, standing: StandingRobot, impulse: Array) -> None:
        self._impulse, self.scale = impulse, float(np.linalg.norm(impulse))
        self._normals, self._offsets = sole_edges(standing)
        self._friction = standing.support.friction

    def wrench(self, posture: Posture) -> Array:
        """Return the ground's impulse on the robot, shape `(6,)` [N s, N m s, world frame].

        Linear, then angular about the world's origin: with the impulse p on the ball, the robot's
        momentum changes by this less p.
        """
        impulse, leg = self._impulse, posture.leg
        jump = posture.solve(-impulse @ posture.jacobian)
        data = leg.workspace.data
        pin.computeCentroidalMomentum(leg.workspace.model, data, posture.q, jump)
        change = data.hg.vector
        about_origin = change[3:] + np.cross(data.com[0], change[:3])
        return np.concatenate([
            change[:3] + impulse,
            about_origin + np.cross(posture.contact_point, impulse),
        ])  # fmt: skip

    def value(self, point: KickPoint) -> Array:
        return self.residual(point.posture)

    def slope(self, point: KickPoint) -> Array:
        return slope_by_differences(self, point, point.variables.n, DIFFERENCE_STEP)

    def residual(self, posture: Posture) -> Array:
        """Return the value at a posture, shape `(k,)` [N s]."""
        p = self.wrench(posture)
        moment = np.array([-p[4], p[3]])  # the centre of pressure times the normal impulse
        rows = [[p[2]], (self._offsets * p[2] - self._normals @ moment) / LENGTH]
        if self._friction is not None:
            rows.append([self._friction * p[2] - np.hypot(p[0], p[1])])
        return np.concatenate(rows)


def centre_of_mass(posture: Posture) -> Array:
    """Return the centre of mass of the robot, its supporting foot included, `(3,)` [m, world]."""
    model, data = posture.leg.workspace.model, posture.leg.workspace.data
    moving, foot = pin.centerOfMass(model, data, posture.q), model.inertias[0]
    moment = data.mass[0] * moving + foot.mass * foot.lever
    return np.asarray(moment / (data.mass[0] + foot.mass))


def joint_jacobian(posture: Posture, joint: int) -> Array:
    """Return the Jacobian of a joint's frame, `(6, nv)` [its origin, world axes].

    The data of the leg must have the joint Jacobians of the posture.
    """
    space = posture.leg.workspace
    jacobian: Any = pin.getJointJacobian(space.model, space.data, joint, pin.LOCAL_WORLD_ALIGNED)
    return np.asarray(jacobian)
