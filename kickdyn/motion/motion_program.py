"""What the program of a motion is made of: splines, solutions, a tree of joints, rows at points.

The wheel of Pinocchio has no `pinocchio.casadi`. `adam-robotics` reads files only, not a Pinocchio
model with locked or turned joints and rotors, and takes twice the operations.

The rows are the same at several points. The Hessian of the Lagrangian is assembled from those at
single points, which takes a fifth of the time of automatic differentiation through the maps from
the unknowns to the points.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin
import scipy.sparse as sp
from scipy.interpolate import BSpline

from kickdyn.core.validation import Array
from kickdyn.motion.separation import Conditions, multipliers_nearby


def _load_ipopt() -> None:
    """Load Ipopt with one thread of its own OpenBLAS, which reads their number when it is loaded.

    Two threads take twice the processor time for matrices of this size, and no less time.
    """
    name = "OPENBLAS_NUM_THREADS"
    if name in os.environ:
        return
    os.environ[name] = "1"
    try:
        ca.load_nlpsol("ipopt")
    finally:
        del os.environ[name]


_load_ipopt()

GRADING = 1.3
"""Exponent by which intervals are shorter near the impact, where the motion is fastest."""


DENSE_TIME = 0.1
"""Time from the impact within which there are more points in an interval [s]."""


class MotionSplines:
    """Cubic splines of joints from rest to the impact and from there to rest.

    Velocity and acceleration are 0 at the beginning and at the end; at the impact positions are
    equal. The splines are linear maps of coefficients, shape `(size, n)` for n joints. They last
    `before` and `after` [s], with numbers of `intervals` between knots before and after the impact.
    """

    def __init__(self, before: float, after: float, intervals: tuple[int, int]) -> None:
        first, second = (np.linspace(0.0, 1.0, count + 1) ** GRADING for count in intervals)
        self.grids = -before * first[::-1], after * second
        # coefficients of both splines are rows of these matrices times the unknown ones
        sizes = len(self.grids[0]) + 2, len(self.grids[1]) + 2
        number = np.concatenate([
            np.maximum(np.arange(sizes[0]) - 2, 0),
            np.minimum(np.arange(sizes[1]) + sizes[0] - 3, sizes[0] + sizes[1] - 6),
        ])  # fmt: skip
        self.size = int(number[-1]) + 1
        self._first = np.unique(number, return_index=True)[1]
        rows = np.eye(self.size)[number]
        self.splines = [
            BSpline(np.concatenate([[grid[0]] * 3, grid, [grid[-1]] * 3]), matrix, 3)
            for grid, matrix in zip(self.grids, np.split(rows, [sizes[0]]), strict=True)
        ]

    def times(self, far: int, near: int) -> list[Array]:
        """Return times before and after the impact: `near` or `far` in each interval, and ends.

        There are `near` in each interval that begins within `DENSE_TIME` of the impact.
        """
        return [
            np.concatenate([
                *(
                    np.linspace(a, b, near if min(abs(a), abs(b)) < DENSE_TIME else far, False)
                    for a, b in pairwise(grid.tolist())
                ),
                grid[-1:],
            ])
            for grid in self.grids
        ]  # fmt: skip

    def values(self, times: list[Array], order: int) -> Array:
        """Return the map from coefficients to a derivative at times before and after, stacked."""
        pairs = zip(self.splines, times, strict=True)
        return np.asarray(np.vstack([spline(t, order) for spline, t in pairs]))

    def at_impact(self) -> Array:
        """Return the map to position, velocity before, and its jump at the impact, `(3, size)`."""
        before, after = self.splines
        v = before(0.0, 1)
        return np.array([before(0.0), v, after(0.0, 1) - v])

    def speed_rows(self) -> Array:
        """Return the map to the coefficients of the velocities, which bound them."""
        rows = np.vstack([spline.derivative().c for spline in self.splines])
        return np.asarray(rows[np.abs(rows).max(axis=1) > 0.0])

    def coefficients(self, before: BSpline, after: BSpline) -> Array:
        """Return the coefficients of a motion with these knots, shape `(size, n)`."""
        return np.asarray(np.vstack([before.c, after.c])[self._first])

    def motion(self, coefficients: Array) -> list[BSpline]:
        """Return both splines for coefficients of shape `(size, n)`."""
        return [BSpline(spline.t, spline.c @ coefficients, 3) for spline in self.splines]


def per_joint(rows: Array, n: int, extra: int) -> Any:
    """Return a map of one joint for all n, as a sparse matrix with `extra` columns of 0."""
    blocks = sp.kron(sp.csr_matrix(rows), sp.eye(n))
    return sp.hstack([blocks, sp.csr_matrix((blocks.shape[0], extra))]).tocsr()


def integration_weights(times: Array) -> Array:
    """Return weights of values at times that integrate them, linear in between [s]."""
    half = np.diff(times) / 2
    return np.append(half, 0.0) + np.insert(half, 0, 0.0)


TOLERANCE = 1e-7
"""Largest violation of a row of a solution; rows have a scale of about 1."""

SAME_TIME = 1e-12
"""Difference up to which times are the same [s]."""


class Multipliers(NamedTuple):
    """Multipliers of rows of speeds and of the impact, of bounds, of points, and of bodies.

    Those of `bounds` are of the coefficients and the share. Those of `points` are of the rows of
    each point and of the bounds of its forces, shape `(points, k)`. `apart` has
    conditions of bodies with theirs.
    """

    speeds: Array
    impact: Array
    bounds: Array
    points: Array
    apart: Sequence[Conditions]


@dataclass(frozen=True, eq=False)
class MotionSolution:
    """Unknowns that Ipopt returned, with the start of a next solution."""

    rest: Array  # posture near which both ends are, shape `(n,)`
    coefficients: Array  # of the splines, shape `(size, n)`
    share: float  # of the launch
    times: list[Array]  # of the points, before and after the impact [s]
    multipliers: Multipliers | None = None  # None if a solution does not start from those
    feasible: bool = True  # whether the rows are in their bounds, within `TOLERANCE`
    iterations: int = 0  # number of its iterations
    limited: tuple[str, ...] = ()  # joints at rest whose torques had rows
    # coefficients at which the forces of joints that give way in the impact were computed for its
    # rows; None if a solution does not start from those
    linearized: Array | None = None


def multipliers_of(
    rows: Array, bounds: Array, sizes: Sequence[int], moments: Array, apart: Sequence[Conditions]
) -> Multipliers:
    """Return multipliers from those of all rows and bounds, the inverse of `taken_over`.

    `sizes` are the numbers of rows of speeds, points, impact and bodies, and of bounds of the
    coefficients and the share.
    """
    *of_rows, of_bounds = sizes
    speeds, points, impact, *of_apart = np.split(rows, np.cumsum(of_rows)[:-1])
    forces = bounds[of_bounds:].reshape(len(moments), -1)
    return Multipliers(
        speeds,
        impact,
        bounds[:of_bounds],
        np.hstack([points.reshape(len(moments), -1), forces]),
        [new._replace(multipliers=x) for new, x in zip(apart, of_apart, strict=True)],
    )


def taken_over(
    start: MotionSolution,
    moments: Array,
    apart: Sequence[Conditions],
    empty: Multipliers,
    forces: int,
) -> tuple[Array, Array]:
    """Return the multipliers of all rows and bounds at moments [s] that a solution's give.

    `empty` are those of a solution without any, of the sizes that the problem has, with one row of
    `points`. The bounds of the `forces` of a point have the last columns of `points`.
    """
    shape = sum(map(len, start.times)), empty.points.shape[1]
    duals = start.multipliers or empty._replace(points=np.zeros(shape))
    distance = np.abs(np.concatenate(start.times)[None] - moments[:, None])
    same = distance.min(axis=1) < SAME_TIME
    points = np.where(same[:, None], duals.points[distance.argmin(axis=1)], 0.0)
    former = {conditions.joints: conditions for conditions in duals.apart}
    of_apart = [multipliers_nearby(new, former.get(new.joints)) for new in apart]
    k = empty.points.shape[1] - forces
    rows = np.concatenate([duals.speeds, points[:, :k].ravel(), duals.impact, *of_apart])
    return rows, np.append(duals.bounds, points[:, k:])


class SymbolicTree:
    """A Pinocchio model of joints of one degree of freedom, in CasADi's scalar symbols q, v and a.

    These have shape `(n,)`; a `state` has other expressions for them.
    """

    def __init__(self, model: Any, state: Sequence[Any] | None = None) -> None:
        self.model = model
        self.q, self.v, self.a = state or (ca.SX.sym(name, model.nv) for name in "qva")
        self._axes = [joint_axis(model, joint) for joint in range(1, model.njoints)]
        self._steps = [
            _step(model.jointPlacements[joint], *self._axes[joint - 1], self.q[joint - 1])
            for joint in range(1, model.njoints)
        ]
        self._poses: list[tuple[Any, Any]] = [(ca.SX.eye(3), ca.SX(3, 1))]
        for joint, (rotation, origin) in enumerate(self._steps, 1):
            above, place = self._poses[int(model.parents[joint])]
            self._poses.append((above @ rotation, place + above @ origin))

    def rotation(self, joint: int) -> Any:
        """Return the rotation from a joint's axes to the world's, shape `(3, 3)`."""
        return self._poses[joint][0]

    def point(self, joint: int, local: Array) -> Any:
        """Return a point in a joint's axes, `(3,)`, in the world frame, shape `(3,)` [m]."""
        rotation, origin = self._poses[joint]
        return rotation @ ca.DM(local) + origin

    def seen_from(self, joint: int, carrier: int, local: Any) -> Any:
        """Return a point in the axes of its carrier, `(3,)`, in those of a joint, `(3,)` [m]."""
        to_joint, to_carrier = (list(self.model.supports[j]) for j in (joint, carrier))
        while to_joint and to_carrier and to_joint[0] == to_carrier[0]:
            del to_joint[0], to_carrier[0]
        for number in reversed(to_carrier):
            rotation, origin = self._steps[number - 1]
            local = rotation @ local + origin
        for number in to_joint:
            rotation, origin = self._steps[number - 1]
            local = rotation.T @ (local - origin)
        return local

    def angular_velocity(self, joint: int) -> Any:
        """Return the angular velocity of the body of a joint, shape `(3,)` [rad/s, world frame]."""
        total = ca.SX(3, 1)
        for number in list(self.model.supports[joint])[1:]:
            turn = self._axes[number - 1][1]
            total += self._poses[number][0] @ ca.DM(turn) * self.v[int(number) - 1]
        return total

    def inverse_dynamics(self, gravity: bool = True) -> tuple[Any, Any]:
        r"""Return torques and the wrench of the ground on the root.

        The torques are :math:`\tau = M(q) a + c(q, v) + g(q)` [N m], rotors included. The wrench,
        shape `(6,)`, is linear [N], then angular about the world's origin [N m, world frame]; it
        includes the weight of the root's body. Newton-Euler as Featherstone, Rigid Body Dynamics
        Algorithms, Table 5.1.
        """
        model, v, a = self.model, self.v, self.a
        zero, pull = ca.SX(3, 1), ca.SX(ca.DM(-model.gravity.linear)) * float(gravity)
        motions = [(zero, zero, pull)]  # angular velocity and its derivative, acceleration
        forces = [_body_force(model.inertias[0], *motions[0])]
        for i, (linear, turn) in enumerate(self._axes):
            rotation, origin = self._steps[i]
            turning, alpha, accel = motions[int(model.parents[i + 1])]
            accel = accel + ca.cross(alpha, origin) + ca.cross(turning, ca.cross(turning, origin))
            back, slide, spin = rotation.T, ca.DM(linear), ca.DM(turn)
            before = back @ turning
            turning = before + spin * v[i]
            alpha = back @ alpha + spin * a[i] + ca.cross(before, spin) * v[i]
            accel = back @ accel + slide * a[i] + 2 * ca.cross(before, slide) * v[i]
            motions.append((turning, alpha, accel))
            forces.append(_body_force(model.inertias[i + 1], turning, alpha, accel))
        torques = []
        for i in reversed(range(len(self._axes))):
            (linear, turn), (force, moment) = self._axes[i], forces[i + 1]
            rotor = model.armature[i] * a[i]
            torques.append(ca.dot(ca.DM(linear), force) + ca.dot(ca.DM(turn), moment) + rotor)
            rotation, origin = self._steps[i]
            force = rotation @ force
            moment = rotation @ moment + ca.cross(origin, force)
            parent = int(model.parents[i + 1])
            forces[parent] = (forces[parent][0] + force, forces[parent][1] + moment)
        return ca.vertcat(*reversed(torques)), ca.vertcat(*forces[0])


