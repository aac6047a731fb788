"""The impact of many postures at once: the answers of `kick_from`, without the flight.

In machine code `BATCH` postures go side by side, in Python all of them, through kinematics,
inertia, impact and joint impulses. What cannot be computed to 1e-12 (a foot that can hardly move
along the normal or across it, one much lighter than the ball, an inertia that has lost its digits)
is marked as doubtful. What differs between legs are arrays, so that one kernel serves every leg.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.core import lanes
from kickdyn.core.compilation import OPTIONS, MachineCode, Source, named
from kickdyn.core.lanes import (
    BATCH,
    aligned_zeros,
    batches,
    blank_records,
    choose,
    inlined,
    jitable,
    larger,
    magnitude,
    namespaces,
    spread,
    square_root,
)
from kickdyn.core.validation import Array
from kickdyn.impact import contact_phases, newton_law, strike_kernel
from kickdyn.impact.contact_phases import contact_axes, slip_direction
from kickdyn.impact.strike_kernel import slip_batch, slip_of_lane, solve_newton_batch, with_ball
from kickdyn.robot import tree_kernel
from kickdyn.robot.leg import Leg
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
    cross,
    dot,
    vector,
)
from kickdyn.sweeps import sweep_kick
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.sweep_kick import ROUNDING, UNLIMITED, Kick

TANGENT, ACROSS, NORMAL, MOBILITY, DOUBT, LOST, USE, WORST, RESTITUTION, MOMENTUM = range(10)
"""Rows of an answer: impulse on the ball along the contact's axes [N s], n^T J M^-1 J^T n [1/kg],
1 where the posture is doubtful; energy lost [J], joint speed over its limit, largest linear impulse
in a joint [N s], residuals of restitution and momentum. The impulse alone fills the first five."""

ROWS = 10

LEAST_DIFFERENCE = 1e-3
"""Share that a difference must keep of its terms, or the posture is doubtful."""

LEAST_SQUARE = 1e-6
"""Share that the square of a direction must keep as it is made orthogonal to others."""

PARALLEL = 1e-12
"""Sine of the angle below which axes count as parallel."""

TASK = np.dtype(
    [
        ("foot", np.int64),  # the joint that carries the contact point
        ("lever", float, 3),  # from its origin to the contact point, in its frame [m]
        ("planar", np.bool_),  # whether all motion is in one plane
        ("joint_impulses", np.bool_),  # whether these are computed, and the use of speed limits
        ("tangent_mobility", float),  # what the ball adds to the Delassus matrix [1/kg]
        ("normal_mobility", float),  # the same along the normal [1/kg]
        ("speed", float),  # of the foot [m/s]
        ("base_velocity", float, 3),  # of the base, at the first joint [m/s]
        ("base_turn", float, 3),  # angular velocity of the base [rad/s]
        ("restitution", float),
        ("friction", float),
    ],
    align=True,
)
"""What is asked of the kernel."""


@dataclass(frozen=True, eq=False)
class KernelModel:
    """A fixed-base tree of hinges and slides that kicks; joints count from 1, 0 is the base."""

    kick: Kick
    planar: bool  # whether all motion is in one plane, which contains the normal
    # first tangent, second tangent and normal of the contact as columns [world frame]; of planar
    # motion, the second tangent is the normal of the plane
    axes: Array
    tree: NDArray[Any]  # constants of each joint, dtype `JOINT`, shape `(n + 1,)`
    # -1 for each joint whose axis is reversed in its frame, because its largest component is
    # negative, else 1: parallel joints have aligned frames
    senses: Array
    task: NDArray[Any]  # the kick, dtype `TASK`, shape `(1,)`

    @classmethod
    def of(cls, leg: Leg, kick: Kick) -> "KernelModel | None":
        """Return the model of a leg and a kick, or None if the kernel does not serve them.

        It serves no floating base, no supports, no loops and no helical joints, and no base that
        moves across the plane of planar motion.
        """
        joints = tree_kernel.hinges_and_slides(leg)
        if joints is None:
            return None
        normal = _plane_normal(joints.world_axes, joints.slides, kick.direction)
        sliding = np.zeros(3) if normal is None else np.cross(normal, kick.direction)
        axes, task, ball = contact_axes(kick.direction, sliding), np.zeros(1, TASK), kick.ball
        tree, frames, senses = tree_kernel.joint_tree(leg, joints, axes)
        task["foot"], task["planar"] = leg.contact_joint, normal is not None
        task["lever"] = frames[leg.contact_joint].T @ leg.contact_lever
        task["normal_mobility"] = 1.0 / ball.mass
        task["tangent_mobility"] = 1.0 / ball.mass + ball.radius**2 / ball.inertia
        if leg.base_velocity is not None:
            linear, turn = leg.base_velocity[:3], leg.base_velocity[3:]
            at_joint = linear + np.cross(turn, leg.workspace.model.jointPlacements[1].translation)
            task["base_velocity"], task["base_turn"] = axes.T @ at_joint, axes.T @ turn
            (_, beside, _), (first, _, last) = task["base_velocity"][0], task["base_turn"][0]
            largest = PARALLEL * float(np.abs(leg.base_velocity).max())
            if normal is not None and max(map(abs, (beside, first, last))) > largest:
                return None
        task["speed"], task["friction"] = kick.speed, kick.friction
        task["restitution"] = kick.restitution_used
        return cls(kick, normal is not None, axes, tree, senses, task)


def _plane_normal(axes: list[Array], slides: NDArray[np.bool_], normal: Array) -> Array | None:
    """Return the unit vector across the plane that all motion is in, if there is one."""
    hinges = [axis for axis, slide in zip(axes, slides, strict=True) if not slide]
    if not hinges:
        return None
    hinge = hinges[0]
    in_plane = all(np.linalg.norm(np.cross(axis, hinge)) < PARALLEL for axis in hinges)
    directions = [normal, *(axis for axis, slide in zip(axes, slides, strict=True) if slide)]
    if not in_plane or any(abs(axis @ hinge) >= PARALLEL for axis in directions):
        return None
    return hinge


class Kernel:
    """The kernel of a model of leg and kick, and a grid: call it with a range of postures.

    It is machine code if `machine_code` is true, else Python on arrays.
    """

    def __init__(self, model: KernelModel, leg: Leg, grid: Grid, *, machine_code: bool) -> None:
        self._kernel = KERNEL() if machine_code else None
        self._model = model
        self._joints = np.array([1 + leg.joint_names.index(name) for name in grid.axes])
        # how many postures in a row share a value of each joint
        repeats = np.append(np.cumprod(grid.shape[:0:-1], dtype=np.int64)[::-1], 1)
        self._repeats = np.broadcast_to(repeats, len(grid.axes)).tolist()
        pairs = zip(self._joints, grid.axes.values(), strict=True)
        self._tables = [self._motion(k, q) for k, q in pairs]

    def __call__(self, first: int, count: int, *, joint_impulses: bool = True) -> Array:
        """Return the answers of `count` postures from number `first` on, shape `(ROWS, count)`.

        Rows are as above. Without `joint_impulses`, the first five rows are computed.
        """
        model, n = self._model, len(self._model.tree)
        task, still = model.task.copy(), ~model.tree["slides"][:, None]  # other joints are at 0
        task["joint_impulses"] = joint_impulses
        padded = -(-count // BATCH) * BATCH
        motion = np.empty((len(self._joints), 2, padded))
        for row, table, repeats in zip(motion, self._tables, self._repeats, strict=True):
            begin, end, steps = first // repeats, -(-(first + count) // repeats), table.shape[1]
            offset = begin % steps
            rounds = 1 + (offset + end - begin - 1) // steps
            values = np.tile(table, rounds) if rounds > 1 else table
            values = values[:, offset : offset + end - begin]
            if repeats > 1:
                ends = np.clip(repeats * np.arange(begin, end), first, first + count)
                values = values.repeat(np.diff(ends, append=first + count), axis=1)
            row[:, :count] = values
        motion[..., count:] = motion[..., count - 1 : count]
        answer = np.empty((ROWS, padded // BATCH, BATCH))
        if self._kernel is not None:
            bodies, state = aligned_zeros((n,), BODY), aligned_zeros((1,), STATE)
            bodies["cosine"] = still
            inertia = aligned_zeros((n, n, BATCH))
            given = motion.reshape(*motion.shape[:2], -1, BATCH)
            self._kernel(self._joints, given, model.tree, task, bodies, inertia, state, answer)
            return answer.reshape(ROWS, -1)[:, :count]
        # the same functions on arrays of all postures
        places, (of_batch,) = blank_records(BODY, n, padded), blank_records(STATE, 1, padded)
        for body, fixed in zip(places, still, strict=True):
            body.cosine[:] = fixed
        for joint, row in zip(self._joints, motion, strict=True):
            places[joint].cosine, places[joint].sine = row
        tree, (of_kick,) = namespaces(model.tree), namespaces(task)
        answer = answer.reshape(ROWS, 1, padded)
        with np.errstate(all="ignore"):  # of doubtful postures
            solve_postures(
                tree, places, np.zeros((n, n, padded)), of_kick, of_batch, of_batch, answer, 0
            )  # fmt: skip
        return answer[:, 0, :count]

    def _motion(self, k: int, values: Array) -> Array:
        """Return cosine and sine of a joint's values for the kernel, or a slide and 0."""
        signed = self._model.senses[k] * values
        if self._model.tree["slides"][k]:
            return np.vstack([signed, np.zeros(len(values))])
        return np.vstack([np.cos(signed), np.sin(signed)])


