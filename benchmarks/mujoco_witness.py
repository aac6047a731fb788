"""Kick with MuJoCo, the contact made stiffer and stiffer: it approaches the instant of `strike`.

    python benchmarks/mujoco_witness.py

The human leg without gravity, the ball at rest. MuJoCo integrates leg and ball through a contact of
finite stiffness; what the ball has gained when it is free is compared with the impulse of the law
`stronge`, as the length of the difference over that impulse. Differences shrink with the contact
time, thus with the root of the stiffness, for the leg turns meanwhile.

MuJoCo's friction is a convex relaxation, which parts bodies that slide: its limit is not Coulomb's.
The kicks with friction therefore start without sliding: the leg's inertia couples the directions,
and friction holds. The last row shows what sliding does.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
from scipy.optimize import brentq

import kickdyn as kd
from kickdyn.checks import Array

LEG, BALL = kd.Leg.human(), kd.Ball()
STIFFNESSES = (1e5, 1e6, 1e7)  # N/m
STEPS = (1e-5, 1e-6)  # s
STIFFEST_CONSTRAINT = 0.9999  # MuJoCo's largest impedance


class Kick(NamedTuple):
    """A kick of the human leg.

    Attributes:
        name: for the table.
        angles: of hip, knee and ankle [deg].
        foot: velocity of the toe [m/s].
        normal: of the contact, any length.
        restitution, friction: coefficients.
    """

    name: str
    angles: tuple[float, float, float]
    foot: tuple[float, float, float]
    normal: tuple[float, float, float]
    restitution: float
    friction: float


KICKS = (
    Kick("frictionless, central, e = 0.8", (5, 10, -5), (8, 0, 4), (8, 0, 4), 0.8, 0.0),
    Kick("frictionless, off centre, e = 0.8", (5, 10, -5), (8, 0, 4), (8, 0, 0), 0.8, 0.0),
    Kick("friction 0.4, e = 1", (5, 10, -5), (8, 0, 4), (8, 0, 4), 1.0, 0.4),
    Kick("friction 0.4, e = 0.8", (5, 10, -5), (8, 0, 4), (8, 0, 4), 0.8, 0.4),
)
SLIDING = Kick("friction 0.05, sliding, e = 0.8", (5, 10, -5), (8, 0, 4), (8, 0, 0), 0.8, 0.05)


def ours(kick: Kick) -> kd.Impact:
    """Return the instant impact."""
    posture = LEG.posture(np.radians(kick.angles))
    touch = kd.Contact(kick.normal, kick.restitution, kick.friction)
    return kd.strike_at(posture, posture.joint_velocity(kick.foot), BALL, touch, "stronge")


def simulated(hit: kd.Impact, stiffness: float, dt: float) -> Array:
    """Return the impulse on the ball by MuJoCo [N s].

    Args:
        hit: posture, velocities and contact are taken from it.
        stiffness: of the contact along the normal [N/m].
        dt: time step [s].
    """
    n, e = hit.touch.normal, hit.touch.restitution
    give = float(n @ hit.posture.delassus() @ n) + 1.0 / BALL.mass
    rate = stiffness * give  # MuJoCo's stiffness is per unit of mass
    damping = 2.0 * damping_ratio(e) * math.sqrt(rate)
    model = mujoco.MjModel.from_xml_string(scene(hit, rate, damping, dt))
    data = mujoco.MjData(model)
    data.qpos[:3], data.qvel[:3] = hit.posture.q, hit.v_before
    mujoco.mj_forward(model, data)
    for step in range(round(1.0 / dt)):
        mujoco.mj_step(model, data)
        if step > 2 and data.ncon == 0:
            return np.array(BALL.mass * data.qvel[3:6])
    raise RuntimeError("leg and ball did not part within a second")


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio of a linear contact that never pulls, for a restitution."""

    def returned(ratio: float) -> float:
        swing = math.sqrt(1.0 - ratio * ratio)
        phase = math.atan2(2.0 * ratio * swing, 2.0 * ratio * ratio - 1.0)  # where the force ends
        return math.exp(-ratio / swing * phase)

    return 0.0 if restitution == 1.0 else brentq(lambda r: returned(r) - restitution, 1e-9, 0.9)


def scene(hit: kd.Impact, rate: float, damping: float, dt: float) -> str:
    """Return the leg, with a flat face at its toe, and the ball before it, as MJCF."""
    model, touch = LEG.model, hit.touch
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
    normal = hit.posture.joint_rotation.T @ touch.normal
    face = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
    bodies += f'<geom type="box" size="1 1 0.1" quat="{quaternion(face)}" '
    bodies += f'pos="{row(LEG.contact_lever - 0.1 * normal)}"/>'
    d = STIFFEST_CONSTRAINT
    friction = (
        'condim="1"' if touch.friction == 0 else f'condim="3" friction="{touch.friction} 0 0"'
    )
    return f"""<mujoco>
  <option gravity="0 0 0" timestep="{dt!r}" cone="elliptic" impratio="100" tolerance="1e-14"/>
  <default><geom {friction} solref="{-rate!r} {-damping!r}" solimp="{d} {d} 1 0.5 1"/></default>
  <worldbody>{bodies}{ends}
    <body pos="{row(hit.ball.position)}"><freejoint/>
      <inertial pos="0 0 0" mass="{BALL.mass!r}" diaginertia="{row([BALL.inertia] * 3)}"/>
      <geom type="sphere" size="{BALL.radius!r}"/>
    </body>
  </worldbody>
</mujoco>"""


def row(values: Any) -> str:
    """Return numbers as MJCF takes them, every digit kept."""
    return " ".join(repr(float(value)) for value in values)


def quaternion(rotation: Array) -> str:
    """Return a rotation as MJCF takes it, the real part first."""
    q = pin.Quaternion(rotation)
    return row([q.w, q.x, q.y, q.z])


def difference(kick: Kick, stiffness: float, dt: float) -> float:
    """Return how far MuJoCo's impulse is from ours, relative to ours."""
    hit = ours(kick)
    gap = simulated(hit, stiffness, dt) - hit.impulse
    return float(np.linalg.norm(gap) / np.linalg.norm(hit.impulse))


def main() -> None:
    """Print the table."""
    columns = [(dt, stiffness) for dt in STEPS for stiffness in STIFFNESSES]
    print("| kick | " + " | ".join(f"{k:.0e} N/m, {dt:.0e} s" for dt, k in columns) + " |")
    print("|---" * (1 + len(columns)) + "|")
    for kick in (*KICKS, SLIDING):
        cells = [f"{100 * difference(kick, stiffness, dt):.2f} %" for dt, stiffness in columns]
        print(f"| {kick.name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
