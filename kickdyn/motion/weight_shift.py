r"""A robot at rest on both feet shifts its weight onto the supporting foot, and back.

Both feet stay where they are. Joints other than six of the kicking limb go from one posture to the
other as a polynomial of time of degree 5; those six follow, so that the kicking foot does not move.
The ground's wrench is the sum of the wrenches on both feet, of which inverse dynamics gives the sum
only. They are parallel forces, whose centres of pressure are

.. math:: p_i = c_i + e, \quad p = (1 - \lambda)\, c_1 + \lambda\, c_2 + e

with the centre of pressure p of the sum, points :math:`c_i` of the soles, and the other foot's
share :math:`\lambda` of the force, from 0 to 1, for which the offset e is the shortest.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.standing import Foot, StandingRobot

CLOSED, STEPS = 1e-13, 20
"""Error of the kicking foot's pose from which on it is where it was [m, rad], and steps."""

CHECKED, UNLOADED = 100, 1e-6
"""Number of times at which limits are checked, and share of the force of an unloaded foot."""

UP = np.array([0.0, 0.0, 1.0])
"""Vertical unit vector."""


@dataclass(frozen=True, eq=False)
class Feet:
    """Both feet of a robot on the ground."""

    leg: Leg  # the joints that move, on the supporting foot
    standing: StandingRobot  # the robot on its supporting foot
    other: Foot  # its kicking foot

    def following(self) -> NDArray[np.int64]:
        """Return the indices of the six joints that follow; refuse a limb that has fewer."""
        model, robot = self.leg.workspace.model, self.standing.robot.workspace.model
        support = robot.frames[frame_id(robot, self.standing.support.frame)].parentJoint
        others = {str(robot.names[joint]) for joint in robot.supports[int(support)]}
        path = [int(joint) for joint in model.supports[self.leg.contact_joint]][1:]
        limb = [joint for joint in path if str(model.names[joint]) not in others]
        if len(limb) < 6:
            raise InvalidInput(
                f"the kicking limb of {self.standing.robot.name} has {len(limb)} joints: a motion "
                "that starts and ends on both feet needs six; give one support, on which it starts"
            )
        return np.array(limb[-6:]) - 1

    def closed(self, q: Array) -> Array:
        """Return q with the joints that follow where they put the kicking foot on the ground."""
        model, data = self.leg.workspace.model, self.leg.workspace.data
        columns, joint, target = self.following(), self.leg.contact_joint, self.other.pose
        q = q.copy()
        for _ in range(STEPS):
            pin.computeJointJacobians(model, data, q)
            rows = pin.getJointJacobian(model, data, joint, pin.LOCAL)
            error = pin.log6(target.actInv(data.oMi[joint])).vector
            if np.abs(error).max() < CLOSED:
                break
            q[columns] -= np.linalg.solve(rows[:, columns], error)
        return q


@dataclass(frozen=True, eq=False)
class WeightShift:
    """From rest on both feet to rest on the supporting one, with the other on the ground."""

    feet: Feet  # on the ground
    first: Array  # postures at both ends, shape `(n,)`
    last: Array
    anchors: Array  # points of both soles between which the force is shared, shape `(2, 2)` [m]
    duration: float  # of the shift [s]
    # what it keeps: a function of CasADi, and the names of its rows, see `margins`
    limits: tuple[Any, tuple[str, ...]]

    def joint_state(self, t: float) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration of the joints, `(n,)`, from 0 to duration."""
        x = t / self.duration
        along = np.array([
            ((6 * x - 15) * x + 10) * x**3,
            30 * (x * (1 - x)) ** 2 / self.duration,
            60 * x * (1 - x) * (1 - 2 * x) / self.duration**2,
        ])  # fmt: skip
        q, v, a = along[:, None] * (self.last - self.first)
        feet, joint = self.feet, self.feet.leg.contact_joint
        model, data, columns = feet.leg.workspace.model, feet.leg.workspace.data, feet.following()
        q = feet.closed(self.first + q)
        v[columns] = a[columns] = 0.0
        rows = pin.computeJointJacobian(model, data, q, joint)
        v[columns] = -np.linalg.solve(rows[:, columns], rows @ v)
        pin.forwardKinematics(model, data, q, v, a)
        a[columns] = -np.linalg.solve(rows[:, columns], data.a[joint].vector)
        return q, v, a

    def warnings(self) -> list[str]:
        """Return a line for each limit that it does not keep."""
        times = np.linspace(0.0, self.duration, CHECKED)
        rows = [self.margins(*self.joint_state(t)) for t in times]
        least = {name: min(row.get(name, math.inf) for row in rows) for name in rows[0]}
        return [
            f"{name} is beyond its limit by {-margin:.2g} while the weight is shifted"
            for name, margin in least.items()
            if margin < 0.0
        ]

    def wrenches(self, wrench: Array, placement: Any) -> tuple[Array, Array]:
        """Return the wrenches on the supporting and the other foot, `(6,)` each, from their sum.

        `placement` is the `pin.SE3` of the supporting frame in the world.
        """
        turn = placement * self.feet.standing.placement.inverse()
        parts = split_wrench(turn.actInv(pin.Force(wrench)).vector, self.anchors)
        supporting, other = (turn.act(pin.Force(part)).vector for part in parts)
        return supporting, other

    def margins(self, q: Array, v: Array, a: Array) -> dict[str, float]:
        """Return the least distance from each limit, by its name; of an unloaded foot, none."""
        (forces, distances), labels = self.limits
        torque, total = (np.asarray(part).ravel() for part in forces(q, v, a))
        parts = split_wrench(total, self.anchors)
        joint, space = self.feet.leg.contact_joint, self.feet.leg.workspace
        pin.computeJointJacobians(space.model, space.data, q)
        rows = pin.getJointJacobian(space.model, space.data, joint, pin.LOCAL)
        torque -= rows.T @ space.data.oMi[joint].actInv(pin.Force(parts[1])).vector
        values = np.asarray(distances(q, v, a, torque, *parts)).ravel()
        return least_by_name(labels, values.tolist())


def split_wrench(wrench: Array, anchors: Array) -> tuple[Array, Array]:
    """Return the wrenches on the supporting and on the other foot, `(6,)` each, from their sum.

    The wrench is about the world's origin; `anchors` are the points c of both soles, `(2, 2)` [m].
    """
    force, moment = np.split(wrench, 2)
    centre = np.array([-moment[1], moment[0]]) / force[2]
    way = anchors[1] - anchors[0]
    share = float(np.clip((centre - anchors[0]) @ way / (way @ way), 0.0, 1.0))
    share = share if share > UNLOADED else 0.0
    twist = moment[2] - np.cross([*centre, 0.0], force)[2]
    offset = centre - anchors[0] - share * way
    parts = [
        part * np.concatenate([force, np.cross([*place, 0.0], force) + twist * UP])
        for part, place in zip((1.0 - share, share), anchors + offset, strict=True)
    ]
    return parts[0], parts[1]


def least_by_name(names: Iterable[str], values: Iterable[float]) -> dict[str, float]:
    """Return the least of the finite values of each name."""
    least: dict[str, float] = {}
    for name, value in zip(names, values, strict=True):
        if math.isfinite(value):
            least[name] = min(value, least.get(name, math.inf))
    return least