def _body_force(body: Any, turning: Any, turned: Any, moved: Any) -> tuple[Any, Any]:
    """Return force and moment about the joint's origin that move a body, in its joint's axes."""
    centre, inertia = ca.DM(body.lever), ca.DM(body.inertia)
    inward = ca.cross(turning, ca.cross(turning, centre))
    force = body.mass * (moved + ca.cross(turned, centre) + inward)
    moment = inertia @ turned + ca.cross(turning, inertia @ turning)
    return force, moment + ca.cross(centre, force)


def _step(fixed: Any, linear: Array, turn: Array, angle: Any) -> tuple[Any, Any]:
    """Return rotation and origin of a joint's frame in its parent's."""
    rotation = ca.DM(fixed.rotation)
    if not turn.any():
        return ca.SX(rotation), ca.DM(fixed.translation) + rotation @ (ca.DM(linear) * angle)
    skew = ca.DM(pin.skew(turn))
    about = ca.DM.eye(3) + ca.sin(angle) * skew + (1 - ca.cos(angle)) * (skew @ skew)
    return rotation @ about, ca.SX(ca.DM(fixed.translation))


def joint_axis(model: Any, joint: int) -> tuple[Array, Array]:
    """Return the linear and the angular part of a joint's axis, in its own frame."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq), np.ones(model.nv))
    axis = np.asarray(data.S).ravel()
    return axis[:3], axis[3:]


OPTIONS = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-3,
    "dual_inf_tol": 0.1,
    "nlp_scaling_method": "none",
    "compl_inf_tol": 1e-3,
    "linear_solver": "mumps",
    "mumps_permuting_scaling": 0,
    "mumps_pivot_order": 0,
}
"""Options of Ipopt that all solutions have. Without a permutation and with an ordering by least
degree, factorizations take a third to a half of the time."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of symbols with their bounds, and functions of their values and derivatives."""

    lower: Array  # bounds, shape `(k,)`
    upper: Array
    values: Any  # of rows and cost for unknowns z and parameters p
    jacobian: Any  # of the rows by z
    slope: Any  # of the cost by z
    hessian: Any  # by z, of the product of the rows with multipliers and of a weight of the cost


