"""The impact of many postures in machine code: the answers of `kick_from`, without the flight.

`BATCH` postures go side by side through kinematics, inertia, impact and joint impulses. What a
kernel cannot compute to 1e-12 (a foot that can hardly move along the normal or across it, one much
lighter than the ball, an inertia that has lost its digits) it marks as doubtful.

Two kernels are compiled from one text, `_sweep`: in space, and in a plane. They serve every leg:
what differs between legs are arrays. Compiling takes seconds, so machine code is kept on the disk.
"""

import math
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from kickdyn.core import simd
from kickdyn.core.compilation import compiled, is_kept, named
from kickdyn.core.simd import BATCH, any_of, batches, choose
from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.sweeps import (
    impact_kernel,
    kernel_model,
    planar_kernel,
    spatial_kernel,
    speed_use_kernel,
    sweep_kick,
)
from kickdyn.sweeps.dataset import VARIABLES
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.impact_kernel import (
    D33,
    OPTIONS,
    delassus_matrix,
    doubt_singular,
    factorize,
    njit,
    solve_impact,
    solve_slip,
    solve_velocity,
    whiten,
)
from kickdyn.sweeps.kernel_model import KernelModel
from kickdyn.sweeps.speed_use_kernel import least_speed_use

TANGENT, ACROSS, NORMAL, MOBILITY, DOUBT, LOST, USE, WORST, RESTITUTION, MOMENTUM = range(10)
"""Rows of an answer: impulse on the ball along the contact's axes [N s], n^T J M^-1 J^T n [1/kg],
1 where the posture is doubtful; energy lost [J], joint speed over its limit, largest linear impulse
in a joint [N s], residuals of restitution and momentum. The impulse alone fills the first five."""

ROWS = 10

BLOCK = 4096
"""Postures whose variables are filled in at a time."""

_tuple: Any = numba.types.UniTuple


