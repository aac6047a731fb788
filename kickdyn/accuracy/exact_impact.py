"""The impact with 50 digits, law `newton`, and how far each answer can be trusted to float64."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from kickdyn.accuracy.exact import (
    DIGITS,
    ExactPosture,
    Vector,
    cross,
    described,
    dot,
    length,
    mapped,
    mp,
    numbers,
    plus,
    turned,
)
from kickdyn.impact.impact_result import Impact

NUDGE = mp.mpf(10) ** -(DIGITS // 2)
LARGEST, SMALLEST = np.finfo(float).max, np.finfo(float).tiny
DIRECTIONS = 180
"""In which sliding is looked for: each sign change between two of them becomes a root."""


@dataclass(frozen=True)
class Quantity:
    """One answer of an impact.

    Attributes:
        exact: with 50 digits.
        scale: what errors are relative to: the answer's own length, if not told otherwise.
        units: which the entries are counted in: moments of a joint in impulses at the foot.
    """

    exact: Vector
    scale: Any
    units: Sequence[float] = ()

    def error(self, found: Any) -> float:
        """Return how far a float64 answer is off, relative to the scale; inf if that is 0.

        What is beyond float64's range must be inf, and what is below may be 0.
        """
        if self.scale > LARGEST:
            return 0.0 if found == math.inf else math.inf
        if not np.isfinite(found).all():
            return math.inf
        values = numbers(np.ravel(found))
        if self.units:
            values = [value / unit for value, unit in zip(values, self.units, strict=True)]
        gap = length(plus(values, self.exact, -1))
        return float(gap / max(self.scale, SMALLEST)) if gap else 0.0


def given(hit: Impact) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what a strike was given: the leg's structure, and every number of the scene."""
    ball, contact, before = hit.ball, hit.contact, hit.ball_before
    structure = described(hit.posture.leg)
    scene = structure.pop("values") | {
        "q": numbers(hit.posture.q),
        "v": numbers(hit.v_before),
        "ball": numbers([ball.mass, ball.radius, ball.inertia_factor]),
        "normal": numbers(contact.normal),
        "coefficients": numbers([contact.restitution, contact.friction]),
        "ball_velocity": numbers(before.velocity),
        "ball_spin": numbers(before.spin),
    }
    return structure, scene


def exact_impact(structure: dict[str, Any], scene: dict[str, Any]) -> dict[str, Quantity]:
    """Return the answers of law `newton` by name, each as in `Impact`."""
    posture = ExactPosture(structure, scene, scene["q"])
    mass, radius, factor = scene["ball"]
    e, mu = scene["coefficients"]
    size = length(scene["normal"])
    n = [part / size for part in scene["normal"]]
    rows = [posture.weighed(row) for row in posture.jacobian]
    leg = [[dot(a, b) for b in rows] for a in rows]
    foot = turned(posture.jacobian, scene["v"])
    centre = plus(scene["ball_velocity"], foot, -1)
    turn = 1 / (factor * mass)
    u = plus(centre, cross(scene["ball_spin"], n), -radius)
    if mu == 0:
        p = -(1 + e) * dot(n, centre) / (dot(n, turned(leg, n)) + 1 / mass)
        impulse, tangential_impulse = [p * part for part in n], [mp.zero] * 3
    else:
        impulse, tangential_impulse = coulomb(
            leg, (1 / mass + turn, 1 / mass), u, n, dot(n, centre), (e, mu)
        )
    weighed = [dot(column, impulse) for column in zip(*rows, strict=True)]
    jump = [-part for part in posture.unweighed(weighed)]
    give = dot(n, turned(leg, n))
    after = plus(plus(plus(u, turned(leg, impulse)), impulse, 1 / mass), tangential_impulse, turn)
    kick = [part / (factor * mass * radius) for part in cross(n, tangential_impulse)]
    spin = plus(scene["ball_spin"], kick, -1)
    answers = {
        "impulse": impulse,
        "effective mass": [1 / give if give else mp.inf],
        "foot velocity": foot,
        "ball velocity": plus(scene["ball_velocity"], impulse, 1 / mass),
        "ball spin": spin,
        "joint velocity": plus(scene["v"], jump),
        "energy lost": [-dot(impulse, plus(u, after)) / 2],
    }
    found = {name: Quantity(value, length(value)) for name, value in answers.items()}
    if mu == 0:
        lost = -dot(n, impulse) * (1 - e) * dot(n, centre) / 2
        found["energy lost"] = Quantity([lost], abs(lost))
    found["ball spin"] = Quantity(spin, length(scene["ball_spin"]) + length(kick))
    transmitted = posture.joint_impulses(jump, [-part for part in impulse])
    for i, wrench in enumerate(transmitted):
        reach = length(plus(posture.contact_point, posture.origins[i], -1))
        both = [*wrench[:3], *[part / reach for part in wrench[3:]]]
        found[f"joint {i + 1}"] = Quantity(both, length(both), [1.0] * 3 + [float(reach)] * 3)
    return found


