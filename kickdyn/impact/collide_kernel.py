"""Contacts that take time in machine code, `BATCH` side by side, for a tree of hinges and slides.

The equations are of `CompliantContact` with a spring and constant torques, the integrator is
scipy's DOP853 with its error estimate; `contact_phases` has the forces and the control of steps of
both. Each lane has its own time, step and phase; where one has ended, the next contact takes its
place.
"""

# mypy: disable-error-code="no-untyped-def, no-untyped-call"

import math
from collections.abc import Iterable
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kickdyn.core import dop853, simd
from kickdyn.core import lanes as lanes_module
from kickdyn.core.compilation import OPTIONS, Source, named
from kickdyn.core.dop853 import COUNT, STAGES, WEIGHT, WHICH_RATE
from kickdyn.core.lanes import (
    BATCH,
    LARGEST_ANGLE,
    aligned_zeros,
    batches,
    blank_records,
    choose,
    inlined,
    jitable,
    larger,
    magnitude,
    namespaces,
    sine_and_cosine,
    spread,
)
from kickdyn.core.validation import Array
from kickdyn.impact import contact_phases, force_model
from kickdyn.impact.compliant_contact import CompliantContact, IntegratedContact
from kickdyn.impact.contact_phases import (
    AGAIN,
    AT_BEGINNING,
    FAILED,
    GIVEN,
    LANE,
    STICKS,
    TAKEN,
    THROUGH,
    begin_phase,
    contact_motion,
    event_precision,
    finish_step,
    free_sliding,
    friction_force,
    limit_step,
    put_forces,
)
from kickdyn.impact.strike_kernel import TASK
from kickdyn.robot import tree_kernel
from kickdyn.robot.leg import Leg
from kickdyn.robot.tree_kernel import (
    BODY,
    D11,
    D12,
    D13,
    D22,
    D23,
    JOINT,
    MOTION,
    STATE,
    cross,
    put,
    vector,
)

GIVEN_ROWS = sum(math.prod(LANE[name].shape) for name in GIVEN) // BATCH
"""Rows of the table of contacts that are fields of a lane; then follow the angles of the joints (or
slides) at first contact, the speeds that scale them, and the first column."""

RESULT = 6
"""Rows of an answer before the last column: an outcome, see below; contact time [s], largest
deflection [m], energy that is not accounted for [J], evaluations and steps."""

PARTED, PARTED_STICKING, DOUBTFUL, PRESSED_THROUGH = 0.0, 1.0, 2.0, 3.0
"""Outcomes of a contact: the points slip at separation, or stick; the answer is not exact, or the
foot reaches the centre of the ball."""

STEP_ROWS = 5
"""Columns of a step before the column at its beginning: time [s], largest deflection so far [m],
kind of friction, and direction of the sliding."""

MOST_STEPS = 1000
"""Steps of a single contact that are kept; one with more is not computed in machine code."""

LEAST_TIME, LEAST_SPEED = 1e-7, 1e-5
"""Contact time [s] and speed of approach [m/s] below which there is no machine code."""

_spring = inlined(force_model.hysteretic_spring)


class Work(NamedTuple):
    """Memory to work in."""

    lane: NDArray[Any]  # a `LANE`
    table: Array  # the same memory as rows of numbers
    joints: Array  # angles at first contact and speeds that scale them, `(2 nv, BATCH)`
    columns: Array  # column at the beginning and at the end of the step, `(2, dim, BATCH)`
    rates: Array  # of a column at each stage of the step, and at its end, `(13, dim, BATCH)`
    sums: Array  # axes in the world frame (9), scale of a column, first column, two error estimates
    rows: NDArray[np.int64]  # which contact a lane has, -1 for none; -1 at first
    bodies: NDArray[Any]  # this and what follows: records of `kickdyn.robot.tree_kernel`
    motion: NDArray[Any]
    inertia: Array
    state: NDArray[Any]


@inlined
def _along(axes, v):
    """Return the components of a vector along three axes in nine rows."""
    x, y, z = v
    return (
        axes[0] * x + axes[1] * y + axes[2] * z,
        axes[3] * x + axes[4] * y + axes[5] * z,
        axes[6] * x + axes[7] * y + axes[8] * z,
    )


