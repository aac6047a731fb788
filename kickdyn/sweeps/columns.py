"""The numbers of a sweep from a kernel's answers, in machine code; all of it but the carry."""

from __future__ import annotations

import math
from typing import Any

import numba

from kickdyn.core.compilation import compiled

(MASS, IMPULSE, IMMOVABLE, BALL_SPEED, SPEED_RATIO, LAUNCH_ANGLE, BACK_SPIN, WORST_JOINT,
 ENERGY_LOST, SPEED_USE, CARRY, RESTITUTION, MOMENTUM) = range(13)  # fmt: skip
"""Rows of a chunk, in the order of `kickdyn.sweeps.run.VARIABLES`."""


def _fill(found, axes, scalars, rows, status, doubt):  # type: ignore[no-untyped-def]
    """Fill in rows and status; doubt what is not finite.

    Args:
        found: a kernel's answer, rows as in `kickdyn.sweeps.kernels`.
        axes: of the contact, as `Scene.axes`.
        scalars: foot speed, restitution, mass of the ball, its radius over its inertia.
        rows: shape `(13, n)`.
        status: of each posture.
        doubt: whether the kernel cannot vouch for it.
    """
    speed, e, mass, turn = scalars
    nx, ny, nz = axes[0, 2], axes[1, 2], axes[2, 2]
    for i in range(found.shape[1]):
        a, b, c = found[0, i], found[1, i], found[2, i]
        px = axes[0, 0] * a + axes[0, 1] * b + nx * c
        py = axes[1, 0] * a + axes[1, 1] * b + ny * c
        pz = axes[2, 0] * a + axes[2, 1] * b + nz * c
        size = math.sqrt(px * px + py * py + pz * pz)
        heavy = 1.0 / found[3, i]
        rows[0, i], rows[1, i], rows[2, i] = heavy, size, (1.0 + e) * speed * heavy
        rows[3, i], rows[4, i] = size / mass, size / mass / speed
        rows[5, i] = math.atan2(pz, math.sqrt(px * px + py * py))
        rows[6, i] = 0.0 - (pz * nx - px * nz) * turn
        rows[7, i], rows[8, i], rows[9, i] = found[7, i], found[5, i], found[6, i]
        rows[11, i], rows[12, i] = found[8, i], found[9, i]
        status[i] = 1 if found[6, i] > 1.0 else 0
        total = 0.0
        for k in range(found.shape[0]):
            total += 0.0 * found[k, i]  # nan if one of them is not finite
        doubt[i] = found[4, i] != 0.0 or total != 0.0


_tuple: Any = numba.types.UniTuple
_matrix: Any = numba.float64[:, ::1]
fill = compiled(
    _fill,
    numba.void(
        _matrix, _matrix, _tuple(numba.float64, 4), _matrix, numba.int8[::1],
        numba.boolean[::1],
    ),
)  # fmt: skip
