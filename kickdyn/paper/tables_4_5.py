r"""Tables 4 and 5: distances of the test bed's kicks, from its leg.

With the contact normal n at the printed height and the attack direction a, Eq. (10) along n gives

.. math:: p = (1 + e)\, s v\, (a \cdot n)\, m(n), \qquad
          \tfrac{1}{m(n)} = n^T J M^{-1} J^T n + \tfrac{1}{m_B} .

The force of Eqs. (15)-(20) is along a with this part p along n, and s is a scale of the printed
foot speed v. The product (1 + e) s is fitted to the row of 50 deg and 2.2 m/s, and the posture,
through m(n), to the row of 30 deg. The other rows are predicted.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize

from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.impact.strike import strike
from kickdyn.paper.assumptions import (
    BALL,
    DEFAULT,
    RESTITUTION,
    Coefficients,
    direction,
    launch_from_force,
    warnings_of,
)
from kickdyn.paper.item import MEASURED, Finding, Item, near, shape
from kickdyn.robot.leg import Leg, Posture

NAME = "Tables 4-5"
ATTACK = direction(20.0)
"""Printed with Table 5, whose first kick is the last of Table 4; these share the foot velocity."""

PASSIVE_LIMIT = 2.0
"""Largest ball/foot speed ratio of a passive impact: 1 + e with e = 1, a leg of infinite mass."""


class TestBedKick(NamedTuple):
    """A kick of the test bed: speed [m/s], height of contact [deg], printed distances [m]."""

    name: str
    foot_speed: float
    contact_deg: float
    experiment: float
    simulation: float


ROWS = LOW, MIDDLE, HIGH, SLOWER, SLOWEST = (
    TestBedKick("Table 4 30 deg", 2.2, 30.0, 3.9, 3.75),
    TestBedKick("Table 4 40 deg", 2.2, 40.0, 6.5, 6.86),
    TestBedKick("Table 4 50 deg", 2.2, 50.0, 7.5, 8.0),
    TestBedKick("Table 5 2.0 m/s", 2.0, 50.0, 6.3, 6.75),
    TestBedKick("Table 5 1.8 m/s", 1.8, 50.0, 5.3, 5.53),
)
"""Table 5 prints the third once more."""

PREDICTED = (MIDDLE, SLOWER, SLOWEST)
NORMALS = np.array([direction(row.contact_deg) for row in (LOW, MIDDLE, HIGH)])


class Fit(NamedTuple):
    """Posture of least gain (1 + e) s of all that fit, its gain, and distances at 40 deg [m]."""

    posture: Posture
    gain: float
    middle: tuple[float, float]


def kick(row: TestBedKick, fitted: Fit, choice: Coefficients) -> Flight:
    """Return the flight of a row's kick, struck by the leg."""
    normal = direction(row.contact_deg)
    v = fitted.posture.joint_velocity(fitted.gain / (1 + RESTITUTION) * row.foot_speed * ATTACK)
    impulse = strike(fitted.posture, v, BALL, Contact(normal, RESTITUTION)).impulse
    return flight(float(impulse @ normal), normal, choice)


def flight(normal_impulse: float, normal: Array, choice: Coefficients) -> Flight:
    """Return the flight from the part of the force along the normal [N s]."""
    force = normal_impulse / float(ATTACK @ normal) * ATTACK
    return fly(launch_from_force(force, normal)[0], BALL, choice.air())


testbed = cache(Leg.testbed)
"""The leg of Table 6."""


def masses(postures: Sequence[Posture]) -> Array:
    """Return m(n) along the normals of Table 4 [kg], shape `(k, 3)` for k postures."""
    of_leg = np.array([[posture.effective_mass(n) for n in NORMALS] for posture in postures])
    return np.asarray(1 / (1 / of_leg + 1 / BALL.mass))


@cache
def grid() -> tuple[Array, Array]:
    """Return a grid of configurations [rad], and m(n) there [kg].

    Both have shape `(i, j, k, 3)`. Where the foot points away from a normal, the ball would lie
    inside it: the masses are NaN.
    """
    leg = testbed()
    ends = zip(leg.lower, leg.upper, strict=True)
    # step of the search for postures, over the joints' range
    axes = [np.arange(low, high + 1e-9, math.radians(5.0)) for low, high in ends]
    q = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    pitch = q @ (1.0, -1.0, -1.0)
    foot = np.stack([np.cos(pitch), 0.0 * pitch, np.sin(pitch)], axis=-1)
    ahead = (foot @ NORMALS.T > 0).all(axis=-1)
    mass = np.full(q.shape, np.nan)
    mass[ahead] = masses([leg.posture(row) for row in q[ahead]])
    return q, mass