@inlined
def _of_axes(axes, v):
    """Return the vector whose components along three axes in nine rows are given."""
    x, y, z = v
    return (
        axes[0] * x + axes[3] * y + axes[6] * z,
        axes[1] * x + axes[4] * y + axes[7] * z,
        axes[2] * x + axes[5] * y + axes[8] * z,
    )


@inlined
def from_first_joint(tree, bodies, k):
    """Return the origin of a joint's body from the first joint."""
    x, y, z = vector(bodies[k].origin)
    k = tree[k].parent
    while k > 0:
        origin = bodies[k].origin
        x, y, z = x + origin[0], y + origin[1], z + origin[2]
        k = tree[k].parent
    return x, y, z


@jitable
def place(tree, angles, column, bodies):
    """Place the bodies by a column of the integrator."""
    for k in range(1, len(tree)):
        angle = angles[k - 1] + column[k - 1]
        if tree[k].slides:
            bodies[k].cosine = angle
        else:
            bodies[k].sine, bodies[k].cosine = sine_and_cosine(angle)
    tree_kernel.place_bodies(tree, bodies)


@jitable
def contact_terms(tree, task, torque, lane, column, memory):
    """Fill in what the forces follow from: height to `pushed`, Jacobian and Delassus matrix.

    The inertia is factorized, and the torques `free` are whitened.
    """
    angles, turned, bodies, motion, inertia, state = memory
    n = len(tree)
    nv = n - 1
    place(tree, angles, column, bodies)
    for k in range(1, n):
        motion[k].speed, motion[k].free = column[nv + k - 1], torque[k - 1]
        row = bodies[k].jacobian
        row[0], row[1], row[2] = 0.0, 0.0, 0.0
    tree_kernel.joint_space_inertia(tree, bodies, inertia)
    tree_kernel.velocity_torques(tree, bodies, motion)
    foot, rotation = bodies[task.foot], bodies[task.foot].rotation
    for r in range(0, 9, 3):
        x, y, z = lane.axes[r], lane.axes[r + 1], lane.axes[r + 2]
        for c in range(3):
            turned[r + c] = rotation[c, 0] * x + rotation[c, 1] * y + rotation[c, 2] * z
    origin, ball = from_first_joint(tree, bodies, task.foot), column[2 * nv :]
    rise = _along(turned, (
        lane.centre[0] + ball[0] - origin[0], lane.centre[1] + ball[1] - origin[1],
        lane.centre[2] + ball[2] - origin[2],
    ))  # fmt: skip
    arm = vector(lane.arm)
    reach = rise[0] - arm[0], rise[1] - arm[1], rise[2] - arm[2]
    velocity = _along(turned, (ball[3], ball[4], ball[5]))
    ball_spin = _along(turned, (ball[6], ball[7], ball[8]))
    turn, speed = vector(foot.turn), vector(foot.velocity)
    spin, foot_velocity = _along(turned, turn), _along(turned, speed)
    point, relative = contact_motion(reach, arm, velocity, ball_spin, foot_velocity, spin)
    moves, spun = motion[task.foot], cross(turn, speed)
    # spatial acceleration, with gravity in it
    bias = _along(turned, (
        moves.acceleration[0] - spun[0], moves.acceleration[1] - spun[1],
        moves.acceleration[2] - spun[2],
    ))  # fmt: skip
    turning = _along(turned, vector(moves.turning))
    lane.free[0], lane.free[1] = free_sliding(
        reach[2], point, relative, velocity, ball_spin, spin, bias, turning, (0.0, 0.0, 0.0)
    )
    lane.height = reach[2]
    put(lane.sliding, relative)
    tree_kernel.contact_jacobian(tree, bodies, task, _of_axes(lane.axes, point), state)
    for k in range(1, n):
        if tree[k].carries_foot:
            row = bodies[k].jacobian
            put(row, _along(turned, vector(row)))
    tree_kernel.factorize(tree, inertia, state)
    tree_kernel.whiten(tree, bodies, inertia, task)
    tree_kernel.whiten_torques(tree, motion, inertia)
    tree_kernel.delassus_matrix(tree, bodies, inertia, state)
    e1, e2 = spread(0.0), spread(0.0)
    for k in range(1, n):
        row, free = bodies[k].jacobian, inertia[k, k] * motion[k].free
        e1, e2 = e1 + row[0] * free, e2 + row[1] * free
    lane.pushed[0], lane.pushed[1] = e1, e2


