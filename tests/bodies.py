"""The bodies of a leg in an impact, each by Newton and Euler."""

import numpy as np
import pinocchio as pin
from tolerances import agrees, closed_form


def external_impulses(impact):
    """Impulse from outside on each body, about the world's origin: ball, ground and loops."""
    posture = impact.posture
    leg, model = posture.leg, posture.leg.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, posture.q)
    total = np.zeros((model.njoints, 6))

    def add(joint, point, linear, angular=(0.0, 0.0, 0.0)):
        total[joint] += np.concatenate([linear, np.cross(point, linear) + angular])

    add(leg.contact_joint, posture.contact_point, -impact.impulse)
    frames = {frame.name: k for k, frame in enumerate(model.frames)}
    for name, impulse in impact.support_impulses.items():
        k, angular = frames[name], impulse[3:] if len(impulse) == 6 else np.zeros(3)
        add(model.frames[k].parentJoint, data.oMf[k].translation, impulse[:3], angular)
    for names, impulse in impact.loop_impulses.items():
        for name, sign in zip(names, (-1.0, 1.0), strict=True):
            k = frames[name]
            add(model.frames[k].parentJoint, data.oMf[k].translation, sign * impulse)
    return total


def check_bodies(impact):
    """The momentum of each body changes by what its joints and the outside give it."""
    model = impact.posture.leg.model
    data, jump = model.createData(), impact.v_after - impact.v_before
    pin.forwardKinematics(model, data, impact.posture.q, jump)
    net = external_impulses(impact)
    gained = np.zeros_like(net)
    for i in range(1, model.njoints):
        transmitted = data.oMi[i].act(pin.Force(impact.joint_impulses[i - 1])).vector
        net[i] += transmitted
        net[model.parents[i]] -= transmitted
        gained[i] = data.oMi[i].act(model.inertias[i] * data.v[i]).vector
    agrees(net[1:], gained[1:], closed_form(100) * (1 + np.abs(net).max() / np.abs(gained).max()))
    assert impact.momentum_residual <= closed_form(10)
