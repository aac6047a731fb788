r"""The nonlinear program of a motion, for Ipopt.

Unknowns are the coefficients c of `MotionSplines` and the share s of the launch. Position, velocity
and acceleration at each point, and position, velocity and its jump at the impact, are constant
linear maps of c, so that the equations of motion add no unknowns. The impact with the impulse
:math:`s\,p` on the ball keeps

.. math::
    M \Delta v + s\, J^T p = 0, \quad n \cdot (s\,u_b - J v^+) = e\, n \cdot J v^-, \quad
    x + r n = x_{ball}

and no sliding, with the velocity :math:`u_b` of the ball's contact point. The objective is

.. math::
    \int \frac1n \sum_i (\tau_i / \tau_{max,i})^2 dt + \epsilon \int |\dddot q|^2 dt
    + w\, (|q(t_0) - q_0|^2 + |q(t_1) - q_0|^2) + W (1 - s).

With :math:`W (1 - s)`, standing still nearly solves the problem, and the solver always has a way
in. The Hessian of the Lagrangian is assembled from those at single points, which takes a fifth of
the time of automatic differentiation through the maps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import scipy.sparse as sp

from kickdyn.core.validation import Array
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.motion.limits import Impulse, Limit, RangeLimit, Sample, SpeedLimit
from kickdyn.motion.splines import MotionSplines, integration_weights, per_joint
from kickdyn.motion.symbolic_tree import SymbolicTree
from kickdyn.restitution import rows_of
from kickdyn.robot.kicking_chain import UNLIMITED
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import StandingRobot

JERK, ENDS, SHARE = 1e-8, 0.1, 3.0
"""Weights of the objective: of the jerk over n [s5/rad2], of the posture at both ends [1/rad2] and
of the share of the launch that is not reached, against about 0.1 s of squared torque."""

LARGEST_TURN = 1.5
"""Largest angular velocity of a standing robot's foot across the normal, before the impact [rad/s]:
during the contact, a foot that turns faster sends the ball aside."""

TURN_SCALE = 10.0
"""Scale of that angular velocity [rad/s]."""

TOLERANCE = 1e-7
"""Largest violation of a row of a solution; rows have a scale of about 1."""

OPTIONS = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-3,
    "dual_inf_tol": 0.1,
    "compl_inf_tol": 1e-3,
    "linear_solver": "mumps",
}
"""Options of Ipopt that all solutions have."""


@dataclass(frozen=True, eq=False)
class KickTask:
    """The kick that a motion is planned for.

    Attributes:
        robot: that kicks, in its own coordinates; on its support, if its base floats.
        leg: the joints that move, on a fixed base: the supporting foot of a standing robot.
        target: impulse and contact.
        foot_directions: in which the foot can move at all, orthonormal rows, shape `(k, 3)`.
        ball_rows: orthonormal directions in which the ball's position is given, shape `(k, 3)`.
        ball_centre: that position, shape `(3,)` [m, world frame].
        facing: rows a of the cone of normals with which the foot can meet a ball, shape `(k, 3)`
            [frame of the contact joint].
        standing: the robot on its foot; None on a fixed base.
    """

    robot: Leg
    leg: Leg
    target: ImpactTarget
    foot_directions: Array
    ball_rows: Array
    ball_centre: Array
    facing: Array
    standing: StandingRobot | None

    @property
    def speed_limit(self) -> Array:
        """Limits of the joints' speeds, `UNLIMITED` where there is none, shape `(n,)` [rad/s]."""
        limit = self.leg.velocity_limit
        return np.where(np.isfinite(limit), limit, UNLIMITED)


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of symbols with their bounds, and functions of their values and derivatives.

    Attributes:
        lower, upper: bounds, shape `(k,)`.
        values: of rows and cost for unknowns z and parameters p.
        jacobian: of the rows by z.
        slope: of the cost by z.
        hessian: by z, of the product of the rows with multipliers and of a weight of the cost.
    """

    lower: Array
    upper: Array
    values: Any
    jacobian: Any
    slope: Any
    hessian: Any


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
        ca.Function("jacobian", [z, p], [ca.densify(ca.jacobian(stacked, z))]),
        ca.Function("slope", [z, p], [ca.densify(ca.gradient(cost, z))]),
        ca.Function(
            "hessian", [z, p, multipliers, weight], [ca.densify(ca.hessian(lagrangian, z)[0])]
        ),
    )


@dataclass(frozen=True, eq=False)
class Solution:
    """Unknowns that Ipopt returned, with what a next solution starts from.

    Attributes:
        coefficients: of the splines, shape `(size, n)`.
        share: of the launch.
        times: of the points, before and after the impact [s].
        multipliers: of the rows of the points, shape `(points, k)`, and of all others.
        feasible: whether the rows are in their bounds, within `TOLERANCE`.
        iterations: number of its iterations.
    """

    coefficients: Array
    share: float
    times: list[Array]
    multipliers: tuple[Array, Array, Array]
    feasible: bool
    iterations: int


class MotionProblem:
    """The problem of a kick's motion.

    Attributes:
        task: the kick.
        splines: whose coefficients are unknown.
        limits: of the whole motion.
        impulse_limits: of the ground's impulse.
        margins: CasADi's function of q, v, a that gives the margins of all `limits`, stacked.
        impulse_margins: likewise of q, the jump of v, and the share, of `impulse_limits`.
    """

    def __init__(
        self,
        task: KickTask,
        splines: MotionSplines,
        limits: Sequence[Limit],
        impulse_limits: Sequence[Impulse],
    ) -> None:
        self.task, self.splines = task, splines
        self.limits, self.impulse_limits = limits, impulse_limits
        model = task.leg.model
        self.n = int(model.nv)
        self.lower = np.maximum(model.lowerPositionLimit, -np.pi)
        self.upper = np.minimum(model.upperPositionLimit, np.pi)
        self._model, tree = model, SymbolicTree(model)
        z, no_parameter = ca.vertcat(tree.q, tree.v, tree.a), ca.SX(0, 1)
        torque, wrench = tree.inverse_dynamics()
        weight = sum(body.mass for body in model.inertias) * 9.81
        sample = Sample(tree, torque, wrench, weight)
        margins = [limit.margins(sample) for limit in limits]
        self.margins = ca.Function("margins", [tree.q, tree.v, tree.a], [ca.vertcat(*margins)])
        rows = [limit.rows(sample) for limit in limits if not limit.by_splines]
        cost = ca.sumsqr(torque / ca.DM(model.effortLimit)) / self.n
        self.path = make_rows(z, no_parameter, rows, cost)
        self._add_impact(tree)

    def _add_impact(self, tree: SymbolicTree) -> None:
        """Make the rows of the impact; its unknowns are q, v before, the jump of v, and s."""
        task, n = self.task, self.n
        target, leg = task.target, task.leg
        ball, normal, impulse = target.ball, target.contact.normal, target.impulse
        q, v, jump = tree.q, tree.v, tree.a
        share, relaxation = ca.SX.sym("share"), ca.SX.sym("relaxation")
        still = ca.SX.zeros(n, 1)
        needed, reaction = ca.substitute(list(tree.inverse_dynamics(gravity=False)), [v], [still])
        lever = leg.posture(leg.configuration()).with_contact_offset(target.contact.offset)
        point = tree.point(leg.contact_joint, lever.contact_lever)
        jacobian = ca.jacobian(point, q)
        inertia = np.diag(pin.crba(self._model, self._model.createData(), pin.neutral(self._model)))
        momentum = 0.3 * np.maximum(inertia, 0.02) * task.speed_limit
        across = impulse - (normal @ impulse) * normal
        ball_point = impulse / ball.mass + ball.turning * across
        speed = float(np.linalg.norm(ball_point))
        apart = share * ca.DM(ball_point) - jacobian @ (v + jump)
        approach = ca.dot(ca.DM(normal), jacobian @ v)
        rebound = ca.dot(ca.DM(normal), apart) - _restitution(target, approach) * approach
        slip = ca.DM(_directions_across(task.foot_directions, normal))
        posture_rows = [
            (ca.DM(task.ball_rows) @ (point + ca.DM(ball.radius * normal - task.ball_centre))
             / ball.radius, 0.0, 0.0),
            (ca.DM(task.facing) @ (tree.rotation(leg.contact_joint).T @ ca.DM(normal)),
             0.0, np.inf),
        ]  # fmt: skip
        rows = [
            ((needed + share * (jacobian.T @ ca.DM(impulse))) / ca.DM(momentum), 0.0, 0.0),
            (rebound / speed, 0.0, 0.0),
            *posture_rows,
        ]
        if target.contact.friction > 0.0 and slip.numel():
            rows.append((slip @ apart / speed, 0.0, 0.0))
        if task.standing is not None:
            most = LARGEST_TURN / TURN_SCALE
            turning = slip @ tree.angular_velocity(leg.contact_joint) / TURN_SCALE
            rows.append((turning, -most, most))
        moment = ca.cross(point, ca.DM(impulse))
        wrench = reaction + share * ca.vertcat(ca.DM(impulse), moment)
        sample = Sample(tree, torque=None, wrench=wrench, size=float(np.linalg.norm(impulse)))
        for limit in self.impulse_limits:
            row, low, high = limit.rows(sample)
            rows.append((row + relaxation * (1.0 - share), low, high))
        z = ca.vertcat(q, v, jump, share)
        self.impact = make_rows(z, relaxation, rows, ca.SX(0.0))
        self.posture = make_rows(q, ca.SX(0, 1), posture_rows, ca.SX(0.0))
        margins = [limit.margins(sample) for limit in self.impulse_limits]
        self.impulse_margins = ca.Function(
            "impulse_margins", [q, jump, share], [ca.vertcat(ca.SX(0, 1), *margins)]
        )

    def stand(self, near: Array, *, at_ball: bool) -> Array | None:
        """Return a posture at rest near one, shape `(n,)`; with `at_ball`, touching the ball."""
        q = ca.MX.sym("q", self.n)
        rows = [self.path.values(ca.vertcat(q, ca.DM.zeros(2 * self.n)), [])[0]]
        lower, upper = [self.path.lower], [self.path.upper]
        if at_ball:
            rows.append(self.posture.values(q, [])[0])
            lower.append(self.posture.lower)
            upper.append(self.posture.upper)
        problem = {"x": q, "f": ca.sumsqr(q - ca.DM(near)), "g": ca.vertcat(*rows)}
        options = {"error_on_fail": False, "print_time": False, "ipopt": OPTIONS}
        solver = ca.nlpsol("stand", "ipopt", problem, options)
        room = 0.02 * (self.upper - self.lower)
        end = solver(
            x0=near, lbx=self.lower + room, ubx=self.upper - room,
            lbg=np.concatenate(lower), ubg=np.concatenate(upper),
        )  # fmt: skip
        return np.asarray(end["x"]).ravel() if solver.stats()["success"] else None

    def solve(
        self,
        start: Solution,
        rest: Array,
        times: list[Array],
        *,
        relaxation: float,
        shares: tuple[float, float],
        options: dict[str, Any],
    ) -> Solution:
        """Return the solution from another one, with other points, by Ipopt.

        Args:
            start: unknowns and multipliers to start from.
            rest: posture near which both ends are, shape `(n,)`.
            times: of the points, before and after the impact [s].
            relaxation: of the limits of the ground's impulse at the share 0.
            shares: bounds of the share.
            options: of Ipopt, besides `OPTIONS`.
        """
        n, splines = self.n, self.splines
        solver, count = self._solver(rest, times, options)
        low, high = (
            np.full(splines.speed_rows().shape[0] * n, s)
            for s in (SpeedLimit.reserve - 1.0, 1.0 - SpeedLimit.reserve)
        )
        room = RangeLimit.reserve * (self.upper - self.lower)
        points, remaining, bounds = start.multipliers
        if len(points):
            old, new = np.concatenate(start.times), np.concatenate(times)
            order = np.abs(old[None] - new[:, None])
            known = order.min(axis=1) < 1e-12
            points = np.where(known[:, None], points[order.argmin(axis=1)], 0.0)
        else:
            points = np.zeros((count, len(self.path.lower)))
            remaining = np.zeros(len(self.impact.lower) + len(low))
        lower = np.concatenate([np.tile(self.path.lower, count), self.impact.lower, low])
        upper = np.concatenate([np.tile(self.path.upper, count), self.impact.upper, high])
        end = solver(
            x0=np.append(start.coefficients.ravel(), np.clip(start.share, *shares)),
            p=relaxation,
            lbx=np.append(np.tile(self.lower + room, splines.size), shares[0]),
            ubx=np.append(np.tile(self.upper - room, splines.size), shares[1]),
            lbg=lower,
            ubg=upper,
            lam_g0=np.concatenate([points.ravel(), remaining]),
            lam_x0=bounds if len(bounds) else np.zeros(splines.size * n + 1),
        )
        x, rows, multipliers, bounds = (
            np.asarray(end[name]).ravel() for name in ("x", "g", "lam_g", "lam_x")
        )
        size = count * len(self.path.lower)
        return Solution(
            x[:-1].reshape(splines.size, n),
            float(x[-1]),
            times,
            (multipliers[:size].reshape(count, -1), multipliers[size:], bounds),
            bool(np.abs(rows - np.clip(rows, lower, upper)).max() <= TOLERANCE),
            int(solver.stats()["iter_count"]),
        )

    def _solver(self, rest: Array, times: list[Array], options: dict[str, Any]) -> tuple[Any, int]:
        """Return Ipopt's solver for points, and their number."""
        n, splines = self.n, self.splines
        point_maps = np.stack([splines.values(times, order) for order in range(3)], axis=1)
        count, size = len(point_maps), splines.size * n + 1
        to_points = _matrix(per_joint(point_maps.reshape(3 * count, -1), n, 1))
        to_share = sp.csr_matrix(([1.0], ([0], [size - 1])), shape=(1, size))
        to_impact = _matrix(sp.vstack([per_joint(splines.at_impact(), n, 1), to_share]))
        to_speeds = _matrix(
            sp.diags(np.tile(1.0 / self.task.speed_limit, len(splines.speed_rows())))
            @ per_joint(splines.speed_rows(), n, 1)
        )
        weights = ca.DM(np.concatenate([integration_weights(t) for t in times])).T
        quadratic = ca.DM(_matrix(self._quadratic()))
        centre = ca.DM(np.append(np.tile(rest, splines.size), 0.0))
        share = ca.DM(size, 1)
        share[size - 1] = -SHARE

        x, p = ca.MX.sym("x", size), ca.MX.sym("p")
        points = ca.reshape(to_points @ x, 3 * n, count)
        impact, path = to_impact @ x, self.path
        rows, costs = path.values.map(count)(points, [])
        cost = (
            ca.dot(weights, costs)
            + 0.5 * ca.dot(x - centre, quadratic @ (x - centre))
            + SHARE * (1.0 - x[-1])
        )
        constraints = ca.vertcat(ca.vec(rows), self.impact.values(impact, p)[0], to_speeds @ x)
        slopes = path.slope.map(count)(points, []) * ca.repmat(weights, 3 * n, 1)
        gradient = to_points.T @ ca.vec(slopes) + quadratic @ (x - centre) + share
        jacobians = ca.horzsplit(path.jacobian.map(count)(points, []), 3 * n)
        jacobian = ca.vertcat(
            ca.diagcat(*jacobians) @ to_points,
            self.impact.jacobian(impact, p) @ to_impact,
            to_speeds,
        )
        cost_weight = ca.MX.sym("weight")
        multipliers = ca.MX.sym("multipliers", constraints.numel())
        k, m = len(path.lower), len(self.impact.lower)
        hessians = ca.horzsplit(
            path.hessian.map(count)(
                points, [], ca.reshape(multipliers[: k * count], k, count), weights * cost_weight
            ),
            3 * n,
        )
        at_impact = self.impact.hessian(
            impact, p, multipliers[k * count : k * count + m], cost_weight
        )
        hessian = (
            to_points.T @ (ca.diagcat(*hessians) @ to_points)
            + to_impact.T @ (at_impact @ to_impact)
            + cost_weight * quadratic
        )
        functions = {
            "grad_f": ca.Function(
                "nlp_grad_f", [x, p], [cost, ca.densify(gradient)], ["x", "p"], ["f", "grad_f_x"]
            ),
            "jac_g": ca.Function(
                "nlp_jac_g", [x, p], [ca.densify(constraints), jacobian], ["x", "p"],
                ["g", "jac_g_x"],
            ),
            "hess_lag": ca.Function(
                "nlp_hess_l", [x, p, cost_weight, multipliers], [ca.triu(hessian)],
                ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"],
            ),
        }  # fmt: skip
        problem = {"x": x, "p": p, "f": cost, "g": constraints}
        made = ca.nlpsol("motion", "ipopt", problem, {
            **functions, "print_time": False, "error_on_fail": False, "calc_lam_p": False,
            "ipopt": {**OPTIONS, **options},
        })  # fmt: skip
        return made, count

    def _quadratic(self) -> Any:
        """Return the matrix of the quadratic part of the objective, for all unknowns."""
        splines = self.splines
        middles = [(grid[1:] + grid[:-1]) / 2 for grid in splines.grids]
        lengths = np.concatenate([np.diff(grid) for grid in splines.grids])
        jerk = splines.values(middles, 3)
        ends = np.zeros(splines.size)
        ends[[0, -1]] = ENDS
        matrix = JERK / self.n * jerk.T @ (lengths[:, None] * jerk) + np.diag(ends)
        every = sp.kron(sp.csr_matrix(matrix), sp.eye(self.n))
        return sp.block_diag([every, sp.csr_matrix((1, 1))])


def _matrix(matrix: Any) -> Any:
    """Return a sparse matrix of scipy as one of CasADi."""
    return ca.DM(sp.csc_matrix(matrix))


def _restitution(target: ImpactTarget, approach: Any) -> Any:
    """Return e for a speed of approach: a number, or a piecewise linear expression."""
    restitution = target.contact.restitution
    if isinstance(restitution, float):
        return restitution
    rows = rows_of(restitution)
    e = rows[0][1]
    for (low, before), (high, after) in pairwise(rows):
        slope = (after - before) / (high - low)
        e += slope * (ca.fmin(ca.fmax(approach, low), high) - low)
    return e


def _directions_across(directions: Array, normal: Array) -> Array:
    """Return directions across the normal that the foot can move in, as rows."""
    _, gains, rows = np.linalg.svd(directions - np.outer(directions @ normal, normal))
    return np.asarray(rows[: len(gains)][gains > 1e-6])