@jitable
def evaluate(tree, task, torque, floats, column, rate, memory):
    """Fill in the rate of a column, and the computed fields of the lanes.

    `floats` are the lanes and the state with floats as fields.
    """
    lane, angles, turned, bodies, motion, inertia, state = memory
    n = len(tree)
    nv = n - 1
    contact_terms(
        tree, task, torque, lane, column, (angles, turned, bodies, motion, inertia, state)
    )
    for i in range(BATCH):
        _push(floats[0], floats[1].delassus, i)
    force = vector(lane.force)
    power = spread(0.0)
    for k in range(1, n):
        row, a = bodies[k].jacobian, tree[k].parent
        left = motion[k].free - (row[0] * force[0] + row[1] * force[1] + row[2] * force[2])
        acceleration = left * inertia[k, k]
        while a > 0:
            acceleration = acceleration - inertia[k, a] * rate[nv + a - 1]
            a = tree[a].parent
        rate[k - 1], rate[nv + k - 1] = column[nv + k - 1], acceleration
        power += column[nv + k - 1] * torque[k - 1]
    pushed, height = _of_axes(turned, force), lane.height
    turned_by = _of_axes(turned, (height * force[1], -(height * force[0]), spread(0.0)))
    gravity, ball, rates = motion[0].acceleration, column[2 * nv :], rate[2 * nv :]
    particle = lane.inverse_inertia == 0.0
    for r in range(3):
        rates[r] = ball[3 + r]
        rates[3 + r] = pushed[r] * lane.inverse_mass - gravity[r]
        rates[6 + r] = turned_by[r] * lane.inverse_inertia
        power -= choose(particle, turned_by[r] * ball[6 + r], 0.0)
    rates[9], rates[10] = lane.lost, power


@inlined
def _push(lane, delassus, i):
    """Fill in the force of lane i, and the ends of its phase."""
    deflection, largest, share = lane.radius[i] - lane.height[i], lane.largest[i], lane.share[i]
    size, _ = _spring(deflection, largest, share, lane.stiffness[i], lane.exponent[i])
    returned = size if deflection < largest else share * size
    height = lane.height[i]
    inverse = lane.inverse_mass[i] + height * height * lane.inverse_inertia[i]
    mobility = delassus[D11, i] + inverse, delassus[D12, i], delassus[D22, i] + inverse
    free = (
        lane.free[0, i] + delassus[D13, i] * size - lane.pushed[0, i],
        lane.free[1, i] + delassus[D23, i] * size - lane.pushed[1, i],
    )
    f1, f2 = friction_force(lane, i, size, mobility, free)
    loss = (returned - size) * lane.sliding[2, i]
    put_forces(lane, i, (f1, f2, size), loss, deflection, (1.0 - share) * largest)


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
    mass, moving, turning = 1.0 / lane.inverse_mass[i], 0.0, 0.0
    for r in range(3):
        moving += column[first + 3 + r, i] ** 2
        turning += column[first + 6 + r, i] ** 2
    height = gx * column[first, i] + gy * column[first + 1, i] + gz * column[first + 2, i]
    energy += mass * (0.5 * moving + height)
    if lane.inverse_inertia[i] > 0.0:
        energy += 0.5 * turning / lane.inverse_inertia[i]
    return energy


