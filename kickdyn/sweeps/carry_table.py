"""Carries of a planar sweep, read off polynomials that were fitted to flights, within an error.

Where all motion is in one plane, a kick is two numbers: the impulse along the normal and, over it,
that along the tangent. Both are bounded before any posture is known: the first by (1 + e) m v, that
of an endlessly heavy leg, the second by the friction. This box is halved until on every patch a
polynomial through flown balls agrees with other flown balls; patches that stay too rough, and kicks
that do not land there, are left to `fly_many`, ball by ball.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from kickdyn.ball import BallState
from kickdyn.core.compilation import compiled
from kickdyn.core.validation import Array
from kickdyn.flight.batch import fly_many
from kickdyn.sweeps.kernel_scene import Scene
from kickdyn.sweeps.kick import Kick

NODES, CHECKS = 8, 9
"""Flights per side of a patch, to make its polynomial and to judge it."""

DEPTH = 7
"""How often the box may be halved."""

MOST = 1500
"""Patches that may be looked at per halving: some ten seconds in the end."""

SAFETY = 2.0
"""By how much the errors that are met must stay below the one that is stated."""

TOL = 1e-11
"""Relative tolerance of those flights."""


def launches(scene: Scene, kick: Kick, impulse: Array) -> BallState:
    """Return how balls leave with impulses along the contact's axes, shape `(n, 3)` [N s]."""
    p = impulse @ scene.axes.T
    spin = np.cross(p, kick.direction) * (kick.ball.radius / kick.ball.inertia)
    return BallState(np.zeros(p.shape), p / kick.ball.mass, spin, np.zeros(len(p)))


class Carries:
    """What was fitted: call it with impulses.

    Args:
        scene: a planar one.
        kick: what is the same for every posture.
        error: that a carry may have [m], above 0.

    Attributes:
        error: the one asked for [m].
        worst: largest error met in the flights that judge [m].
        flights: flown to make it.
        patches: whose carries are read off.
    """

    def __init__(self, scene: Scene, kick: Kick, error: float) -> None:
        self._scene, self._kick, self.error = scene, kick, error
        self._most = (1.0 + kick.restitution) * kick.speed * kick.ball.mass
        self._slope = max(kick.friction, 1e-3)
        self.worst, self.flights = 0.0, 0
        kept: list[Array] = []
        self._index = np.full((2**DEPTH, 2 * 2**DEPTH), -1, np.int64)
        corners = np.array([[0, 0], [0, 1]])
        for depth in range(DEPTH + 1):
            if depth > 1:  # fewer would meet too little to be judged by
                found, errors = self._fitted(corners, depth)
                sound = errors * SAFETY <= error
                self.worst = max(self.worst, float(errors[sound].max(initial=0.0)))
                for corner, coefficients in zip(corners[sound], found[sound], strict=True):
                    side = 2 ** (DEPTH - depth)
                    i, j = corner * side
                    self._index[i : i + side, j : j + side] = len(kept)
                    box = np.append((corner + 0.5) / 2**depth - [0.0, 1.0], 0.5 / 2**depth)
                    kept.append(np.concatenate([box, coefficients]))
                corners = corners[~sound]
            corners = np.concatenate([2 * corners + each for each in np.ndindex(2, 2)])
            if not 0 < len(corners) <= MOST:
                break
        self.patches = len(kept)
        self._patches = np.array(kept) if kept else np.zeros((1, 3 + NODES**2))

    def __call__(
        self, normal: Array, tangent: Array, carry: Array, unknown: NDArray[np.bool_]
    ) -> None:
        """Fill in carries of impulses [N s], and which of them must be flown."""
        size = self._most, self._slope
        _look_up(normal, tangent, size, self._index, self._patches, carry, unknown)

    def _fitted(self, corners: NDArray[np.int64], depth: int) -> tuple[Array, Array]:
        """Return coefficients of each patch, lowest powers first, and its largest error [m]."""
        nodes, checks = _between(NODES), np.linspace(-1.0, 1.0, CHECKS)
        made = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), -1).reshape(-1, 2)
        held = np.stack(np.meshgrid(checks, checks, indexing="ij"), -1).reshape(-1, 2)
        places = np.concatenate([made, held])
        middle = (corners[:, None] + 0.5 * (1.0 + places)) / 2**depth - [0.0, 1.0]
        share, slope = np.maximum(middle[..., 0], 1e-6), middle[..., 1] * self._slope
        flown = self._flown(share.ravel(), slope.ravel()).reshape(share.shape)
        inverse = np.linalg.inv(np.vander(nodes, increasing=True))
        values = (flown / share**2)[:, : len(made)].reshape(-1, NODES, NODES)
        found = np.einsum("ai,nij,bj->nab", inverse, values, inverse)
        powers = [np.vander(part, NODES, increasing=True) for part in held.T]
        again = np.einsum("ka,nab,kb->nk", powers[0], found, powers[1])
        errors = np.abs(again * share[:, len(made) :] ** 2 - flown[:, len(made) :]).max(axis=1)
        return found.reshape(len(found), -1), np.where(np.isfinite(errors), errors, np.inf)

    def _flown(self, share: Array, slope: Array) -> Array:
        """Return the carry of impulses over the largest, and tangent over normal; nan if aloft."""
        self.flights += len(share)
        normal = share * self._most
        impulse = np.column_stack([slope * normal, np.zeros(len(share)), normal])
        balls = launches(self._scene, self._kick, impulse)
        flown = fly_many(balls, self._kick.ball, self._kick.air, tol=TOL)
        return np.asarray(np.where(flown.status.values == 0, flown.range.values, np.nan))


def _between(count: int) -> Array:
    """Return Chebyshev's points of the first kind, all of them within (-1, 1)."""
    return np.asarray(np.cos(np.pi * (np.arange(count) + 0.5) / count))


def _read(normal, tangent, size, index, patches, carry, unknown):  # type: ignore[no-untyped-def]
    most, slope = size
    rows, columns = index.shape
    for i in range(len(normal)):
        share = normal[i] / most
        aside = tangent[i] / (normal[i] * slope)
        unknown[i] = not (0.0 < share < 1.0 + 1e-9 and -1.0 - 1e-9 < aside < 1.0 + 1e-9)
        if unknown[i]:
            continue
        a = min(int(share * rows), rows - 1)
        b = max(min(int((aside + 1.0) * 0.5 * columns), columns - 1), 0)
        k = index[a, b]
        unknown[i] = k < 0
        if k < 0:
            continue
        u = (share - patches[k, 0]) / patches[k, 2]
        v = (aside - patches[k, 1]) / patches[k, 2]
        total = 0.0
        for c in range(NODES - 1, -1, -1):
            place, part = 3 + c * NODES, 0.0
            for d in range(NODES - 1, -1, -1):
                part = part * v + patches[k, place + d]
            total = total * u + part
        carry[i] = total * share * share


_tuple: Any = numba.types.UniTuple
_vector: Any = numba.float64[::1]
_look_up = compiled(
    _read,
    numba.void(
        _vector, _vector, _tuple(numba.float64, 2), numba.int64[:, ::1],
        numba.float64[:, ::1], _vector, numba.boolean[::1],
    ),
    error_model="numpy",
)  # fmt: skip
