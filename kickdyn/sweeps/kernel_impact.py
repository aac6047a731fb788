"""From the joint-space inertia and the Jacobian to the impulse, many postures at once.

Whatever depends on the posture is a batch of postures, see `kickdyn.core.lanes`.

The functions have these arguments in common; joints count from 1, as Pinocchio's do:

    tree, task: constants of the joints and of the kick, see `JOINT` and `kernel.TASK`.
    bodies: quantities of each joint, see `tree_kernel`.
    inertia: M, shape `(n + 1, n + 1)`, lower triangle.
    state: quantities of each posture, see `STATE`.
"""

import math

from kickdyn.core.lanes import (
    choose,
    inlined,
    jitable,
    larger,
    magnitude,
    smaller,
    spread,
    square_root,
)
from kickdyn.impact.contact_motion import slip_direction
from kickdyn.impact.newton_law import energy_lost, slip_impulse, stick_impulse
from kickdyn.robot.tree_kernel import D11, D12, D13, D22, D23, D33, cross, dot, vector
from kickdyn.sweeps.sweep_kick import ROUNDING, UNLIMITED

LEAST_DIFFERENCE = 1e-3
"""Share that a difference must keep of its terms, or the posture is doubtful."""

jitable(slip_direction), jitable(slip_impulse), inlined(stick_impulse), inlined(energy_lost)

LEAST_SQUARE = 1e-6
"""Share that the square of a direction must keep as it is made orthogonal to others."""


@jitable
def solve_impact(task, state):  # type: ignore[no-untyped-def]
    r"""Fill in the impulse on the ball and the energy lost, law `newton`.

    The foot arrives along the normal, so that friction stands in one proportion to the normal
    impulse. In a plane, slipping cuts it to :math:`\pm\mu`; out of it, `solve_slip` follows.
    Postures in which terms cancel are doubtful: a foot much lighter than the ball.
    """
    delassus, mu, e = state.delassus, task.friction, task.restitution
    g = (
        delassus[D11] + task.tangent_mobility, delassus[D12], delassus[D22] + task.tangent_mobility,
        delassus[D13], delassus[D23], delassus[D33] + task.normal_mobility,
    )  # fmt: skip
    g11, g12, g22, g13, g23, g33 = g
    _, (s, t), (h22, _) = stick_impulse(g, (0.0, 0.0, -task.speed), e)
    sticks = s * s + t * t <= mu * mu
    flat = (g12 == 0.0) & (g23 == 0.0) | (mu == 0.0)
    s = choose(flat, smaller(larger(s, -mu), mu), s)
    t = choose(flat, 0.0, t)
    resistance = g33 + (g13 * s + g23 * t)
    sound = (resistance > LEAST_DIFFERENCE * g33) & (flat | (h22 > LEAST_DIFFERENCE * g22))
    state.doubt = choose(sound, state.doubt, 1.0)
    p = (1.0 + e) * task.speed / resistance
    sliding = choose(sticks, 0.0, (g11 * s + g13) * p)
    state.impulse[0], state.impulse[1], state.impulse[2] = s * p, t * p, p
    lost = energy_lost((s * p, t * p, p), (0.0, 0.0, -task.speed), (sliding, 0.0), e)
    state.energy_lost = lost


@jitable
def solve_slip(task, state):  # type: ignore[no-untyped-def]
    """Put impulses that leave the friction cone on it, out of a plane.

    The foot arrives along the normal, so that one direction of slip is possible. The fields of
    `state` are arrays of floats here.
    """
    delassus, impulse, mu, e = state.delassus, state.impulse, task.friction, task.restitution
    for i in range(impulse.shape[1]):
        g12, g13, g23 = delassus[D12, i], delassus[D13, i], delassus[D23, i]
        s, t, largest = impulse[0, i], impulse[1, i], mu * impulse[2, i]
        sticks = s * s + t * t <= largest * largest
        if sticks or (g12 == 0.0 and g23 == 0.0) or state.doubt[i] > 0.0:
            continue
        g11, g22 = (
            delassus[D11, i] + task.tangent_mobility,
            delassus[D22, i] + task.tangent_mobility,
        )
        x, y, _ = slip_direction(mu * g11, mu * g12, mu * g22, g13, g23)
        g = g11, g12, g22, g13, g23, delassus[D33, i] + task.normal_mobility
        slip, lost = slip_impulse(g, (0.0, 0.0, -task.speed), e, mu, ((x, y),))
        impulse[0, i], impulse[1, i], impulse[2, i] = slip
        state.energy_lost[i] = lost


@jitable
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
    sound = sound & (square > LEAST_SQUARE * larger(larger(d11, d22), d33))
    state.doubt = choose(sound, state.doubt, 1.0)


PARALLEL, ASKEW = ROUNDING**2, 1e-8
"""Squared sine of two columns up to which they count as parallel, and from which on their cross
product has digits enough; between them a posture is doubtful."""


@jitable
def least_speed_use(tree, bodies, task, state):  # type: ignore[no-untyped-def]
    r"""Fill in the least possible value of the largest joint speed over its limit.

    `sweep_kick.slowest_joint_velocity` solves the linear programme
    :math:`\min \max_i |v_i| / l_i` under :math:`J v = w` for one posture. Its dual is

    .. math:: \max_y \frac{w \cdot y}{\sum_i l_i |a_i \cdot y|}

    with :math:`a_i` the columns of :math:`J` and w the foot's velocity less what a base that moves
    gives it. The maximum lies at a :math:`y` that is orthogonal to
    as many columns as fix it, two in space and one in a plane, so that all candidates can be tried
    (Boyd and Vandenberghe, Convex Optimization, 2004, chapter 5). A call of `linprog` takes a
    millisecond.
    """
    turned = cross(task.base_turn, vector(state.from_base))
    for i in range(3):
        state.needed[i] = (task.speed if i == 2 else 0.0) - (task.base_velocity[i] + turned[i])
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
                _raise_speed_use(tree, bodies, state, least, y)
                continue
            for k in range(j + 1, len(tree)):
                if tree[k].carries_foot:
                    y = _orthogonal(bodies[j].jacobian, bodies[k].jacobian, state)
                    _raise_speed_use(tree, bodies, state, least, y)
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


@jitable
def _raise_speed_use(tree, bodies, state, least, y):  # type: ignore[no-untyped-def]
    r"""Raise the speed use to the value of a candidate :math:`y`, if that is larger.

    w is the velocity that the joints must give the contact point, and `least` the smallest speed
    limit above 0.
    """
    capacity = spread(0.0)
    for k in range(1, len(tree)):
        limit, a = tree[k].speed_limit, bodies[k].jacobian
        if not tree[k].carries_foot or limit == 0.0:
            continue
        along = magnitude(dot(a, y))
        if limit > 1e3 * least:  # its product with a rounding error may count beside other joints
            limit = limit if limit <= UNLIMITED else math.inf
            moves = along > ROUNDING * square_root(dot(a, a) * dot(y, y))
            capacity += choose(moves, limit * along, 0.0)
        else:
            capacity += limit * along
    gain = magnitude(dot(state.needed, y))
    state.speed_use = larger(state.speed_use, choose(gain > 0.0, gain / capacity, 0.0))
