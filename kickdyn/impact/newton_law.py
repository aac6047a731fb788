"""Newton's law: kinematic restitution and Coulomb's cone, solved exactly."""

import math

import numpy as np

from kickdyn.core.mechanics import Triple
from kickdyn.core.validation import length
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

TANGENT = 1e-8
"""Share by which a line may miss a circle that it touches but for rounding."""

LEAST_RESISTANCE = 1e-14
"""Resistance to an impulse along the cone, relative to its terms, up to which it is rounding."""

ASTRAY = 0.01
"""Sliding across the friction, relative to the velocity before, from which it does not oppose."""

Matrix = tuple[float, float, float, float, float, float]
"""Entries 11, 12, 22, 13, 23, 33 of a symmetric matrix; of the Delassus matrix, the normal last."""

Conic = tuple[float, float, float, float, float, float]
"""See `slip_conic`."""

Directions = tuple[tuple[float, float], ...]
"""Pairs of cosine and sine."""

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

    The kernels of `strike_many` and of sweeps compile the functions below that compute it.
    """
    (contact,) = problem.contacts
    e, mu = contact.restitution, contact.friction
    if mu == 0.0:
        return frictionless(problem)
    axes, before = problem.in_contact_axes()
    matrix = problem.delassus(axes)
    (g11, g12, g13), (_, g22, g23), (_, _, g33) = matrix.tolist()
    g, u = (g11, g12, g22, g13, g23, g33), (before[0], before[1], before[2])
    if True in [body.is_free for body in problem.bodies]:  # `any` takes twice as long
        stick, _, _ = stick_impulse(g, u, e)
    else:  # G may be singular. The limit of heavier balls is the least impulse, if there is any.
        free = np.multiply(before, (1.0, 1.0, 1.0 + e))
        least = -np.linalg.pinv(matrix, rcond=SINGULAR, hermitian=True).dot(free)
        unbalanced = length(matrix.dot(least) + free) > SINGULAR * length(free)
        stick = (math.inf, 0.0, 0.0) if unbalanced else tuple(least.tolist())
    if math.hypot(stick[0], stick[1]) <= mu * stick[2]:
        lost = energy_lost(stick, u, (0.0, 0.0), e)
        return solution_in_world(axes, stick, (True,), lost)
    slip, lost = slip_impulse(g, u, e, mu, meet_circle(slip_conic(g, u, e, mu)))
    return solution_in_world(axes, slip, (False,), lost)


def solve_newton_at_several(problem: ContactProblem) -> Solution:
    r"""Return impulses with Newton's restitution and Coulomb's cone at every contact.

    A contact can separate faster than its restitution says, pushed by the others, and one that
    did not approach before has no restitution:

    .. math:: 0 \le u_n^+ + e \min(u_n, 0) \perp p_n \ge 0 .

    This nonlinear complementarity problem is solved by `solve_cones`; `KickdynError` is raised
    where it finds no solution.
    """
    axes, velocities = problem.in_contact_axes()
    before, delassus = np.array(velocities), problem.delassus(axes)
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
    return solution_in_world(axes, impulses.tolist(), sticking, lost, residual)


def stick_impulse(
    g: Matrix, u: Triple, e: float
) -> tuple[Triple, tuple[float, float], tuple[float, float]]:
    r"""Return the impulse after which the points stick, friction by the normal impulse, pivots.

    The impulse [N s] solves :math:`G p = -(u_1, u_2, (1 + e)\, u_3)` in Cholesky's order, because
    Cramer's rule would lose digits twice; u is the velocity before. A normal impulse 1 alone needs
    the second pair as friction. The pivots are what is left of entries 22 and 33 of G [1/kg].
    """
    g11, g12, g22, g13, g23, g33 = g
    inverse = 1.0 / g11
    ratio = g12 * inverse
    h22, h23 = g22 - ratio * g12, g23 - ratio * g13
    inverse22 = 1.0 / h22
    t = -h23 * inverse22
    s = -(g13 + g12 * t) * inverse
    h33 = g33 + (g13 * s + g23 * t)
    r2 = (ratio * u[0] - u[1]) * inverse22  # friction without a normal impulse
    r1 = -(u[0] + g12 * r2) * inverse
    p = -((1.0 + e) * u[2] + g13 * r1 + g23 * r2) / h33
    return (r1 + s * p, r2 + t * p, p), (s, t), (h22, h33)


def slip_impulse(
    g: Matrix, u: Triple, e: float, mu: float, directions: Directions
) -> tuple[Triple, float]:
    r"""Return the impulse on the cone that loses most energy [N s], and the energy lost [J].

    Along a direction of `meet_circle`, the impulse :math:`p\, (\mu c, \mu s, 1)` follows from
    the normal row. Where the cone hardly resists, p alone would have few digits, so that Newton's
    method improves p and the direction together. Impulses whose friction would drive the sliding
    are none, nor are those that nothing but rounding resists; without any, the energy lost is
    -inf. Directions (c, s) have about unit length; pairs of zeros are passed over.
    """
    g11, g12, g22, g13, g23, g33 = g
    f3 = (1.0 + e) * u[2]
    terms, speed = mu * (abs(g13) + abs(g23)) + g33, abs(u[0]) + abs(u[1]) - f3
    impulse, most = (0.0, 0.0, 0.0), -math.inf
    for c, s in directions:
        resistance = mu * (g13 * c + g23 * s) + g33
        if resistance <= 0.0 or (c == 0.0 and s == 0.0):
            continue
        p = -f3 / resistance
        driven = c * (p * (mu * (g11 * c + g12 * s) + g13) + u[0])
        driven += s * (p * (mu * (g12 * c + g22 * s) + g23) + u[1])
        if resistance > 0.01 * terms and driven > 0.01 * speed:  # beyond what the steps change
            continue
        for _ in range(5):
            if p == 0.0:  # below the smallest number
                break
            # residuals over p, because products of two slow speeds would underflow
            x = mu * (g11 * c + g12 * s) + g13 + u[0] / p
            y = mu * (g12 * c + g22 * s) + g23 + u[1] / p
            across, aside = mu * (g13 * c + g23 * s) + g33, g23 * c - g13 * s
            z = across + f3 / p
            turned = aside + mu * ((g22 - g11) * c * s + g12 * (c * c - s * s))
            stiff = mu * (g11 * s * s - 2.0 * g12 * c * s + g22 * c * c) - (c * x + s * y)
            missed = c * y - s * x
            determinant = across * stiff - mu * aside * turned
            if determinant == 0.0 or not math.isfinite(determinant):
                break
            turn = (turned * z - across * missed) / determinant
            step = (mu * aside * missed - stiff * z) / determinant
            c, s, p = c - s * turn, s + c * turn, p + p * step
            size = math.sqrt(c * c + s * s)
            c, s = c / size, s / size
            if abs(turn) <= 1e-9 and abs(step) <= 1e-9:
                break
        if p < 0.0 or p * (LEAST_RESISTANCE * terms) > -f3:
            continue
        x = p * (mu * (g11 * c + g12 * s) + g13) + u[0]
        y = p * (mu * (g12 * c + g22 * s) + g23) + u[1]
        if c * x + s * y > 0.0 or abs(c * y - s * x) > ASTRAY * speed:  # friction would drive it
            continue
        lost = 0.5 * p * (-u[2] * (1.0 - e) - mu * (c * (u[0] + x) + s * (u[1] + y)))
        if lost > most:
            impulse, most = (mu * p * c, mu * p * s, p), lost
    return impulse, most


def slip_conic(g: Matrix, u: Triple, e: float, mu: float) -> Conic:
    r"""Return the conic of parallel friction and sliding, over directions (c, s) of friction.

    With the impulse :math:`p\, (\mu c, \mu s, 1)`, and p from the normal row, they are parallel
    where the unit circle meets the conic

    .. math:: m\, (c^2 + s^2) + h\, (c^2 - s^2) + 2 d_1 c + 2 d_2 s = 0

    in axes that are turned by an angle b. Returned are h, m, d_1 and d_2, scaled to order 1, and
    cosine and sine of b. Friction mu is above 0.
    """
    g11, g12, g22, g13, g23, g33 = g
    f3 = (1.0 + e) * u[2]
    # sliding times a positive number: x and y, as coefficients of c, s and 1
    x0, x1, x2 = mu * (u[0] * g13 - f3 * g11), mu * (u[0] * g23 - f3 * g12), u[0] * g33 - f3 * g13
    y0, y1, y2 = mu * (u[1] * g13 - f3 * g12), mu * (u[1] * g23 - f3 * g22), u[1] * g33 - f3 * g23
    # c y - s x is the conic, with the product of c and s as long as axes are not turned
    mean, even, odd = 0.5 * (y0 - x1), 0.5 * (y0 + x1), 0.5 * (y1 - x0)
    scale = max(max(abs(mean), abs(even), abs(odd)), max(abs(x2), abs(y2)))
    if scale == 0.0:
        scale = 1.0
    mean, even, odd = mean / scale, even / scale, odd / scale
    h = math.sqrt(even * even + odd * odd)
    cos_b, sin_b = 1.0, 0.0
    if even >= 0.0 and h > 0.0:
        cos_b = math.sqrt(0.5 * (1.0 + even / h))
        sin_b = 0.5 * odd / h / cos_b
    elif h > 0.0:
        sin_b = math.sqrt(0.5 * (1.0 - even / h))
        cos_b = 0.5 * odd / h / sin_b
    d1 = 0.5 * (y2 * cos_b - x2 * sin_b) / scale
    d2 = -0.5 * (y2 * sin_b + x2 * cos_b) / scale
    return h, mean, d1, d2, cos_b, sin_b


def meet_circle(conic: Conic) -> Directions:
    r"""Return the four points, at most, in which the unit circle meets the conic of `slip_conic`.

    Between 0 and 1 there is a :math:`\tau` for which conic and circle have this combination:

    .. math:: 2 h\, (\tau c^2 - (1 - \tau) s^2) + 2 d_1 c + 2 d_2 s + m + h - 2 h \tau ,

    a pair of straight lines. It is a root of a cubic that changes its sign there. The lines meet
    the circle where the conic does (Richter-Gebert, Perspectives on Projective Geometry, 2011,
    chapter 11). Points that a line misses are (0, 0).
    """
    h, mean, d1, d2, cos_b, sin_b = conic
    low, high = 0.0, 1.0
    tau = 0.5 if d1 == 0.0 and d2 == 0.0 else d1 * d1 / (d1 * d1 + d2 * d2)
    for _ in range(80):  # Newton's method, kept within the bracket
        level, curve = mean + h - 2.0 * h * tau, 2.0 * h * tau * (1.0 - tau)
        value = (1.0 - tau) * d1 * d1 - tau * d2 * d2 - curve * level
        slope = 2.0 * h * (curve - (1.0 - 2.0 * tau) * level) - d1 * d1 - d2 * d2
        if value >= 0.0:
            low = tau
        if value <= 0.0:
            high = tau
        new = tau - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - tau) <= 1e-10:
            break
        tau = new

    level = mean + h - 2.0 * h * tau
    a, b = math.sqrt(tau), math.sqrt(1.0 - tau)
    if tau > 0.5:
        first = abs(d1) / a
        second = math.sqrt(max(first * first - 2.0 * h * level, 0.0))
    else:
        second = abs(d2) / b
        first = math.sqrt(max(second * second + 2.0 * h * level, 0.0))
    # the lines a c + b s + far / (2 h) = 0 and a c - b s + near = 0, in these axes
    far = math.copysign(first + second, d1)
    near = level / far if far != 0.0 else 0.0
    far = far / (2.0 * h) if abs(far) < 4.0 * h else 2.0
    b = -b if d1 * d2 > 0.0 else b
    px, py, qx, qy = 0.0, 0.0, 0.0, 0.0
    if abs(far) <= 1.0 + TANGENT:
        half = math.sqrt(max(1.0 - far * far, 0.0))
        px, py, qx, qy = (
            -far * a - half * b,
            half * a - far * b,
            half * b - far * a,
            -far * b - half * a,
        )
    rx, ry, sx, sy = 0.0, 0.0, 0.0, 0.0
    if abs(near) <= 1.0 + TANGENT:
        half = math.sqrt(max(1.0 - near * near, 0.0))
        rx, ry, sx, sy = (
            half * b - near * a,
            half * a + near * b,
            -near * a - half * b,
            near * b - half * a,
        )
    return (
        (cos_b * px - sin_b * py, sin_b * px + cos_b * py),
        (cos_b * qx - sin_b * qy, sin_b * qx + cos_b * qy),
        (cos_b * rx - sin_b * ry, sin_b * rx + cos_b * ry),
        (cos_b * sx - sin_b * sy, sin_b * sx + cos_b * sy),
    )


def energy_lost(p: Triple, u: Triple, sliding_after: tuple[float, float], e: float) -> float:
    """Return minus the impulse times the mean velocity at the contact [J], in contact axes."""
    tangential = p[0] * (u[0] + sliding_after[0]) + p[1] * (u[1] + sliding_after[1])
    return 0.5 * (-p[2] * u[2] * (1.0 - e) - tangential)


NEWTON = ImpactLaw(
    "newton",
    solve_newton,
    solve_several=solve_newton_at_several,
    differentiate=sensitivity,
    has_kernel=True,
)