def make_rows(z: Any, p: Any, rows: Sequence[tuple[Any, float, float]], cost: Any) -> Rows:
    """Return the functions of rows, each with the bounds of all its entries, and of a cost."""
    stacked = ca.vertcat(*(row for row, _, _ in rows))
    sizes = [row.numel() for row, _, _ in rows]
    multipliers, weight = ca.SX.sym("multipliers", sum(sizes)), ca.SX.sym("weight")
    lagrangian = ca.dot(multipliers, stacked) + weight * cost
    return Rows(
        np.repeat([low for _, low, _ in rows], sizes),
        np.repeat([high for _, _, high in rows], sizes),
        ca.Function("values", [z, p], [stacked, cost]),
        ca.Function("jacobian", [z, p], [ca.jacobian(stacked, z)]),
        ca.Function("slope", [z, p], [ca.densify(ca.gradient(cost, z))]),
        ca.Function("hessian", [z, p, multipliers, weight], [ca.hessian(lagrangian, z)[0]]),
    )


class Block(NamedTuple):
    """Rows at several points."""

    rows: Rows  # of one point
    matrix: Any  # sparse map to the unknowns of all points, stacked
    parameters: Array  # of the points, shape `(m, points)`
    weights: Array  # of the costs of the points, shape `(points,)`