@jitable
def _load(i, row, given, lane, work):
    """Put contact `row` into lane i."""
    table, joints, columns, scale, start = work
    nv, dim = len(joints) // 2, columns.shape[1]
    for r in range(len(table)):
        table[r, i] = given[r, row] if r < GIVEN_ROWS else 0.0
    for r in range(2 * nv):
        joints[r, i] = given[GIVEN_ROWS + r, row]
    for r in range(dim):
        start[r, i] = columns[0, r, i] = columns[1, r, i] = given[GIVEN_ROWS + 2 * nv + r, row]
    time, speed = lane.expected[i], lane.speed[i]
    for k in range(nv):
        fast = joints[nv + k, i]
        scale[k, i], scale[nv + k, i] = fast * time, fast
    for r in range(3):
        scale[2 * nv + r, i], scale[2 * nv + 3 + r, i] = speed * time, speed
        scale[2 * nv + 6 + r, i] = lane.spin[i]
    scale[dim - 2, i] = scale[dim - 1, i] = lane.energy[i]
    lane.step[i] = lane.first_step[i]


def _collide(tree, task, torque, given, answer, steps, work, rtol):
    """Fill in the answers of contacts: load them into lanes, step all, see where each is.

    `steps` has rows for the steps of contact 0, or none.
    """
    lane, table, joints, columns, rates, sums, rows, bodies, motion, inertia, state = work
    task, dim, n = task[0], columns.shape[1], len(tree)
    lanes, lane, floats = batches(lane)[0], lane[0], state[0]
    turned, scale, start = sums[:9], sums[9 : 9 + dim], sums[9 + dim : 9 + 2 * dim]
    sums, nv = sums[9 + 2 * dim :], n - 1
    memory = (
        lanes, batches(joints), batches(turned), batches(bodies), batches(motion),
        batches(inertia), batches(state)[0],
    )  # fmt: skip
    column, new = batches(columns[0]), batches(columns[1])
    scales, starts, total = batches(scale), batches(start), batches(sums)
    rate, precision = batches(rates), event_precision(rtol)
    count, waiting, busy, kept = answer.shape[1], 0, 0, 0
    while True:
        for i in range(BATCH):
            if rows[i] < 0 and waiting < count:
                _load(i, waiting, given, lane, (table, joints, columns, scale, start))
                floats.doubt[i] = 0.0
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
                    new[m] = column[m] + lanes.step * weighted
                else:
                    total[(t - 1) * dim + m] = weighted
            if k > STAGES:
                continue
            evaluate(tree, task, torque, (lane, floats), new, rate[k], memory)
            for i in range(BATCH if k == 0 else 0):
                if lane.calls[i] == 0.0:
                    lane.before[i] = energy_of(tree, lane, columns[1], motion, inertia, bodies, i)
                limit_step(lane, i)
        five, three = spread(0.0), spread(0.0)
        for m in range(dim):
            drift = spread(0.0)  # of uniform motion
            if m < nv:
                drift = starts[nv + m]
            elif 2 * nv <= m < 2 * nv + 3:
                drift = starts[m + 3]
            moved = starts[m] + lanes.time * drift
            later = moved + lanes.step * drift
            departure = larger(magnitude(column[m] - moved), magnitude(new[m] - later))
            per = 1.0 / (rtol * lanes.tolerance_factor * (scales[m] + departure))
            a, b = total[m] * per, total[dim + m] * per
            five, three = five + a * a, three + b * b
        total[0], total[1] = five, three
        for i in range(BATCH):
            if rows[i] < 0:
                continue
            if i == 0 and kept < len(steps):
                begins = steps[kept]
                begins[0], begins[1], begins[2] = lane.time[i], lane.largest[i], lane.kind[i]
                begins[3], begins[4] = lane.along[0, i], lane.along[1, i]
                for m in range(dim):
                    begins[STEP_ROWS + m] = columns[0, m, i]
            five_i, h = sums[0, i], lane.step[i]
            size = (five_i + 0.01 * sums[1, i]) * dim
            error = h * five_i / math.sqrt(size) if size != 0.0 else 0.0
            outcome = finish_step(lane, i, error, precision)
            if outcome == AGAIN:
                continue
            if outcome == TAKEN or 0 <= outcome < AT_BEGINNING:
                for m in range(dim):
                    columns[0, m, i] = columns[1, m, i]
                kept += i == 0
            parted = outcome >= 0 and begin_phase(lane, i, outcome % AT_BEGINNING)
            if parted:  # nothing but gravity acts since then
                late = lane.ends[0, i] / lane.sliding[2, i]
                lane.time[i] += late
                for m in range(dim):
                    columns[0, m, i] += late * rates[STAGES, m, i]
            if not (parted or outcome in (FAILED, THROUGH)):
                continue
            row, doubtful = rows[i], outcome == FAILED or floats.doubt[i] != 0.0
            for k in range(1, n):
                doubtful |= not abs(joints[k - 1, i] + columns[0, k - 1, i]) < LARGEST_ANGLE
            energy = energy_of(tree, lane, columns[1], motion, inertia, bodies, i)
            kind = PARTED_STICKING if lane.kind[i] == STICKS else PARTED
            kind = PRESSED_THROUGH if outcome == THROUGH else kind
            answer[0, row] = DOUBTFUL if doubtful else kind
            answer[1, row], answer[2, row] = lane.time[i], lane.largest[i]
            lost, work_done = columns[1, dim - 2, i], columns[1, dim - 1, i]
            answer[3, row] = lane.before[i] + work_done - energy - lost
            answer[4, row], answer[5, row] = lane.calls[i], kept
            for m in range(dim):
                answer[RESULT + m, row] = columns[0, m, i]
            rows[i], lane.step[i] = -1, 0.0
            busy -= 1