def coulomb(
    leg: list[Vector],
    ball: tuple[Any, Any],
    u: Vector,
    n: Vector,
    closing: Any,
    coefficients: tuple[Any, Any],
) -> tuple[Vector, Vector]:
    """Return the impulse of `newton`: what sticks, else what slides and loses most energy.

    Second, its part across the normal, which may be far below its last digit.

    Args:
        leg: its Delassus matrix.
        ball: the ball's, across the normal and along it.
        u: velocity at the contact.
        n: normal.
        closing: component of u along it, which a fast spin would drown.
        coefficients: restitution and friction.
    """
    e, mu = coefficients
    least = min(range(3), key=lambda i: abs(n[i]))
    first = cross(n, [mp.mpf(i == least) for i in range(3)])
    first = [part / length(first) for part in first]
    basis = [first, cross(n, first), n]
    g = [[dot(a, turned(leg, b)) for b in basis] for a in basis]
    for i, share in enumerate((ball[0], ball[0], ball[1])):
        g[i][i] += share
    before = [*turned(basis[:2], u), closing]
    free = [*before[:2], (1 + e) * closing]
    size = [1 / mp.sqrt(g[i][i]) for i in range(3)]
    scaled = mp.matrix([[g[i][j] * size[i] * size[j] for j in range(3)] for i in range(3)])
    right = mp.matrix([a * b for a, b in zip(free, size, strict=True)])
    stick = [-a * b for a, b in zip(mp.lu_solve(scaled, right), size, strict=True)]

    def both(p: Vector) -> tuple[Vector, Vector]:
        columns = list(zip(*basis, strict=True))
        return [dot(c, p) for c in columns], [dot(c[:2], p[:2]) for c in columns]

    if length(stick[:2]) <= mu * stick[2]:
        return both(stick)

    def tried(angle: Any) -> tuple[Vector, Vector, Any]:
        along = [mu * mp.cos(angle), mu * mp.sin(angle), mp.one]
        resistance = dot(g[2], along)
        sliding = plus([resistance * f for f in free], turned(g, along), -free[2])
        return along, sliding, resistance  # sliding times the resistance

    def aside(angle: Any) -> Any:
        along, sliding, _ = tried(angle)
        return along[0] * sliding[1] - along[1] * sliding[0]

    best: tuple[Any, Vector] | None = None
    for angle in roots(aside):
        along, sliding, resistance = tried(angle)
        if resistance <= 0 or dot(sliding[:2], along[:2]) > 0:
            continue
        p = [-free[2] / resistance * part for part in along]
        lost = -dot(p, plus(before, plus(before, turned(g, p)))) / 2
        if best is None or lost > best[0]:
            best = lost, p
    if best is None:
        raise ArithmeticError("no direction of sliding was found")
    return both(best[1])


def roots(of: Any) -> list[Any]:
    """Return the angles at which a smooth function of the angle changes its sign."""
    step = 2 * mp.pi / DIRECTIONS
    angles = [(k + mp.mpf(1) / 3) * step for k in range(DIRECTIONS + 1)]
    values = [of(angle) for angle in angles]
    large = mp.mpf(10) ** 600 / (max(abs(value) for value in values) or 1)
    found = []
    for low, high, at_low, at_high in zip(angles, angles[1:], values, values[1:], strict=False):
        if at_low * at_high <= 0 and at_low != at_high:
            # made large, for the search ends at once where a function is below its tolerance
            far = partial(_times, large, of)
            found.append(mp.findroot(far, (low, high), solver="anderson", verify=False))
    return found


def _times(factor: Any, of: Any, angle: Any) -> Any:
    return factor * of(angle)


def conditions(
    structure: dict[str, Any], scene: dict[str, Any], exact: dict[str, Quantity], samples: int = 4
) -> dict[str, float]:
    """Return the condition number of each answer, by name, at least 1.

    It estimates by how many times e an answer changes at most, relative to its scale, if every
    number of the scene changes by up to a share e of itself: float64 inputs then allow
    15 - log10(condition) digits, whatever the algorithm. With the change by all N numbers, each up
    or down at random, of mean square s^2, the worst combination of signs makes at most sqrt(N) s
    (Cauchy-Schwarz); s itself is a mean over a few samples.

    Args:
        structure: as `given` returns it.
        scene: likewise.
        exact: the answers there.
        samples: over which s is averaged.
    """
    rng = np.random.default_rng(50)
    squares = dict.fromkeys(exact, 0.0)
    count = 0

    def nudged(value: Any) -> Any:
        nonlocal count
        count += value != 0
        return value * (1 + NUDGE * int(rng.choice((-1, 1))))

    for _ in range(samples):
        moved = exact_impact(
            structure, {name: mapped(nudged, values) for name, values in scene.items()}
        )
        for name, one in exact.items():
            if one.scale and mp.isfinite(one.scale):
                change = length(plus(moved[name].exact, one.exact, -1)) / one.scale
                squares[name] += float(change / NUDGE) ** 2
    spread = count / samples**2  # numbers per sample, over samples
    return {name: max(1.0, math.sqrt(spread * square)) for name, square in squares.items()}


def answers(hit: Impact) -> dict[str, Any]:
    """Return what `strike` says, by the names of `exact_impact`."""
    found: dict[str, Any] = {
        "impulse": hit.impulse,
        "effective mass": hit.effective_mass,
        "foot velocity": hit.foot_velocity,
        "ball velocity": hit.ball_after.velocity,
        "ball spin": hit.ball_after.spin,
        "joint velocity": hit.v_after,
        "energy lost": hit.energy_lost,
    }
    return found | {f"joint {i + 1}": wrench for i, wrench in enumerate(hit.joint_impulses)}
