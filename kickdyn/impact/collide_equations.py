"""Equations of contacts that take time, `BATCH` side by side, in machine code.

They are of `CompliantContact` for a tree of hinges and slides, and the force of a spring,
`ForceModel`; `kickdyn.impact.contact_motion` has the relative motion and the friction of both.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import math

from kickdyn.core.lanes import BATCH, choose, inlined, jitable, sine_and_cosine, spread
from kickdyn.impact import contact_motion, force_model
from kickdyn.impact.compliant_contact import STARTING, Friction
from kickdyn.impact.integrate_contact import BEYOND_SEPARATION
from kickdyn.robot.tree_kernel import (
    D11,
    D12,
    D13,
    D22,
    D23,
    contact_jacobian,
    cross,
    delassus_matrix,
    factorize,
    joint_space_inertia,
    place_bodies,
    velocity_torques,
    whiten,
    whiten_torques,
)

# Rows of a lane that are given: contact axes in the frame of the foot's joint (two tangents and the
# normal), from the joint's origin to the contact point along them [m], centre of the ball from the
# first joint [m], and what the names say.
AXES, ARM, CENTRE, INVERSE_MASS, INVERSE_INERTIA, RADIUS, FRICTION = 0, 9, 12, 15, 16, 17, 18
STIFFNESS, SHARE, EXPONENT, RATE, RESTING, SPEED, EXPECTED, FIRST = range(19, 27)
ENERGY, SPIN, KIND, ALONG, LARGEST = 27, 28, 29, 30, 32
# Rows that are computed: height, sliding (3), its acceleration without friction or joints that
# accelerate (2), acceleration of the contact point along the tangents without contact (2), force on
# the ball (3), power lost, what falls to 0 at the ends of the phase (3), what falls to 0 where
# sticking ends, deflection, largest friction.
HEIGHT, SLIDING, FREE, PUSHED, FORCE, LOST = 33, 34, 37, 39, 41, 44
ENDS, LEFT, DEFLECTION, MOST_FRICTION = 45, 48, 49, 50
# Rows of the integration: time, step, last whole step, energy at first contact, a bracket of the
# step to an end of a phase with the values there, which end it is, 1 after a rejected step,
# evaluations, what is left of the ends at the beginning of a step (3), longest step of points that
# come to rest.
TIME, STEP, WHOLE, BEFORE, LOW, LOW_VALUE, HIGH, HIGH_VALUE = range(51, 59)
WHICH, REJECTED, CALLS, BEGIN, REST = 59, 60, 61, 62, 65
START = 66
"""First row that depends on the leg: angles of the joints (or slides) at first contact, the speeds
that scale them, and the first column: as `CompliantContact` has them."""

RESULT = 5
"""Rows of an answer before the last column: 1 where the points stick at separation, 2 where it is
doubtful, 3 where the foot reaches the centre of the ball, else 0; contact time [s], largest
deflection [m], energy that is not accounted for [J] and evaluations."""

MOST_CALLS = 20_000
"""Evaluations of one contact after which it is left to `collide`."""

BRIEF = 0.02, 1e-4
"""Time in which points come to rest, relative to the expected contact time, that one step may go
beyond: where they slide straight, and where they turn, which takes ever shorter steps."""

SLIPS, STICKS, STARTS = (float(kind.value) for kind in Friction)

_contact_motion = inlined(contact_motion.contact_motion)
_free_sliding = inlined(contact_motion.free_sliding)
_slipping_force = inlined(contact_motion.slipping_force)
_sticking_force = inlined(contact_motion.sticking_force)
_slip_end = inlined(contact_motion.slip_end)
_slip_direction = jitable(contact_motion.slip_direction)
_spring = inlined(force_model.hysteretic_spring)


@inlined
def _along(axes, first, v):
    """Return the components of a vector along three axes in nine rows."""
    a, x, y, z = first, v[0], v[1], v[2]
    return (
        axes[a] * x + axes[a + 1] * y + axes[a + 2] * z,
        axes[a + 3] * x + axes[a + 4] * y + axes[a + 5] * z,
        axes[a + 6] * x + axes[a + 7] * y + axes[a + 8] * z,
    )


@inlined
def _of_axes(axes, first, v):
    """Return the vector whose components along three axes in nine rows are given."""
    a, x, y, z = first, v[0], v[1], v[2]
    return (
        axes[a] * x + axes[a + 3] * y + axes[a + 6] * z,
        axes[a + 1] * x + axes[a + 4] * y + axes[a + 7] * z,
        axes[a + 2] * x + axes[a + 5] * y + axes[a + 8] * z,
    )


@inlined
def from_first_joint(tree, bodies, k):
    """Return the origin of a joint's body from the first joint."""
    origin = bodies[k].origin
    x, y, z = origin[0], origin[1], origin[2]
    k = tree[k].parent
    while k > 0:
        origin = bodies[k].origin
        x, y, z = x + origin[0], y + origin[1], z + origin[2]
        k = tree[k].parent
    return x, y, z