named(_collide, "collide", lanes_module, simd, dop853, tree_kernel, contact_phases,
      force_model)  # fmt: skip


def source() -> Source:
    """Return the source of the machine code of `_collide`."""
    import numba  # here, because it takes long to import

    typeof: Any = numba.typeof
    tree, task, lane, bodies, motion, state = (
        typeof(np.zeros(1, dtype)) for dtype in (JOINT, TASK, LANE, BODY, MOTION, STATE)
    )
    vector, matrix, cube = numba.float64[::1], numba.float64[:, ::1], numba.float64[:, :, ::1]
    kinds = (
        lane, matrix, matrix, cube, cube, matrix, numba.int64[::1], bodies, motion, cube, state,
    )  # fmt: skip
    work = numba.types.NamedTuple(kinds, Work)
    signature = numba.void(tree, task, vector, matrix, matrix, matrix, work, numba.float64)
    return Source(_collide, signature, OPTIONS)


class ContactKernel:
    """The machine code of contacts for one leg and its constant torques."""

    def __init__(self, leg: Leg, geometry: tuple[Any, ...], torque: Array) -> None:
        self.leg, nv = leg, leg.nv
        self._tree, frames, senses = geometry
        self.senses, self.foot_axes = senses[1:], frames[leg.contact_joint]
        self.first_joint = leg.workspace.model.jointPlacements[1].translation
        task, self._dim = np.zeros(1, TASK), 2 * nv + 11
        task["foot"] = leg.contact_joint
        self._gravity = np.array(leg.model.gravity.linear)
        self._given_leg = self._tree, task, np.ascontiguousarray(self.senses * torque)

    @classmethod
    def of(cls, leg: Leg, torque: Any) -> Self | None:
        """Return the kernel of a leg, or None if there is none."""
        turns = leg.base_velocity is not None and bool(leg.base_velocity[3:].any())
        if leg.nq != leg.nv or leg.compliant_drives or turns:
            return None
        geometry = tree_kernel.tree_in_world_axes(leg)
        return None if geometry is None else cls(leg, geometry, torque)

    def run(self, code: Any, lanes: Any, table: Iterable[Array], tol: float, steps: Array) -> Array:
        """Return the answers of n contacts in lanes, shape `(RESULT + dim, n)`.

        The table has angles of the joints, speeds that scale them, and first columns, as rows;
        `steps` is filled in with the steps of the first contact, or has no rows.
        """
        n = lanes.height.shape[-1]
        rows = [np.atleast_2d(getattr(lanes, name)) for name in GIVEN]  # n may be 0
        given = np.ascontiguousarray(np.concatenate([*rows, *table]))
        answer = np.empty((RESULT + self._dim, n))
        code(*self._given_leg, given, answer, steps, self._memory(), max(tol, 3e-14))
        return answer

    def _memory(self) -> Work:
        nv, dim = self.leg.nv, self._dim
        motion, lane = aligned_zeros((nv + 1,), MOTION), aligned_zeros((1,), LANE)
        motion["acceleration"][0] = -self._gravity[:, None]
        return Work(
            lane, lane.view(float).reshape(-1, BATCH), aligned_zeros((2 * nv, BATCH)),
            aligned_zeros((2, dim, BATCH)), aligned_zeros((13, dim, BATCH)),
            aligned_zeros((9 + 4 * dim, BATCH)), np.full(BATCH, -1),
            aligned_zeros((nv + 1,), BODY), motion, aligned_zeros((nv + 1, nv + 1, BATCH)),
            aligned_zeros((1,), STATE),
        )  # fmt: skip

    def motion(self, code: Any, equations: CompliantContact) -> IntegratedContact | None:
        """Return the motion of one contact with its steps; None if digits are lost."""
        lane, nv = equations.lane_of(None), self.leg.nv
        if lane.speed[0] < LEAST_SPEED or lane.expected[0] < LEAST_TIME:
            return None
        axes = equations.lane.axes.reshape(3, 3) @ self.foot_axes
        lane.axes[:] = axes.reshape(9, 1)
        y = equations.start()
        turn = np.ones(self._dim)
        turn[:nv] = turn[nv : 2 * nv] = self.senses
        table = self.senses * equations.q, equations.fast, turn * y
        steps = np.empty((MOST_STEPS, STEP_ROWS + self._dim))
        result = self.run(
            code, lane, tuple(row[:, None] for row in table), equations.tol, steps
        )[:, 0]  # fmt: skip
        count = int(result[5])
        if result[0] > PARTED_STICKING or count > MOST_STEPS or not np.isfinite(result).all():
            return None
        steps = steps[:count]
        columns = turn * np.vstack([steps[:, STEP_ROWS:], result[RESULT:]])
        times = np.append(steps[:, 0], result[1])
        return IntegratedContact(equations, times, columns, steps[:, 1:STEP_ROWS], int(result[4]))

    def begin(self, lanes: Any, angles: Array, columns: Array) -> tuple[Array, Array, Array]:
        """Fill in axes, arm and sliding of contacts, and the centres of the balls.

        Before, the axes are in the world frame, and the arm is from the joint's origin to the
        contact point in its frame. Returned are the mobility of the foot along the normal [1/kg],
        the diagonal of the joint-space inertia, and which rows are computed to full precision.
        """
        tree, task, torque = self._given_leg
        joints, (foot,), count = namespaces(tree), namespaces(task), len(tree)
        n = columns.shape[1]
        bodies, motion = blank_records(BODY, count, n), blank_records(MOTION, count, n)
        (state,) = blank_records(STATE, 1, n)
        motion[0].acceleration[:] = -self._gravity[:, None]
        inertia = np.zeros((count, count, n))
        with np.errstate(all="ignore"):  # of rows that have lost their digits
            place(joints, angles, columns, bodies)
            rotation, axes = bodies[foot.foot].rotation, lanes.axes.reshape(3, 3, n)
            lever = lanes.arm
            lanes.centre[:] = np.array(from_first_joint(joints, bodies, foot.foot))
            lanes.centre += np.einsum("ijn,jn->in", rotation, lever) + lanes.radius * axes[2]
            axes[:] = np.einsum("jin,ajn->ain", rotation, axes)
            lever[:] = np.einsum("ain,in->an", axes, lever)
            memory = angles, np.zeros((9, n)), bodies, motion, inertia, state
            contact_terms(joints, foot, torque, lanes, columns, memory)
        sound = (state.doubt == 0.0) & (np.abs(angles).max(axis=0) < LARGEST_ANGLE)
        return state.delassus[tree_kernel.D33].copy(), inertia[0, 1:], sound
