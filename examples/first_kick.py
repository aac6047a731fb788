"""A human leg strikes a ball: what the impact does, and where the ball goes."""

import numpy as np

import kickdyn as kd

leg, ball = kd.Leg.human(), kd.Ball()
posture = leg.posture(np.radians([5, 10, -5]))  # hip, knee, ankle

# The foot moves at 7 m/s, 30 degrees above the horizontal, and meets the ball in this direction.
direction = np.array([np.cos(np.pi / 6), 0, np.sin(np.pi / 6)])
contact = kd.Contact(direction, restitution=0.8, friction=0.4)
impact = kd.strike(posture, posture.joint_velocity(7 * direction), ball, contact)
flight = kd.fly(impact.ball_after, ball, air=kd.Air())

print(impact)
print(flight)
for name, joint in zip(leg.joint_names, impact.joint_impulses, strict=True):
    print(f"{name}: {np.linalg.norm(joint[:3]):.2f} N s, {np.linalg.norm(joint[3:]):.2f} N m s")

kd.page(impact, flight).save("first_kick.html")