@jitable
def place(tree, lanes, column, bodies):
    """Place the bodies by a column of the integrator."""
    for k in range(1, len(tree)):
        angle = lanes[START + k - 1] + column[k - 1]
        if tree[k].slides:
            bodies[k].cosine = angle
        else:
            bodies[k].sine, bodies[k].cosine = sine_and_cosine(angle)
    place_bodies(tree, bodies)


@jitable
def contact_terms(tree, task, torque, lanes, column, memory):
    """Fill in what the forces follow from: rows `HEIGHT` to `PUSHED`, Jacobian and Delassus matrix.

    The inertia is factorized, and the torques `free` are whitened.
    """
    turned, bodies, motion, inertia, state = memory
    n = len(tree)
    nv = n - 1
    place(tree, lanes, column, bodies)
    for k in range(1, n):
        motion[k].speed, motion[k].free = column[nv + k - 1], torque[k - 1]
        row = bodies[k].jacobian
        row[0], row[1], row[2] = 0.0, 0.0, 0.0
    joint_space_inertia(tree, bodies, inertia)
    velocity_torques(tree, bodies, motion)
    foot, rotation = bodies[task.foot], bodies[task.foot].rotation
    for r in range(3):
        a, x, y, z = (
            AXES + 3 * r,
            lanes[AXES + 3 * r],
            lanes[AXES + 3 * r + 1],
            lanes[AXES + 3 * r + 2],
        )
        for c in range(3):
            turned[a + c] = rotation[c, 0] * x + rotation[c, 1] * y + rotation[c, 2] * z
    origin, first = from_first_joint(tree, bodies, task.foot), 2 * nv
    moved = column[first], column[first + 1], column[first + 2]
    rise = _along(turned, AXES, (
        lanes[CENTRE] + moved[0] - origin[0], lanes[CENTRE + 1] + moved[1] - origin[1],
        lanes[CENTRE + 2] + moved[2] - origin[2],
    ))  # fmt: skip
    arm = lanes[ARM], lanes[ARM + 1], lanes[ARM + 2]
    reach = rise[0] - arm[0], rise[1] - arm[1], rise[2] - arm[2]
    ball = _along(turned, AXES, (column[first + 3], column[first + 4], column[first + 5]))
    ball_spin = _along(turned, AXES, (column[first + 6], column[first + 7], column[first + 8]))
    turn = foot.turn[0], foot.turn[1], foot.turn[2]
    speed = foot.velocity[0], foot.velocity[1], foot.velocity[2]
    spin, velocity = _along(turned, AXES, turn), _along(turned, AXES, speed)
    point, relative = _contact_motion(reach, arm, ball, ball_spin, velocity, spin)
    moves, spun = motion[task.foot], cross(turn, speed)
    # spatial acceleration, with gravity in it
    bias = _along(turned, AXES, (
        moves.acceleration[0] - spun[0], moves.acceleration[1] - spun[1],
        moves.acceleration[2] - spun[2],
    ))  # fmt: skip
    turning = _along(turned, AXES, (moves.turning[0], moves.turning[1], moves.turning[2]))
    b1, b2 = _free_sliding(
        reach[2], point, relative, ball, ball_spin, spin, bias, turning, (0.0, 0.0, 0.0)
    )
    lanes[HEIGHT], lanes[FREE], lanes[FREE + 1] = reach[2], b1, b2
    lanes[SLIDING], lanes[SLIDING + 1], lanes[SLIDING + 2] = relative
    contact_jacobian(tree, bodies, task, _of_axes(lanes, AXES, point), state)
    for k in range(1, n):
        if tree[k].carries_foot:
            row = bodies[k].jacobian
            row[0], row[1], row[2] = _along(turned, AXES, (row[0], row[1], row[2]))
    factorize(tree, inertia, state)
    whiten(tree, bodies, inertia, task)
    whiten_torques(tree, motion, inertia)
    delassus_matrix(tree, bodies, inertia, state)
    e1, e2 = spread(0.0), spread(0.0)
    for k in range(1, n):
        row, free = bodies[k].jacobian, inertia[k, k] * motion[k].free
        e1, e2 = e1 + row[0] * free, e2 + row[1] * free
    lanes[PUSHED], lanes[PUSHED + 1] = e1, e2


