"""Newton's law: kinematic restitution and Coulomb's cone, solved exactly."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import lapack

from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.contact_problem import ContactProblem, Solution, contact_axes, frictionless


def newton(problem: ContactProblem) -> Solution:
    """Newton's restitution along the normal, Coulomb's cone across it, solved exactly.

    The normal velocity after is -e times that before. The contact points stick if the impulse that
    stops them from sliding lies inside the cone; else the impulse lies on the cone, against the
    direction of the sliding that remains.

    There is always a solution, for the Delassus matrix is positive definite (Acary & Cadoux 2013);
    under strong friction a lopsided leg can have up to three. Sticking then comes first, else
    what loses most energy. With friction, an eccentric impact can gain energy by this law: the
    negative `energy_lost` says so.
    """
    if problem.friction == 0.0:
        return frictionless(problem)
    n, u, e, mu = problem.normal, problem.velocity, problem.restitution, problem.friction
    approach, _ = problem.along_normal()  # not from u: a fast spin would cost its digits
    axes = contact_axes(n, u)
    g_matrix = problem.delassus_in(axes)
    before = u.dot(axes)
    before[2] = -approach
    free = before.copy()
    free[2] -= e * approach  # what an impulse must bring to rest
    _, stick, singular = lapack.dposv(g_matrix, -free)
    if singular:  # but for rounding
        stick = -np.linalg.solve(g_matrix, free)
    p1, p2, pressing = stick.tolist()
    if math.hypot(p1, p2) <= mu * pressing:
        lost = _lost(stick, before, (0.0, 0.0), e)
        return Solution(axes.dot(stick), True, lost, axes[:, :2].dot(stick[:2]))

    best: tuple[Array, float] | None = None
    for angle in slip_angles(g_matrix, free, mu):
        along = np.array([mu * math.cos(angle), mu * math.sin(angle), 1.0])
        resistance = float(g_matrix[2].dot(along))
        if resistance <= 0.0:
            continue
        slip = -free[2] / resistance * along
        x, y, _ = (g_matrix.dot(slip) + free).tolist()
        if x * along[0] + y * along[1] > 0.0:  # friction would push, not resist
            continue
        lost = _lost(slip, before, (x, y), e)
        if best is None or lost > best[1]:
            best = slip, lost
    if best is None:
        raise KickdynError(
            f"no impulse found on the friction cone (mu = {mu:g}, e = {e:g}, "
            f"relative velocity {u.tolist()} m/s)"
        )
    return Solution(axes.dot(best[0]), False, best[1], axes[:, :2].dot(best[0][:2]))


def _lost(impulse: Array, before: Array, sliding: tuple[float, float], e: float) -> float:
    """Return the energy lost: minus the impulse times the mean velocity at the contact."""
    p1, p2, pressing = impulse.tolist()
    u1, u2, u3 = before.tolist()
    across = p1 * (u1 + sliding[0]) + p2 * (u2 + sliding[1])
    return 0.5 * float(-pressing * u3 * (1.0 - e) - across)


def slip_angles(g_matrix: Array, velocity: Array, mu: float) -> list[float]:
    """Return every direction in which friction and sliding can be opposite.

    With the impulse p (mu cos, mu sin, 1) and p from the normal row, "sliding is parallel to
    friction" is a trigonometric polynomial of degree 2, thus a quartic in exp(i angle).
    """
    g, free = g_matrix.tolist(), velocity.tolist()
    x, y = (
        [
            mu * (free[i] * g[2][0] - free[2] * g[i][0]),
            mu * (free[i] * g[2][1] - free[2] * g[i][1]),
            free[i] * g[2][2] - free[2] * g[i][2],
        ]
        for i in (0, 1)
    )  # sliding times a positive number: x and y, as coefficients of cos, sin and 1
    mean, cos1, sin1 = (x[1] - y[0]) / 2, -y[2], x[2]
    cos2, sin2 = -(x[1] + y[0]) / 2, (x[0] - y[1]) / 2
    if max(abs(mean), abs(cos2), abs(sin2)) <= 1e-17 * max(abs(cos1), abs(sin1)):
        return [math.atan2(-cos1, sin1), math.atan2(cos1, -sin1)]  # mu too small to turn sliding
    roots = np.roots(
        [
            complex(cos2, -sin2) / 2,
            complex(cos1, -sin1) / 2,
            mean,
            complex(cos1, sin1) / 2,
            complex(cos2, sin2) / 2,
        ]
    ).tolist()
    angles = []
    for root in roots:
        if not abs(abs(root) - 1.0) < 1e-4:
            continue
        angle = math.atan2(root.imag, root.real)
        for _ in range(3):  # Newton's method takes the root to the last digit
            c, s = math.cos(angle), math.sin(angle)
            c2, s2 = c * c - s * s, 2 * c * s
            value = mean + cos1 * c + sin1 * s + cos2 * c2 + sin2 * s2
            slope = -cos1 * s + sin1 * c + 2 * (sin2 * c2 - cos2 * s2)
            angle -= value / slope if slope else 0.0
        angles.append(angle)
    return angles
