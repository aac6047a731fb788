"""Which posture kicks best? Every combination of hip, knee and ankle angles strikes the ball."""

import numpy as np

import kickdyn as kd

leg = kd.Leg.human()
postures = {
    "hip": np.radians(np.arange(-10, 31, 10)),
    "knee": np.radians(np.arange(5, 46, 10)),
    "ankle": np.radians([0, 20]),
}
table = kd.sweep(leg, postures, kd.Kick(speed=15, attack=np.radians(20)))

# The table is an xarray.Dataset. speed_use is the largest joint speed over its limit.
possible = table.where(table.speed_use <= 1)
best = possible.isel(possible.ball_speed.argmax(...))
number = int(possible.ball_speed.notnull().sum())
print(f"{number} of {table.ball_speed.size} postures are within the speed limits")
print("best:", ", ".join(f"{name} {np.degrees(float(best[name])):.0f} deg" for name in postures))
print(f"ball {float(best.ball_speed):.2f} m/s, carry {float(best.carry):.1f} m")
print(f"largest impulse in a joint {float(best.worst_joint_impulse):.2f} N s")

table.to_netcdf("posture_sweep.nc", engine="h5netcdf")
