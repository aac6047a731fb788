"""A humanoid passes a ball along the ground to a team mate: `pip install "kickdyn[robots]"`."""

import numpy as np

import kickdyn as kd

leg = kd.Leg.from_robot("g1", legs_only=True)
ball, air = kd.Ball(mass=0.2, radius=0.07), kd.Air()

# The ball is to be 3 m ahead and 0.5 m to the left after 2 s; it slides and rolls over carpet.
goal = kd.Goal((3, 0.5, 0), time=2)
plan = kd.plan_kick(leg, goal, ball, air, surface="carpet")
print(plan)
print(plan.path)

print(f"{plan.speed_use:.0%} of the speed limits, {plan.torque_use:.0%} of the torque limits")
for name, q, v in zip(plan.leg.joint_names, plan.q, plan.v, strict=True):
    if abs(v) > 1e-3:
        print(f"{name:26} {np.degrees(q):6.1f} deg {v:6.2f} rad/s")

kd.page(plan, caption="a pass over carpet").save("robot_pass.html")
