"""The impact of many strikes in machine code, by the law `newton`.

`BATCH` strikes go side by side, each with its own posture, velocity, contact and ball, see
`kickdyn.core.lanes`. What is not computed to full precision is marked as doubtful.
"""

import math
from typing import Any

import numpy as np

from kickdyn.core import lanes as lanes_module
from kickdyn.core.compilation import OPTIONS, MachineCode, Source, named
from kickdyn.core.lanes import (
    BATCH,
    batches,
    choose,
    inlined,
    jitable,
    larger,
    magnitude,
    sine_and_cosine,
    smaller,
    spread,
    square_root,
)
from kickdyn.impact import newton_law
from kickdyn.impact.newton_law import (
    energy_lost,
    meet_circle,
    slip_conic,
    slip_impulse,
    stick_impulse,
)
from kickdyn.robot import tree_kernel
from kickdyn.robot.tree_kernel import (
    BODY,
    D11,
    D12,
    D13,
    D22,
    D23,
    D33,
    JOINT,
    STATE,
    add,
    cross,
    dot,
    put,
    scale,
    vector,
)

TASK = np.dtype([("foot", np.int64), ("planar", np.bool_)], align=True)
"""The joint that carries the contact point; motion is never taken to be in a plane."""

AXES, LEVER, CENTRE, VELOCITY, SPIN, RADIUS = 0, 9, 12, 15, 18, 21
RESTITUTION, FRICTION, INVERSE_MASS, TURNING, GIVEN = 22, 23, 24, 25, 26
"""Rows of what is given of each strike: two tangents and the normal, contact point in the frame of
the foot's joint [m], centre of the ball from the contact point, from the first joint on [m],
velocity [m/s] and spin [rad/s] of the ball, its radius [m], restitution, friction, inverse mass
[1/kg], what the ball's rotation adds to the mobility along the tangents [1/kg]; their number."""

IMPULSE, BALL_VELOCITY, BALL_SPIN, BALL_POSITION = 0, 3, 6, 9
APPROACH, LOST, FIRST = 12, 13, 14
"""Columns of an answer: impulse on the ball [N s], velocity [m/s], spin [rad/s] and centre of the
ball [m], speed of approach [m/s], energy lost [J]; velocity of each joint, and the linear and
angular impulse in each joint, in its frame."""

STICK, SLIDE, PARTING, ANEW = 0.0, 1.0, 2.0, 3.0
"""Flags of an answer: points stick, or slip, foot and ball do not approach, or the strike is to be
computed anew."""

