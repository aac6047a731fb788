"""Carries of a planar sweep, interpolated between flights within a tolerance.

Where all motion is in one plane, a kick is two numbers: the impulse along the normal and, over it,
the impulse along the tangent. Both are bounded before any posture is known: the first by
(1 + e) v m, as if the leg were infinitely heavy, the second by the friction. So thousands of
flights serve millions of postures.

A posture of a sweep takes 0.15 us with interpolated carries and 3.4 us if `fly_many` flies every
ball (human leg, tolerance 1e-6 m, one thread, `python benchmarks/sweep.py`).
"""

from collections.abc import Callable

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
    """Polynomials of the carry over patches of a rectangle of impulses.

    Coordinates are the normal impulse, over the largest that a leg could give, and the tangential
    over the normal one, over the largest that friction allows. The rectangle is halved until on
    every patch a polynomial of degree `NODES - 1` through flights at Chebyshev's points (of the
    carry over the squared normal impulse, which is smooth at 0) agrees with other flights within
    the tolerance. Patches that do not get there, and impulses whose ball does not land, are left
    to be flown.

    The leg of the model is planar, and the kick has air.

    Args:
        model: leg and kick.
        tolerance: largest error of a carry [m].
        impulses: impulses along normal and tangent [N s], shapes `(n,)`, which the rectangle is
            to enclose closely; None is all impulses that can be.
        machine_code: whether the balls fly in machine code.
    """

    def __init__(
        self,
        model: KernelModel,
        tolerance: float,
        impulses: tuple[Array, Array] | None = None,
        *,
        machine_code: bool = True,
    ) -> None:
        self._model, kick, self._machine_code = model, model.kick, machine_code
        self._largest_impulse = (1.0 + kick.restitution_used) * kick.speed * kick.ball.mass
        self._largest_slope = max(kick.friction, 1e-3)
        self._corner, self._sides, fewest_halvings, most_patches = (0.0, -1.0), (1.0, 2.0), 2, 1500
        if impulses is not None:
            normal, tangent = impulses
            shares = normal / self._largest_impulse, tangent / (normal * self._largest_slope)
            lowest = [float(share.min()) for share in shares]
            widths = [float(share.max()) - low for share, low in zip(shares, lowest, strict=True)]
            self._corner = lowest[0], lowest[1]
            self._sides = max(widths[0], 1e-6), max(widths[1], 1e-6)
            # the balls that the table saves must be more than those that it takes
            fewest_halvings, most_patches = 0, len(normal) // (4 * (NODES**2 + CHECKS**2))
        patches: list[Array] = []
        self._index = np.full((2**MOST_HALVINGS, 2**MOST_HALVINGS), -1, np.int64)
        corners = np.array([[0, 0]])
        for depth in range(MOST_HALVINGS + 1):
            if not 0 < len(corners) <= most_patches:  # per halving: some ten seconds in all
                break
            if depth >= fewest_halvings:  # larger patches are checked at too few places
                coefficients, errors = self._fit(corners, depth)
                good = 2.0 * errors <= tolerance  # between the checks they may be larger
                for corner, polynomial in zip(corners[good], coefficients[good], strict=True):
                    side = 2 ** (MOST_HALVINGS - depth)
                    i, j = corner * side
                    self._index[i : i + side, j : j + side] = len(patches)
                    box = np.append((corner + 0.5) / 2**depth, 0.5 / 2**depth)
                    patches.append(np.concatenate([box, polynomial]))
                corners = corners[~good]
            corners = np.concatenate([2 * corners + corner for corner in np.ndindex(2, 2)])
        self._patches = np.array(patches) if patches else np.zeros((1, 3 + NODES**2))

    def __call__(self, normal: Array, tangent: Array, carry: Array) -> NDArray[np.bool_]:
        """Fill in the carries [m] of impulses along normal and tangent [N s], shapes `(n,)`.

        Return which balls must be flown instead.
        """
        to_fly = np.empty(len(normal), bool)
        scales = np.array([self._largest_impulse, self._largest_slope, *self._corner, *self._sides])
        pays = EVALUATE.pays(len(normal) * SECONDS_IN_PYTHON)
        evaluate: Callable[..., None] = EVALUATE() if pays else _evaluate
        with np.errstate(divide="ignore", invalid="ignore"):  # of impulses that are 0
            evaluate(normal, tangent, scales, self._index, self._patches, carry, to_fly)
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
        place = (corners[:, None] + 0.5 * (1.0 + places)) / 2**depth
        place = self._corner + place * self._sides
        share, slope = np.maximum(place[..., 0], 1e-6), place[..., 1] * self._largest_slope
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
        carry, landed = carries(
            balls, kick.ball, kick.air, FLIGHT_TOLERANCE, machine_code=self._machine_code
        )
        return np.where(landed, carry, np.nan)


SECONDS_IN_PYTHON = 3e-5
"""Processor time of a carry from the table, roughly [s]."""


def _evaluate(normal, tangent, scales, index, patches, carry, to_fly):  # type: ignore[no-untyped-def]
    """Fill in carries by Horner's scheme, and where there is no polynomial."""
    rows, columns = index.shape
    largest, slope, corner_x, corner_y, side_x, side_y = scales
    for i in range(len(normal)):
        share = normal[i] / largest
        x = (share - corner_x) / side_x
        y = (tangent[i] / (normal[i] * slope) - corner_y) / side_y
        to_fly[i] = not (-1e-9 < x < 1.0 + 1e-9 and -1e-9 < y < 1.0 + 1e-9 and share > 0.0)
        if to_fly[i]:
            continue
        a = max(min(int(x * rows), rows - 1), 0)
        b = max(min(int(y * columns), columns - 1), 0)
        k = index[a, b]
        to_fly[i] = k < 0
        if k < 0:
            continue
        u = (x - patches[k, 0]) / patches[k, 2]
        v = (y - patches[k, 1]) / patches[k, 2]
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
    signature = numba.void(vector, vector, vector, index, patches, vector, numba.boolean[::1])
    return Source(_evaluate, signature, {"error_model": "numpy"})


EVALUATE = MachineCode(_source, "the interpolation of carries", 0.4)
