"""G1 kicks a ball in MuJoCo as computed by kickdyn: `pip install "kickdyn[robots,mjcf]"`."""

from pathlib import Path

import mujoco
import numpy as np

import kickdyn as kd

leg = kd.Leg.from_robot("g1", legs_only=True)
posture = leg.posture(leg.configuration({"right_hip_pitch_joint": -0.3, "right_knee_joint": 0.4}))
v = posture.joint_velocity((3, 0, 0.5))  # of the foot [m/s]
ball, contact = kd.Ball(mass=0.2, radius=0.07), kd.Contact((1, 0, 0.2), 0.75)

tuning = kd.tune_mujoco(posture, v, ball, contact, timestep=0.002, contact_time=0.01)
print(tuning)
folder = Path("build")
folder.mkdir(exist_ok=True)
(folder / "ball.xml").write_text(tuning.mjcf())  # for an <include> in your own model


def kick(model: mujoco.MjModel) -> np.ndarray:
    """Return the velocity of the ball once it has left the foot."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)  # just before they touch
    mujoco.mj_step(model, data, 2)
    while data.ncon:
        mujoco.mj_step(model, data)
    return data.qvel[-6:-3]


model = mujoco.MjModel.from_xml_string(tuning.scene)
collision = kd.collide(posture, v, ball, contact, contact_time=0.01)
print("kickdyn ", collision.ball_after.velocity, "m/s")
print("tuned   ", kick(model), "m/s")
model.pair_solref[0], model.pair_solimp[0] = (0.02, 1), (0.9, 0.95, 0.001, 0.5, 2)
print("defaults", kick(model), "m/s")
kd.page(kd.strike(posture, v, ball, contact)).save(folder / "mujoco_kick.html")
