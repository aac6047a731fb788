"""All variables of a range of postures, by a compiled kernel and flights."""

from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.compilation import MachineCode, Source
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.batch import MARCH, TIME_LIMIT, landings, seconds_of_fly
from kickdyn.flight.events import ground_event
from kickdyn.flight.flight_result import LANDED
from kickdyn.impact.laws import find_law
from kickdyn.robot.leg import Leg
from kickdyn.sweeps.dataset import VARIABLES, describe, variables_of
from kickdyn.sweeps.grid import Grid
from kickdyn.sweeps.kernel import KERNEL, NORMAL, TANGENT, Kernel, KernelModel, fill_variables
from kickdyn.sweeps.sweep_kick import FLIGHT_TOLERANCE, Kick, PostureStatus, kick_from

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


def _carries(
    model: KernelModel, impulse: Array, tol: float, machine_code: bool
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the carries [m] of balls after impulses, and which balls land, shapes `(n,)`."""
    balls, kick = launches(model, impulse), model.kick
    back, how = (ground_event(kick.ball, None),), {"machine_code": machine_code}
    end, status = landings(balls, kick.ball, kick.air, back, tol, TIME_LIMIT, **how)
    return np.hypot(end.position[:, 0], end.position[:, 1]), status == LANDED


class CarryTable:
    """Polynomials of the carry over patches of a rectangle of impulses.

    Coordinates are the normal impulse, over the largest that a leg could give, and the tangential
    over the normal one, over the largest that friction allows. The rectangle is halved until on
    every patch a polynomial of degree `NODES - 1` through flights at Chebyshev's points (of the
    carry over the squared normal impulse, which is smooth at 0) agrees with other flights within
    the tolerance. Patches that do not get there, and impulses whose ball does not land, are left
    to be flown.

    The leg of the model is planar, and the kick has air. With impulses along normal and tangent
    [N s], shapes `(n,)`, the rectangle encloses these closely; else all impulses that can be.
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
        pays = EVALUATE.pays(len(normal) * SECONDS_OF_CARRY)
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
        carry, landed = _carries(self._model, impulse, FLIGHT_TOLERANCE, self._machine_code)
        return np.where(landed, carry, np.nan)


SECONDS_OF_CARRY = 3e-5
"""Processor time of a carry from the table in Python, roughly [s]."""


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


SECONDS_IN_PYTHON = 3e-6
"""Processor time of a posture without its flight, by arrays of Python, roughly [s]."""

STORED_FROM = 2000
"""Postures from which the flights of a stored sweep are machine code, so that it has the same
digits whether or not it was interrupted. In memory, `fly_many`'s rule decides."""

TABLE_FROM = 600
"""Postures from which carries are interpolated: the least table takes 145 flights."""

CHUNK = 262_144
"""Postures per chunk, roughly."""

BLOCK = 16_384
"""Postures of a chunk that are computed at a time: larger intermediate results take more memory."""

SLOW_CHUNK = 512
"""Postures per chunk where each of them is one `kick_from`: about a second."""

_CARRY = list(VARIABLES).index("carry")


