"""From the joint-space inertia and the Jacobian to the impulse, many postures at once.

`BATCH` postures are computed side by side, with vector instructions: whatever depends on the
posture is an array of batches, see `kickdyn.core.simd`. What cannot be computed to 1e-12 is marked
in `doubt`, and is left to `kick_from`. Joints count from 1, as Pinocchio's do.

The functions of all kernels have these arguments in common, of n joints:

    parent: parent of each joint.
    slides: whether each joint is prismatic.
    carries: whether the foot moves with each joint.
    constants: constants of each joint, columns as in `kernel_model`.
    foot, lever: the joint that carries the contact point, and from its origin to that, in its axes.
    x: rows of each joint, shape `(n + 1, ROWS)`; COS and SIN are given.
    inertia: M, shape `(n + 1, n + 1)`, lower triangle.
    rows: columns of J, one row per joint, shape `(n + 1, 3)`, for tangents and normal; in a plane
        `(n + 1, 2)`.
    point: rows of the contact point.
    delassus: Delassus matrix of the foot, six rows.
    across, along: the ball's mobility along the tangents and along the normal [1/kg].
    speed, e, mu: foot speed [m/s], restitution, friction.
    impulse: impulse on the ball, three rows: first and second tangent, normal [N s].
    doubt: one batch, set to 1 where digits are lost.

Kernels must give the same bits whether they were compiled now or are read from the disk, or a
resumed sweep would differ from one that ran at once. So `njit` allows no fused multiply-adds: which
of them the compiler finds depends on what it inlines.
"""

import math
from typing import Any

import numba
import numpy as np

from kickdyn.core.lanes import WITHIN
from kickdyn.core.simd import BATCH, choose, spread

OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
"""How the kernels are compiled: without memory management, since all arrays are the caller's."""

njit: Any = numba.njit(**OPTIONS, **WITHIN)
_allocating: Any = numba.njit(**{**OPTIONS, "_nrt": True}, **WITHIN)

LOSS = 300.0
"""Amplification of the rounding of M in the energy of a joint velocity up to which 1e-12 is kept;
legs have about 10, and a link before one ten times as long some hundreds."""


@njit
def factorize(parent, inertia, doubt):  # type: ignore[no-untyped-def]
    r"""Factorize the joint-space inertia in place, :math:`M = L^T L` with lower triangular L.

    In this order, from the tip to the base, L has an entry only where one joint carries the other:
    the branches of a tree cost nothing to each other (Featherstone, Rigid Body Dynamics Algorithms,
    2008, table 6.3). L is left in `inertia`, its diagonal inverted; row 0, of the base, becomes the
    diagonal of M.
    """
    diagonal = inertia[0]  # of no joint: free to keep M's diagonal
    for k in range(1, len(parent)):
        diagonal[k] = inertia[k, k]
    for k in range(len(parent) - 1, 0, -1):
        pivot = inertia[k, k]  # one that keeps less of its diagonal has lost its digits
        doubt[0] = choose(pivot > 1e-9 * diagonal[k], doubt[0], 1.0)
        pivot = 1.0 / math.sqrt(pivot)
        inertia[k, k] = pivot
        a = parent[k]
        while a > 0:
            inertia[k, a] *= pivot
            a = parent[a]
        a = parent[k]
        while a > 0:
            left, b = inertia[k, a], a
            while b > 0:
                inertia[a, b] -= left * inertia[k, b]
                b = parent[b]
            a = parent[a]


@njit
def whiten(parent, carries, lower, rows):  # type: ignore[no-untyped-def]
    r"""Replace the rows of :math:`J^T` by those of :math:`W = L^{-T} J^T`.

    Its product :math:`W^T W = J M^{-1} J^T` is the Delassus matrix; `lower` is L of `factorize`.
    """
    for k in range(len(parent) - 1, 0, -1):
        if not carries[k]:
            continue
        for c in range(rows.shape[1]):
            own = rows[k, c] * lower[k, k]
            rows[k, c] = own
            a = parent[k]
            while a > 0:
                rows[a, c] -= lower[k, a] * own
                a = parent[a]


