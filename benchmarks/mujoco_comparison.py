"""Compare MuJoCo with `strike` for contacts of increasing stiffness.

    python benchmarks/mujoco_comparison.py

The human leg without gravity, the ball at rest. MuJoCo integrates leg and ball through a contact of
finite stiffness; what the ball has gained when it is free is compared with the impulse of the law
`stronge`, as the length of the difference over that impulse. Differences shrink with the contact
time, thus with the root of the stiffness, for the leg turns meanwhile.

MuJoCo's friction is a convex relaxation: friction opposes what is missing from the tangential
acceleration that damping asks for, and parts bodies that slide, so that its limit is not Coulomb's.
Neither friction's own damping (solreffriction) nor impratio changes that. Kicks with friction that
holds from the start are not touched. For one that slides, `relaxed` is the limit of MuJoCo's own
law, and what MuJoCo approaches.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

import kickdyn as kd
from kickdyn.core.validation import Array
from kickdyn.impact.impact_result import Impact
from kickdyn.simulators.mujoco_kick import IMPEDANCE, MujocoContact, MujocoKick, damping_ratio

LEG, BALL = kd.Leg.human(), kd.Ball()
STIFFNESSES = (1e5, 1e6, 1e7)  # N/m
STEP = 1e-6  # s


def mujoco_kick(impact: Impact, stiffness: float, dt: float) -> Callable[[], Array]:
    """Return a function that runs a kick in MuJoCo and gives the impulse on the ball [N s].

    The stiffness of the contact along the normal is in N/m, the time step in s.
    """
    n, e = impact.contact.normal, impact.restitution
    inverse_mass = float(n @ impact.posture.delassus() @ n) + 1.0 / impact.ball.mass
    rate = stiffness * inverse_mass  # MuJoCo's stiffness is per unit of mass
    damping = 2.0 * damping_ratio(e) * math.sqrt(rate)
    solimp = (IMPEDANCE, IMPEDANCE, 1.0, 0.5, 1.0)
    contact = MujocoContact((-rate, -damping), solimp, impact.contact.friction)
    kick = MujocoKick(impact.approach, dt, contact)

    def run() -> Array:
        gained = kick.run().velocity - impact.ball_before.velocity
        return np.asarray(impact.ball.mass * gained)

    return run


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
    contact = kd.Contact(kick.normal, kick.restitution, kick.friction)
    return kd.strike(posture, posture.joint_velocity(kick.foot), BALL, contact, "stronge")


def relaxed(kick: Kick) -> np.ndarray:
    """Return the impulse of MuJoCo's law in the limit of a stiff contact and no time step.

    With u = (sliding, normal velocity) and r the gap, the force f minimises f G f / 2 - a f in the
    cone |f_t| <= mu f_n, where a = (-b u_t, -k r - b u_n) is the acceleration that spring and
    damper ask for (MuJoCo's documentation, Computation, the elliptic cone without regularization).
    Then u' = G f, r' = u_n from touch to r = 0: homogeneous, so k is 1 in units of its own time.
    Of contacts whose sliding stays in one plane.
    """
    hit = ours(kick)
    n, mass = hit.contact.normal, hit.ball.mass
    along = np.array([n[2], 0.0, -n[0]])
    assert n[1] == 0.0
    assert hit.foot_velocity[1] == 0.0
    axes = np.array([along, n])
    turning = hit.ball.radius**2 / hit.ball.inertia
    whole = hit.posture.delassus() + np.eye(3) / mass + turning * (np.eye(3) - np.outer(n, n))
    give = axes @ whole @ axes.T
    damping = 2.0 * damping_ratio(kick.restitution)
    edges = np.array([[kick.friction, 1.0], [-kick.friction, 1.0]])

    def force(gap: float, u: np.ndarray) -> np.ndarray:
        asked = np.array([-damping * u[0], -gap - damping * u[1]])
        inside = np.linalg.solve(give, asked)
        if abs(inside[0]) <= kick.friction * inside[1]:
            return inside
        sizes = [max(edge @ asked, 0.0) / (edge @ give @ edge) for edge in edges]
        gains = [size**2 * (edge @ give @ edge) for size, edge in zip(sizes, edges, strict=True)]
        best = int(np.argmax(gains))
        return sizes[best] * edges[best]

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        pushed = force(y[0], y[1:3])
        return np.concatenate([[y[2]], give @ pushed, pushed])

    def apart(_: float, y: np.ndarray) -> float:
        return float(y[0])

    apart.terminal, apart.direction = True, 1.0
    u = axes @ (hit.ball_before.velocity - hit.foot_velocity)
    start = np.array([1e-9 * u[1], *u, 0.0, 0.0])
    found = solve_ivp(rates, (0, 100), start, rtol=1e-9, atol=1e-11, events=apart, max_step=0.05)
    return axes.T @ found.y[3:, -1]


def difference(kick: Kick, stiffness: float, dt: float) -> float:
    """Return how far MuJoCo's impulse is from ours, relative to ours."""
    return apart(mujoco_kick(ours(kick), stiffness, dt)(), ours(kick).impulse)


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Return the length of the difference, relative to the other's."""
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def table(stiffnesses: tuple[float, ...] = STIFFNESSES, dt: float = STEP) -> dict[str, list[float]]:
    """Return the differences in per cent, by row: of each kick, then from MuJoCo's own limit."""
    rows = {
        kick.name: [100 * difference(kick, stiffness, dt) for stiffness in stiffnesses]
        for kick in (*KICKS, SLIDING)
    }
    limit, hit = relaxed(SLIDING), ours(SLIDING)
    rows["the same, against MuJoCo's own limit"] = [
        100 * apart(mujoco_kick(hit, stiffness, dt)(), limit) for stiffness in stiffnesses
    ]
    return rows


def main() -> None:
    """Print the table, and what the limit of MuJoCo's law differs by."""
    print("| kick | " + " | ".join(f"{stiffness:.0e} N/m" for stiffness in STIFFNESSES) + " |")
    print("|---" * (1 + len(STIFFNESSES)) + "|")
    for name, cells in table().items():
        print(f"| {name} | " + " | ".join(f"{cell:.2f} %" for cell in cells) + " |")
    for kick in (*KICKS, SLIDING):
        off = 100 * apart(relaxed(kick), ours(kick).impulse)
        print(f"{kick.name}: the limit of MuJoCo's law is {off:.2f} % from ours")


if __name__ == "__main__":
    main()
