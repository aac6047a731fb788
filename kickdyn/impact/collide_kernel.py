"""Contacts that take time, `BATCH` side by side, integrated in machine code.

The integrator is scipy's DOP853 with its error estimate. Each lane has its own time, step and
phase; where one has ended, the next contact takes its place. A step that a phase ends in is taken
anew, by a secant, until it ends just after that.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kickdyn.core import dop853, lanes, simd
from kickdyn.core.compilation import OPTIONS, Source, named
from kickdyn.core.dop853 import COUNT, STAGES, WEIGHT, WHICH_RATE
from kickdyn.core.lanes import BATCH, LARGEST_ANGLE, batches, inlined, jitable, spread
from kickdyn.core.validation import Array
from kickdyn.impact import (
    collide_equations,
    compliant_contact,
    contact_motion,
    force_model,
    integrate_contact,
)
from kickdyn.impact.collide_equations import (
    ALONG,
    BEFORE,
    BEGIN,
    CALLS,
    DEFLECTION,
    ENDS,
    ENERGY,
    EXPECTED,
    FIRST,
    HEIGHT,
    HIGH,
    HIGH_VALUE,
    KIND,
    LARGEST,
    LEFT,
    LOW,
    LOW_VALUE,
    MOST_CALLS,
    MOST_FRICTION,
    RADIUS,
    REJECTED,
    REST,
    RESTING,
    RESULT,
    SHARE,
    SLIDING,
    SLIPS,
    SPEED,
    SPIN,
    START,
    STARTS,
    STEP,
    STICKS,
    TIME,
    WHICH,
    WHOLE,
    energy_of,
    evaluate,
)
from kickdyn.impact.compliant_contact import STARTING
from kickdyn.impact.integrate_contact import BEYOND_SEPARATION, MAX_CONTACT_TIMES
from kickdyn.impact.strike_kernel import TASK
from kickdyn.robot import tree_kernel
from kickdyn.robot.tree_kernel import BODY, JOINT, MOTION, STATE

_slides = inlined(contact_motion.slides)


class Work(NamedTuple):
    """Memory to work in.

    Attributes:
        lane: what the rows above say of every lane.
        columns: column at the beginning and at the end of the step, `(2, dim, BATCH)`.
        rates: of a column at each stage of the step, and at its end, `(13, dim, BATCH)`.
        sums: axes in the world frame (9), scale of a column, and two estimates of the error.
        rows: which contact a lane has, -1 for none; -1 at first.
        bodies, motion, inertia, state: records of `kickdyn.robot.tree_kernel`.
    """

    lane: Array
    columns: Array
    rates: Array
    sums: Array
    rows: NDArray[np.int64]
    bodies: NDArray[Any]
    motion: NDArray[Any]
    inertia: Array
    state: NDArray[Any]


@jitable
def _load(i, row, given, tree, lane, columns, scale, floats):
    """Put contact `row` into lane i."""
    nv = len(tree) - 1
    dim, begin = columns.shape[1], START + 2 * nv
    for r in range(lane.shape[0]):
        lane[r, i] = given[r, row] if r < LARGEST or START <= r < begin else 0.0
    for r in range(dim):
        columns[0, r, i] = columns[1, r, i] = given[begin + r, row]
    time, speed, energy = lane[EXPECTED, i], lane[SPEED, i], lane[ENERGY, i]
    for k in range(nv):
        fast = lane[START + nv + k, i]
        scale[k, i], scale[nv + k, i] = fast * time, fast
    for r in range(3):
        scale[2 * nv + r, i], scale[2 * nv + 3 + r, i] = speed * time, speed
        scale[2 * nv + 6 + r, i] = lane[SPIN, i]
    scale[dim - 2, i] = scale[dim - 1, i] = energy
    lane[STEP, i], floats.doubt[i] = lane[FIRST, i], 0.0


@inlined
def _limit_step(lane, i):
    """Let a step of restitution end shortly after separation at the present speed.

    And a step of points that slide shortly before they come to rest, where their direction may
    change, or shortly after that if it is brief.
    """
    lane[BEGIN, i], lane[BEGIN + 1, i] = lane[ENDS, i], lane[ENDS + 1, i]
    lane[BEGIN + 2, i] = lane[ENDS + 2, i]
    largest, deflection, e = lane[LARGEST, i], lane[DEFLECTION, i], math.sqrt(lane[SHARE, i])
    if lane[HIGH, i] > 0.0:
        return
    lane[STEP, i] = min(lane[STEP, i], lane[REST, i])
    if largest == 0.0:
        return
    leaving, left = lane[SLIDING + 2, i], 0.5 * lane[EXPECTED, i] * e / (1.0 + e)
    if deflection < 0.99 * largest and leaving > 0.0:
        left = (deflection - (1.0 - lane[SHARE, i]) * largest) / leaving
    least = 1e-9 * MAX_CONTACT_TIMES * lane[EXPECTED, i]
    lane[STEP, i] = min(lane[STEP, i], max(BEYOND_SEPARATION * left, least))


@inlined
def _precision(lane, i, which, precision):
    """Return the accepted distance beyond 0 of the value that ends a phase.

    `precision` is relative. The forces change continuously there, except where points come to rest.
    """
    if which == 0 and lane[LARGEST, i] == 0.0:
        return precision * lane[SPEED, i]
    if which < 2:
        return precision * lane[LARGEST, i]
    if lane[KIND, i] == SLIPS:
        return lane[RESTING, i]
    if lane[KIND, i] == STARTS and lane[ENDS + 2, i] != -lane[LEFT, i]:
        return 5.0 * STARTING * lane[SPEED, i]
    return precision * lane[MOST_FRICTION, i]


@inlined
def _next_trial(lane, i):
    """Put the next length of a step that is to end just after the end of a phase."""
    low, high = lane[LOW, i], lane[HIGH, i]
    above, below = lane[LOW_VALUE, i], lane[HIGH_VALUE, i]
    if low == 0.0 and lane[WHICH, i] == 2.0 and lane[KIND, i] == STARTS:
        slowest = STARTING * lane[SPEED, i]  # the sliding grows with the square of the time
        lane[STEP, i] = high * max(math.sqrt(2.0 * slowest / (slowest - below)), 1e-3)
    elif above > 0.0:
        share = above / (above - below)
        lane[STEP, i] = low + min(max(share, 0.001), 0.999) * (high - low)
    else:  # as where the phase begins with 0
        lane[STEP, i] = low + 0.1 * (high - low)


@inlined
def _first_end(lane, i):
    """Return which end a step falls into first, by a secant; -1 for none."""
    first, earliest = -1, math.inf
    for k in range(3):
        end, begin = lane[ENDS + k, i], lane[BEGIN + k, i]
        if end <= 0.0:
            about = max(begin, 0.0) / (max(begin, 0.0) - end) if end < 0.0 else 1.0
            if about < earliest:
                first, earliest = k, about
    return first


@inlined
def _begin_phase(lane, i, which):
    """Begin the next phase of lane i at its new column, or return whether foot and ball part."""
    if which < 2:
        if which == 0 and lane[LARGEST, i] > 0.0:
            return True
        lane[LARGEST, i] = lane[DEFLECTION, i] if which == 0 else 0.0
        return False
    w1, w2, ended = lane[SLIDING, i], lane[SLIDING + 1, i], lane[KIND, i]
    speed = math.sqrt(w1 * w1 + w2 * w2)
    moves = _slides(speed, lane[RESTING, i], ended == SLIPS, lane[LEFT, i])
    if ended != STICKS and moves:
        lane[KIND, i], lane[ALONG, i], lane[ALONG + 1, i] = SLIPS, w1 / speed, w2 / speed
    elif ended == STICKS or (ended != STARTS and lane[LEFT, i] < 0.0):
        lane[KIND, i] = STARTS
    else:
        lane[KIND, i] = STICKS
    return False


@inlined
def _end_step(lane, i, error, relative):
    """Return the outcome of a step of lane i.

    It is taken (-1), taken anew (-2), left to `collide` (-3), the foot reaches the centre of the
    ball (-4), or a phase ends with it: the number of the end, plus 10 where it has ended at the
    beginning of the step.
    """
    h, doubtful = lane[STEP, i], lane[CALLS, i] > MOST_CALLS
    if doubtful or h < 1e-13 * lane[EXPECTED, i]:
        return -3
    if not error < 1.0:
        factor = max(0.2, 0.9 / math.sqrt(math.sqrt(math.sqrt(error)))) if error < 1e30 else 0.2
        lane[STEP, i], lane[REJECTED, i], lane[HIGH, i] = h * factor, 1.0, 0.0
        return -2
    which, trying = _first_end(lane, i), lane[HIGH, i] > 0.0
    if which < 0 and lane[HEIGHT, i] <= 1e-9 * lane[RADIUS, i]:
        return -4
    if which < 0 and not trying:
        return -1
    if which < 0:  # before the end that is sought
        seek = int(lane[WHICH, i])
        value = lane[ENDS + seek, i] + 0.5 * _precision(lane, i, seek, relative)
        if lane[LOW_VALUE, i] > 0.0:  # Anderson and Bjorck's weight of the end that stays
            weight = 1.0 - value / lane[LOW_VALUE, i]
            lane[HIGH_VALUE, i] *= weight if weight > 0.0 else 0.5
        lane[LOW, i], lane[LOW_VALUE, i] = h, value
        _next_trial(lane, i)
        return -2
    value, precision = lane[ENDS + which, i], _precision(lane, i, which, relative)
    if value >= -precision:
        return which
    if h < 1e-6 * lane[FIRST, i] and lane[BEGIN + which, i] <= 0.0:
        return which + 10
    if not trying or which != int(lane[WHICH, i]):
        begin = lane[BEGIN + which, i]
        lane[LOW, i], lane[LOW_VALUE, i] = 0.0, begin + 0.5 * precision if begin > 0.0 else 0.0
    elif lane[LOW_VALUE, i] > 0.0:
        weight = 1.0 - (value + 0.5 * precision) / lane[HIGH_VALUE, i]
        lane[LOW_VALUE, i] *= weight if weight > 0.0 else 0.5
    lane[HIGH, i], lane[HIGH_VALUE, i] = h, value + 0.5 * precision
    lane[WHICH, i] = which
    _next_trial(lane, i)
    return -2


def _collide(tree, task, torque, given, answer, work, rtol):
    """Fill in the answers of contacts: load them into lanes, step all, see where each is."""
    lane, columns, rates, sums, rows, bodies, motion, inertia, state = work
    task, floats, dim, n = task[0], state[0], columns.shape[1], len(tree)
    turned, scale, sums = sums[:9], sums[9 : 9 + dim], sums[9 + dim :]
    memory = (
        batches(lane), batches(turned), batches(bodies), batches(motion), batches(inertia),
        batches(state)[0],
    )  # fmt: skip
    lanes, column, new = memory[0], batches(columns[0]), batches(columns[1])
    scales, total = batches(scale), batches(sums)
    rate, relative = batches(rates), max(0.1 * math.sqrt(rtol), 1e-7)
    count, waiting, busy = answer.shape[1], 0, 0
    while True:
        for i in range(BATCH):
            if rows[i] < 0 and waiting < count:
                _load(i, waiting, given, tree, lane, columns, scale, floats)
                rows[i] = waiting
                waiting, busy = waiting + 1, busy + 1
        if busy == 0:
            break
        for k in range(STAGES + 3):
            t = max(k - STAGES, 0)
            for m in range(dim):
                if k == 0:
                    new[m] = column[m]
                    continue
                weighted = WEIGHT[k, 0] * rate[WHICH_RATE[k, 0], m]
                for j in range(1, COUNT[k]):
                    weighted += WEIGHT[k, j] * rate[WHICH_RATE[k, j], m]
                if k <= STAGES:
                    new[m] = column[m] + lanes[STEP] * weighted
                else:
                    total[(t - 1) * dim + m] = weighted
            if k > STAGES:
                continue
            evaluate(tree, task, torque, lane, new, rate[k], floats, memory)
            for i in range(BATCH if k == 0 else 0):
                if lane[CALLS, i] == 0.0:
                    lane[BEFORE, i] = energy_of(tree, lane, columns[1], motion, inertia, bodies, i)
                _limit_step(lane, i)
        five, three = spread(0.0), spread(0.0)
        for m in range(dim):
            per = 1.0 / (rtol * scales[m] + rtol * max(math.fabs(column[m]), math.fabs(new[m])))
            a, b = total[m] * per, total[dim + m] * per
            five, three = five + a * a, three + b * b
        total[0], total[1] = five, three
        for i in range(BATCH):
            if rows[i] < 0:
                continue
            lane[CALLS, i] += STAGES + 1
            five_i, h = sums[0, i], lane[STEP, i]
            size = (five_i + 0.01 * sums[1, i]) * dim
            error = h * five_i / math.sqrt(size) if size != 0.0 else 0.0
            which = _end_step(lane, i, error, relative)
            if which == -2:
                continue
            doubtful, through, parted = which == -3, which == -4, False
            if -3 < which < 10:
                for m in range(dim):
                    columns[0, m, i] = columns[1, m, i]
                lane[TIME, i] += h
            if which == -1:
                most = 1.0 if lane[REJECTED, i] > 0.0 else 10.0
                growth = 0.9 / math.sqrt(math.sqrt(math.sqrt(error))) if error > 1e-12 else most
                lane[WHOLE, i], lane[REJECTED, i] = h, 0.0
                lane[STEP, i] = h * min(max(growth, 0.2), most)
                doubtful = lane[TIME, i] > MAX_CONTACT_TIMES * lane[EXPECTED, i]
            elif which >= 0:
                parted = _begin_phase(lane, i, which % 10)
                lane[STEP, i] = max(lane[WHOLE, i], lane[FIRST, i])
                lane[HIGH, i], lane[REJECTED, i] = 0.0, 0.0
                if parted:  # nothing but gravity acts since then
                    late = lane[ENDS, i] / lane[SLIDING + 2, i]
                    lane[TIME, i] += late
                    for m in range(dim):
                        columns[0, m, i] += late * rates[STAGES, m, i]
            if not (doubtful or through or parted):
                continue
            row = rows[i]
            for k in range(1, n):
                doubtful |= not abs(lane[START + k - 1, i] + columns[0, k - 1, i]) < LARGEST_ANGLE
            energy = energy_of(tree, lane, columns[1], motion, inertia, bodies, i)
            kind = 3.0 if through else 1.0 if lane[KIND, i] == STICKS else 0.0
            answer[0, row] = 2.0 if doubtful or floats.doubt[i] != 0.0 else kind
            answer[1, row], answer[2, row] = lane[TIME, i], lane[LARGEST, i]
            lost, work_done = columns[1, dim - 2, i], columns[1, dim - 1, i]
            answer[3, row] = lane[BEFORE, i] + work_done - energy - lost
            answer[4, row] = lane[CALLS, i]
            for m in range(dim):
                answer[RESULT + m, row] = columns[0, m, i]
            rows[i], lane[STEP, i] = -1, 0.0
            busy -= 1


_CALLED = (lanes, simd, dop853, tree_kernel, collide_equations, contact_motion, force_model,
           compliant_contact, integrate_contact)  # fmt: skip
named(_collide, "collide", *_CALLED)


def source() -> Source:
    """Return the source of the machine code of `_collide`."""
    import numba  # here, because it takes long to import

    typeof: Any = numba.typeof
    tree, task, bodies, motion, state = (
        typeof(np.zeros(1, dtype)) for dtype in (JOINT, TASK, BODY, MOTION, STATE)
    )
    vector, matrix, cube = numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]
    kinds = matrix, cube, cube, matrix, numba.int64[::1], bodies, motion, cube, state
    work = numba.types.NamedTuple(kinds, Work)
    signature = numba.void(tree, task, vector, matrix, matrix, work, numba.float64)
    return Source(_collide, signature, OPTIONS)
