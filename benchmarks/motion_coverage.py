"""How often the deviations of a fitted motion cover the truth, over many synthetic subjects.

    python benchmarks/motion_coverage.py [SUBJECTS] [RATE]

Each subject kicks with a run-up of 4 m/s: the hip flexes at 5 rad/s and the knee extends at 17
rad/s at the contact, with amplitudes and phases of its own. The angle of the knee is a hyperbolic
tangent of time for even numbers of the subject, an error function for odd ones. Three markers
each on pelvis, thigh, shank and foot have 1 mm of noise. Printed are the share of true values
within 1.96 deviations of the estimate, over all joints and for the knee, and root mean square
errors at the contact, of velocities relative to the true ones.
"""

import sys

import numpy as np
import pinocchio as pin
from scipy import special

import kickdyn as kd

LEG = kd.Leg.human(height=1.65, mass=58, sex="female", model="3d", base="floating")
CLUSTERS = {
    "base": [(0.1, 0.05, 0.08), (0.1, 0.2, 0.08), (-0.1, 0.1, 0.1)],
    "thigh": [(0.07, -0.05, -0.1), (0.06, 0.05, -0.2), (0.02, -0.06, -0.3)],
    "shank": [(0.05, 0.03, -0.1), (0.04, -0.04, -0.25), (-0.03, -0.05, -0.35)],
    "foot": [(0.1, 0.03, 0.02), (0.12, -0.03, 0.02), (-0.04, 0.0, 0.02)],
}
PLACES = {f"{link}{i}": (link, p) for link, ps in CLUSTERS.items() for i, p in enumerate(ps)}
NOISE = 1e-3
"""Standard deviation of each coordinate of a marker [m]."""


def subject(seed, rate):
    """Return the track of a subject's markers, and its configuration over time."""
    rng = np.random.default_rng(seed)
    size, shift = rng.uniform(0.9, 1.1, 12), rng.normal(0.0, 0.01, 12)
    turned = special.erf if seed % 2 else np.tanh

    def state(t):
        x = np.zeros(12)
        x[:3] = 4.0 * t * size[0], 0.1 * t, 1.0 + 0.05 * np.cos(6 * t)
        x[3:6] = 0.1 * np.sin(5 * t), -0.2 * np.sin(4 * t + 0.5), 0.3 * size[5] * np.sin(6 * t)
        x[6] = 0.3 + 0.7 * size[6] * np.tanh((t + 0.06 - shift[6]) / 0.09)
        x[7:9] = 0.1 * np.sin(7 * t) - 0.1, 0.1 * np.cos(8 * t)
        x[9] = 1.15 - size[9] * turned((t - shift[9]) / 0.06)
        x[10:] = 0.5 + 0.1 * np.sin(9 * t), 0.05 * np.sin(8 * t)
        return pin.integrate(LEG.model, LEG.configuration(), x)

    times = np.arange(-0.2, 0.0, 1.0 / rate)
    model, data = LEG.model, LEG.model.createData()
    positions = np.zeros((len(times), len(PLACES), 3))
    for k, t in enumerate(times):
        pin.framesForwardKinematics(model, data, state(t))
        for m, (link, point) in enumerate(PLACES.values()):
            positions[k, m] = data.oMf[model.getFrameId(link)].act(np.array(point))
    positions += NOISE * rng.normal(size=positions.shape)
    return kd.BodyTrack(times, list(PLACES), positions), state


def main(subjects=200, rate=500):
    """Print coverage and errors."""
    knee, scores, errors = LEG.velocity_index("knee"), [], []
    for seed in range(subjects):
        track, state = subject(seed, rate)
        at = kd.fit_motion(track, LEG, PLACES).at_contact(0.0)
        h, model = 1e-5, LEG.model
        v = pin.difference(model, state(-h), state(h)) / (2 * h)
        q_error, v_error = pin.difference(model, state(0.0), at.posture.q), at.v - v
        scores.append([q_error / at.q_deviations, v_error / at.v_deviations])
        foot = LEG.posture(state(0.0)).point_velocity(v)
        missed = np.linalg.norm(at.foot_velocity - foot) / np.linalg.norm(foot)
        errors.append([missed, v_error[knee] / v[knee], *np.degrees(q_error[6:])])
    covered = np.abs(scores) < 1.96
    print(f"{subjects} subjects at {rate} Hz")
    for name, of_all in zip(("q", "v"), covered.transpose(1, 0, 2), strict=True):
        print(f"{name} covered: {of_all.mean():.1%}, of the knee {of_all[:, knee].mean():.1%}")
    foot, speed, *angles = np.sqrt(np.mean(np.square(errors), axis=0))
    print(f"errors: foot velocity {foot:.1%}, knee velocity {speed:.1%}; angles [deg]:")
    print(", ".join(f"{n} {a:.2f}" for n, a in zip(LEG.single_joints, angles, strict=True)))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
