"""Inverse dynamics and kinematics of a tree of joints in CasADi's symbols.

The wheel of Pinocchio has no `pinocchio.casadi`. `adam-robotics` reads files only, not a Pinocchio
model with locked or turned joints and rotors, and takes twice the operations.
"""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array


class SymbolicTree:
    r"""A Pinocchio model of joints of one degree of freedom, in CasADi's scalar symbols.

    Attributes:
        model: the `pin.Model`.
        q, v, a: its symbols, shape `(n,)`.

    Args:
        model: see above.
        state: expressions for q, v and a; None are symbols.
    """

    def __init__(self, model: Any, state: Sequence[Any] | None = None) -> None:
        self.model = model
        self.q, self.v, self.a = state or (ca.SX.sym(name, model.nv) for name in "qva")
        self._axes = [joint_axis(model, joint) for joint in range(1, model.njoints)]
        self._steps = [
            _step(model.jointPlacements[joint], *self._axes[joint - 1], self.q[joint - 1])
            for joint in range(1, model.njoints)
        ]
        self._poses: list[tuple[Any, Any]] = [(ca.SX.eye(3), ca.SX(3, 1))]
        for joint, (rotation, origin) in enumerate(self._steps, 1):
            above, place = self._poses[int(model.parents[joint])]
            self._poses.append((above @ rotation, place + above @ origin))

    def rotation(self, joint: int) -> Any:
        """Return the rotation from a joint's axes to the world's, shape `(3, 3)`."""
        return self._poses[joint][0]

    def point(self, joint: int, local: Array) -> Any:
        """Return a point in a joint's axes, `(3,)`, in the world frame, shape `(3,)` [m]."""
        rotation, origin = self._poses[joint]
        return rotation @ ca.DM(local) + origin

    def seen_from(self, joint: int, carrier: int, local: Any) -> Any:
        """Return a point in the axes of its carrier, `(3,)`, in those of a joint, `(3,)` [m]."""
        to_joint, to_carrier = (list(self.model.supports[j]) for j in (joint, carrier))
        while to_joint and to_carrier and to_joint[0] == to_carrier[0]:
            del to_joint[0], to_carrier[0]
        for number in reversed(to_carrier):
            rotation, origin = self._steps[number - 1]
            local = rotation @ local + origin
        for number in to_joint:
            rotation, origin = self._steps[number - 1]
            local = rotation.T @ (local - origin)
        return local

    def angular_velocity(self, joint: int) -> Any:
        """Return the angular velocity of the body of a joint, shape `(3,)` [rad/s, world frame]."""
        total = ca.SX(3, 1)
        for number in list(self.model.supports[joint])[1:]:
            turn = self._axes[number - 1][1]
            total += self._poses[number][0] @ ca.DM(turn) * self.v[int(number) - 1]
        return total

    def inverse_dynamics(self, gravity: bool = True) -> tuple[Any, Any]:
        r"""Return torques and the wrench of the ground on the root.

        The torques are :math:`\tau = M(q) a + c(q, v) + g(q)` [N m], rotors included. The wrench,
        shape `(6,)`, is linear [N], then angular about the world's origin [N m, world frame]; it
        includes the weight of the root's body. Newton-Euler as Featherstone, Rigid Body Dynamics
        Algorithms, Table 5.1.
        """
        model, v, a = self.model, self.v, self.a
        zero, pull = ca.SX(3, 1), ca.SX(ca.DM(-model.gravity.linear)) * float(gravity)
        motions = [(zero, zero, pull)]  # angular velocity and its derivative, acceleration
        forces = [_body_force(model.inertias[0], *motions[0])]
        for i, (linear, turn) in enumerate(self._axes):
            rotation, origin = self._steps[i]
            turning, alpha, accel = motions[int(model.parents[i + 1])]
            accel = accel + ca.cross(alpha, origin) + ca.cross(turning, ca.cross(turning, origin))
            back, slide, spin = rotation.T, ca.DM(linear), ca.DM(turn)
            before = back @ turning
            turning = before + spin * v[i]
            alpha = back @ alpha + spin * a[i] + ca.cross(before, spin) * v[i]
            accel = back @ accel + slide * a[i] + 2 * ca.cross(before, slide) * v[i]
            motions.append((turning, alpha, accel))
            forces.append(_body_force(model.inertias[i + 1], turning, alpha, accel))
        torques = []
        for i in reversed(range(len(self._axes))):
            (linear, turn), (force, moment) = self._axes[i], forces[i + 1]
            rotor = model.armature[i] * a[i]
            torques.append(ca.dot(ca.DM(linear), force) + ca.dot(ca.DM(turn), moment) + rotor)
            rotation, origin = self._steps[i]
            force = rotation @ force
            moment = rotation @ moment + ca.cross(origin, force)
            parent = int(model.parents[i + 1])
            forces[parent] = (forces[parent][0] + force, forces[parent][1] + moment)
        return ca.vertcat(*reversed(torques)), ca.vertcat(*forces[0])


def _body_force(body: Any, turning: Any, turned: Any, moved: Any) -> tuple[Any, Any]:
    """Return force and moment about the joint's origin that move a body, in its joint's axes."""
    centre, inertia = ca.DM(body.lever), ca.DM(body.inertia)
    force = body.mass * (
        moved + ca.cross(turned, centre) + ca.cross(turning, ca.cross(turning, centre))
    )
    moment = inertia @ turned + ca.cross(turning, inertia @ turning)
    return force, moment + ca.cross(centre, force)


def _step(fixed: Any, linear: Array, turn: Array, angle: Any) -> tuple[Any, Any]:
    """Return rotation and origin of a joint's frame in its parent's."""
    rotation = ca.DM(fixed.rotation)
    if not turn.any():
        return ca.SX(rotation), ca.DM(fixed.translation) + rotation @ (ca.DM(linear) * angle)
    skew = ca.DM(pin.skew(turn))
    about = ca.DM.eye(3) + ca.sin(angle) * skew + (1 - ca.cos(angle)) * (skew @ skew)
    return rotation @ about, ca.SX(ca.DM(fixed.translation))


def joint_axis(model: Any, joint: int) -> tuple[Array, Array]:
    """Return the linear and the angular part of a joint's axis, in its own frame."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq), np.ones(model.nv))
    axis = np.asarray(data.S).ravel()
    return axis[:3], axis[3:]
