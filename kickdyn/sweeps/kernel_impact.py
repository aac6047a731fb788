"""From the joint-space inertia and the Jacobian to the impulse, many postures at once.

Whatever depends on the posture is a batch of `BATCH` postures, see `kickdyn.core.simd`.

The functions have these arguments in common; joints count from 1, as Pinocchio's do:

    tree, task: constants of the joints and of the kick, see `kernel.JOINT` and `kernel.TASK`.
    bodies: what is computed of each joint, see `kernel_dynamics`.
    inertia: M, shape `(n + 1, n + 1)`, lower triangle.
    state: what is computed of each posture, see `STATE`.
"""

import math

import numpy as np

from kickdyn.core.simd import BATCH, choose, spread
from kickdyn.sweeps.kernel_dynamics import cross, dot, inlined, njit
from kickdyn.sweeps.sweep_kick import ROUNDING, UNLIMITED

STATE = np.dtype(
    [
        ("number", float, BATCH),  # 0, 1, 2 ... within the batch; given
        ("point", float, (3, BATCH)),  # contact point from the origin of the foot's joint [m]
        ("jacobian_square", float, BATCH),  # sum of squares of the contact point's Jacobian
        ("delassus", float, (6, BATCH)),  # Delassus matrix of the foot [1/kg]
        ("impulse", float, (3, BATCH)),  # on the ball along both tangents and the normal [N s]
        ("energy_lost", float, BATCH),  # [J]
        ("speed_use", float, BATCH),  # least possible largest joint speed over its limit
        ("doubt", float, BATCH),  # 1 where digits are lost, else 0
        ("foot_jump", float, BATCH),  # of the foot's velocity along the normal [m/s]
        ("largest_square", float, BATCH),  # of the linear impulse in a joint [N2 s2]
        ("momentum_error", float, BATCH),  # largest residual of the momentum balance
    ]
)
"""What is computed of each posture."""

D11, D12, D22, D13, D23, D33 = range(6)
"""Entries of the Delassus matrix along first tangent (1), second tangent (2) and normal (3)."""

LARGEST_AMPLIFICATION = 300.0
"""Amplification of the rounding of M in the energy of a joint velocity up to which 1e-12 is kept;
legs have about 10, and a link before one ten times as long some hundreds."""

LEAST_DIFFERENCE = 1e-3
"""Share that a difference must keep of its terms, or the posture is doubtful."""

LEAST_SQUARE = 1e-6
"""Share that the square of a direction must keep as it is made orthogonal to others."""

LEAST_PIVOT = 1e-9
"""Share that a pivot must keep of its diagonal entry of M, or it has lost its digits."""


@njit
def factorize(tree, inertia, state):  # type: ignore[no-untyped-def]
    r"""Factorize the joint-space inertia in place, :math:`M = L^T D L` with unit triangular L.

    In this order, from the tip to the base, L has an entry only where one joint carries the other:
    the branches of a tree cost nothing to each other (Featherstone, Rigid Body Dynamics Algorithms,
    2008, table 6.3). L is left in `inertia`, with :math:`D^{-1}` on its diagonal; row 0, of the
    base, becomes the diagonal of M.
    """
    diagonal = inertia[0]  # of no joint: free to keep M's diagonal
    for k in range(1, len(tree)):
        diagonal[k] = inertia[k, k]
    for k in range(len(tree) - 1, 0, -1):
        pivot = inertia[k, k]
        state.doubt = choose(pivot > LEAST_PIVOT * diagonal[k], state.doubt, 1.0)
        inverse = 1.0 / pivot
        inertia[k, k] = inverse
        a = tree[k].parent
        while a > 0:
            entry, b = inertia[k, a] * inverse, a
            while b > 0:
                inertia[a, b] -= entry * inertia[k, b]
                b = tree[b].parent
            inertia[k, a] = entry
            a = tree[a].parent