@jitable
def evaluate(tree, task, torque, lane, column, rate, floats, memory):
    """Fill in the rate of a column, and the rows of the lanes that are computed."""
    lanes, turned, bodies, motion, inertia, state = memory
    n = len(tree)
    nv = n - 1
    first = 2 * nv
    contact_terms(tree, task, torque, lanes, column, (turned, bodies, motion, inertia, state))
    for i in range(BATCH):
        _push(lane, floats, i)
    f1, f2, f3 = lanes[FORCE], lanes[FORCE + 1], lanes[FORCE + 2]
    power = spread(0.0)
    for k in range(1, n):
        row, a = bodies[k].jacobian, tree[k].parent
        left = motion[k].free - (row[0] * f1 + row[1] * f2 + row[2] * f3)
        acceleration = left * inertia[k, k]
        while a > 0:
            acceleration = acceleration - inertia[k, a] * rate[nv + a - 1]
            a = tree[a].parent
        rate[k - 1], rate[nv + k - 1] = column[nv + k - 1], acceleration
        power += column[nv + k - 1] * torque[k - 1]
    force = _of_axes(turned, AXES, (f1, f2, f3))
    height = lanes[HEIGHT]
    turned_by = _of_axes(turned, AXES, (height * f2, -(height * f1), spread(0.0)))
    gravity = motion[0].acceleration
    particle = lanes[INVERSE_INERTIA] == 0.0
    for r in range(3):
        rate[first + r] = column[first + 3 + r]
        rate[first + 3 + r] = force[r] * lanes[INVERSE_MASS] - gravity[r]
        rate[first + 6 + r] = turned_by[r] * lanes[INVERSE_INERTIA]
        power -= choose(particle, turned_by[r] * column[first + 6 + r], 0.0)
    rate[first + 9], rate[first + 10] = lanes[LOST], power


