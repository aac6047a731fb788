r"""What the joints and bodies of a robot must keep in a kick, as terms.

- Speed, torque and range of the joints.
- Bodies are out of the ball and out of each other.

A robot that stands on one foot keeps, in postures of `StandingRobot.leg`, whose base is the
supporting foot, or of a part of it:

- Static balance: the centre of mass is above the sole.
- The kicking foot is above the ground.
- The trunk, which is the body of the floating base, is at most `TILT` from upright.
- The support's impulse :math:`\lambda` in the strike, which follows from the posture and from the
  impulse on the ball alone, is one that the ground can supply:
  :math:`\lambda_z \ge 0, |\lambda_t| \le \mu \lambda_z`, its centre of pressure in the sole.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.kick_terms import KickPoint, KickTerm, KickVariables, slope_by_differences
from kickdyn.planning.problem import TOLERANCE, Bounds, Function, Kind
from kickdyn.robot.collisions import TOUCHING, CollisionBody, Placed, Proximity
from kickdyn.robot.ground_clearance import LARGEST_MESH, body_frames, extreme_spheres
from kickdyn.robot.human_body import muscle_share, muscle_share_slope
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.model_validation import frames_by_name
from kickdyn.robot.standing import (
    StandingRobot,
    assumed_speed_limit,
    joint_spheres,
    rest_configuration,
    sole_edges,
)

WITHOUT_LIMITS = "it has one without its speed and torque limits"
"""The explanation of a limit of speed or torque."""

RESERVE = 1e-3
"""What is left of `TOUCHING` [m]: the solver keeps its conditions within a tolerance."""

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


class KickTorqueLimit(KickTerm):
    """The torque that keeps the joints' speed, gravity included, is within its limit."""

    kind, margin, rates_starts = Kind.INEQUALITY, 2 * TOLERANCE, False
    explanation = WITHOUT_LIMITS

    def __init__(self, variables: KickVariables) -> None:
        leg = variables.leg
        self._names, self._vs = variables.names, variables.vs
        effort = leg.effort_limit[self._vs]
        self.limit = np.where(effort > 0.0, effort, np.inf)  # 0 is no limit
        self._model, self._data = leg.model, leg.model.createData()
        self._still = np.zeros(leg.nv)

    def torque(self, posture: Posture, v: Array) -> Array:
        """Return the torque of the joints that move the foot, shape `(n,)` [N m]."""
        return np.asarray(pin.rnea(self._model, self._data, posture.q, v, self._still)[self._vs])

    def use(self, point: KickPoint) -> Array:
        """Return the torques over their limits, shape `(n,)`."""
        return np.abs(self.torque(point.posture, point.v)) / self.limit

    def residual(self, posture: Posture, v: Array) -> Array:
        use = self.torque(posture, v) / self.limit
        return 1.0 - use * use

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, Array]:
        gain = -2 * (self.torque(posture, v) / self.limit**2)[:, None]
        by_q, by_v = self.torque_derivatives(posture, v)
        return gain * by_q, gain * by_v

    def torque_derivatives(self, posture: Posture, v: Array) -> tuple[Array, Array]:
        """Return the derivatives of the torque by q and v of the leg, shape `(n, nv)` each."""
        state = posture.q, v, self._still
        by_q, by_v, _ = pin.computeRNEADerivatives(self._model, self._data, *state)
        shape = (len(v), len(v))
        return np.reshape(by_q, shape)[self._vs], np.reshape(by_v, shape)[self._vs]

    def binding(self, point: KickPoint) -> list[str]:
        return _reached("torque", self._names, self.use(point))


class KickSpeedLimit(Bounds[KickPoint]):
    """The speed of each joint is within its limit, which is kept by `TOLERANCE`.

    A joint without a limit has that of `assumed_speed_limit`.
    """

    explanation = WITHOUT_LIMITS

    def __init__(self, variables: KickVariables) -> None:
        self._names, self._vs = variables.names, variables.vs
        self.limit = assumed_speed_limit(variables.leg)[self._vs]
        most = np.where(np.isfinite(self.limit), 1.0 - TOLERANCE, np.inf)
        self.upper = np.array([*np.full(variables.n, np.inf), *most, np.inf])
        self.lower = -self.upper

    def use(self, point: KickPoint) -> Array:
        """Return the speeds over their limits, shape `(n,)`."""
        return np.abs(point.v[self._vs]) / self.limit

    def binding(self, point: KickPoint) -> list[str]:
        return _reached("speed", self._names, self.use(point))


class JointRange(Bounds[KickPoint]):
    """The range of each joint, and of the share of the foot velocity from the least one on."""

    def __init__(self, variables: KickVariables, least_share: float = 0.0) -> None:
        free = np.full(variables.n, np.inf)
        self.lower = np.array([*variables.lower, *-free, least_share])
        self.upper = np.array([*variables.upper, *free, 1.0])


def check_limits(variables: KickVariables) -> None:
    """Refuse limits of speed or torque that are 0."""
    leg, vs = variables.leg, variables.vs
    for what, limit in (("speed", leg.velocity_limit[vs]), ("torque", leg.effort_limit[vs])):
        if not (limit > 0.0).all():
            name = variables.names[int(np.argmin(limit > 0.0))]
            raise InvalidInput(
                f"{what} limit of {name} is {limit.min():g}: it must be above 0 (Leg.with_drives, "
                "--drives FILE), or, without a motion, lifted (limits=False, --no-limits)"
            )


def _reached(what: str, names: tuple[str, ...], use: Array) -> list[str]:
    pairs = zip(names, use.tolist(), strict=True)
    return [f"{what} of {name}" for name, share in pairs if share > 1.0 - 10 * TOLERANCE]