SLOWEST, FASTEST = 1e-100, 1e100
"""Least and largest speed of approach [m/s] whose squares are numbers; other strikes are to be
computed anew."""

ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Share of what cancels in the speed of approach that is rounding, as in `find_approach`."""

LEAST_SHARE = 1e-12
"""Share that a pivot or a resistance must keep of its terms, or the strike is doubtful."""

LEAST_RESISTANCE = 1e-10
"""Share of its mobility along the normal that a contact must resist with, or it is doubtful."""

BORDER, CONVERGED, ENOUGH = 1e-9, 1e-8, 0.01
"""Share by which the impulse for sticking must lie outside the cone, last turn [rad] of Newton's
method, and share that the resistance must keep of its terms, for `slip_batch` to solve a lane."""

jitable(slip_impulse), jitable(slip_conic), jitable(meet_circle)
inlined(stick_impulse), inlined(energy_lost)


@inlined
def with_ball(delassus, ball):  # type: ignore[no-untyped-def]
    """Return the Delassus matrix with the mobility of the ball across and along the normal."""
    across, along = ball
    return (
        delassus[D11] + across, delassus[D12], delassus[D22] + across, delassus[D13],
        delassus[D23], delassus[D33] + along,
    )  # fmt: skip


@jitable
def solve_newton_batch(state, ball, u, contact, least):  # type: ignore[no-untyped-def]
    """Fill in the impulse in the contact's axes by the law `newton` if points stick, or in a plane.

    Where the foot arrives along the normal and nothing couples it across a plane, friction that
    does not suffice is at its largest. The result is doubtful unless pivots and resistance keep at
    least a share `least` of their terms.
    Returned is 1 where the points stick; `slips` is set where the direction of their slip is to be
    found, see `slip_batch` and `slip_of_lane`.

    The state has the Delassus matrix of the foot, `ball` its own mobility across and along the
    normal [1/kg], and `contact` restitution and friction; u is the velocity of the ball over the
    foot [m/s].
    """
    (e, mu), g = contact, with_ball(state.delassus, ball)
    g11, g12, g22, g13, g23, g33 = g
    (p1, p2, p3), (s, _), (h22, h33) = stick_impulse(g, u, e)
    rubs, most = spread(0.0) + mu > 0.0, mu * p3
    sticks = rubs & (p3 >= 0.0) & (p1 * p1 + p2 * p2 <= most * most)
    straight = (g12 == 0.0) & (g23 == 0.0) & (spread(0.0) + (u[0] * u[0] + u[1] * u[1]) == 0.0)
    level = choose(straight, 1.0, choose(rubs, 0.0, spread(1.0))) > 0.0
    s = smaller(larger(s, 0.0 - mu), mu)
    resistance = g33 + g13 * s
    p = (0.0 - (1.0 + e) * u[2]) / resistance
    resistance = choose(sticks, h33, choose(level, resistance, h33))
    sound = (resistance > least * g33) & (level | (h22 > least * g22))
    state.doubt = choose(sound, state.doubt, 1.0)
    impulse = choose(sticks, p1, s * p), choose(sticks, p2, 0.0), choose(sticks, p3, p)
    sliding = choose(sticks, 0.0, u[0] + (g11 * s + g13) * p)
    put(state.impulse, impulse)
    state.energy_lost = energy_lost(impulse, u, (sliding, 0.0), e)
    recedes = spread(0.0) + u[2] >= 0.0
    state.slips = choose(sticks | level | recedes, 0.0, choose(sound, 1.0, spread(0.0)))
    return choose(sticks, 1.0, spread(0.0))


@jitable
def slip_batch(state, ball, u, contact):  # type: ignore[no-untyped-def]
    r"""Fill in the impulse where the points slip and only one direction of slip is possible.

    With friction along the unit vector :math:`c`, and G split into tangential and normal parts,
    the impulse is :math:`p\, (\mu c, 1)` with :math:`p = -f / R` and the resistance
    :math:`R = g_{nn} + \mu\, g_n \cdot c > 0`. Points slide on against the friction if

    .. math:: R\, u_t^+ = M c + d = -\lambda c, \quad \lambda \ge 0, \quad
              M = \mu\, (u_t g_n^T - f G_{tt}), \quad d = g_{nn} u_t - f g_n, \quad
              f = (1 + e)\, u_n .

    Eliminating c leaves a polynomial of fourth degree in :math:`\lambda`, whose last coefficient
    is negative because the impulse for sticking lies outside the cone. If the signs of its
    coefficients change once, it has one positive root (Descartes' rule), so that any direction that
    Newton's method finds is the only one. `slips` remains set in the other lanes. The arguments are
    those of `solve_newton_batch`.
    """
    (e, mu), (u1, u2, u3) = contact, u
    g11, g12, g22, g13, g23, g33 = with_ball(state.delassus, ball)
    f = (1.0 + e) * u3
    m11, m12 = mu * (u1 * g13 - f * g11), mu * (u1 * g23 - f * g12)
    m21, m22 = mu * (u2 * g13 - f * g12), mu * (u2 * g23 - f * g22)
    d1, d2 = g33 * u1 - f * g13, g33 * u2 - f * g23
    trace, det, square = m11 + m22, m11 * m22 - m12 * m21, d1 * d1 + d2 * d2
    a1, a2 = m22 * d1 - m12 * d2, m11 * d2 - m21 * d1
    second, third = trace * trace + 2.0 * det - square, trace * det - (d1 * a1 + d2 * a2)
    single = (trace >= 0.0) & ((second >= 0.0) | (third <= 0.0))
    single = single | ((second <= 0.0) & (third <= 0.0))
    single = single & (a1 * a1 + a2 * a2 > (1.0 + BORDER) * (det * det))
    rate = larger(square_root(square) - 0.5 * trace, 0.0)  # exact if friction acts alike all round
    c, s = a1 + rate * d1, a2 + rate * d2
    size = -1.0 / square_root(c * c + s * s)
    c, s, turn = c * size, s * size, spread(0.0)
    for _ in range(5):
        x, y = m11 * c + m12 * s + d1, m21 * c + m22 * s + d2
        slope = c * (m22 * c - m21 * s - x) + s * (m11 * s - m12 * c - y)
        turn = (s * x - c * y) / slope
        c, s = c - s * turn, s + c * turn
        size = 1.5 - 0.5 * (c * c + s * s)  # 1 / length but for turn**4
        c, s = c * size, s * size
    resistance = mu * (g13 * c + g23 * s) + g33
    p = (0.0 - f) / resistance
    x, y = p * (mu * (g11 * c + g12 * s) + g13) + u1, p * (mu * (g12 * c + g22 * s) + g23) + u2
    enough = resistance > ENOUGH * (mu * (magnitude(g13) + magnitude(g23)) + g33)
    converged = magnitude(turn) + magnitude(size - 1.0) <= CONVERGED
    solved = (state.slips > 0.0) & single & enough & converged & (c * x + s * y <= 0.0)
    impulse = mu * p * c, mu * p * s, p
    for i in range(3):
        state.impulse[i] = choose(solved, impulse[i], state.impulse[i])
    lost = energy_lost(impulse, u, (x, y), e)
    state.energy_lost = choose(solved, lost, state.energy_lost)
    state.slips = choose(solved, 0.0, state.slips)


@inlined
def slip_of_lane(floats, g, u, contact, directions, i):  # type: ignore[no-untyped-def]
    """Fill in the impulse of lane i where the points slip, see `slip_impulse`."""
    e, mu = contact
    impulse, lost = slip_impulse(g, u, e, mu, directions)
    if not 0.0 < impulse[2] * (LEAST_RESISTANCE * g[5]) < -(1.0 + e) * u[2]:
        floats.doubt[i] = 1.0
    floats.impulse[0, i], floats.impulse[1, i], floats.impulse[2, i] = impulse
    floats.energy_lost[i] = lost


@jitable
def _slip(floats, given, g, i):  # type: ignore[no-untyped-def]
    """Fill in the impulse of lane i of batch g where the points slip in one of several ways."""
    inverse = given[INVERSE_MASS, g, i]
    ball = inverse + given[TURNING, g, i], inverse
    matrix = with_ball(floats.delassus[:, i], ball)
    contact = given[RESTITUTION, g, i], given[FRICTION, g, i]
    u = floats.velocity[0, i], floats.velocity[1, i], floats.velocity[2, i]
    directions = meet_circle(slip_conic(matrix, u, *contact))
    slip_of_lane(floats, matrix, u, contact, directions, i)


@jitable
def strike_batch(tree, frames, senses, task, given, given_floats, g, memory):  # type: ignore[no-untyped-def]
    """Fill in the answers of one batch of strikes; `given` is read at batch g.

    `memory` is what it works in: bodies, the matrix of inertia, state, its floats, and rows of
    joint angles, velocities, columns of the answer and the flag.
    """
    bodies, inertia, state, floats, row_of = memory
    n = len(tree)
    nv = n - 1
    result, first = row_of[2 * nv :], FIRST + nv
    width = len(result) - 1
    for k in range(1, n):
        if tree[k].slides:
            bodies[k].cosine = row_of[k - 1]
        else:
            bodies[k].sine, bodies[k].cosine = sine_and_cosine(row_of[k - 1])
    state.doubt = spread(0.0)
    tree_kernel.place_bodies(tree, bodies)
    tree_kernel.joint_space_inertia(tree, bodies, inertia)
    lever = given[LEVER, g], given[LEVER + 1, g], given[LEVER + 2, g]
    tree_kernel.contact_jacobian(tree, bodies, task, lever, state)
    a = (
        (given[AXES, g], given[AXES + 1, g], given[AXES + 2, g]),
        (given[AXES + 3, g], given[AXES + 4, g], given[AXES + 5, g]),
        (given[AXES + 6, g], given[AXES + 7, g], given[AXES + 8, g]),
    )
    velocity = given[VELOCITY, g], given[VELOCITY + 1, g], given[VELOCITY + 2, g]
    spin = given[SPIN, g], given[SPIN + 1, g], given[SPIN + 2, g]
    turned, radius = cross(spin, a[2]), given[RADIUS, g]
    w1 = velocity[0] - radius * turned[0]
    w2 = velocity[1] - radius * turned[1]
    w3 = velocity[2] - radius * turned[2]
    u1, u2, u3 = dot(a[0], (w1, w2, w3)), dot(a[1], (w1, w2, w3)), dot(a[2], (w1, w2, w3))
    size = magnitude(a[2][0]), magnitude(a[2][1]), magnitude(a[2][2])
    terms = dot(size, (magnitude(w1), magnitude(w2), magnitude(w3)))
    for k in range(1, n):
        row = bodies[k].jacobian
        if not tree[k].carries_foot:
            row[0], row[1], row[2] = 0.0, 0.0, 0.0
            continue
        column, speed = vector(row), row_of[nv + k - 1]
        x, y, z = dot(a[0], column), dot(a[1], column), dot(a[2], column)
        row[0], row[1], row[2] = x, y, z
        u1, u2, u3 = u1 - x * speed, u2 - y * speed, u3 - z * speed
        absolute = magnitude(column[0]), magnitude(column[1]), magnitude(column[2])
        terms = terms + 2.0 * magnitude(speed) * dot(size, absolute)
    put(state.velocity, (u1, u2, u3))
    inverse, turning = given[INVERSE_MASS, g], given[TURNING, g]
    tree_kernel.factorize(tree, inertia, state)
    tree_kernel.whiten(tree, bodies, inertia, task)
    tree_kernel.delassus_matrix(tree, bodies, inertia, state)
    contact = given[RESTITUTION, g], given[FRICTION, g]
    ball = inverse + turning, inverse
    sticks = solve_newton_batch(state, ball, (u1, u2, u3), contact, LEAST_SHARE)
    slip_batch(state, ball, (u1, u2, u3), contact)
    for i in range(floats.slips.size):
        if floats.slips[i] > 0.0:
            _slip(floats, given_floats, g, i)
    tree_kernel.solve_velocity(tree, bodies, inertia, state)
    s, t, p = state.impulse[0], state.impulse[1], state.impulse[2]
    impulse = add(add(scale(s, a[0]), scale(t, a[1])), scale(p, a[2]))
    put(state.impulse, impulse)
    tree_kernel.joint_impulses(tree, bodies, task, state)
    point = vector(state.point)
    k = task.foot
    while k > 0:
        point = add(point, vector(bodies[k].origin))
        k = tree[k].parent
    centre = given[CENTRE, g], given[CENTRE + 1, g], given[CENTRE + 2, g]
    put(result[IMPULSE:], impulse)
    put(result[BALL_VELOCITY:], add(velocity, scale(inverse, impulse)))
    put(result[BALL_SPIN:], add(spin, scale(turning / radius, cross(impulse, a[2]))))
    put(result[BALL_POSITION:], add(point, centre))
    result[APPROACH], result[LOST] = 0.0 - u3, state.energy_lost
    sound = (state.doubt == 0.0) & (magnitude(state.energy_lost) < math.inf)
    parting = (0.0 - u3 <= ROUNDING * terms) & (u3 < FASTEST)
    sound = sound & (0.0 - u3 > SLOWEST)
    result[width] = choose(parting, PARTING, choose(sound, SLIDE - sticks, ANEW))
    for k in range(1, n):
        result[FIRST + k - 1] = senses[k] * (row_of[nv + k - 1] + bodies[k].jump)
        _write(bodies[k].rotation, frames[k], bodies[k].force, result, first)
        _write(bodies[k].rotation, frames[k], bodies[k].torque, result, first + 3)
        first += 6
    first -= 6 * nv


@jitable
def _write(rotation, frame, rows, result, first):  # type: ignore[no-untyped-def]
    """Write a vector in the axes of its joint to rows of a result."""
    x, y, z = rows[0], rows[1], rows[2]
    u = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    v = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    w = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
    for r in range(3):
        result[first + r] = frame[r, 0] * u + frame[r, 1] * v + frame[r, 2] * w


def _strike(tree, frames, task, senses, given, motion, memory, answer):  # type: ignore[no-untyped-def]
    """Fill in the answers of strikes, `BATCH` at a time.

    `given` has the rows that the names above say, of one batch where all strikes share them. Joint
    angles and velocities, and answers with their flags, have a row for each strike. `memory` is
    what it works in: the bodies, the matrix of inertia, a `STATE`, and a batch of joint angles,
    velocities, columns of the answer and the flag. Rows where foot and ball part are nan.
    """
    (q, v), (answer, flags) = motion, answer
    bodies, inertia, state, floats_of = memory
    task, floats, count, given_floats = task[0], state[0], len(q), given
    batch = batches(bodies), batches(inertia), batches(state)[0], floats, batches(floats_of)
    given = batches(given)
    nv, width = len(tree) - 1, answer.shape[1]
    for c in range((count + BATCH - 1) // BATCH):
        g = c if given.shape[1] > 1 else 0
        for i in range(BATCH):
            row = min(BATCH * c + i, count - 1)
            for k in range(nv):
                floats_of[k, i] = senses[k + 1] * q[row, k]
                floats_of[nv + k, i] = senses[k + 1] * v[row, k]
        strike_batch(tree, frames, senses, task, given, given_floats, g, batch)
        for i in range(min(BATCH, count - BATCH * c)):
            flag, row, column = np.int8(floats_of[2 * nv + width, i]), BATCH * c + i, 2 * nv
            flags[row] = flag
            for r in range(width):
                answer[row, r] = math.nan if flag == PARTING else floats_of[column + r, i]


named(_strike, "strike", lanes_module, newton_law, tree_kernel)


def _source() -> Source:
    import numba  # here, because it takes long to import

    typeof: Any = numba.typeof
    tree, task, bodies, state = (typeof(np.zeros(1, dtype)) for dtype in (JOINT, TASK, BODY, STATE))
    vector, matrix, cube = numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]
    tuple_of: Any = numba.types.Tuple
    memory, motion = tuple_of((bodies, cube, state, matrix)), tuple_of((matrix, matrix))
    answer = tuple_of((matrix, numba.int8[::1]))
    signature = numba.void(tree, cube, task, vector, cube, motion, memory, answer)
    return Source(_strike, signature, OPTIONS)


KERNEL = MachineCode(_source, "the kernel of strikes", 7.0)
