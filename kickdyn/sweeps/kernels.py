"""A kick from every posture of a grid, in machine code: the answers of `kick_from`, but the flight.

`LANES` postures go side by side. What a kernel cannot vouch for to 1e-12 (a foot that can hardly
move along the normal or across it, one far lighter than the ball, an inertia that has lost its
digits) it marks, to be computed by `kick_from`.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from kickdyn.core.compilation import compiled, named
from kickdyn.core.validation import Array
from kickdyn.flight import lanes
from kickdyn.flight.lanes import LANES
from kickdyn.sweeps import arithmetic, factors, impulses, speed_use
from kickdyn.sweeps import planar_kernel as planar
from kickdyn.sweeps import spatial_kernel as spatial
from kickdyn.sweeps import speed_use_kernel as quickness
from kickdyn.sweeps.arithmetic import HOW, njit
from kickdyn.sweeps.factors import factor, unweigh, weigh
from kickdyn.sweeps.impulses import D33, gather, movable, slide, strike
from kickdyn.sweeps.kernel_scene import Scene

TANGENT, ACROSS, NORMAL, GIVE, DOUBT, LOST, USE, WORST, RESTITUTION, MOMENTUM = range(10)
"""Rows of an answer: impulse on the ball along the contact's axes [N s], n^T J M^-1 J^T n [1/kg],
1 where in doubt; energy lost [J], joint speed over its limit, largest linear impulse in a joint
[N s], residuals of restitution and momentum. The first five are all that `impulse only` fills."""

ROWS = 10

_LIMIT = spatial.LIMIT


@njit
def _deal(first, second, table, repeat, a, at):  # type: ignore[no-untyped-def]
    """Fill in a joint's first two rows from where axis `a` stands, and move it on."""
    digit, done, i = at[a, 0], at[a, 1], 0
    while i < LANES:
        run = min(repeat - done, LANES - i)
        x, y = table[digit, 0], table[digit, 1]
        for j in range(i, i + run):
            first[j], second[j] = x, y
        i, done = i + run, done + run
        if done == repeat:
            done, digit = 0, digit + 1
            if digit == len(table):
                digit = 0
    at[a, 0], at[a, 1] = digit, done


motion: Any = spatial
"""What `_sweep` stands on; for a plane it is taken again on `planar`."""
WIDTH = 3
"""Columns of a Jacobian there."""