def fill_variables(
    answer: Array, model: KernelModel, rows: Array, status: NDArray[np.int8]
) -> NDArray[np.bool_]:
    """Fill in variables and status of a sweep from a kernel's answers, all but the carry.

    `answer` has shape `(ROWS, n)`; `rows` has a row for each of `dataset.VARIABLES`. Returns which
    postures are doubtful: the kernel marks them, or an answer is not finite.
    """
    kick, ball = model.kick, model.kick.ball
    nx, _, nz = kick.direction
    with np.errstate(all="ignore"):  # of doubtful postures
        x, y, z = model.axes.T[:, :, None]  # not as a matrix: its rounding depends on the processor
        p = x * answer[TANGENT] + y * answer[ACROSS] + z * answer[NORMAL]
        level = p[0] * p[0] + p[1] * p[1]
        size = np.sqrt(level + p[2] * p[2])
        values = {
            "effective_mass": 1.0 / answer[MOBILITY],
            "impulse": size,
            "immovable_impulse": (1.0 + kick.restitution_used) * kick.speed / answer[MOBILITY],
            "ball_speed": size / ball.mass,
            "speed_ratio": size / ball.mass / kick.speed,
            "launch_angle": np.arctan2(p[2], np.sqrt(level)),
            "back_spin": 0.0 - (p[2] * nx - p[0] * nz) * (ball.radius / ball.inertia),
            "worst_joint_impulse": answer[WORST],
            "energy_lost": answer[LOST],
            "speed_use": answer[USE],
            "restitution_residual": answer[RESTITUTION],
            "momentum_residual": answer[MOMENTUM],
        }
        for row, name in zip(rows, VARIABLES, strict=True):
            if name != "carry":
                row[:] = values[name]
        status[:] = answer[USE] > 1.0
        return np.asarray((answer[DOUBT] != 0.0) | ~np.isfinite(answer.sum(axis=0)))


