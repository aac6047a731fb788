"""A kick from every posture of a grid: the best posture, the best for gentle joints, the front."""

import numpy as np

import kickdyn as kd
from kickdyn.sweeps.queries import pareto_front, possible

leg = kd.Leg.human()
postures = {
    "hip": np.radians(np.arange(-10, 41, 5)),
    "knee": np.radians(np.arange(0, 61, 5)),
    "ankle": np.radians(np.arange(-20, 51, 10)),
}
data = kd.sweep(leg, postures, kd.Kick(speed=7.0))
print(data)

speed = data.ball_speed.where(possible(data))  # nan where a joint would be too fast
gentle = speed.where(data.worst_joint_impulse < 2.2)
for name, values in (("best", speed), ("gentle", gentle)):
    row = data.isel(values.argmax(...))
    angles = ", ".join(f"{joint} {float(row[f'{joint}_deg']):.0f} deg" for joint in postures)
    print(f"{name}: {angles}: {row.ball_speed:.2f} m/s, {row.worst_joint_impulse:.2f} N s")

front = pareto_front(data, more="ball_speed", less="worst_joint_impulse")
print(f"{front.sizes['posture']} postures are on the front of ball speed and joint impulse.")
