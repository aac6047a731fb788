r"""`KickReader`: reads a library of kicks and answers with a motion, on NumPy alone.

This file depends on NumPy only, so that it can be copied onto a robot. A library has motions at
nodes of the launch's speed, elevation and azimuth and of the ball's place x, y. Cells are boxes
between nodes; in a covered cell, the coefficients of the splines are interpolated linearly along
each axis. Then the equations of the impact are solved exactly: with the mass matrix M, the Jacobian
J of the contact point and the impulse p on the ball, of mass m,

.. math::
    M w = -J^T p, \quad c = -J w + p / m, \quad
    n \cdot J v^- = n \cdot c / (1 + e), \quad v^+ = v^- + w,

at the configuration q nearest to the interpolated one in which the foot touches the ball. The
impulse is along the normal n, so the ball does not spin; across n, J v^- is c, with which the foot
sticks, or free without friction.

The file is NumPy's `.npz` with the arrays that `ARRAYS` describes. Frames are those of the library:
the robot stands on its supporting foot, z is up, and azimuth 0 is along x.
"""

import hashlib
import os
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FORMAT = "kickdyn kick library 1"

AXES = ("speed", "elevation", "azimuth", "x", "y")
"""Axes of a library: the launch's speed [m/s], its angles above the ground and to the left of x
[rad], and the place of the ball's centre [m]."""

ARRAYS = {
    "format": "name of the format",
    "checksum": "SHA-256 of the other arrays, in the order of their names",
    "robot": "name of the robot",
    "lower, upper": "ranges of the axes, of which some are single values, (5,)",
    "coefficients": "of the splines of the nodes, (nodes, size, moving joints) [rad; m]",
    "cell_lower, cell_upper": "corners of the cells, (cells, 5)",
    "cell_nodes": "nodes at the corners of a cell, the last axis of more than one value fastest, "
    "-1 where there is none, (cells, 2^d)",
    "cell_reasons": "why a cell is not covered; empty where it is, (cells,)",
    "cell_margins": "least margin of each limit in the motions checked in a cell, (cells, limits)",
    "limits": "names of the limits, with units, (limits,)",
    "before_knots, after_knots": "of the cubic splines before and after the impact [s]",
    "before_matrix, after_matrix": "from the coefficients of a node to those of the splines",
    "at_impact": "from the coefficients to position, velocity before and after, (3, size)",
    "from_impact": "from changes of these to smooth changes of the coefficients, (size, 3)",
    "joints": "names of all joints, from the supporting foot on, (n,)",
    "moving": "indices of those that move, in the order of the coefficients",
    "resting": "values of the joints where they do not move, (n,) [rad; m]",
    "parents": "joint before each joint, -1 for the ground, (n,)",
    "rotations, translations": "of each joint in the axes of its parent, (n, 3, 3) and (n, 3) [m]",
    "axes": "of the joints, in their own frames, (n, 3)",
    "prismatic": "whether each joint slides, (n,)",
    "masses, centres, inertias": "of the bodies, in the frames of their joints, inertias about the "
    "centres of mass, (n,), (n, 3), (n, 3, 3) [kg, m, kg m2]",
    "armature": "inertia of the rotors at the joints, (n,) [kg m2; kg]",
    "contact": "joint that carries the contact point",
    "contact_point": "in the frame of that joint, (3,) [m]",
    "ball": "mass [kg], radius [m], height of its centre [m]",
    "impact": "coefficients of restitution and friction",
    "settling": "time in which joints that the impact pushes return to rest [s]",
    "simulated": "speed, elevation and azimuth of the ball that the motion of a node gives in "
    "MuJoCo, by `correct_library`; NaN where the foot misses, and absent before, (nodes, 3)",
}
"""Arrays of a file, in SI units."""

ITERATIONS, LAUNCH_ERROR, STEP = 30, 1e-6, 1e-4
"""Most steps in which a launch is corrected, its error then, relative and in rad, and the share of
a range over which slopes are differences."""


class InterpolatedKick(NamedTuple):
    """A kick from a library."""

    coefficients: Array  # of the splines, shape `(size, moving joints)`
    q: Array  # of all joints at the impact, shape `(n,)` each [rad, rad/s; m, m/s]
    v_before: Array
    v_after: Array
    # least distance from each limit among the motions checked in the cell
    margins: dict[str, float]