class Kernel:
    """The kernel of a model of leg and kick, and a grid: call it with a range of postures."""

    def __init__(self, model: KernelModel, leg: Leg, grid: Grid) -> None:
        self._kernel, self._motion = compiled_kernel(model.planar), _kinematics(model.planar)
        joints = [1 + leg.joint_names.index(name) for name in grid.axes]
        slides = [bool(model.slides[k]) for k in joints]
        steps = np.array(grid.shape, np.int64)
        repeats = np.append(np.cumprod(steps[:0:-1])[::-1], 1)
        tables = [_motion(q, s) for q, s in zip(grid.axes.values(), slides, strict=True)]
        for a in np.flatnonzero(repeats < BATCH):  # one row per posture, until they begin anew
            steps[a], table = steps[a] * repeats[a], np.repeat(tables[a], repeats[a], axis=0)
            tables[a], repeats[a] = np.resize(table, (steps[a] + BATCH, 2)), 1
        self._still = np.concatenate([_motion(np.zeros(1), bool(slide)) for slide in model.slides])
        lengths = np.array([len(table) for table in tables])
        self._grid = (
            steps, np.array(joints), np.cumsum(lengths) - lengths, repeats,
            np.ascontiguousarray(np.concatenate(tables).T),
        )  # fmt: skip
        kick, ball = model.kick, model.kick.ball
        # what the ball adds to the Delassus matrix along the tangents and along the normal
        mobility = 1.0 / ball.mass + ball.radius**2 / ball.inertia, 1.0 / ball.mass
        self._model = (
            model.parent, model.slides, model.carries_foot, model.constants, model.foot,
            tuple(map(float, model.lever)),
            (*mobility, kick.speed, kick.restitution_used, kick.friction),
        )  # fmt: skip

    def __call__(self, first: int, count: int, *, full: bool = True) -> Array:
        """Return the answers of `count` postures from number `first` on, shape `(ROWS, count)`.

        Rows are as above. Without `full`, the impulse alone is computed, the first five rows.
        """
        answer = np.empty((ROWS, -(-count // BATCH), BATCH))
        steps, _, _, repeats, _ = self._grid
        at = np.column_stack([(first // repeats) % steps, first % repeats])
        self._kernel(*self._grid, at, *self._model, full, *self._memory(), answer)
        return answer.reshape(ROWS, -1)[:, :count]

    def _memory(self) -> tuple[Array, ...]:
        """Return the memory that a call of the kernel works in, joints at 0."""
        motion, n = self._motion, len(self._still)
        x = np.zeros((n, motion.ROWS, BATCH))
        x[1:, motion.COS], x[1:, motion.SIN] = self._still[1:, :1], self._still[1:, 1:]
        x[0, motion.UNIT] = 1.0  # the base is not rotated
        inertia, rows = np.zeros((n, n, BATCH)), np.zeros((n, motion.AXES, BATCH))
        work = np.zeros((WORK_ROWS, BATCH))
        work[-1] = np.arange(BATCH)
        return x, inertia, rows, np.zeros((n, BATCH)), work


def fill_variables(
    answer: Array, model: KernelModel, rows: Array, status: NDArray[np.int8]
) -> NDArray[np.bool_]:
    """Fill in variables and status of a sweep from a kernel's answers, all but the carry.

    `answer` has shape `(ROWS, n)`; `rows` has a row for each of `dataset.VARIABLES`. Returns which
    postures are doubtful: the kernel marks them, or an answer is not finite.
    """
    kick, ball = model.kick, model.kick.ball
    if len(status) > BLOCK:  # arrays that stay in the processor's cache take a third of the time
        parts = [slice(at, at + BLOCK) for at in range(0, len(status), BLOCK)]
        each = (fill_variables(answer[:, k], model, rows[:, k], status[k]) for k in parts)
        return np.concatenate(list(each))
    nx, _, nz = kick.direction
    with np.errstate(all="ignore"):  # of doubtful postures
        x, y, z = model.axes.T[:, :, None]  # not as a matrix: its rounding depends on the processor
        p = x * answer[TANGENT] + y * answer[ACROSS] + z * answer[NORMAL]
        level = p[0] * p[0] + p[1] * p[1]
        size, spin = np.sqrt(level + p[2] * p[2]), ball.radius / ball.inertia
        found = {
            "effective_mass": 1.0 / answer[MOBILITY],
            "impulse": size,
            "immovable_impulse": (1.0 + kick.restitution_used) * kick.speed / answer[MOBILITY],
            "ball_speed": size / ball.mass,
            "speed_ratio": size / ball.mass / kick.speed,
            "launch_angle": np.arctan2(p[2], np.sqrt(level)),
            "back_spin": 0.0 - (p[2] * nx - p[0] * nz) * spin,
            "worst_joint_impulse": answer[WORST],
            "energy_lost": answer[LOST],
            "speed_use": answer[USE],
            "restitution_residual": answer[RESTITUTION],
            "momentum_residual": answer[MOMENTUM],
        }
        for row, name in zip(rows, VARIABLES, strict=True):
            if name != "carry":
                row[:] = found[name]
        status[:] = answer[USE] > 1.0
        return np.asarray((answer[DOUBT] != 0.0) | ~np.isfinite(answer.sum(axis=0)))


def _motion(values: Array, slide: bool) -> NDArray[np.float64]:
    """Return the two first rows of a joint: a slide's value and 0, or cosine and sine."""
    if slide:
        return np.column_stack([values, np.zeros(len(values))])
    return np.column_stack([np.cos(values), np.sin(values)])


@njit
def _deal_axis(own, first, values, steps, repeat, at, number):  # type: ignore[no-untyped-def]
    """Fill in a joint's first two rows, from row `first` on, and move its axis of the grid on.

    `values` are those of the axis in two rows. Where `repeat` is 1, they go on beyond `steps` from
    the beginning; else `repeat` is at least `BATCH`, and a batch has two values at most. `at` is
    where the axis is, the number of the value and how many postures have had it. `number` counts
    the postures of a batch.
    """
    digit, done = at[0], at[1] + BATCH
    for row in range(2):
        if repeat == 1:
            own[first + row] = batches(values[row, digit : digit + BATCH])[()]
        else:
            x, y = values[row, digit], values[row, (digit + 1) % steps]
            own[first + row] = choose(number >= float(BATCH - (done - repeat)), y, x)
    if repeat == 1:
        digit, done = (digit + BATCH) % steps, 0
    elif done >= repeat:
        digit, done = (digit + 1) % steps, done - repeat
    at[0], at[1] = digit, done


motion: Any = spatial_kernel
"""Kinematics of `_sweep`; `_variant` puts `planar_kernel` in its place for motion in a plane."""

WIDTH = 3
"""Columns of the Jacobian; 2 in a plane."""

WORK_ROWS = 20
"""Rows of the memory `work`: contact point (4), Delassus matrix (6), impulse (3), what
`joint_impulses` returns (3), energy lost, doubt, use of the speed limits, and 0, 1, 2 ..."""


def _sweep(steps, joints, offsets, repeats, table, at, parent, slides, carries, constants,  # type: ignore[no-untyped-def]
          foot, lever, kick, full, x, inertia, rows, jump, work, answer):  # fmt: skip
    """Fill in the answers of consecutive postures, `BATCH` at a time.

    `steps` is the number of values of each axis of the grid, `joints` its joint, `offsets` where it
    begins in `table`, which has the first two rows of a joint for every value of every axis, and
    `repeats` how many postures in a row share a value, see `_deal_axis`; `at` has, of each axis,
    the number of the first posture's value and how many postures before it share that. `x`,
    `inertia`, `rows`, `jump` and `work` are memory of the caller's, because code that allocates
    none compiles in three quarters of the time. The other arguments are those of `impact_kernel`.
    """
    n = len(parent)
    across, along, speed, e, mu = kick
    floats, x, inertia, rows = work, batches(x), batches(inertia), batches(rows)
    jump, work, answer = batches(jump), batches(work), batches(answer)
    point, delassus, impulse, reaction = work[:4], work[4:10], work[10:13], work[13:16]
    lost, doubt, use, number = work[16:17], work[17:18], work[18:19], work[19]
    for c in range(answer.shape[1]):
        for a in range(len(steps)):
            own, values = x[joints[a]], table[:, offsets[a] :]
            _deal_axis(own, motion.COS, values, steps[a], repeats[a], at[a], number)
        doubt[0] = 0.0
        motion.place_bodies(parent, slides, constants, x)
        motion.joint_space_inertia(parent, slides, constants, x, inertia)
        motion.contact_jacobian(parent, slides, carries, constants, foot, lever, x, rows, point)
        if full:  # before the Jacobian is whitened
            least_speed_use(carries, rows, constants, speed, use, doubt)
        factorize(parent, inertia, doubt)
        whiten(parent, carries, inertia, rows)
        delassus_matrix(carries, rows, delassus)
        solve_impact(delassus, across, along, speed, e, mu, impulse, lost, doubt)
        s, t, p = impulse[0], impulse[1], impulse[2]
        if WIDTH == 3 and any_of(s * s + t * t > (mu * p) * (mu * p)):
            solve_slip(
                floats[4:10], across, along, speed, e, mu, floats[10:13], floats[16:17],
                floats[17:18],
            )  # fmt: skip
            s, t, p = impulse[0], impulse[1], impulse[2]
        if full:
            doubt_singular(delassus, WIDTH == 2, doubt)
            for k in range(1, n):
                pushed = rows[k, 0] * s
                if WIDTH == 3:
                    pushed = pushed + rows[k, 1] * t
                jump[k] = -(pushed + rows[k, WIDTH - 1] * p)
            solve_velocity(parent, inertia, jump, doubt)
            motion.joint_impulses(
                parent, slides, constants, foot, impulse, jump, x, point, reaction
            )
            parting = p * along - (speed + reaction[2])
            total = math.sqrt(s * s + t * t + p * p)
            answer[LOST, c], answer[USE, c] = lost[0], use[0]
            answer[WORST, c] = math.sqrt(reaction[0])
            answer[RESTITUTION, c] = math.fabs(parting - e * speed) / speed
            answer[MOMENTUM, c] = reaction[1] / (math.sqrt(point[motion.SIZE]) * total)
        answer[TANGENT, c], answer[ACROSS, c], answer[NORMAL, c] = s, t, p
        answer[MOBILITY, c], answer[DOUBT, c] = delassus[D33], doubt[0]


def _kinematics(in_plane: bool) -> Any:
    """Return the module of kinematics in a plane or in space."""
    return planar_kernel if in_plane else spatial_kernel


@cache
def _variant(in_plane: bool) -> Callable[..., None]:
    """Return `_sweep` for motion in a plane or in space, to be compiled."""
    kinematics = _kinematics(in_plane)
    # numba looks for changes in this file only; the others are part of the name
    modules = (simd, kernel_model, impact_kernel, sweep_kick, speed_use_kernel, kinematics)
    content = zlib.crc32(b"".join(Path(str(each.__file__)).read_bytes() for each in modules))
    names = {**globals(), "motion": kinematics, "WIDTH": kinematics.AXES}
    return named(FunctionType(_sweep.__code__, names), f"sweep_{content:08x}")


def kernel_is_kept(in_plane: bool) -> bool | None:
    """Return whether a kernel is on the disk; None where it cannot be kept."""
    return is_kept(_variant(in_plane))


@cache
def compiled_kernel(in_plane: bool) -> Callable[..., None]:
    """Return a kernel, from the disk where it is kept there."""
    integers, flags, matrix = numba.int64[::1], numba.boolean[::1], numba.float64[:, ::1]
    cube = numba.float64[:, :, ::1]
    three, five = _tuple(numba.float64, 3), _tuple(numba.float64, 5)
    signature = numba.void(
        integers, integers, integers, integers, matrix, numba.int64[:, ::1], integers, flags, flags,
        matrix, numba.int64, three, five, numba.boolean, cube, cube, cube, matrix, matrix, cube,
    )  # fmt: skip
    what = f"the kernel of sweeps {'in a plane' if in_plane else 'in space'}"
    return compiled(_variant(in_plane), signature, what, **OPTIONS)
