"""Newton's law: kinematic restitution and Coulomb's cone, solved exactly."""

import math

import numpy as np
from scipy.linalg import lapack

from kickdyn.core.validation import Array, length
from kickdyn.errors import KickdynError
from kickdyn.impact.cone_solver import solve_cones
from kickdyn.impact.contact_problem import (
    ContactProblem,
    ImpactLaw,
    Solution,
    frictionless,
    solution_in_world,
)
from kickdyn.impact.sensitivity import sensitivity

SINGULAR = 1e-12
"""Mobility, relative to the largest, below which contacts with an obstacle cannot move."""

MAX_RESIDUAL = 1e-9
"""Largest `cone_residual` of impulses at several contacts."""

AT_REST_SPEED = 1e-9
"""Speed, relative to the approach, below which one of several contact points is at rest."""


def solve_newton(problem: ContactProblem) -> Solution:
    r"""Return the impulse with Newton's restitution along the normal and Coulomb's cone across it.

    The relative velocity :math:`u^+ = u + G p` after the impact satisfies

    .. math:: u_n^+ = -e\, u_n, \qquad |p_t| \le \mu\, p_n, \qquad
              p_t = -\mu\, p_n\, u_t^+ / |u_t^+| \;\text{ if }\; u_t^+ \ne 0 .

    The contact points stick if the impulse that stops their sliding lies inside the cone; else the
    impulse lies on the cone. A solution always exists, because G is positive definite (Acary &
    Cadoux 2013); with strong friction and an eccentric leg there can be three. Sticking then comes
    first, else the solution that loses most energy. With friction, an eccentric impact can gain
    energy by this law, which a negative `energy_lost` shows.
    """
    (contact,) = problem.contacts
    e, mu = contact.restitution, contact.friction
    if mu == 0.0:
        return frictionless(problem)
    axes, before = problem.in_contact_axes()
    g_matrix = problem.delassus(axes)
    free = before.copy()
    free[2] *= 1.0 + e  # to be stopped by the impulse
    _, stick, singular = lapack.dposv(g_matrix, -free)
    if not any(body.is_free for body in problem.bodies):
        # G may be singular. The limit of heavier balls is the least impulse, if there is any.
        stick = -np.linalg.pinv(g_matrix, rcond=SINGULAR, hermitian=True).dot(free)
        left = length(g_matrix.dot(stick) + free) > SINGULAR * length(free)
        stick = np.array([math.inf, 0.0, 0.0]) if left else stick
    elif singular:  # to rounding
        stick = -np.linalg.solve(g_matrix, free)
    p1, p2, p3 = stick.tolist()
    if math.hypot(p1, p2) <= mu * p3:
        lost = _energy_lost(stick, before, (0.0, 0.0), e)
        return solution_in_world(axes, stick, (True,), lost)

    slip, most = np.zeros(3), -math.inf  # what `solve_contacts` refuses, unless there is a slip
    for angle in slip_angles(g_matrix, free, mu):
        direction = np.array([mu * math.cos(angle), mu * math.sin(angle), 1.0])
        resistance = float(g_matrix[2].dot(direction))
        if resistance <= 0.0:
            continue
        impulse = _corrected(g_matrix, free, mu, angle, -float(free[2]) / resistance)
        x, y, _ = (g_matrix.dot(impulse) + free).tolist()
        if x * direction[0] + y * direction[1] > 0.0:  # friction would drive the sliding
            continue
        lost = _energy_lost(impulse, before, (x, y), e)
        if lost > most:
            slip, most = impulse, lost
    return solution_in_world(axes, slip, (False,), most)


