r"""Equations of motion of a kinematic chain in CasADi symbols.

The wheel of Pinocchio has no `pinocchio.casadi`. `adam-robotics` reads files only, not a Pinocchio
model with locked or turned joints and armature, and takes twice the operations.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array


class CasadiChain:
    r"""The joints between a fixed base and the foot, each of one degree of freedom.

    Args:
        model: `pin.Model` of those joints alone, one after the other.
        lever: the contact point in the last joint's axes, shape `(3,)` [m].

    Attributes:
        n: number of joints.
        torque: CasADi function of q, v, a: :math:`M a + c(q, v) + g(q)` by Newton-Euler, armature
            included [N m].
        momentum: of q and v: :math:`M(q) v` [N m s].
        point_velocity: of q and v: velocity of the contact point, shape `(3,)` [m/s, world axes].
        point_position: of q: position of the contact point [m, world frame].
        direction: of q and a vector in the last joint's axes: that vector in the world's.
        impulse: of q and a force on the contact point: :math:`J^T f`.
    """

    def __init__(self, model: Any, lever: Array) -> None:
        self.n = int(model.nv)
        self._model = model
        self._axes = [_axis(model, joint) for joint in range(1, model.njoints)]
        q, v, a = (ca.SX.sym(name, self.n) for name in "qva")
        f = ca.SX.sym("f", 3)
        self.torque = ca.Function("torque", [q, v, a], [self._newton_euler(q, v, a, True)])
        zero = ca.SX(self.n, 1)
        self.momentum = ca.Function("momentum", [q, v], [self._newton_euler(q, zero, v, False)])
        position = self._position(q, ca.DM(lever))
        self.direction = ca.Function(
            "direction", [q, f], [self._position(q, f) - self._position(q, ca.DM(3, 1))]
        )
        slope = ca.jacobian(position, q)
        self.point_velocity = ca.Function("point_velocity", [q, v], [slope @ v])
        self.point_position = ca.Function("point_position", [q], [position])
        self.impulse = ca.Function("impulse", [q, f], [slope.T @ f])

    def _step(self, joint: int, angle: Any) -> tuple[Any, Any]:
        """Return rotation and origin of a joint's frame in its parent's."""
        fixed, (linear, turn) = self._model.jointPlacements[joint], self._axes[joint - 1]
        rotation = ca.DM(fixed.rotation)
        if not turn.any():
            return rotation, ca.DM(fixed.translation) + rotation @ (ca.DM(linear) * angle)
        skew = ca.DM(pin.skew(turn))
        about = ca.DM.eye(3) + ca.sin(angle) * skew + (1 - ca.cos(angle)) * (skew @ skew)
        return rotation @ about, ca.DM(fixed.translation)

    def _position(self, q: Any, point: Any) -> Any:
        """Return a point in the last joint's axes in the world frame."""
        for joint in range(self.n, 0, -1):
            rotation, origin = self._step(joint, q[joint - 1])
            point = rotation @ point + origin
        return point

    def _newton_euler(self, q: Any, v: Any, a: Any, gravity: bool) -> Any:
        """Return joint torques: Featherstone, Rigid Body Dynamics Algorithms, Table 5.1."""
        down = self._model.gravity.linear if gravity else np.zeros(3)
        turning, turned, lifted = ca.SX(3, 1), ca.SX(3, 1), ca.SX(ca.DM(-down))
        steps, forces = [], []
        for joint in range(1, self.n + 1):
            at, (linear, turn) = joint - 1, self._axes[joint - 1]
            rotation, origin = self._step(joint, q[at])
            moved = lifted + ca.cross(turned, origin) + ca.cross(turning, ca.cross(turning, origin))
            back, slide, spin = rotation.T, ca.DM(linear), ca.DM(turn)
            turning, before = back @ turning + spin * v[at], back @ turning
            turned = back @ turned + spin * a[at] + ca.cross(before, spin) * v[at]
            lifted = back @ moved + slide * a[at] + 2 * ca.cross(before, slide) * v[at]
            body = self._model.inertias[joint]
            centre, inertia = ca.DM(body.lever), ca.DM(body.inertia)
            force = body.mass * (
                lifted + ca.cross(turned, centre) + ca.cross(turning, ca.cross(turning, centre))
            )
            moment = inertia @ turned + ca.cross(turning, inertia @ turning)
            steps.append((rotation, origin))
            forces.append((force, moment + ca.cross(centre, force)))
        torques, force, moment = [], ca.SX(3, 1), ca.SX(3, 1)
        for joint in range(self.n, 0, -1):
            linear, turn = self._axes[joint - 1]
            own = forces[joint - 1]
            force, moment = force + own[0], moment + own[1]
            rotor = self._model.armature[joint - 1] * a[joint - 1]
            torques.append(ca.dot(ca.DM(linear), force) + ca.dot(ca.DM(turn), moment) + rotor)
            rotation, origin = steps[joint - 1]
            force = rotation @ force
            moment = rotation @ moment + ca.cross(origin, force)
        return ca.vertcat(*reversed(torques))


def _axis(model: Any, joint: int) -> tuple[Array, Array]:
    """Return the linear and the angular part of a joint's axis, in its own frame."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq), np.ones(model.nv))
    axis = np.asarray(data.S).ravel()
    return axis[:3], axis[3:]
