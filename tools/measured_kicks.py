"""Make the C3D files of `notebooks/measured_kick.ipynb`: two kicks of a subject, as if measured.

    python tools/measured_kicks.py

A woman of 1.65 m and 58 kg kicks a ball of 0.9 bar with the instep and with the toe, after a run-up
of 4 m/s. Her segments are 2 % longer than the regressions say. Fourteen markers at 500 Hz have 1 mm
of noise in each coordinate, two of them are hidden for some frames, and `ball` is the centre of the
ball. The kicks are computed: the joint velocities before the impact are given, those after it
follow from `kd.strike`. Printed is the truth, which `data/README.md` has.
"""

from pathlib import Path

import ezc3d
import numpy as np
import pinocchio as pin

import kickdyn as kd

DATA = Path(__file__).resolve().parent.parent / "data"
SUBJECT = {"height": 1.65, "mass": 58.0, "sex": "female", "model": "3d", "base": "floating"}
LONGER = 1.02
MARKERS = {
    "RASI": ("base", (0.09, -0.04, 0.08)),
    "LASI": ("base", (0.09, 0.19, 0.08)),
    "RPSI": ("base", (-0.10, 0.03, 0.09)),
    "LPSI": ("base", (-0.10, 0.12, 0.09)),
    "RTHF": ("thigh", (0.08, 0.0, -0.13)),
    "RTHI": ("thigh", (0.02, -0.07, -0.20)),
    "RKNE": ("thigh", (0.0, -0.05, -0.35)),
    "RTUB": ("shank", (0.05, 0.0, -0.06)),
    "RTIB": ("shank", (0.02, -0.05, -0.22)),
    "RANK": ("shank", (0.0, -0.04, -0.41)),
    "RHEE": ("foot", (-0.05, 0.0, 0.0)),
    "RTOE": ("foot", (0.10, 0.01, 0.03)),
    "RMT5": ("foot", (0.08, -0.05, 0.0)),
}
RATE, NOISE = 500.0, 1e-3
CONTACT, DURATION = 0.2007, 0.3
"""Beginning of the contact and duration of the record [s]."""

BALL = kd.Ball(pressure=90e3)
CONTACT_TIME = 0.009
"""Time in which the ball gains its velocity, linearly [s]."""

KICKS = {
    "instep": {
        "angles": {"hip": 20, "knee": 35, "ankle": 40, "hip_rotation": -5, "subtalar": 5},
        "speeds": {"hip": 5.5, "hip_adduction": 1.0, "hip_rotation": 2.0, "knee": -18, "ankle": 1},
        "normal": (1.0, 0.0, 0.2),  # axes of the world
    },
    "toe": {
        "angles": {"hip": 25, "knee": 32, "ankle": 5, "hip_rotation": -3, "subtalar": 3},
        "speeds": {
            "hip": 5.0,
            "hip_adduction": 0.5,
            "hip_rotation": 1.0,
            "knee": -16,
            "ankle": 0.5,
        },
        "normal": (1.0, 0.05, 0.35),
    },
}


def subject(surface):
    """Return the leg of the subject, and its markers."""
    longer = SUBJECT | {"height": LONGER * SUBJECT["height"]}
    places = {name: (link, LONGER * np.array(p)) for name, (link, p) in MARKERS.items()}
    return kd.Leg.human(**longer, frame=surface), places


def impact(surface):
    """Return the true impact of a kick; the ball rests on the ground."""
    leg, _ = subject(surface)
    kick = KICKS[surface]
    q = leg.configuration({name: np.radians(a) for name, a in kick["angles"].items()})
    contact = kd.Contact(kick["normal"], "inflated", 0.4)
    centre = leg.posture(q).contact_point + BALL.radius * contact.normal
    q[:3] -= centre - (0.0, 0.0, BALL.radius)
    v = np.zeros(leg.nv)
    v[:6] = 3.2, 0.2, 0.1, 0.2, 0.5, 1.5
    for name, speed in kick["speeds"].items():
        v[leg.velocity_index(name)] = speed
    return kd.strike(leg.posture(q), v, BALL, contact)


def configuration(hit, t):
    """Return the configuration at a time from the contact: speeds rise until it, and fall after."""
    model, rise = hit.posture.leg.model, 0.06
    if t >= 0.0:
        fall = np.full(model.nv, rise)
        fall[-2:] = 0.004  # ligaments stop ankle and subtalar joint
        return pin.integrate(model, hit.posture.q, hit.v_after * fall * (1.0 - np.exp(-t / fall)))
    step = hit.v_before * rise * np.tanh(t / rise)
    step[0] = 4.0 * t + (hit.v_before[0] - 4.0) * rise * np.tanh(t / rise)  # run-up
    step[1:6] = hit.v_before[1:6] * t
    return pin.integrate(model, hit.posture.q, step)


def record(surface, rng):
    """Return positions of markers and ball, shape `(frames, markers, 3)` [m]."""
    hit, (_, places) = impact(surface), subject(surface)
    model, flight = hit.posture.leg.model, kd.fly(hit.ball_after, BALL)
    data, frames = model.createData(), []
    for t in np.arange(0.0, DURATION, 1.0 / RATE) - CONTACT:
        pin.framesForwardKinematics(model, data, configuration(hit, t))
        markers = [data.oMf[model.getFrameId(link)].act(point) for link, point in places.values()]
        ball = hit.ball_before.position
        if t > CONTACT_TIME:
            ball = flight.sample(t - 0.5 * CONTACT_TIME).position
        elif t > 0.0:
            ball = ball + hit.ball_after.velocity * t**2 / (2.0 * CONTACT_TIME)
        frames.append([*markers, ball])
    positions = np.array(frames)
    positions += NOISE * rng.normal(size=positions.shape)
    positions[40:52, list(places).index("LPSI")] = np.nan
    positions[70:76, list(places).index("RTHI")] = np.nan
    return positions


def write(path, positions):
    """Write a C3D file in millimetres; hidden markers have a negative residual."""
    file, labels = ezc3d.c3d(), [*MARKERS, "ball"]
    points = file["parameters"]["POINT"]
    points["RATE"]["value"], points["UNITS"]["value"] = [RATE], ["mm"]
    points["LABELS"]["value"] = labels
    content = np.ones((4, len(labels), len(positions)))
    content[:3] = 1e3 * positions.transpose(2, 1, 0)
    file["data"]["points"] = content
    file.write(str(path))


def main():
    """Write the files and print the truth."""
    for number, surface in enumerate(KICKS):
        write(DATA / f"kick_{surface}.c3d", record(surface, np.random.default_rng(number)))
        hit = impact(surface)
        print(surface)
        print(
            f"  foot {hit.foot_velocity.round(2)} m/s, ball {hit.ball_after.velocity.round(2)} m/s"
        )
        print(f"  restitution {hit.restitution:.3f}, effective mass {hit.effective_mass:.3f} kg")
        for name, force in zip(hit.posture.leg.joint_names, hit.joint_impulses, strict=True):
            print(f"  impulse in {name} {np.linalg.norm(force[:3]):.3f} N s")
        if hit.warnings:
            print("  ", *hit.warnings)


if __name__ == "__main__":
    main()