def solve_newton_at_several(problem: ContactProblem) -> Solution:
    r"""Return impulses with Newton's restitution and Coulomb's cone at every contact.

    A contact can separate faster than its restitution says, pushed by the others, and one that
    did not approach before has no restitution:

    .. math:: 0 \le u_n^+ + e \min(u_n, 0) \perp p_n \ge 0 .

    This nonlinear complementarity problem is solved by `solve_cones`; `KickdynError` is raised
    where it finds no solution.
    """
    axes, before = problem.in_contact_axes()
    delassus = problem.delassus(axes)
    restitutions = np.array([contact.restitution for contact in problem.contacts])
    frictions = np.array([contact.friction for contact in problem.contacts])
    free = before.copy()
    free[2::3] += restitutions * np.minimum(before[2::3], 0.0)
    impulses, residual = solve_cones(delassus, free, frictions)
    if not residual <= MAX_RESIDUAL:
        raise KickdynError(
            f"no impulses found at {len(frictions)} contacts: the best have a residual of "
            f"{residual:.1g} (friction up to {frictions.max():g})"
        )
    after = before + delassus @ impulses
    sliding = np.hypot(after[0::3], after[1::3])
    at_rest = AT_REST_SPEED * float(np.abs(before[2::3]).max())
    sticking = tuple(((sliding <= at_rest) & (frictions > 0.0)).tolist())
    lost = -0.5 * float(impulses @ (before + after))
    return solution_in_world(axes, impulses, sticking, lost, residual)


def _energy_lost(
    impulse: Array, before: Array, sliding_after: tuple[float, float], e: float
) -> float:
    """Return minus the impulse times the mean velocity at the contact [J], in contact axes."""
    p1, p2, p3 = impulse.tolist()
    u1, u2, u3 = before.tolist()
    tangential = p1 * (u1 + sliding_after[0]) + p2 * (u2 + sliding_after[1])
    return 0.5 * float(-p3 * u3 * (1.0 - e) - tangential)


def _corrected(g_matrix: Array, free: Array, mu: float, angle: float, p: float) -> Array:
    """Return the impulse in a direction of slip, after steps of Newton's method for p and angle.

    Where the cone hardly resists along that direction, p alone would have few digits.
    """
    (g11, g12, g13), (_, g22, g23), (*_, g33) = g_matrix.tolist()
    for _ in range(4):
        c, s = math.cos(angle), math.sin(angle)
        x, y, z = (g_matrix.dot(p * np.array([mu * c, mu * s, 1.0])) + free).tolist()
        across, aside = mu * (g13 * c + g23 * s) + g33, g23 * c - g13 * s
        turned = aside + mu * ((g22 - g11) * c * s + g12 * (c * c - s * s))
        stiff = mu * p * (g11 * s * s - 2.0 * g12 * c * s + g22 * c * c) - (c * x + s * y)
        missed = c * y - s * x
        determinant = across * stiff - mu * p * aside * turned
        if determinant and math.isfinite(determinant):
            step = (mu * p * aside * missed - stiff * z) / determinant
            angle, p = angle + (turned * z - across * missed) / determinant, p + step
    return np.array([mu * p * math.cos(angle), mu * p * math.sin(angle), p])


def slip_angles(g_matrix: Array, velocity: Array, mu: float) -> list[float]:
    r"""Return every direction in which friction and sliding can be parallel.

    With the impulse :math:`p\, (\mu \cos\alpha, \mu \sin\alpha, 1)`, and p from the normal row,
    "sliding is parallel to friction" is a trigonometric polynomial of degree 2 in
    :math:`\alpha`, thus a quartic in :math:`\exp(i \alpha)`.
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
    first, second = complex(cos1, sin1) / 2, complex(cos2, sin2) / 2
    quartic = [second.conjugate(), first.conjugate(), mean, first, second]
    roots = [root for root in np.roots(quartic).tolist() if abs(abs(root) - 1.0) < 1e-4]
    return [math.atan2(root.imag, root.real) for root in roots]


NEWTON = ImpactLaw(
    "newton",
    solve_newton,
    solve_several=solve_newton_at_several,
    differentiate=sensitivity,
    has_kernel=True,
    eq_10_without_friction=True,
)
