"""How uncertain is the launch if posture, speed and contact are measured with errors?"""

import numpy as np

import kickdyn as kd

leg, ball = kd.Leg.human(), kd.Ball()
posture = leg.posture(np.radians([10, 20, 5]))
direction = np.array([np.cos(0.4), 0, np.sin(0.4)])
contact = kd.Contact(direction, restitution=0.8, friction=0.4)
impact = kd.strike(posture, posture.joint_velocity(10 * direction), ball, contact)

# Standard deviations: of angles [rad], joint velocities [rad/s], restitution, normal [rad].
errors = {"q": np.radians(2), "v": 0.3, "restitution": 0.03, "normal": np.radians(3)}
result = impact.uncertainty(**errors)
print(result)

# For comparison, a thousand strikes with random errors of the velocity and the restitution.
random = np.random.default_rng(0)
speeds = []
for _ in range(1000):
    v = impact.v_before + random.normal(0, errors["v"], leg.nv)
    e = 0.8 + random.normal(0, errors["restitution"])
    other = kd.Contact(direction, restitution=min(e, 1.0), friction=0.4)
    speeds.append(kd.strike(posture, v, ball, other).ball_after.velocity)
partial = impact.uncertainty(v=errors["v"], restitution=errors["restitution"])
deviation = np.sqrt(np.diag(partial.velocity))
print(f"ball velocity, first order:    {deviation.round(3)} m/s")
print(f"ball velocity, 1000 strikes:   {np.std(speeds, axis=0).round(3)} m/s")