@njit
def whiten(tree, bodies, factors, task):  # type: ignore[no-untyped-def]
    r"""Replace the rows of :math:`J^T` by the rows of :math:`W = L^{-T} J^T`.

    Then :math:`W^T D^{-1} W = J M^{-1} J^T` is the Delassus matrix; `factors` are L and
    :math:`D^{-1}` of `factorize`.
    """
    for k in range(len(tree) - 1, 0, -1):
        if not tree[k].carries_foot:
            continue
        row = bodies[k].jacobian
        for i in range(0, 3, 2 if task.planar else 1):
            a = tree[k].parent
            while a > 0:
                bodies[a].jacobian[i] -= factors[k, a] * row[i]
                a = tree[a].parent


@njit
def delassus_matrix(tree, bodies, factors, state):  # type: ignore[no-untyped-def]
    """Fill in the Delassus matrix of the foot from whitened rows."""
    d11, d12, d22 = spread(0.0), spread(0.0), spread(0.0)
    d13, d23, d33 = spread(0.0), spread(0.0), spread(0.0)
    for k in range(1, len(tree)):
        if not tree[k].carries_foot:
            continue
        row, inverse = bodies[k].jacobian, factors[k, k]
        s, t, n = row[0], row[1], row[2]
        scaled_s, scaled_t = inverse * s, inverse * t
        d11 += scaled_s * s
        d12 += scaled_s * t
        d13 += scaled_s * n
        d22 += scaled_t * t
        d23 += scaled_t * n
        d33 += inverse * n * n
    delassus = state.delassus
    delassus[D11], delassus[D12], delassus[D22] = d11, d12, d22
    delassus[D13], delassus[D23], delassus[D33] = d13, d23, d33


@njit
def solve_impact(task, state):  # type: ignore[no-untyped-def]
    r"""Fill in the impulse on the ball and the energy lost, law `newton`.

    With the ball's mobility on its diagonal, :math:`G` maps the impulse :math:`p` to the change of
    the relative velocity. Sticking asks for no tangential velocity and Newton's restitution along
    the normal, :math:`G p = (0, 0, (1 + e) v)`: the tangential parts over the normal one,
    :math:`s = p_1 / p_3` and :math:`t = p_2 / p_3`, solve the first two rows. In a plane
    (:math:`t = 0`), slipping cuts :math:`s` to :math:`\pm\mu`; out of it, `solve_slip` follows.
    Postures in which terms cancel are doubtful: a foot much lighter than the ball.
    """
    delassus, mu, e = state.delassus, task.friction, task.restitution
    g11, g12 = delassus[D11] + task.tangent_mobility, delassus[D12]
    g22, g13 = delassus[D22] + task.tangent_mobility, delassus[D13]
    g23, g33 = delassus[D23], delassus[D33] + task.normal_mobility
    inverse = 1.0 / g11
    ratio = g12 * inverse  # Cholesky's order: Cramer's rule would lose digits twice
    h22, h23 = g22 - ratio * g12, g23 - ratio * g13
    t = -h23 / h22
    s = -(g13 + g12 * t) * inverse
    sticks = s * s + t * t <= mu * mu
    flat = (g12 == 0.0) & (g23 == 0.0) | (mu == 0.0)
    s = choose(flat, min(max(s, -mu), mu), s)
    t = choose(flat, 0.0, t)
    resistance = g33 + (g13 * s + g23 * t)
    sound = (resistance > LEAST_DIFFERENCE * g33) & (flat | (h22 > LEAST_DIFFERENCE * g22))
    state.doubt = choose(sound, state.doubt, 1.0)
    p = (1.0 + e) * task.speed / resistance
    sliding = choose(sticks, 0.0, (g11 * s + g13) * p)
    state.impulse[0], state.impulse[1], state.impulse[2] = s * p, t * p, p
    state.energy_lost = 0.5 * p * (task.speed * (1.0 - e) - s * sliding)


