"""A kick in MuJoCo: a contact of finite stiffness, integrated in time, where it is installed."""

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.impact_result import Impact


def mujoco_kick(impact: Impact, stiffness: float, dt: float) -> Callable[[], Array]:
    """Return a function that runs a kick in MuJoCo and gives the impulse on the ball [N s].

    The stiffness of the contact along the normal is in N/m, the time step in s.
    """
    n, e = impact.contact.normal, impact.restitution
    inverse_mass = float(n @ impact.posture.delassus() @ n) + 1.0 / impact.ball.mass
    rate = stiffness * inverse_mass  # MuJoCo's stiffness is per unit of mass
    damping = 2.0 * damping_ratio(e) * math.sqrt(rate)
    model = mujoco.MjModel.from_xml_string(scene(impact, rate, damping, dt))
    data, n_joints = mujoco.MjData(model), len(impact.v_before)

    def run() -> Array:
        """Return the impulse on the ball of one simulated kick, shape `(3,)` [N s]."""
        mujoco.mj_resetData(model, data)
        data.qpos[:n_joints], data.qvel[:n_joints] = impact.posture.q, impact.v_before
        mujoco.mj_forward(model, data)
        for step in range(round(1.0 / dt)):
            mujoco.mj_step(model, data)
            if step > 2 and data.ncon == 0:
                return np.array(impact.ball.mass * data.qvel[n_joints : n_joints + 3])
        raise KickdynError("leg and ball did not part within a second")

    return run


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio, 0 to 0.9, of a linear contact that does not pull, by e."""

    def returned(ratio: float) -> float:
        """Return the restitution of a damped spring with this damping ratio."""
        swing = math.sqrt(1.0 - ratio * ratio)
        phase = math.atan2(2.0 * ratio * swing, 2.0 * ratio * ratio - 1.0)  # where the force ends
        return math.exp(-ratio / swing * phase)

    if restitution == 1.0:
        return 0.0
    return float(brentq(lambda ratio: returned(ratio) - restitution, 1e-9, 0.9))


def scene(impact: Impact, rate: float, damping: float, dt: float) -> str:
    """Return an MJCF model of the leg, with a flat face at its toe, and the ball before it."""
    model, contact, ball = impact.posture.leg.model, impact.contact, impact.ball
    data = model.createData()
    zero = pin.neutral(model)
    bodies = ends = ""
    for i in range(1, model.njoints):
        placement, inertia = model.jointPlacements[i], model.inertias[i]
        axis = pin.computeJointJacobian(model, data, zero, i)[3:, model.joints[i].idx_v]
        moments = inertia.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        bodies += (
            f'<body pos="{row(placement.translation)}" quat="{quaternion(placement.rotation)}">'
            f'<inertial pos="{row(inertia.lever)}" mass="{inertia.mass!r}" '
            f'fullinertia="{row(moments)}"/><joint type="hinge" axis="{row(axis)}"/>'
        )
        ends += "</body>"
    normal = impact.posture.rotation_world_joint.T @ contact.normal
    face = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
    bodies += f'<geom type="box" size="1 1 0.1" quat="{quaternion(face)}" '
    bodies += f'pos="{row(impact.posture.contact_lever - 0.1 * normal)}"/>'
    d = 0.9999  # MuJoCo's largest impedance
    friction = 'condim="1"'
    if contact.friction:
        friction = f'condim="3" friction="{contact.friction} 0 0"'
    return f"""<mujoco>
  <option gravity="0 0 0" timestep="{dt!r}" cone="elliptic" impratio="100" tolerance="1e-14"/>
  <default><geom {friction} solref="{-rate!r} {-damping!r}" solimp="{d} {d} 1 0.5 1"/></default>
  <worldbody>{bodies}{ends}
    <body pos="{row(impact.ball_after.position)}"><freejoint/>
      <inertial pos="0 0 0" mass="{ball.mass!r}" diaginertia="{row([ball.inertia] * 3)}"/>
      <geom type="sphere" size="{ball.radius!r}"/>
    </body>
  </worldbody>
</mujoco>"""


def row(values: Any) -> str:
    """Return numbers as the text of an MJCF attribute, with all their digits."""
    return " ".join(repr(float(value)) for value in values)


def quaternion(rotation: Array) -> str:
    """Return a rotation matrix as the quaternion of an MJCF attribute, the real part first."""
    q = pin.Quaternion(rotation)
    return row([q.w, q.x, q.y, q.z])