@inlined
def _push(lane, floats, i):
    """Fill in force, power lost and what falls to 0 at the ends of the phase of lane i."""
    w1, w2, w3, height = (
        lane[SLIDING, i], lane[SLIDING + 1, i], lane[SLIDING + 2, i], lane[HEIGHT, i],
    )  # fmt: skip
    deflection, largest, share = lane[RADIUS, i] - height, lane[LARGEST, i], lane[SHARE, i]
    size, _ = _spring(deflection, largest, share, lane[STIFFNESS, i], lane[EXPONENT, i])
    returned = size if deflection < largest else share * size
    most, kind = lane[FRICTION, i] * size, lane[KIND, i]
    along = lane[ALONG, i], lane[ALONG + 1, i]
    f1, f2, end, left, rest = 0.0, 0.0, math.inf, math.inf, math.inf
    if lane[FRICTION, i] > 0.0:
        inverse = lane[INVERSE_MASS, i] + height * height * lane[INVERSE_INERTIA, i]
        mobility = (
            floats.delassus[D11, i] + inverse, floats.delassus[D12, i],
            floats.delassus[D22, i] + inverse,
        )  # fmt: skip
        free = (
            lane[FREE, i] + floats.delassus[D13, i] * size - lane[PUSHED, i],
            lane[FREE + 1, i] + floats.delassus[D23, i] * size - lane[PUSHED + 1, i],
        )
        s1, s2 = _sticking_force(mobility, free, lane[RATE, i], w1, w2)
        left = most - math.sqrt(s1 * s1 + s2 * s2)
        if kind == SLIPS:
            f1, f2 = _slipping_force(most, along, w1, w2)
            end = _slip_end(along, w1, w2, lane[RESTING, i])
            slowing = w1 * (free[0] + mobility[0] * f1 + mobility[1] * f2)
            slowing += w2 * (free[1] + mobility[1] * f1 + mobility[2] * f2)
            rest = (w1 * w1 + w2 * w2) / -slowing if slowing < 0.0 else math.inf
            turning = w1 * (free[1] + mobility[1] * f1 + mobility[2] * f2)
            turning -= w2 * (free[0] + mobility[0] * f1 + mobility[1] * f2)
            brief = BRIEF[0] if abs(turning) < 1e-3 * abs(slowing) else BRIEF[1]
            rest *= BEYOND_SEPARATION if rest < brief * lane[EXPECTED, i] else 0.75
        elif kind == STICKS:
            f1, f2, end = s1, s2, left
        else:
            d1, d2, _ = _slip_direction(
                most * mobility[0], most * mobility[1], most * mobility[2], free[0], free[1]
            )
            f1, f2 = most * d1, most * d2
            slowest = STARTING * lane[SPEED, i] + 3.0 * lane[RESTING, i]
            end = min(slowest - math.sqrt(w1 * w1 + w2 * w2), -left)
    lane[FORCE, i], lane[FORCE + 1, i], lane[FORCE + 2, i] = f1, f2, size
    lane[LOST, i] = (returned - size) * w3 - f1 * w1 - f2 * w2
    lane[DEFLECTION, i], lane[MOST_FRICTION, i] = deflection, most
    lane[LEFT, i], lane[ENDS + 2, i], lane[REST, i] = left, end, rest
    if largest == 0.0:
        lane[ENDS, i], lane[ENDS + 1, i] = -w3, math.inf
    else:
        lane[ENDS, i] = deflection - (1.0 - share) * largest
        lane[ENDS + 1, i] = largest - deflection


@jitable
def energy_of(tree, lane, column, motion, inertia, bodies, i):
    """Return the energy of leg and ball of lane i at the column that was evaluated last [J]."""
    n, gx = len(tree), motion[0].acceleration[0, i]
    gy, gz = motion[0].acceleration[1, i], motion[0].acceleration[2, i]
    energy, first = 0.0, 2 * n - 2
    for k in range(1, n):
        speed, a = column[n + k - 2, i], tree[k].parent
        while a > 0:
            speed += inertia[k, a, i] * column[n + a - 2, i]
            a = tree[a].parent
        energy += 0.5 * speed * speed / inertia[k, k, i]
        moment, a, mass = bodies[k].moment, k, tree[k].mass
        energy += gx * moment[0, i] + gy * moment[1, i] + gz * moment[2, i]
        while a > 0:
            origin = bodies[a].origin
            energy += mass * (gx * origin[0, i] + gy * origin[1, i] + gz * origin[2, i])
            a = tree[a].parent
    mass, moving, turning = 1.0 / lane[INVERSE_MASS, i], 0.0, 0.0
    for r in range(3):
        moving += column[first + 3 + r, i] ** 2
        turning += column[first + 6 + r, i] ** 2
    height = gx * column[first, i] + gy * column[first + 1, i] + gz * column[first + 2, i]
    energy += mass * (0.5 * moving + height)
    if lane[INVERSE_INERTIA, i] > 0.0:
        energy += 0.5 * turning / lane[INVERSE_INERTIA, i]
    return energy