class Cost(NamedTuple):
    r"""A cost :math:`\frac12 (x - c)^T Q (x - c) + s^T x` of the first unknowns x: Q, c and s."""

    quadratic: Any
    centre: Array
    slope: Array


def block_solver(
    blocks: Sequence[Block], linear: Any, cost: Cost, columns: int, options: dict[str, Any]
) -> Any:
    """Return Ipopt's solver for sparse linear rows, and for blocks of rows with their costs.

    The `cost` comes on top. `options` are those of Ipopt besides `OPTIONS`.
    """
    quadratic, to_linear = _matrix(cost.quadratic, columns, columns), _matrix(linear, columns)
    centre, slope = (_matrix(part[:, None], 1, columns) for part in (cost.centre, cost.slope))
    sizes = [to_linear.size1(), *(len(block.rows.lower) * len(block.weights) for block in blocks)]
    x, p, cost_weight = ca.MX.sym("x", columns), ca.MX.sym("p", 0), ca.MX.sym("weight")
    multipliers = ca.MX.sym("multipliers", sum(sizes))
    parts = ca.vertsplit(multipliers, np.cumsum([0, *sizes]).tolist())
    total = 0.5 * ca.dot(x - centre, quadratic @ (x - centre)) + ca.dot(slope, x)
    gradient, hessian = quadratic @ (x - centre) + slope, cost_weight * quadratic
    constraints, jacobian = [to_linear @ x], [ca.MX(to_linear)]
    for (rows, matrix, parameters, weights), part in zip(blocks, parts[1:], strict=True):
        count, to_points = len(weights), _matrix(matrix, columns)
        m = matrix.shape[0] // count
        z, p_given, weight = (
            ca.reshape(to_points @ x, m, count), ca.DM(parameters), ca.DM(weights).T
        )  # fmt: skip
        values, costs = rows.values.map(count)(z, p_given)
        total += ca.dot(weight, costs)
        slopes = rows.slope.map(count)(z, p_given) * ca.repmat(weight, m, 1)
        gradient += to_points.T @ ca.vec(slopes)
        constraints.append(ca.vec(values))
        jacobians = ca.horzsplit(rows.jacobian.map(count)(z, p_given), m)
        jacobian.append(ca.diagcat(*jacobians) @ to_points)
        by_row = ca.reshape(part, len(rows.lower), count)
        hessians = rows.hessian.map(count)(z, p_given, by_row, weight * cost_weight)
        hessian += to_points.T @ (ca.diagcat(*ca.horzsplit(hessians, m)) @ to_points)
    functions = {
        "grad_f": ca.Function(
            "nlp_grad_f", [x, p], [total, ca.densify(gradient)], ["x", "p"], ["f", "grad_f_x"]
        ),
        "jac_g": ca.Function(
            "nlp_jac_g", [x, p], [ca.densify(ca.vertcat(*constraints)), ca.vertcat(*jacobian)],
            ["x", "p"], ["g", "jac_g_x"],
        ),
        "hess_lag": ca.Function(
            "nlp_hess_l", [x, p, cost_weight, multipliers], [ca.triu(hessian)],
            ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
        ),
    }  # fmt: skip
    problem = {"x": x, "p": p, "f": total, "g": ca.vertcat(*constraints)}
    return ca.nlpsol("motion", "ipopt", problem, {
        **functions, "print_time": False, "error_on_fail": False, "calc_lam_p": False,
        "ipopt": {**OPTIONS, **options},
    })  # fmt: skip


def _matrix(matrix: Any, columns: int, rows: int | None = None) -> Any:
    """Return a sparse matrix of scipy, with zeros added to its size, as one of CasADi."""
    larger = sp.csc_matrix(matrix)
    larger.resize(rows or matrix.shape[0], columns)
    return ca.DM(larger)