@njit
def solve_velocity(parent, lower, v, doubt):  # type: ignore[no-untyped-def]
    r"""Replace :math:`z` by the joint velocity :math:`v = L^{-1} z`.

    A relative error e of M's diagonal changes the energy :math:`v^T M v = z^T z` by about
    :math:`e \sum_i M_{ii} v_i^2`: where this is more than `LOSS` times the energy, too few digits
    are left. `lower` is L of `factorize`; z and v are `n + 1` batches.
    """
    whole, parts = spread(0.0), spread(0.0)
    for k in range(1, len(parent)):
        own, a = v[k], parent[k]
        whole += own * own
        while a > 0:
            own = own - lower[k, a] * v[a]
            a = parent[a]
        own = own * lower[k, k]
        parts += lower[0, k] * (own * own)
        v[k] = own
    doubt[0] = choose(parts <= LOSS * whole, doubt[0], 1.0)


KEPT = 1e-3
"""Share that a difference must keep of its terms, or the posture is doubtful."""

NEAR = 1e-6
"""The same of the square of a direction that is made orthogonal to others."""

D11, D12, D22, D13, D23, D33 = range(6)
"""Rows of the Delassus matrix: entries along first tangent (1), second tangent (2), normal (3)."""


@njit
def delassus_matrix(carries, rows, delassus):  # type: ignore[no-untyped-def]
    r"""Fill in the Delassus matrix of the foot, :math:`G = W^T W`, from whitened rows.

    In a plane the entries of the second tangent stay 0.
    """
    d11, d12, d22 = spread(0.0), spread(0.0), spread(0.0)
    d13, d23, d33 = spread(0.0), spread(0.0), spread(0.0)
    for k in range(1, len(carries)):
        if not carries[k]:
            continue
        s, n = rows[k, 0], rows[k, rows.shape[1] - 1]
        d11 += s * s
        d13 += s * n
        d33 += n * n
        if rows.shape[1] == 3:
            t = rows[k, 1]
            d12 += s * t
            d22 += t * t
            d23 += t * n
    delassus[D11], delassus[D12], delassus[D22] = d11, d12, d22
    delassus[D13], delassus[D23], delassus[D33] = d13, d23, d33


@njit
def solve_impact(delassus, across, along, speed, e, mu, impulse, lost, doubt):  # type: ignore[no-untyped-def]
    r"""Fill in the impulse on the ball and the energy lost [J], law `newton`.

    With the ball's mobility on its diagonal, :math:`G` maps the impulse :math:`p` to the change of
    the relative velocity. Sticking asks for no tangential velocity and Newton's restitution along
    the normal, :math:`G p = (0, 0, (1 + e) v)`: the tangential parts over the normal one,
    :math:`s = p_1 / p_3` and :math:`t = p_2 / p_3`, solve the first two rows. In a plane
    (:math:`t = 0`), slipping cuts :math:`s` to :math:`\pm\mu`; out of it, `solve_slip` follows. See
    `kickdyn.impact.newton_law` for one posture. Doubtful is where terms cancel: a foot much lighter
    than the ball, which moves easily along one direction.
    """
    push = (1.0 + e) * speed
    g11, g12, g22 = delassus[D11] + across, delassus[D12], delassus[D22] + across
    g13, g23, g33 = delassus[D13], delassus[D23], delassus[D33] + along
    share = g12 / g11  # Cholesky's order: Cramer's rule would lose digits twice
    h22, h23 = g22 - share * g12, g23 - share * g13
    t = -h23 / h22
    s = -(g13 + g12 * t) / g11
    sticks = s * s + t * t <= mu * mu
    flat = (g12 == 0.0) & (g23 == 0.0) | (mu == 0.0)
    s = choose(flat, min(max(s, -mu), mu), s)
    t = choose(flat, 0.0, t)
    resistance = g33 + (g13 * s + g23 * t)
    sound = (resistance > KEPT * g33) & (flat | (h22 > KEPT * g22))
    doubt[0] = choose(sound, doubt[0], 1.0)
    p = push / resistance
    sliding = choose(sticks, 0.0, (g11 * s + g13) * p)
    impulse[0], impulse[1], impulse[2] = s * p, t * p, p
    lost[0] = 0.5 * p * (speed * (1.0 - e) - s * sliding)


