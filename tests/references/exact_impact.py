"""The impact with 50 digits, law `newton`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kickdyn.impact.impact_result import Impact
from references.exact_leg import Exact, ExactPosture, leg_numbers, length, mp, numbers

LARGEST, SMALLEST = np.finfo(float).max, np.finfo(float).tiny


@dataclass(frozen=True)
class Quantity:
    """One answer of an impact.

    Attributes:
        exact: with 50 digits.
        scale: what errors are relative to, mostly the answer's own length.
        units: in which the entries are counted: moments of a joint in impulses at the foot.
    """

    exact: Exact
    scale: Any
    units: Sequence[float] = ()

    def error(self, found: Any) -> float:
        """Return how far a float64 answer is off, relative to the scale; inf if that is 0."""
        if self.scale > LARGEST:
            return 0.0 if found == math.inf else math.inf
        if not np.isfinite(found).all():
            return math.inf
        values = numbers(np.ravel(found))
        if self.units:
            values = values / numbers(self.units)
        gap = length(values - self.exact)
        return float(gap / max(self.scale, SMALLEST)) if gap else 0.0


def given(impact: Impact) -> tuple[dict[str, Any], dict[str, Exact]]:
    """Return what a strike was given: the leg's structure, and every number of the scene."""
    ball, contact, before = impact.ball, impact.contact, impact.ball_before
    structure, values = leg_numbers(impact.posture.leg)
    return structure, values | {"q": numbers(impact.posture.q), "v": numbers(impact.v_before),
        "ball": numbers([ball.mass, ball.radius, ball.inertia_factor]),
        "normal": numbers(contact.normal),
        "coefficients": numbers([contact.restitution, contact.friction]),
        "ball_velocity": numbers(before.velocity), "ball_spin": numbers(before.spin)}  # fmt: skip


def exact_impact(structure: dict[str, Any], scene: dict[str, Exact]) -> dict[str, Quantity]:
    """Return the answers of law `newton` by name, each as in `Impact`; arguments as of `given`."""
    posture = ExactPosture(structure, scene, scene["q"])
    mass, radius, factor = scene["ball"]
    e, mu = scene["coefficients"]
    n = scene["normal"] / length(scene["normal"])
    rows = np.array([posture.whiten(row) for row in posture.jacobian])
    delassus = rows @ rows.T
    foot = posture.jacobian @ scene["v"]
    centre = scene["ball_velocity"] - foot
    turning = 1 / (factor * mass)
    u = centre - radius * np.cross(scene["ball_spin"], n)
    if mu == 0:
        impulse = -(1 + e) * (n @ centre) / (n @ delassus @ n + 1 / mass) * n
        tangential = 0 * n
    else:
        of_ball = (1 / mass + turning, 1 / mass + turning, 1 / mass)
        impulse, tangential = coulomb(delassus, of_ball, u, n, n @ centre, (e, mu))
    jump = -posture.unwhiten(impulse @ rows)
    per_impulse = n @ delassus @ n
    after = u + delassus @ impulse + impulse / mass + turning * tangential
    spin_change = np.cross(n, tangential) / (factor * mass * radius)
    spin = scene["ball_spin"] - spin_change
    answers = {"impulse": impulse,
        "effective mass": np.array([1 / per_impulse if per_impulse else mp.inf]),
        "foot velocity": foot, "ball velocity": scene["ball_velocity"] + impulse / mass,
        "ball spin": spin, "joint velocity": scene["v"] + jump,
        "energy lost": np.array([-(impulse @ (u + after)) / 2])}  # fmt: skip
    found = {name: Quantity(value, length(value)) for name, value in answers.items()}
    if mu == 0:
        lost = -(n @ impulse) * (1 - e) * (n @ centre) / 2
        found["energy lost"] = Quantity(np.array([lost]), abs(lost))
    found["ball spin"] = Quantity(spin, length(scene["ball_spin"]) + length(spin_change))
    for i, wrench in enumerate(posture.joint_impulses(jump, -impulse)):
        reach = length(posture.contact_point - posture.origins[i])
        both = np.concatenate([wrench[:3], wrench[3:] / reach])
        found[f"joint {i + 1}"] = Quantity(both, length(both), [1.0] * 3 + [float(reach)] * 3)
    return found


def coulomb(
    delassus: Exact,
    of_ball: Sequence[Any],
    u: Exact,
    n: Exact,
    closing: Any,
    coefficients: tuple[Any, Any],
) -> tuple[Exact, Exact]:
    """Return the impulse of law `newton` and its tangential part [N s].

    It is that of a sticking contact where this is inside the cone, else that of the direction of
    sliding that loses most energy. The tangential part may be far below the whole's last digit.

    Given are the leg's Delassus matrix, two tangential entries and the normal one of the ball's,
    the velocity u at the contact, the normal, the component of u along it, which a fast spin would
    drown, and restitution and friction.
    """
    e, mu = coefficients
    least = min(range(3), key=lambda i: abs(n[i]))
    first = np.cross(n, numbers(np.eye(3)[least]))
    first = first / length(first)
    basis = np.array([first, np.cross(n, first), n])
    g = basis @ delassus @ basis.T + np.diag(np.array(of_ball))
    before = np.array([*(basis[:2] @ u), closing])
    free = np.array([*before[:2], (1 + e) * closing])
    size = np.array([1 / mp.sqrt(g[i, i]) for i in range(3)])
    scaled = mp.matrix((g * np.outer(size, size)).tolist())
    stick = -size * np.array(list(mp.lu_solve(scaled, mp.matrix((free * size).tolist()))))

    def in_world(p: Exact) -> tuple[Exact, Exact]:
        return p @ basis, p[:2] @ basis[:2]

    if length(stick[:2]) <= mu * stick[2]:
        return in_world(stick)

    def sliding_at(angle: Any) -> tuple[Exact, Exact, Any]:
        along = np.array([mu * mp.cos(angle), mu * mp.sin(angle), mp.one])
        resistance = g[2] @ along
        return along, resistance * free - free[2] * (g @ along), resistance

    def aside(angle: Any) -> Any:
        along, sliding, _ = sliding_at(angle)  # the sliding, times the resistance
        return along[0] * sliding[1] - along[1] * sliding[0]

    best: tuple[Any, Exact] | None = None
    for angle in roots(aside):
        along, sliding, resistance = sliding_at(angle)
        if resistance <= 0 or sliding[:2] @ along[:2] > 0:
            continue
        p = -free[2] / resistance * along
        lost = -(p @ (2 * before + g @ p)) / 2
        if best is None or lost > best[0]:
            best = lost, p
    if best is None:
        raise ArithmeticError("no direction of sliding was found")
    return in_world(best[1])


def roots(function: Callable[[Any], Any]) -> list[Any]:
    """Return the angles at which a smooth function changes its sign between two of 180 angles."""
    angles = [(k + mp.mpf(1) / 3) * 2 * mp.pi / 180 for k in range(181)]
    values = [function(angle) for angle in angles]
    # made large, for the search ends at once where a function is below its tolerance
    large = mp.mpf(10) ** 600 / (max(abs(value) for value in values) or 1)
    return [mp.findroot(
        lambda angle: large * function(angle), (low, high), solver="anderson", verify=False)
        for low, high, at_low, at_high in zip(angles, angles[1:], values, values[1:], strict=False)
        if at_low * at_high <= 0 and at_low != at_high]  # fmt: skip