class ChunkSolver:
    """Computes all variables of ranges of postures; safe to call from several threads.

    All postures go through `kernel` at once, on arrays or, for millions of them, in machine code.
    Where it does not serve (a base that floats or moves, supports, loops, wind that changes with
    height, a law without a kernel), and where it marks a posture as doubtful, `kick_from` computes
    one after the other, a thousand times slower.

    Attributes:
        leg, grid, kick, tolerance: as for `kickdyn.sweep`.
        chunk: number of postures to compute at a time.
        carry_tolerance: `tolerance` where carries are interpolated, else 0.
    """

    def __init__(
        self, leg: Leg, grid: Grid, kick: Kick, tolerance: float = 0.0, *, stored: bool = False
    ) -> None:
        self.tolerance = validation.number("tolerance", tolerance, at_least=0, unit="m")
        self.leg, self.grid, self.kick = leg, grid, kick
        self._model: KernelModel | None = None
        self._kernel: Kernel | None = None
        self._table: Callable[[Array, Array, Array], NDArray[np.bool_]] | None = None
        windy = kick.air is not None and callable(kick.air.wind)
        if not windy and find_law(kick.law).has_kernel:
            self._model = KernelModel.of(leg, kick)
        self._stored, self._flies_in_machine_code = stored, False
        self.chunk = SLOW_CHUNK if self._model is None else CHUNK
        planar = self._model is not None and self._model.planar
        in_table = planar and kick.air is not None and grid.size >= TABLE_FROM
        self.carry_tolerance = self.tolerance if in_table else 0.0
        self._flight_tolerance = min(max(1e-3 * self.tolerance, FLIGHT_TOLERANCE), 1e-9)

    @property
    def seconds(self) -> float:
        """Processor time that a large grid takes, roughly [s]."""
        seconds = 2e-3 if self._model is None else 0.3e-6 if self.carry_tolerance > 0.0 else 4e-6
        return seconds * self.grid.size

    def describe(self) -> xr.Dataset:
        """Return coordinates and provenance of the sweep, see `dataset.describe`."""
        return describe(self.leg, self.grid, self.kick, self.carry_tolerance)

    def prepare(self) -> None:
        """Compile the kernel and fly the balls of the carry table; to be called before threads."""
        if self._model is None:
            return
        count, tol = self.grid.size, self._flight_tolerance
        if self._stored:
            self._flies_in_machine_code = count >= STORED_FROM
        else:
            self._flies_in_machine_code = count > BLOCK or MARCH.pays(count * seconds_of_fly(tol))
        machine_code = KERNEL.pays(count * SECONDS_IN_PYTHON)
        self._kernel = Kernel(self._model, self.leg, self.grid, machine_code=machine_code)
        if self.carry_tolerance > 0.0 and count > BLOCK:
            self._table = CarryTable(self._model, self.carry_tolerance)

    def __call__(self, first: int, count: int) -> tuple[Array, NDArray[np.int8]]:
        """Return the results of n postures from number `first` on.

        These are values in the order of `VARIABLES`, shape `(len(VARIABLES), n)`, and flags of
        `PostureStatus`, shape `(n,)`.
        """
        rows = np.full((len(VARIABLES), count), np.nan)
        status, doubtful = np.zeros(count, np.int8), np.ones(count, bool)
        if self._model is not None:
            for begin in range(0, count, BLOCK):
                k = slice(begin, begin + BLOCK)
                doubtful[k] = self._compute(self._model, first + begin, rows[:, k], status[k])
        for i in np.flatnonzero(doubtful).tolist():
            try:
                q = self.grid.configuration(self.leg, first + i)
            except InvalidInput:
                status[i] = PostureStatus.NOT_CLOSED.flag
                continue
            outcome = kick_from(self.leg.posture(q), self.kick)
            rows[:, i] = list(variables_of(outcome, self.kick).values())
            status[i] = outcome.status.flag
        return rows, status

    def _compute(
        self, model: KernelModel, first: int, rows: Array, status: NDArray[np.int8]
    ) -> NDArray[np.bool_]:
        """Fill in the results of kernel and flights; return which postures are doubtful."""
        assert self._kernel is not None
        answer = self._kernel(first, len(status))
        doubtful = fill_variables(answer, model, rows, status)
        to_fly, table = ~doubtful, self._table
        if self.carry_tolerance > 0.0 and table is None and to_fly.any():  # of the whole grid
            impulses = answer[NORMAL, to_fly], answer[TANGENT, to_fly]
            fast = self._flies_in_machine_code
            table = CarryTable(model, self.carry_tolerance, impulses, machine_code=fast)
        if table is not None:
            to_fly &= table(answer[NORMAL], answer[TANGENT], rows[_CARRY])
        flown = np.flatnonzero(to_fly)
        if flown.size:
            impulse, fast = answer[:3, flown].T, self._flies_in_machine_code
            rows[_CARRY, flown], landed = _carries(model, impulse, self._flight_tolerance, fast)
            doubtful[flown[~landed]] = True
        return doubtful
