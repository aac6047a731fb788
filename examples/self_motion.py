"""Of all postures with the same contact point, which kicks hardest (Fig. 1 of the paper)?"""

import numpy as np

import kickdyn as kd
from kickdyn.paper.fig_1 import self_motion

leg, ball = kd.Leg.human(), kd.Ball()
attack = np.array([np.cos(np.pi / 6), 0, np.sin(np.pi / 6)])  # 30 deg above the horizontal
contact = kd.Contact(attack, restitution=0.8)

impacts = []
for posture in self_motion(leg, np.radians([25, 40, 10])):  # hip, knee, ankle
    v = posture.joint_velocity(attack)  # the foot at 1 m/s in all of them
    impacts.append(kd.strike(posture, v, ball, contact))

sizes = [np.linalg.norm(impact.impulse) for impact in impacts]
for name, index in (("least", np.argmin(sizes)), ("most", np.argmax(sizes))):
    hip, knee, ankle = np.degrees(impacts[index].posture.q)
    print(
        f"{name}: {sizes[index]:.4f} N s at hip {hip:.1f}, knee {knee:.1f}, ankle {ankle:.1f} deg"
    )
