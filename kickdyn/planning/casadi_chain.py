r"""Equations of motion of a kinematic chain in CasADi symbols.

The wheel of Pinocchio has no `pinocchio.casadi`. `adam-robotics` reads files only, not a Pinocchio
model with locked or turned joints and armature, and takes twice the operations.
"""

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array


def torque_function(model: Any) -> Any:
    r"""Return the CasADi function of q, v and a: :math:`M a + c(q, v) + g(q)` [N m].

    Newton-Euler as Featherstone, Rigid Body Dynamics Algorithms, Table 5.1; armature is included.

    Args:
        model: `pin.Model` of joints of one degree of freedom, one after the other.
    """
    q, v, a = (ca.SX.sym(name, model.nv) for name in "qva")
    axes = [_axis(model, joint) for joint in range(1, model.njoints)]
    turning, turned, lifted = ca.SX(3, 1), ca.SX(3, 1), ca.SX(ca.DM(-model.gravity.linear))
    steps, forces = [], []
    for at, (linear, turn) in enumerate(axes):
        rotation, origin = _step(model.jointPlacements[at + 1], linear, turn, q[at])
        moved = lifted + ca.cross(turned, origin) + ca.cross(turning, ca.cross(turning, origin))
        back, slide, spin = rotation.T, ca.DM(linear), ca.DM(turn)
        turning, before = back @ turning + spin * v[at], back @ turning
        turned = back @ turned + spin * a[at] + ca.cross(before, spin) * v[at]
        lifted = back @ moved + slide * a[at] + 2 * ca.cross(before, slide) * v[at]
        body = model.inertias[at + 1]
        centre, inertia = ca.DM(body.lever), ca.DM(body.inertia)
        force = body.mass * (
            lifted + ca.cross(turned, centre) + ca.cross(turning, ca.cross(turning, centre))
        )
        moment = inertia @ turned + ca.cross(turning, inertia @ turning)
        steps.append((rotation, origin))
        forces.append((force, moment + ca.cross(centre, force)))
    torques, force, moment = [], ca.SX(3, 1), ca.SX(3, 1)
    for at in reversed(range(len(axes))):
        linear, turn = axes[at]
        force, moment = force + forces[at][0], moment + forces[at][1]
        rotor = model.armature[at] * a[at]
        torques.append(ca.dot(ca.DM(linear), force) + ca.dot(ca.DM(turn), moment) + rotor)
        rotation, origin = steps[at]
        force = rotation @ force
        moment = rotation @ moment + ca.cross(origin, force)
    return ca.Function("torque", [q, v, a], [ca.vertcat(*reversed(torques))])


def point_function(model: Any) -> Any:
    """Return the CasADi function of q and a point in the last joint's axes: it in the world frame.

    Args:
        model: as of `torque_function`.
    """
    q, local = ca.SX.sym("q", model.nv), ca.SX.sym("point", 3)
    point = local
    for joint in range(model.nv, 0, -1):
        axis = _axis(model, joint)
        rotation, origin = _step(model.jointPlacements[joint], *axis, q[joint - 1])
        point = rotation @ point + origin
    return ca.Function("point", [q, local], [point])


def _step(fixed: Any, linear: Array, turn: Array, angle: Any) -> tuple[Any, Any]:
    """Return rotation and origin of a joint's frame in its parent's."""
    rotation = ca.DM(fixed.rotation)
    if not turn.any():
        return rotation, ca.DM(fixed.translation) + rotation @ (ca.DM(linear) * angle)
    skew = ca.DM(pin.skew(turn))
    about = ca.DM.eye(3) + ca.sin(angle) * skew + (1 - ca.cos(angle)) * (skew @ skew)
    return rotation @ about, ca.DM(fixed.translation)


def _axis(model: Any, joint: int) -> tuple[Array, Array]:
    """Return the linear and the angular part of a joint's axis, in its own frame."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq), np.ones(model.nv))
    axis = np.asarray(data.S).ravel()
    return axis[:3], axis[3:]