class KickReader:
    """A library of kicks.

    Args:
        arrays: see `ARRAYS`; of a file by `read_kicks`.
    """

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.arrays = a = arrays
        self.lower, self.upper = a["lower"], a["upper"]
        self.active = np.flatnonzero(self.upper > self.lower)
        self.joints = [str(name) for name in a["joints"]]
        self.limits = [str(name) for name in a["limits"]]
        self._covered = a["cell_reasons"] == ""
        parents = a["parents"]
        self._after = np.eye(len(parents), dtype=bool)  # [i, j]: body j moves with joint i
        for j, parent in enumerate(parents):
            if parent >= 0:
                self._after[:, j] |= self._after[:, parent]

    def nearest(self, point: Array) -> Array | None:
        """Return the covered point that is nearest, relative to the ranges; None without one."""
        if not self._covered.any():
            return None
        a, scale = self.arrays, np.where(self.upper > self.lower, self.upper - self.lower, 1.0)
        inside = np.clip(point, a["cell_lower"][self._covered], a["cell_upper"][self._covered])
        return np.asarray(inside[np.linalg.norm((inside - point) / scale, axis=1).argmin()])

    def cell(self, point: Array) -> int | None:
        """Return the covered cell around a point with the largest least margin, if any."""
        a, room = self.arrays, 1e-9
        inside = (a["cell_lower"] - room <= point) & (point <= a["cell_upper"] + room)
        cells = np.flatnonzero(inside.all(axis=1) & self._covered)
        if not len(cells):
            return None
        return int(cells[a["cell_margins"][cells].min(axis=1, initial=np.inf).argmax()])

    def kick(self, point: Array) -> InterpolatedKick | None:
        """Return the kick at speed, elevation, azimuth, x and y, `(5,)`; None where none is."""
        point = np.asarray(point, dtype=float)
        if point.shape != (5,) or not np.isfinite(point).all():
            raise ValueError(f"the point must be 5 finite numbers, {', '.join(AXES)}")
        number = self.cell(point)
        if number is None:
            return None
        coefficients = self._interpolated("coefficients", point, number)
        least = self.arrays["cell_margins"][number].tolist()
        margins = dict(zip(self.limits, least, strict=True))
        return InterpolatedKick(*self.with_exact_impact(coefficients, point), margins)

    def _interpolated(self, name: str, point: Array, number: int) -> Array:
        """Return values of the nodes, interpolated at a point of a cell."""
        a = self.arrays
        low, high = (a[end][number, self.active] for end in ("cell_lower", "cell_upper"))
        weights = np.ones(1)
        for share in (point[self.active] - low) / (high - low):
            weights = np.kron(weights, [1.0 - share, share])
        return np.asarray(np.tensordot(weights, a[name][a["cell_nodes"][number]], 1))

    @cached_property
    def node_points(self) -> Array:
        """Places of the nodes of the covered cells on the axes, `(nodes, 5)`; NaN for others."""
        a = self.arrays
        points = np.full((len(a["coefficients"]), 5), np.nan)
        for number in np.flatnonzero(self._covered):
            ends = np.stack([a["cell_lower"][number], a["cell_upper"][number]], axis=1)
            corners = np.tile(self.lower, (len(a["cell_nodes"][number]), 1))
            corners[:, self.active] = list(product(*ends[self.active]))
            points[a["cell_nodes"][number]] = corners
        return points

    def correct(self, point: Array) -> tuple[Array, float] | None:
        """Return the point whose kick has in MuJoCo the launch of another, and an angle [rad].

        The robot must be turned to the left about the ball by the angle. The launches of the nodes
        in MuJoCo are interpolated as their motions are, and Newton's method finds where they have
        the speed and the elevation of `point`, `(5,)`. None is where they have not.
        """
        wished, low, high = np.asarray(point, dtype=float), self.lower, self.upper
        if not wished[0] > 0.0:
            return None
        scale, steps = np.array([1.0 / wished[0], 1.0]), STEP * np.diag(high - low)
        free = self.active[self.active < 2]
        far = np.abs((self.arrays["simulated"] - wished[:3])[:, :2] * scale).sum(axis=1)
        far += np.abs(self.node_points[:, 3:] - wished[3:]).sum(axis=1)
        if np.isnan(far).all():
            return None
        place = np.append(self.node_points[np.nanargmin(far), :3], wished[3:])
        for _ in range(ITERATIONS):
            launch = self.simulated(place)
            if launch is None:
                return None
            error, turn = (wished[:2] - launch[:2]) * scale, float(wished[2] - launch[2])
            azimuth = float(np.clip(place[2] + turn, low[2], high[2]))
            if max(*np.abs(error), abs(azimuth - place[2])) < LAUNCH_ERROR:
                return place, turn
            slopes = np.zeros((2, len(free)))
            for k, axis in enumerate(free):
                near = ((n, self.simulated(place + n * steps[axis])) for n in (-1, 0, 1))
                ends = [(n, at) for n, at in near if at is not None]
                (n, first), (m, last) = ends[0], ends[-1]
                slopes[:, k] = (last - first)[:2] * scale / (max(m - n, 1) * steps[axis, axis])
            place[free] += np.linalg.lstsq(slopes, error, rcond=1e-6)[0]
            place[2] = azimuth
            place[:3] = np.clip(place, low, high)[:3]
        return None

    def simulated(self, point: Array) -> Array | None:
        """Return speed, elevation and azimuth in MuJoCo of the kick at a point, if any."""
        number = self.cell(point)
        if number is None:
            return None
        launch = self._interpolated("simulated", point, number)
        return None if np.isnan(launch).any() else launch

    def with_exact_impact(
        self, coefficients: Array, point: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return the nearest coefficients that keep the equations of the impact, q, v- and v+."""
        a, moving = self.arrays, self.arrays["moving"]
        mass, radius, height = a["ball"]
        restitution, friction = a["impact"]
        launch = launch_velocity(point)
        normal = launch / np.linalg.norm(launch)
        impulse, place = mass * launch, np.array([*point[3:], height]) - radius * normal
        state = a["at_impact"] @ coefficients
        position, before = state[0].copy(), state[1]
        for _ in range(3):
            where, jacobian, _ = self.kinematics(position)
            position += np.linalg.pinv(jacobian[:, moving], rcond=1e-6) @ (place - where)
        _, jacobian, inertia = self.kinematics(position)
        jump = np.linalg.solve(inertia, -jacobian.T @ impulse)
        change = impulse / mass - jacobian @ jump
        along = (normal @ change) * normal
        wished, rows = along / (1.0 + restitution) + change - along, jacobian[:, moving]
        if friction == 0.0:  # the foot is free across the normal
            wished, rows = normal @ wished, normal[None] @ rows
        before = before + np.linalg.pinv(rows, rcond=1e-6) @ (wished - rows @ before)
        exact = np.array([position, before, before + jump[moving]])
        coefficients = coefficients + a["from_impact"] @ (exact - state)
        q, v = a["resting"].copy(), np.zeros(len(jump))
        q[moving], v[moving] = position, before
        return coefficients, q, v, v + jump

    def kinematics(self, position: Array) -> tuple[Array, Array, Array]:
        """Return the contact point, its Jacobian and the mass matrix, of all joints.

        `position` has the values of the moving joints.
        """
        a = self.arrays
        q = a["resting"].copy()
        q[a["moving"]] = position
        count = len(q)
        rotations, origins = np.empty((count, 3, 3)), np.empty((count, 3))
        turns = _rotations(a["axes"], np.where(a["prismatic"], 0.0, q))
        slides = a["axes"] * np.where(a["prismatic"], q, 0.0)[:, None]
        for i, parent in enumerate(a["parents"]):
            rotation, origin = a["rotations"][i], a["translations"][i]
            if parent >= 0:
                origin = origins[parent] + rotations[parent] @ origin
                rotation = rotations[parent] @ rotation
            origins[i] = origin + rotation @ slides[i]
            rotations[i] = rotation @ turns[i]
        axes = np.einsum("nij,nj->ni", rotations, a["axes"])
        slide = a["prismatic"][:, None]
        # velocities of the world's origin and angular velocities that the joints give
        motion = np.hstack([np.where(slide, axes, np.cross(origins, axes)), axes * ~slide])
        contact = int(a["contact"])
        point = origins[contact] + rotations[contact] @ a["contact_point"]
        jacobian = (motion[:, :3] + np.cross(motion[:, 3:], point)).T * self._after[:, contact]
        centres = origins + np.einsum("nij,nj->ni", rotations, a["centres"])
        inertias = rotations @ a["inertias"] @ rotations.transpose(0, 2, 1)
        # momenta of each body, and its moment about the origin, for the motion of each joint
        linear = motion[:, None, :3] + np.cross(motion[:, None, 3:], centres[None])
        linear *= self._after[:, :, None] * a["masses"][None, :, None]
        angular = np.einsum("jab,ib->ija", inertias, motion[:, 3:]) * self._after[:, :, None]
        angular += np.cross(centres[None], linear)
        moved = self._after.astype(float)
        momentum = np.concatenate([linear, angular], axis=2)
        total = np.einsum("kj,ija->ika", moved, momentum)  # of the bodies that joint k moves
        inertia = np.einsum("ika,ka->ik", total, motion) + np.diag(a["armature"])
        return point, jacobian, inertia

    def samples(self, kick: InterpolatedKick, rate: float) -> tuple[Array, Array, Array]:
        """Return times [s, impact at 0], and q and v of all joints at a rate [Hz]."""
        if not rate > 0.0:
            raise ValueError(f"rate is {rate}: it must be above 0 Hz")
        a, moving = self.arrays, self.arrays["moving"]
        begin, end = a["before_knots"][0], a["after_knots"][-1]
        times = np.arange(np.ceil(rate * begin), np.floor(rate * end) + 1) / rate
        q, v = np.tile(a["resting"], (len(times), 1)), np.zeros((len(times), len(self.joints)))
        for name, chosen in (("before", times <= 0.0), ("after", times > 0.0)):
            knots, matrix = a[f"{name}_knots"], a[f"{name}_matrix"] @ kick.coefficients
            for order, values in enumerate((q, v)):
                values[np.ix_(chosen, moving)] = _spline(knots, matrix, times[chosen], order)
        pushed = np.setdiff1d(np.arange(len(self.joints)), moving)
        late, duration = times > 0.0, float(a["settling"])
        x = np.minimum(times[late] / duration, 1.0)[:, None]
        jump = kick.v_after[pushed]
        way = duration * (x - 6 * x**3 + 8 * x**4 - 3 * x**5)
        q[np.ix_(late, pushed)] += way * jump
        v[np.ix_(late, pushed)] += (1 - 18 * x**2 + 32 * x**3 - 15 * x**4) * jump
        return times, q, v


def read_kicks(file: str | os.PathLike[str]) -> KickReader:
    """Return the library in a file that `kickdyn.kick_library` has written.

    Raises:
        ValueError: the file is no library of this format, or damaged.
    """
    try:
        # NumPy leaves a damaged file open that it has opened itself
        with Path(file).open("rb") as opened, np.load(opened, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        raise
    except Exception as error:  # NumPy and zipfile raise many kinds for damaged bytes
        raise ValueError(f"{file} is not a library of kicks, or damaged ({error})") from None
    form = str(arrays.get("format", "none"))
    if form != FORMAT:
        raise ValueError(f"{file} has the format {form!r}: this version reads {FORMAT!r}")
    if str(arrays.pop("checksum", "")) != checksum(arrays):
        raise ValueError(f"{file} is damaged: the numbers in it are not those that were written")
    return KickReader(arrays)


def write_kicks(out: BinaryIO, arrays: dict[str, Any]) -> None:
    """Write the arrays of a library into an open file."""
    np.savez_compressed(out, checksum=np.array(checksum(arrays)), **arrays)


def launch_velocity(point: Array) -> Array:
    """Return the velocity of the ball's launch at a point of the axes, shape `(3,)` [m/s]."""
    speed, elevation, azimuth = point[:3]
    level = np.cos(elevation)
    direction = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
    return np.asarray(speed * np.array(direction))


def launch_axes(velocity: Array) -> Array:
    """Return speed, elevation and azimuth of a velocity, `(3,)` [m/s, rad]."""
    x, y, z = velocity
    level = np.hypot(x, y)
    return np.array([np.hypot(level, z), np.arctan2(z, level), np.arctan2(y, x)])


def _rotations(axes: Array, angles: Array) -> Array:
    """Return the rotations about unit axes, `(n, 3)`, by angles, `(n,)` [rad] (Rodrigues)."""
    cross = np.zeros((len(axes), 3, 3))
    x, y, z = axes.T
    cross[:, [2, 0, 1], [1, 2, 0]] = np.array([x, y, z]).T
    cross[:, [1, 2, 0], [2, 0, 1]] = -np.array([x, y, z]).T
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + (1.0 - cosine) * cross @ cross)