def _sweep(steps, joints, offsets, table, first, still, parent, slides, carries, constants,  # type: ignore[no-untyped-def]
          foot, lever, kick, full, answer):  # fmt: skip
    n, count = len(parent), answer.shape[1]
    across, along, speed, e, mu, per_mass = kick
    x, inertia = np.zeros((n, motion.ROWS * LANES)), np.zeros((n, n, LANES))
    rows, jump = np.zeros((n, WIDTH * LANES)), np.zeros((n, LANES))
    point, delassus = np.zeros(7 * LANES), np.zeros(6 * LANES)
    impulse, heard = np.zeros(3 * LANES), np.zeros(3 * LANES)
    lost, doubt, use = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    for i in range(LANES):
        x[0, i] = 1.0  # the base is not turned
        if WIDTH == 3:
            x[0, 4 * LANES + i] = x[0, 8 * LANES + i] = 1.0
        for k in range(1, n):
            x[k, motion.COS + i], x[k, motion.SIN + i] = still[k, 0], still[k, 1]
    at, repeats = np.zeros((len(steps), 2), np.int64), np.ones(len(steps), np.int64)
    each = 1
    for a in range(len(steps) - 1, -1, -1):
        repeats[a] = each
        at[a, 0], at[a, 1] = (first // each) % steps[a], first % each
        each *= steps[a]
    for begin in range(0, count, LANES):
        for a in range(len(steps)):
            own, held = x[joints[a]], table[offsets[a] : offsets[a] + steps[a]]
            _deal(own[motion.COS :], own[motion.SIN :], held, repeats[a], a, at)
        doubt[:] = 0.0
        motion.place(parent, slides, constants, x)
        motion.weights(parent, slides, constants, x, inertia)
        motion.reach(parent, slides, carries, constants, foot, lever, x, rows, point)
        if full:  # before the columns of the Jacobian are weighed
            quickness.quickness(carries, rows, constants, _LIMIT, speed, use, doubt)
        factor(parent, inertia, doubt)
        weigh(parent, carries, inertia, rows)
        gather(carries, rows, delassus)
        strike(delassus, across, along, speed, e, mu, impulse, lost, doubt)
        if WIDTH == 3:  # else nothing slips out of the plane, and it need not be compiled
            slide(delassus, across, along, speed, e, mu, impulse, lost, doubt)
        end = min(LANES, count - begin)
        if full:
            movable(delassus, WIDTH == 2, doubt)
            for k in range(1, n):
                row, dv = rows[k], jump[k]
                for i in range(LANES):
                    t, last = row[i] * impulse[i], row[(WIDTH - 1) * LANES + i]
                    t += row[LANES + i] * impulse[LANES + i] if WIDTH == 3 else 0.0
                    dv[i] = -(t + last * impulse[2 * LANES + i])
            unweigh(parent, inertia, jump, doubt)
            motion.jolt(parent, slides, constants, foot, impulse, jump, x, point, heard)
            for i in range(end):
                c = begin + i
                pressed = impulse[2 * LANES + i]
                parting = pressed * per_mass - (speed + heard[2 * LANES + i])
                total = math.sqrt(impulse[i] ** 2 + impulse[LANES + i] ** 2 + pressed**2)
                answer[LOST, c], answer[USE, c] = lost[i], use[i]
                answer[WORST, c] = math.sqrt(heard[i])
                answer[RESTITUTION, c] = math.fabs(parting - e * speed) / speed
                answer[MOMENTUM, c] = heard[LANES + i] / (math.sqrt(point[motion.SIZE + i]) * total)
        for i in range(end):
            c = begin + i
            answer[TANGENT, c], answer[ACROSS, c] = impulse[i], impulse[LANES + i]
            answer[NORMAL, c], answer[GIVE, c] = impulse[2 * LANES + i], delassus[D33 + i]
            answer[DOUBT, c] = doubt[i]


_tuple: Any = numba.types.UniTuple
_SIGNATURE = numba.void(
    *(numba.int64[::1],) * 3, numba.float64[:, ::1], numba.int64, numba.float64[:, ::1],
    numba.int64[::1], numba.boolean[::1], numba.boolean[::1], numba.float64[:, ::1], numba.int64,
    _tuple(numba.float64, 3), _tuple(numba.float64, 6), numba.boolean,
    numba.float64[:, ::1],
)  # fmt: skip


def _compiled(in_plane: bool) -> Callable[..., None]:
    """Return a kernel from the disk if it can be kept there: compiling takes seconds."""
    on = planar if in_plane else spatial
    # numba looks for changes in this file only; the others are part of the name
    parts = (lanes, arithmetic, factors, impulses, quickness, speed_use, on)
    check_type = zlib.crc32(b"".join(Path(str(part.__file__)).read_bytes() for part in parts))
    names = {**globals(), "motion": on, "WIDTH": 2 if in_plane else 3}
    twin = named(FunctionType(_sweep.__code__, names), f"sweep_{check_type:08x}")
    return compiled(twin, _SIGNATURE, **HOW)


_kernels: dict[bool, Callable[..., None]] = {}


class Kernel:
    """The kernel of a scene over a grid: call it with a range of postures.

    Args:
        scene: what kicks.
        joints: number of the joint (from 1) of each axis of the grid.
        values: of each axis, shape `(k,)` [rad; m for slides]; the last axis runs fastest.
        still: value of every joint, shape `(n,)`, for those without an axis.
        ball_mass: [kg].
    """

    def __init__(
        self, scene: Scene, joints: list[int], values: list[Array], still: Array, ball_mass: float
    ) -> None:
        if scene.planar not in _kernels:
            _kernels[scene.planar] = _compiled(scene.planar)
        self._kernel = _kernels[scene.planar]
        steps = np.array([len(axis) for axis in values], np.int64)
        table = [_turn(axis, scene.slides[k]) for axis, k in zip(values, joints, strict=True)]
        alone = np.array(
            [_turn(np.array([q]), s)[0] for q, s in zip(still, scene.slides[1:], strict=True)]
        )
        offsets = np.cumsum(steps) - steps
        whole = np.ascontiguousarray(np.concatenate(table))
        self._grid = (steps, np.array(joints, np.int64), offsets, whole)
        self._scene = (
            np.ascontiguousarray(np.vstack([np.zeros((1, 2)), alone])), scene.parent, scene.slides,
            scene.carries, scene.constants, scene.foot, tuple(map(float, scene.lever)),
            (*scene.give, scene.speed, scene.restitution, scene.friction, 1.0 / ball_mass),
        )  # fmt: skip

    def __call__(self, first: int, count: int, *, full: bool = True) -> Array:
        """Return the answers of `count` postures from number `first` on, shape `(ROWS, count)`."""
        answer = np.empty((ROWS, count))
        self._kernel(*self._grid, first, *self._scene, full, answer)
        return answer


def _turn(values: Array, slide: bool | np.bool_) -> NDArray[np.float64]:
    """Return what a joint's rows begin with: a slide's value, or cosine and sine."""
    if slide:
        return np.column_stack([values, np.zeros(len(values))])
    return np.column_stack([np.cos(values), np.sin(values)])