@njit
def solve_slip(delassus, across, along, speed, e, mu, impulse, lost, doubt):  # type: ignore[no-untyped-def]
    """Put impulses that leave the friction cone on it, out of a plane.

    Arguments as before, but arrays of floats whose last axis has the `BATCH` postures.
    """
    for i in range(BATCH):
        g12, g23 = delassus[D12, i], delassus[D23, i]
        s, t, most = impulse[0, i], impulse[1, i], mu * impulse[2, i]
        if s * s + t * t <= most * most or (g12 == 0.0 and g23 == 0.0) or doubt[0, i] > 0.0:
            continue
        g11, g22 = delassus[D11, i] + across, delassus[D22, i] + across
        g13, g33 = delassus[D13, i], delassus[D33, i] + along
        found = _slip_impulse(
            g11, g12, g22, g13, g23, g33, (1.0 + e) * speed, mu, speed * (1.0 - e)
        )
        impulse[0, i], impulse[1, i], impulse[2, i], lost[0, i] = found


@_allocating
def _slip_impulse(g11, g12, g22, g13, g23, g33, push, mu, parting):  # type: ignore[no-untyped-def]
    r"""Return impulse on the friction cone and energy lost.

    The friction :math:`p_3 \mu (\cos a, \sin a)` opposes the sliding velocity, which is the first
    two rows of :math:`G p`: their cross product vanishes, a sum of waves of :math:`a` and
    :math:`2a`. Of its roots that oppose, the one that loses most energy is taken, as
    `kickdyn.impact.newton_law` does.
    """
    cos1, sin1, cos2, sin2 = -g23, g13, -mu * g12, 0.5 * mu * (g11 - g22)
    best = (math.nan, math.nan, math.nan, -math.inf)
    for angle in _roots(cos1, sin1, cos2, sin2):
        for _ in range(3):
            c, s = math.cos(angle), math.sin(angle)
            c2, s2 = c * c - s * s, 2.0 * c * s
            value = cos1 * c + sin1 * s + cos2 * c2 + sin2 * s2
            slope = -cos1 * s + sin1 * c + 2.0 * (sin2 * c2 - cos2 * s2)
            angle -= value / slope if slope != 0.0 else 0.0
        s, t = mu * math.cos(angle), mu * math.sin(angle)
        resistance = g13 * s + g23 * t + g33
        p = push / resistance
        slide_s, slide_t = (g11 * s + g12 * t + g13) * p, (g12 * s + g22 * t + g23) * p
        if resistance <= 0.0 or slide_s * s + slide_t * t > 0.0:
            continue
        lost = 0.5 * p * (parting - (s * slide_s + t * slide_t))
        if lost > best[3]:
            best = (s * p, t * p, p, lost)
    return best


@_allocating
def _roots(cos1, sin1, cos2, sin2):  # type: ignore[no-untyped-def]
    r"""Return every angle a with :math:`c_1 \cos a + s_1 \sin a + c_2 \cos 2a + s_2 \sin 2a = 0`.

    These are the roots on the unit circle of a quartic in :math:`e^{ia}`, eigenvalues of its
    companion matrix; `np.roots`, which does the same, takes seconds to compile. They are accurate
    enough to begin Newton's iteration with.
    """
    angles, count = np.empty(4), 0
    if max(abs(cos2), abs(sin2)) <= 1e-17 * max(abs(cos1), abs(sin1)):
        angles[0], angles[1] = math.atan2(-cos1, sin1), math.atan2(cos1, -sin1)
        return angles[:2]
    first, companion = complex(cos2, -sin2), np.zeros((4, 4), np.complex128)
    companion[0, 0], companion[0, 2] = -complex(cos1, -sin1) / first, -complex(cos1, sin1) / first
    companion[0, 3] = -complex(cos2, sin2) / first
    companion[1, 0] = companion[2, 1] = companion[3, 2] = 1.0
    for root in np.linalg.eigvals(companion):
        if abs(abs(root) - 1.0) < 1e-4:
            angles[count] = math.atan2(root.imag, root.real)
            count += 1
    return angles[:count]


@njit
def doubt_singular(delassus, flat, doubt):  # type: ignore[no-untyped-def]
    """Set `doubt` to 1 where the foot can hardly move along the normal alone, or across it."""
    d11, d12, d22 = delassus[D11], delassus[D12], delassus[D22]
    d13, d23, d33 = delassus[D13], delassus[D23], delassus[D33]
    share = d12 / d11
    h22, h23 = d22 - share * d12, d23 - share * d13
    square, sound = d33 - d13 / d11 * d13, d11 > NEAR * d33
    if not flat:
        square = square - h23 / h22 * h23
        sound = sound & (d22 > NEAR * d33) & (h22 > NEAR * d22)
    sound = sound & (square > NEAR * max(max(d11, d22), d33))
    doubt[0] = choose(sound, doubt[0], 1.0)