@jitable
def solve_postures(tree, bodies, inertia, task, state, floats, answer, c):  # type: ignore[no-untyped-def]
    """Fill in batch c of the answers, given cosine and sine of all joints.

    `inertia` is the joint-space inertia, its lower triangle, shape `(n + 1, n + 1)`; `floats` has
    the fields of `state` as floats.
    """
    state.doubt = spread(0.0)
    tree_kernel.place_bodies(tree, bodies)
    tree_kernel.joint_space_inertia(tree, bodies, inertia)
    tree_kernel.contact_jacobian(tree, bodies, task, task.lever, state)
    if task.joint_impulses:  # before the Jacobian is whitened
        least_speed_use(tree, bodies, task, state)
    tree_kernel.factorize(tree, inertia, state)
    tree_kernel.whiten(tree, bodies, inertia, task)
    tree_kernel.delassus_matrix(tree, bodies, inertia, state)
    ball, u = (task.tangent_mobility, task.normal_mobility), (0.0, 0.0, -task.speed)
    contact = task.restitution, task.friction
    solve_newton_batch(state, ball, u, contact, LEAST_DIFFERENCE)
    if not task.planar:
        slip_batch(state, ball, u, contact)
        for i in range(floats.slips.size):
            if floats.slips[i] > 0.0:  # one direction is possible
                g, mu = with_ball(floats.delassus[:, i], ball), task.friction
                x, y, _ = slip_direction(mu * g[0], mu * g[1], mu * g[2], g[3], g[4])
                slip_of_lane(floats, g, u, contact, ((x, y),), i)
    if task.joint_impulses:
        doubt_singular(task, state)
        tree_kernel.solve_velocity(tree, bodies, inertia, state)
        tree_kernel.joint_impulses(tree, bodies, task, state)
        write_joint_impulses(task, state, answer, c)
    answer[TANGENT, c], answer[ACROSS, c] = state.impulse[0], state.impulse[1]
    answer[NORMAL, c], answer[MOBILITY, c] = state.impulse[2], state.delassus[D33]
    answer[DOUBT, c] = state.doubt


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