@njit
def solve_slip(task, state):  # type: ignore[no-untyped-def]
    """Put impulses that leave the friction cone on it, out of a plane.

    The foot arrives along the normal, so that one direction of slip is possible. The fields of
    `state` are arrays of `BATCH` floats here.
    """
    delassus, impulse, mu, e = state.delassus, state.impulse, task.friction, task.restitution
    for i in range(BATCH):
        g12, g13, g23 = delassus[D12, i], delassus[D13, i], delassus[D23, i]
        s, t, largest = impulse[0, i], impulse[1, i], mu * impulse[2, i]
        sticks = s * s + t * t <= largest * largest
        if sticks or (g12 == 0.0 and g23 == 0.0) or state.doubt[i] > 0.0:
            continue
        g11 = delassus[D11, i] + task.tangent_mobility
        g22 = delassus[D22, i] + task.tangent_mobility
        x, y = slip_direction(mu * g11, mu * g12, mu * g22, g13, g23)
        s, t = mu * x, mu * y
        resistance = g13 * s + g23 * t + (delassus[D33, i] + task.normal_mobility)
        p = (1.0 + e) * task.speed / resistance if resistance > 0.0 else math.nan
        slide_s, slide_t = (g11 * s + g12 * t + g13) * p, (g12 * s + g22 * t + g23) * p
        impulse[0, i], impulse[1, i], impulse[2, i] = s * p, t * p, p
        dissipated = task.speed * (1.0 - e) - (s * slide_s + t * slide_t)
        state.energy_lost[i] = 0.5 * p * dissipated


@njit
def slip_direction(a11, a12, a22, g1, g2):  # type: ignore[no-untyped-def]
    r"""Return the unit vector :math:`d` of the friction where the foot slips.

    The friction :math:`\mu p_3 d` opposes the sliding velocity :math:`p_3 (A d + g)`, with
    :math:`A = \mu G` along the tangents and :math:`g` their coupling to the normal:
    :math:`(A + k) d = -g` with :math:`k \ge 0`. The length of d decreases with k and is above 1 at
    0, where the foot would stick, so that one k makes it 1. Newton's method on its inverse, which
    is concave, comes to that from below (Conn, Gould and Toint, Trust-Region Methods, 2000,
    chapter 7).
    """
    k = max(0.0, math.sqrt(g1 * g1 + g2 * g2) - (a11 + a22))
    x, y, size = 0.0, 0.0, 1.0
    for _ in range(60):
        b11, b22 = a11 + k, a22 + k
        determinant = b11 * b22 - a12 * a12
        x, y = (a12 * g2 - b22 * g1) / determinant, (a12 * g1 - b11 * g2) / determinant
        size = math.sqrt(x * x + y * y)
        decrease = (x * (b22 * x - a12 * y) + y * (b11 * y - a12 * x)) / determinant
        step = (size - 1.0) * size * size / decrease
        k += step
        if not step > 1e-16 * k:
            break
    return x / size, y / size


@njit
def doubt_singular(task, state):  # type: ignore[no-untyped-def]
    """Mark postures whose foot can hardly move along the normal alone, or across it."""
    delassus = state.delassus
    d11, d12, d22 = delassus[D11], delassus[D12], delassus[D22]
    d13, d23, d33 = delassus[D13], delassus[D23], delassus[D33]
    square, sound = d33 - d13 / d11 * d13, d11 > LEAST_SQUARE * d33
    if not task.planar:
        ratio = d12 / d11
        h22, h23 = d22 - ratio * d12, d23 - ratio * d13
        square = square - h23 / h22 * h23
        sound = sound & (d22 > LEAST_SQUARE * d33) & (h22 > LEAST_SQUARE * d22)
    sound = sound & (square > LEAST_SQUARE * max(max(d11, d22), d33))
    state.doubt = choose(sound, state.doubt, 1.0)


@njit
def solve_velocity(tree, bodies, factors, state):  # type: ignore[no-untyped-def]
    r"""Fill in the jump of the joints' velocity, :math:`v = L^{-1} z` with :math:`D z = -W p`.

    A relative error e of M's diagonal changes the energy :math:`v^T M v = z^T D z` by about
    :math:`e \sum_i M_{ii} v_i^2`: where this is more than `LARGEST_AMPLIFICATION` times the energy,
    too few digits are left. `factors` are L and :math:`D^{-1}` of `factorize`.
    """
    impulse, energy, terms = state.impulse, spread(0.0), spread(0.0)
    for k in range(1, len(tree)):
        row = bodies[k].jacobian
        pushed = -dot(row, impulse)
        v, a = pushed * factors[k, k], tree[k].parent
        energy += pushed * v
        while a > 0:
            v = v - factors[k, a] * bodies[a].jump
            a = tree[a].parent
        terms += factors[0, k] * (v * v)
        bodies[k].jump = v
    state.doubt = choose(terms <= LARGEST_AMPLIFICATION * energy, state.doubt, 1.0)