class KickMuscleTorqueLimit(KickTorqueLimit):
    """The torque that keeps the joints' speed is within what muscles have at this speed.

    Speed limits are those without torque. Rows are the distances from the limits in the positive
    and in the negative direction, shape `(2n,)`.
    """

    def __init__(self, variables: KickVariables) -> None:
        super().__init__(variables)
        limit = variables.leg.velocity_limit[self._vs]
        self._speed_limit = np.where(limit > 0.0, limit, np.inf)

    def _speed(self, v: Array) -> tuple[Array, Array]:
        """Return the signs of the directions, `(2, 1)`, and shortening speeds, shape `(2, n)`."""
        signs = np.array([[1.0], [-1.0]])
        return signs, np.clip(signs * v[self._vs] / self._speed_limit, 0.0, 1.0)

    def use(self, point: KickPoint) -> Array:
        torque = self.torque(point.posture, point.v) / self.limit
        _, speed = self._speed(point.v)
        most = np.where(torque > 0.0, *muscle_share(speed))
        return np.asarray(np.abs(torque) / np.maximum(most, 1e-9))

    def residual(self, posture: Posture, v: Array) -> Array:
        signs, speed = self._speed(v)
        distances = muscle_share(speed) - signs * self.torque(posture, v) / self.limit
        return np.asarray(distances.ravel())

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, Array]:
        by_q, by_v = self.torque_derivatives(posture, v)
        signs, speed = self._speed(v)
        fall = signs * muscle_share_slope(speed) * (speed > 0.0) / self._speed_limit
        rows_q = -signs[:, :, None] * (by_q / self.limit[:, None])
        rows_v = -signs[:, :, None] * (by_v / self.limit[:, None])
        columns = np.arange(len(self._vs))
        rows_v[:, columns, self._vs] += fall
        return rows_q.reshape(-1, len(v)), rows_v.reshape(-1, len(v))


class BodyClearance(KickTerm):
    r"""Bodies of pairs are outside each other, or outside the ball, None: their distances [m].

    A body with the point p nearest to another body, or to the ball, has the distance d with
    :math:`\dot d = n_p \cdot (\dot x - \dot p)`, where :math:`n_p` points from p to the other's
    nearest point x; for the ball, x is the contact point, which carries it.
    """

    kind, margin, required = Kind.INEQUALITY, 2 * TOLERANCE, False
    rates_starts = False

    def __init__(
        self,
        robot: Leg,
        variables: KickVariables,
        pairs: Sequence[tuple[CollisionBody, CollisionBody | None]],
    ) -> None:
        contact, ball = variables.target.contact, variables.target.ball
        self._robot, self.scale, self._pairs = robot, ball.radius, pairs
        self._from_contact = ball.radius * contact.normal
        self._posture: Posture | None = None
        self._known: list[Proximity] = []
        bodies = (body for pair in self._pairs for body in pair if body is not None)
        numbers = frames_by_name(variables.leg.workspace.model)
        self._frames = {body.frame: numbers[body.frame] for body in bodies}

    def residual(self, posture: Posture, v: Array) -> Array:
        return TOUCHING - RESERVE - np.array([x.depth for x in self._contacts(posture)])

    def derivatives(self, posture: Posture, v: Array) -> tuple[Array, None]:
        contacts = self._contacts(posture)
        model, data = posture.leg.workspace.model, posture.leg.workspace.data
        pin.computeJointJacobians(model, data, posture.q)
        pin.updateFramePlacements(model, data)

        def moved(body: CollisionBody | None, point: Array) -> Array:
            if body is None:
                return posture.jacobian
            number = self._frames[body.frame]
            jacobian = pin.getFrameJacobian(model, data, number, pin.LOCAL_WORLD_ALIGNED)
            arm = point - data.oMf[number].translation
            return np.asarray(jacobian[:3] - pin.skew(arm) @ jacobian[3:])

        slopes = [
            contact.normal @ (moved(other, contact.point) - moved(body, contact.point))
            for (body, other), contact in zip(self._pairs, contacts, strict=True)
        ]
        return np.array(slopes).reshape(len(contacts), posture.leg.nv), None

    def _contacts(self, posture: Posture) -> list[Proximity]:
        if posture is not self._posture:  # value and slope are of one posture
            space, centre = posture.leg.workspace, posture.contact_point + self._from_contact
            placed = Placed(self._robot, self._frames, space.model, space.data, posture.q)
            ball = placed.place_ball(centre, self.scale)
            self._posture = posture
            self._known = [placed.proximity(body, other or ball) for body, other in self._pairs]
        return self._known


def bodies_near_ball(robot: Leg) -> list[tuple[CollisionBody, None]]:
    """Return the bodies that can come near the ball, each with it; none without shapes."""
    posture, space = robot.posture(rest_configuration(robot)), robot.workspace
    placed = Placed(robot, body_frames(robot), space.model, space.data, posture.q)
    return [(body, None) for body in placed.bodies_near(posture.contact_point, LARGEST_MESH)]


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


class KickClearance(StanceTerm):
    """The kicking foot is above the ground: heights of its spheres above `CLEARANCE` [m].

    `robot` has the shapes of its file; `leg`, whose postures are evaluated, the same contact frame.
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
    explanation = f"it has one if its trunk may lean by more than {math.degrees(TILT):.0f} deg"

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
    from the sole's edges over `LENGTH`; and, with friction, what is left of it. The impulse on the
    ball has the shape `(3,)` [N s, world frame].
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