PARALLEL_SQUARE, ASKEW = ROUNDING**2, 1e-8
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
    movers, limited, least, longest = 0, 0, math.inf, spread(0.0)
    for k in range(1, len(tree)):
        if tree[k].carries_foot and tree[k].speed_limit > 0.0:
            longest = larger(longest, dot(bodies[k].jacobian, bodies[k].jacobian))
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
                _raise_speed_use(tree, bodies, state, least, longest, y)
                continue
            for k in range(j + 1, len(tree)):
                if tree[k].carries_foot:
                    y = _orthogonal(bodies[j].jacobian, bodies[k].jacobian, state)
                    _raise_speed_use(tree, bodies, state, least, longest, y)
    if movers < (2 if task.planar else 3):
        state.doubt = 1.0
    # from there on, the foot can hardly move so
    state.doubt = choose(state.speed_use < 1e9, state.doubt, 1.0)


@inlined
def _orthogonal(a, b, state):  # type: ignore[no-untyped-def]
    """Return the vector product of two columns, 0 where they are parallel."""
    x, y, z = across = cross(a, b)
    sine_square = dot(across, across) / (dot(a, a) * dot(b, b))
    doubtful = (sine_square > PARALLEL_SQUARE) & (sine_square < ASKEW)
    state.doubt = choose(doubtful, 1.0, state.doubt)
    askew = choose(sine_square >= ASKEW, 1.0, 0.0)
    return askew * x, askew * y, askew * z


@jitable
def _raise_speed_use(tree, bodies, state, least, longest, y):  # type: ignore[no-untyped-def]
    r"""Raise the speed use to the value of a candidate :math:`y`, if that is larger.

    w is the velocity that the joints must give the contact point, `least` the smallest speed limit
    above 0, and `longest` the square of the longest column, by which a joint's whole column may be
    rounding, where its axis passes through the contact point.
    """
    capacity = spread(0.0)
    for k in range(1, len(tree)):
        limit, a = tree[k].speed_limit, bodies[k].jacobian
        if not tree[k].carries_foot or limit == 0.0:
            continue
        along = magnitude(dot(a, y))
        if limit > 1e3 * least:  # its product with a rounding error may count beside other joints
            limit = limit if limit <= UNLIMITED else math.inf
            moves = along > ROUNDING * square_root(longest * dot(y, y))
            capacity += choose(moves, limit * along, 0.0)
        else:
            capacity += limit * along
    gain = magnitude(dot(state.needed, y))
    state.speed_use = larger(state.speed_use, choose(gain > 0.0, gain / capacity, 0.0))


def _sweep(joints, motion, tree, task, bodies, inertia, state, answer):  # type: ignore[no-untyped-def]
    """Fill in the answers of postures, `BATCH` at a time.

    `motion` has cosine and sine of `joints`, `(k, 2, batches, BATCH)`. `bodies`, `inertia` and
    `state` are memory of the caller's, because code that allocates none compiles in three quarters
    of the time. Here `task` and `state` have shape `(1,)`.
    """
    task, floats = task[0], state[0]
    bodies, inertia, state = batches(bodies), batches(inertia), batches(state)[0]
    answer, motion = batches(answer), batches(motion)
    for c in range(answer.shape[1]):
        for a in range(len(joints)):
            body = bodies[joints[a]]
            body.cosine, body.sine = motion[a, 0, c], motion[a, 1, c]
        solve_postures(tree, bodies, inertia, task, state, floats, answer, c)


@jitable
def write_joint_impulses(task, state, answer, c):  # type: ignore[no-untyped-def]
    """Write the rows of an answer that the impulses in the joints give, to batch c."""
    s, t, p = state.impulse[0], state.impulse[1], state.impulse[2]
    parting = p * task.normal_mobility - (task.speed + state.foot_jump)
    size = square_root(s * s + t * t + p * p)
    answer[LOST, c], answer[USE, c] = state.energy_lost, state.speed_use
    answer[WORST, c] = square_root(state.largest_square)
    error = magnitude(parting - task.restitution * task.speed)
    answer[RESTITUTION, c] = error / task.speed
    answer[MOMENTUM, c] = state.momentum_error / (square_root(state.jacobian_square) * size)


named(_sweep, "sweep", lanes, tree_kernel, contact_phases, newton_law, strike_kernel, sweep_kick)


def _source() -> Source:
    import numba  # here, because it takes long to import

    typeof: Any = numba.typeof
    tree, task, bodies, state = (typeof(np.zeros(1, dtype)) for dtype in (JOINT, TASK, BODY, STATE))
    cube, motion = numba.float64[:, :, ::1], numba.float64[:, :, :, ::1]
    joints = numba.int64[::1]
    signature = numba.void(joints, motion, tree, task, bodies, cube, state, cube)
    return Source(_sweep, signature, OPTIONS)


KERNEL = MachineCode(_source, "the kernel of sweeps", 5.0)
