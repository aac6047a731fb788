"""Carries of a planar sweep, interpolated between flights within a tolerance.

Where all motion is in one plane, a kick is two numbers: the impulse along the normal and, over it,
the impulse along the tangent. Both are bounded before any posture is known: the first by
(1 + e) v m, as if the leg were infinitely heavy, the second by the friction. So thousands of
flights serve millions of postures.

A posture of a sweep takes 0.15 us with interpolated carries and 3.4 us if `fly_many` flies every
ball (human leg, tolerance 1e-6 m, one thread, `python benchmarks/sweep.py`).
"""

import numpy as np
from numpy.typing import NDArray

from kickdyn.ball import BallState
from kickdyn.core.compilation import MachineCode, Source
from kickdyn.core.validation import Array
from kickdyn.flight.batch import carries
from kickdyn.sweeps.kernel import KernelModel
from kickdyn.sweeps.sweep_kick import FLIGHT_TOLERANCE

NODES, CHECKS = 8, 9
"""Flights per side of a patch, to fit its polynomial and to check it."""

MOST_HALVINGS = 7
"""How often the rectangle of impulses is halved at most."""


def launches(model: KernelModel, impulse: Array) -> BallState:
    r"""Return balls after impulses, :math:`v = p / m` and :math:`\omega = (r / I)\,p \times n`.

    The impulses are given along the contact's axes, shape `(n, 3)` [N s].
    """
    p, kick = impulse @ model.axes.T, model.kick
    spin = np.cross(p, kick.direction) * (kick.ball.radius / kick.ball.inertia)
    return BallState(np.zeros(p.shape), p / kick.ball.mass, spin, np.zeros(len(p)))


class CarryTable:
    """Polynomials of the carry over patches of the impulses' rectangle.

    The rectangle is halved until on every patch a polynomial of degree `NODES - 1` through flights
    at Chebyshev's points (of the carry over the squared normal impulse, which is smooth at 0)
    agrees with other flights within the tolerance. Patches that do not get there, and impulses
    whose ball does not land, are left to be flown.

    The leg of the model is planar, and the kick has air.
    """

    def __init__(self, model: KernelModel, tolerance: float) -> None:
        self._model, kick = model, model.kick
        self._largest_impulse = (1.0 + kick.restitution_used) * kick.speed * kick.ball.mass
        self._largest_slope = max(kick.friction, 1e-3)
        patches: list[Array] = []
        self._index = np.full((2**MOST_HALVINGS, 2 * 2**MOST_HALVINGS), -1, np.int64)
        corners = np.array([[0, 0], [0, 1]])
        for depth in range(MOST_HALVINGS + 1):
            if depth > 1:  # larger patches are checked at too few places
                coefficients, errors = self._fit(corners, depth)
                good = 2.0 * errors <= tolerance  # between the checks they may be larger
                for corner, polynomial in zip(corners[good], coefficients[good], strict=True):
                    side = 2 ** (MOST_HALVINGS - depth)
                    i, j = corner * side
                    self._index[i : i + side, j : j + side] = len(patches)
                    box = np.append((corner + 0.5) / 2**depth - [0.0, 1.0], 0.5 / 2**depth)
                    patches.append(np.concatenate([box, polynomial]))
                corners = corners[~good]
            corners = np.concatenate([2 * corners + corner for corner in np.ndindex(2, 2)])
            if not 0 < len(corners) <= 1500:  # patches per halving: some ten seconds in all
                break
        self._patches = np.array(patches) if patches else np.zeros((1, 3 + NODES**2))
        self._evaluate = EVALUATE()

    def __call__(self, normal: Array, tangent: Array, carry: Array) -> NDArray[np.bool_]:
        """Fill in the carries [m] of impulses along normal and tangent [N s], shapes `(n,)`.

        Return which balls must be flown instead.
        """
        to_fly = np.empty(len(normal), bool)
        largest, slope = self._largest_impulse, self._largest_slope
        self._evaluate(normal, tangent, largest, slope, self._index, self._patches, carry, to_fly)
        return to_fly

    def _fit(self, corners: NDArray[np.int64], depth: int) -> tuple[Array, Array]:
        """Return coefficients of each patch, lowest powers first, and its largest error [m]."""
        nodes = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)  # Chebyshev's, first kind
        checks = np.linspace(-1.0, 1.0, CHECKS)
        fitted, checked = (
            np.stack(np.meshgrid(points, points, indexing="ij"), -1).reshape(-1, 2)
            for points in (nodes, checks)
        )
        places = np.concatenate([fitted, checked])
        middle = (corners[:, None] + 0.5 * (1.0 + places)) / 2**depth - [0.0, 1.0]
        share, slope = np.maximum(middle[..., 0], 1e-6), middle[..., 1] * self._largest_slope
        flown = self._fly(share.ravel(), slope.ravel()).reshape(share.shape)
        degrees, number = (NODES - 1, NODES - 1), len(fitted)
        powers = np.polynomial.polynomial.polyvander2d(places[:, 0], places[:, 1], degrees)
        coefficients = (flown / share**2)[:, :number] @ np.linalg.inv(powers[:number]).T
        again = coefficients @ powers[number:].T * share[:, number:] ** 2
        errors = np.abs(again - flown[:, number:]).max(axis=1)
        return coefficients, np.where(np.isfinite(errors), errors, np.inf)

    def _fly(self, share: Array, slope: Array) -> Array:
        """Return carries [m] of normal impulses over the largest and tangential over normal ones.

        Where a ball does not land, the carry is nan.
        """
        normal = share * self._largest_impulse
        impulse = np.column_stack([slope * normal, np.zeros(len(share)), normal])
        kick = self._model.kick
        balls = launches(self._model, impulse)
        carry, landed = carries(balls, kick.ball, kick.air, FLIGHT_TOLERANCE, machine_code=True)
        return np.where(landed, carry, np.nan)


def _evaluate(normal, tangent, largest, slope, index, patches, carry, to_fly):  # type: ignore[no-untyped-def]
    """Fill in carries by Horner's scheme, and where there is no polynomial."""
    rows, columns = index.shape
    for i in range(len(normal)):
        share = normal[i] / largest
        aside = tangent[i] / (normal[i] * slope)
        to_fly[i] = not (0.0 < share < 1.0 + 1e-9 and -1.0 - 1e-9 < aside < 1.0 + 1e-9)
        if to_fly[i]:
            continue
        a = min(int(share * rows), rows - 1)
        b = max(min(int((aside + 1.0) * 0.5 * columns), columns - 1), 0)
        k = index[a, b]
        to_fly[i] = k < 0
        if k < 0:
            continue
        u = (share - patches[k, 0]) / patches[k, 2]
        v = (aside - patches[k, 1]) / patches[k, 2]
        total = 0.0
        for c in range(NODES - 1, -1, -1):
            begin, inner = 3 + c * NODES, 0.0
            for d in range(NODES - 1, -1, -1):
                inner = inner * v + patches[k, begin + d]
            total = total * u + inner
        carry[i] = total * share * share


def _source() -> Source:
    import numba  # here, because it takes long to import

    vector, index, patches = numba.float64[::1], numba.int64[:, ::1], numba.float64[:, ::1]
    number, flags = numba.float64, numba.boolean[::1]
    signature = numba.void(vector, vector, number, number, index, patches, vector, flags)
    return Source(_evaluate, signature, {"error_model": "numpy"})


EVALUATE = MachineCode(_source, "the interpolation of carries", 0.4)
