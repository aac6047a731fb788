"""Newton's law: kinematic restitution and Coulomb's cone, solved exactly."""

from __future__ import annotations

import math

import numpy as np

from kickdyn.checks import Array
from kickdyn.errors import KickdynError
from kickdyn.impact.problem import ContactProblem, Solution, contact_axes, frictionless


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
    delassus = problem.delassus()
    approach, _ = problem.along_normal()  # not from u: a fast spin would cost its digits
    axes = contact_axes(n, u)
    g_matrix = axes.T.dot(delassus).dot(axes)
    before = u.dot(axes)
    before[2] = -approach
    free = before.copy()
    free[2] -= e * approach  # what an impulse must bring to rest
    stick = -np.linalg.solve(g_matrix, free)
    p1, p2, pressing = stick.tolist()
    if math.hypot(p1, p2) <= mu * pressing:
        return Solution(axes.dot(stick), True, _lost(stick, before, np.zeros(2), e))

    best: tuple[Array, float] | None = None
    for angle in slip_angles(g_matrix, free, mu):
        along = np.array([mu * math.cos(angle), mu * math.sin(angle), 1.0])
        resistance = float(g_matrix[2] @ along)
        if resistance <= 0.0:
            continue
        slip = -free[2] / resistance * along
        sliding = (g_matrix @ slip + free)[:2]
        if float(sliding @ along[:2]) > 0.0:  # friction would push, not resist
            continue
        lost = _lost(slip, before, sliding, e)
        if best is None or lost > best[1]:
            best = slip, lost
    if best is None:
        raise KickdynError(
            f"no impulse found on the friction cone (mu = {mu:g}, e = {e:g}, "
            f"relative velocity {u.tolist()} m/s)"
        )
    return Solution(axes @ best[0], False, best[1])


def _lost(impulse: Array, before: Array, sliding: Array, e: float) -> float:
    """Return the energy lost: minus the impulse times the mean velocity at the contact."""
    normal = -impulse[2] * before[2] * (1.0 - e)
    return 0.5 * float(normal - impulse[:2] @ (before[:2] + sliding))


def slip_angles(g: Array, free: Array, mu: float) -> list[float]:
    """Return every direction in which friction and sliding can be opposite.

    With the impulse p (mu cos, mu sin, 1) and p from the normal row, "sliding is parallel to
    friction" is a trigonometric polynomial of degree 2, thus a quartic in exp(i angle).
    """
    x, y = (
        np.array(
            [
                mu * (free[i] * g[2, 0] - free[2] * g[i, 0]),
                mu * (free[i] * g[2, 1] - free[2] * g[i, 1]),
                free[i] * g[2, 2] - free[2] * g[i, 2],
            ]
        )
        for i in (0, 1)
    )  # sliding times a positive number: x and y, as coefficients of cos, sin and 1
    mean, cos1, sin1 = (x[1] - y[0]) / 2, -y[2], x[2]
    cos2, sin2 = -(x[1] + y[0]) / 2, (x[0] - y[1]) / 2
    if max(abs(mean), abs(cos2), abs(sin2)) <= 1e-17 * max(abs(cos1), abs(sin1)):
        return [math.atan2(-cos1, sin1), math.atan2(cos1, -sin1)]  # mu too small to turn sliding
    roots = np.roots(
        [
            (cos2 - 1j * sin2) / 2,
            (cos1 - 1j * sin1) / 2,
            mean,
            (cos1 + 1j * sin1) / 2,
            (cos2 + 1j * sin2) / 2,
        ]
    )
    angles = []
    for root in roots[np.abs(np.abs(roots) - 1.0) < 1e-4]:
        angle = float(np.angle(root))
        for _ in range(3):  # Newton's method takes the root to the last digit
            c, s = math.cos(angle), math.sin(angle)
            c2, s2 = c * c - s * s, 2 * c * s
            value = mean + cos1 * c + sin1 * s + cos2 * c2 + sin2 * s2
            slope = -cos1 * s + sin1 * c + 2 * (sin2 * c2 - cos2 * s2)
            angle -= value / slope if slope else 0.0
        angles.append(angle)
    return angles