PARALLEL, ASKEW = ROUNDING**2, 1e-8
"""Squared sine of two columns up to which they count as parallel, and from which on their cross
product has digits enough; between them a posture is doubtful."""


@njit
def least_speed_use(tree, bodies, task, state):  # type: ignore[no-untyped-def]
    r"""Fill in the least possible value of the largest joint speed over its limit.

    `sweep_kick.slowest_joint_velocity` solves the linear programme
    :math:`\min \max_i |v_i| / l_i` under :math:`J v = w` for one posture. Its dual is

    .. math:: \max_y \frac{w \cdot y}{\sum_i l_i |a_i \cdot y|}

    with :math:`a_i` the columns of :math:`J`. The maximum lies at a :math:`y` that is orthogonal to
    as many columns as fix it, two in space and one in a plane, so that all candidates can be tried
    (Boyd and Vandenberghe, Convex Optimization, 2004, chapter 5). A call of `linprog` takes a
    millisecond.
    """
    movers, limited, least = 0, 0, math.inf
    for k in range(1, len(tree)):
        if tree[k].carries_foot and tree[k].speed_limit > 0.0:
            movers += 1
            limited += 1 if tree[k].speed_limit <= UNLIMITED else 0
            least = min(least, tree[k].speed_limit)
    state.speed_use = 0.0
    if limited > 0:
        for j in range(1, len(tree)):
            if not tree[j].carries_foot:
                continue
            if task.planar:
                column = bodies[j].jacobian
                y = -column[2], spread(0.0), spread(0.0) + column[0]
                _raise_speed_use(tree, bodies, task, state, least, y)
                continue
            for k in range(j + 1, len(tree)):
                if tree[k].carries_foot:
                    y = _orthogonal(bodies[j].jacobian, bodies[k].jacobian, state)
                    _raise_speed_use(tree, bodies, task, state, least, y)
    if movers < (2 if task.planar else 3):
        state.doubt = 1.0
    # from there on, the foot can hardly move so
    state.doubt = choose(state.speed_use < 1e9, state.doubt, 1.0)


@inlined
def _orthogonal(a, b, state):  # type: ignore[no-untyped-def]
    """Return the vector product of two columns, 0 where they are parallel."""
    x, y, z = across = cross(a, b)
    sine_square = dot(across, across) / (dot(a, a) * dot(b, b))
    doubtful = (sine_square > PARALLEL) & (sine_square < ASKEW)
    state.doubt = choose(doubtful, 1.0, state.doubt)
    askew = choose(sine_square >= ASKEW, 1.0, 0.0)
    return askew * x, askew * y, askew * z


@njit
def _raise_speed_use(tree, bodies, task, state, least, y):  # type: ignore[no-untyped-def]
    r"""Raise the speed use to the value of a candidate :math:`y`, if that is larger.

    The foot's velocity is along the normal, so that :math:`w \cdot y` is its speed times the last
    entry of y. `least` is the smallest speed limit above 0.
    """
    capacity = spread(0.0)
    for k in range(1, len(tree)):
        limit, a = tree[k].speed_limit, bodies[k].jacobian
        if not tree[k].carries_foot or limit == 0.0:
            continue
        along = math.fabs(dot(a, y))
        if limit > 1e3 * least:  # its product with a rounding error may count beside other joints
            limit = limit if limit <= UNLIMITED else math.inf
            moves = along > ROUNDING * math.sqrt(dot(a, a) * dot(y, y))
            capacity += choose(moves, limit * along, 0.0)
        else:
            capacity += limit * along
    gain = task.speed * math.fabs(y[2])
    state.speed_use = max(state.speed_use, choose(gain > 0.0, gain / capacity, 0.0))
