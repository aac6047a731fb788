"""Kick with MuJoCo, the contact made stiffer and stiffer: it approaches the instant of `strike`.

    python benchmarks/mujoco_witness.py

The human leg without gravity, the ball at rest. MuJoCo integrates leg and ball through a contact of
finite stiffness; what the ball has gained when it is free is compared with the impulse of the law
`stronge`, as the length of the difference over that impulse. Differences shrink with the contact
time, thus with the root of the stiffness, for the leg turns meanwhile.

MuJoCo's friction is a convex relaxation, which parts bodies that slide: its limit is not Coulomb's.
The kicks with friction therefore start without sliding: the leg's inertia couples the directions,
and friction holds. The last row shows what sliding does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import kickdyn as kd
from kickdyn.accuracy.mujoco_kick import simulated

LEG, BALL = kd.Leg.human(), kd.Ball()
STIFFNESSES = (1e5, 1e6, 1e7)  # N/m
STEPS = (1e-5, 1e-6)  # s


class Kick(NamedTuple):
    """A kick of the human leg.

    Attributes:
        name: for the table.
        angles: of hip, knee and ankle [deg].
        foot: velocity of the toe [m/s].
        normal: of the contact, any length.
        restitution, friction: coefficients.
    """

    name: str
    angles: tuple[float, float, float]
    foot: tuple[float, float, float]
    normal: tuple[float, float, float]
    restitution: float
    friction: float


KICKS = (
    Kick("frictionless, central, e = 0.8", (5, 10, -5), (8, 0, 4), (8, 0, 4), 0.8, 0.0),
    Kick("frictionless, off centre, e = 0.8", (5, 10, -5), (8, 0, 4), (8, 0, 0), 0.8, 0.0),
    Kick("friction 0.4, e = 1", (5, 10, -5), (8, 0, 4), (8, 0, 4), 1.0, 0.4),
    Kick("friction 0.4, e = 0.8", (5, 10, -5), (8, 0, 4), (8, 0, 4), 0.8, 0.4),
)
SLIDING = Kick("friction 0.05, sliding, e = 0.8", (5, 10, -5), (8, 0, 4), (8, 0, 0), 0.8, 0.05)


def ours(kick: Kick) -> kd.Impact:
    """Return the instant impact."""
    posture = LEG.posture(np.radians(kick.angles))
    touch = kd.Contact(kick.normal, kick.restitution, kick.friction)
    return kd.strike_at(posture, posture.joint_velocity(kick.foot), BALL, touch, "stronge")


def difference(kick: Kick, stiffness: float, dt: float) -> float:
    """Return how far MuJoCo's impulse is from ours, relative to ours."""
    hit = ours(kick)
    gap = simulated(hit, stiffness, dt) - hit.impulse
    return float(np.linalg.norm(gap) / np.linalg.norm(hit.impulse))


def main() -> None:
    """Print the table."""
    columns = [(dt, stiffness) for dt in STEPS for stiffness in STIFFNESSES]
    print("| kick | " + " | ".join(f"{k:.0e} N/m, {dt:.0e} s" for dt, k in columns) + " |")
    print("|---" * (1 + len(columns)) + "|")
    for kick in (*KICKS, SLIDING):
        cells = [f"{100 * difference(kick, stiffness, dt):.2f} %" for dt, stiffness in columns]
        print(f"| {kick.name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