@cache
def fit(choice: Coefficients) -> Fit:
    """Return the fit to the rows of 30 and 50 deg with a choice of coefficients."""
    leg, speeds = testbed(), HIGH.foot_speed * (NORMALS @ ATTACK)

    def distance(row: int, driven: float) -> float:
        return flight(driven * speeds[row], NORMALS[row], choice).range

    low, high = (
        brentq(lambda driven, row=row: distance(row, driven) - ROWS[row].experiment, 0.5, 5)
        for row in (0, 2)
    )

    def misfit(mass: Array) -> Array:
        return np.asarray(mass[..., 0] / mass[..., 2] * high / low - 1.0)

    def masses_at(q: Array) -> Array:
        return np.asarray(masses([leg.posture(q)])[0])

    q, mass_there = grid()
    error, values = misfit(mass_there), np.concatenate([q, mass_there], axis=-1)
    crossed = error[..., :-1] * error[..., 1:] < 0  # from one ankle angle to the next
    before, after = error[..., :-1][crossed], error[..., 1:][crossed]
    fraction = (before / (before - after))[:, None]
    fits = (1 - fraction) * values[..., :-1, :][crossed] + fraction * values[..., 1:, :][crossed]
    gains, middle = high / fits[:, 5], high * fits[:, 4] / fits[:, 5]
    best = minimize(
        lambda x: high / masses_at(x)[2],
        fits[np.argmin(gains), :3],
        method="SLSQP",
        bounds=list(zip(leg.lower, leg.upper, strict=True)),
        constraints={"type": "eq", "fun": lambda x: misfit(masses_at(x))},
        tol=1e-10,
    ).x
    mass = masses_at(best)
    gain, middle = float(high / mass[2]), np.append(middle, high * mass[1] / mass[2])
    return Fit(leg.posture(best), gain, (distance(1, middle.min()), distance(1, middle.max())))


def items() -> list[Item]:
    """Return the fit, every row against experiment and simulation, and the paper's words."""
    fitted, source = fit(DEFAULT), "Eq. (10) along the contact normal"
    paths = {row: kick(row, fitted, DEFAULT) for row in ROWS}
    why = (
        f"e is the restitution, s a scale of the printed foot speeds; a passive impact gives at "
        f"most {PASSIVE_LIMIT:g}, with e = 1, s = 1 and a leg of infinite mass: the printed foot "
        "speeds cannot be speeds of the contact point"
    )
    ratio, result = float(paths[HIGH].launch.speed) / HIGH.foot_speed, list[Item]()
    for name, ours in (("ball/foot speed ratio", ratio), ("(1 + e) s", fitted.gain)):
        verdict = Finding.FITTED if ours <= PASSIVE_LIMIT else Finding.NOT_REACHABLE
        result.append(Item(f"{NAME} {name}", None, ours, "1", verdict, why, source))
    result += varying(DEFAULT)
    why = 'the paper says that at 50 deg the ball "travels farthest and highest"'
    lower = (paths[LOW], paths[MIDDLE])
    largest = all(paths[HIGH].range > x.range and paths[HIGH].height > x.height for x in lower)
    name, apex = f"{HIGH.name} apex", paths[HIGH].height
    result.append(Item(name, None, apex, "m", shape(largest), why, source))
    why = f"the paper claims agreement with the experiment within {100 * MEASURED:g} %"
    for name, pairs in (
        ("paper's simulation", [(row.simulation, row.experiment) for row in ROWS]),
        ("predicted row", [(paths[row].range, row.experiment) for row in PREDICTED]),
    ):
        worst = max(abs(ours / experiment - 1) for ours, experiment in pairs)
        name, verdict = f"{NAME} largest error of a {name}", shape(worst <= MEASURED)
        result.append(Item(name, None, 100 * worst, "%", verdict, why, source))
    return result


def varying(choice: Coefficients) -> list[Item]:
    """Return the distance of every row with a choice of coefficients, each fitted anew."""
    fitted, result = fit(choice), list[Item]()
    angles = testbed().angles_deg(fitted.posture.q)
    posture = ", ".join(f"{name} {angle:.0f}" for name, angle in angles.items())
    reasons = {
        LOW: f"the posture is fitted to the rows of 30 and 50 deg: {posture} deg; of all that fit, "
        f"it needs the smallest (1 + e) s, {fitted.gain:.2g}",
        HIGH: "(1 + e) s is fitted; Table 5 prints this kick again",
        MIDDLE: "predicted; all postures that fit the rows of 30 and 50 deg give "
        f"{fitted.middle[0]:.1f} to {fitted.middle[1]:.1f} m; the posture with the smallest "
        "(1 + e) s gives the largest distance",
        **{
            row: "predicted from the row of 50 deg and 2.2 m/s, whatever the posture: the launch "
            "speed is in proportion to the foot speed; distance in proportion to its square, as "
            f"in vacuum, is {HIGH.experiment * (row.foot_speed / HIGH.foot_speed) ** 2:.2f} m"
            for row in (SLOWER, SLOWEST)
        },
    }
    source = f"Eqs. (10), (15)-(21), Table 6, {choice.name}"
    for row in ROWS:
        path, why = kick(row, fitted, choice), reasons[row]
        verdict = Finding.REPRODUCED if row in PREDICTED else Finding.FITTED
        for what, paper in (("", row.experiment), (" simulation", row.simulation)):
            name, close = f"{row.name} distance{what}", near(path.range, paper, MEASURED, verdict)
            notes = warnings_of(path)
            result.append(Item(name, paper, path.range, "m", close, why, source, notes=notes))
    return result