def _spline(knots: Array, coefficients: Array, times: Array, order: int) -> Array:
    """Return a cubic B-spline or a derivative of it, by the recursion of Cox and de Boor."""
    degree = 3
    for _ in range(order):
        spans = knots[degree + 1 : -1] - knots[1 : -degree - 1]
        coefficients = degree * np.diff(coefficients, axis=0) / spans[:, None]
        knots, degree = knots[1:-1], degree - 1
    last = len(knots) - degree - 2
    span = np.clip(np.searchsorted(knots, times, side="right") - 1, degree, last)
    basis = np.zeros((len(times), len(knots) - 1))
    basis[np.arange(len(times)), span] = 1.0
    for k in range(1, degree + 1):
        widths = knots[k:] - knots[:-k]
        slopes = np.divide(1.0, widths, out=np.zeros_like(widths), where=widths > 0.0)
        rising = (times[:, None] - knots[: -k - 1]) * slopes[:-1]
        falling = (knots[k + 1 :] - times[:, None]) * slopes[1:]
        basis = rising * basis[:, :-1] + falling * basis[:, 1:]
    return np.asarray(basis @ coefficients)


def checksum(arrays: dict[str, Any]) -> str:
    """Return the SHA-256 of arrays with their names."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode() + array.tobytes())
    return digest.hexdigest()
