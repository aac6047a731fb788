"""A kick of a leg with a run-up, and the track of its markers."""

import functools

import numpy as np
import pinocchio as pin

import kickdyn as kd

LEG = kd.Leg.human(height=1.65, mass=58, sex="female", model="3d", base="floating")
CLUSTERS = {
    "base": [(0.1, 0.05, 0.08), (0.1, 0.2, 0.08), (-0.1, 0.1, 0.1)],
    "thigh": [(0.07, -0.05, -0.1), (0.06, 0.05, -0.2), (0.02, -0.06, -0.3)],
    "shank": [(0.05, 0.03, -0.1), (0.04, -0.04, -0.25), (-0.03, -0.05, -0.35)],
    "foot": [(0.1, 0.03, 0.02), (0.12, -0.03, 0.02), (-0.04, 0.0, 0.02)],
}
PLACES = {f"{link}{i}": (link, p) for link, ps in CLUSTERS.items() for i, p in enumerate(ps)}
HIP, KNEE, ANKLE = (LEG.velocity_index(name) for name in ("hip", "knee", "ankle"))


def state(t):
    """Configuration of a kick with a run-up, the contact at 0: the knee extends at 17 rad/s."""
    x = np.zeros(12)
    x[:3] = 4.0 * t, 0.1 * t, 1.0 + 0.05 * np.cos(6 * t)
    x[3:6] = 0.1 * np.sin(5 * t), -0.2 * np.sin(4 * t + 0.5), 0.3 * np.sin(6 * t)
    x[6:9] = 0.7 * np.tanh((t + 0.06) / 0.09) + 0.3, 0.1 * np.sin(7 * t) - 0.1, 0.1 * np.cos(8 * t)
    x[9:] = 1.15 - np.tanh(t / 0.06), 0.5 + 0.1 * np.sin(9 * t), 0.05 * np.sin(8 * t)
    return pin.integrate(LEG.model, LEG.configuration(), x)


def velocity(t, h=1e-5):
    return pin.difference(LEG.model, state(t - h), state(t + h)) / (2 * h)


@functools.cache
def clean(rate, until=0.0):
    times = np.arange(-0.2, until, 1 / rate)
    model, data = LEG.model, LEG.model.createData()
    positions = np.zeros((len(times), len(PLACES), 3))
    for k, t in enumerate(times):
        pin.framesForwardKinematics(model, data, state(t))
        for m, (link, point) in enumerate(PLACES.values()):
            positions[k, m] = data.oMf[model.getFrameId(link)].act(np.array(point))
    return times, positions


def track(rate=500, noise=0.0, seed=1, until=0.0):
    times, positions = clean(rate, until)
    rng = np.random.default_rng(seed)
    return kd.BodyTrack(times, list(PLACES), positions + noise * rng.normal(size=positions.shape))
