r"""The nonlinear program of a motion, for Ipopt.

Unknowns are the coefficients c of `MotionSplines`, the share s of the launch, and at each point the
torques and the ground's wrench. Position, velocity and acceleration at each point, and position,
velocity and its jump at the impact, are constant linear maps of c. With torques and wrench unknown,
the objective and most limits are quadratic or linear in the unknowns, which makes the Hessian
cheaper, and the solver's equations sparser, than those of c alone. The impact with the impulse
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
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin
import scipy.sparse as sp

from kickdyn.core.validation import Array
from kickdyn.motion.impact_target import ImpactTarget
from kickdyn.motion.limits import (
    LENGTH,
    Impulse,
    Limit,
    RangeLimit,
    Sample,
    SpeedLimit,
    TorqueLimit,
)
from kickdyn.motion.separation import (
    BALL_RESERVE,
    RESERVE,
    Conditions,
    Surroundings,
    multipliers_nearby,
)
from kickdyn.motion.splines import MotionSplines, integration_weights, per_joint
from kickdyn.motion.symbolic_tree import SymbolicTree
from kickdyn.restitution import rows_of
from kickdyn.robot.kicking_chain import UNLIMITED
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import StandingRobot

JERK, ENDS, SHARE = {False: 1e-8, True: 1e-7}, 0.1, 3.0
"""Weights of the objective: of the jerk over n [s5/rad2], by whether the robot stands on a foot, of
the posture at both ends [1/rad2] and of the share of the launch that is not reached, against about
0.1 s of squared torque."""

LARGEST_TURN = 1.5
"""Largest angular velocity of a standing robot's foot across the normal, before the impact [rad/s]:
during the contact, a foot that turns faster sends the ball aside."""

LEAST_EFFECT = 1e-3
"""Share of the launch below which a limit does not count as one that holds it back."""

TURN_SCALE = 10.0
"""Scale of that angular velocity [rad/s]."""

TOLERANCE = 1e-7
"""Largest violation of a row of a solution; rows have a scale of about 1."""

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
        muscles: whether the torque limits fall with speed, as those of muscles.
    """

    robot: Leg
    leg: Leg
    target: ImpactTarget
    foot_directions: Array
    ball_rows: Array
    ball_centre: Array
    facing: Array
    standing: StandingRobot | None
    muscles: bool = False

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


class Multipliers(NamedTuple):
    """Multipliers of a solution.

    Attributes:
        speeds: of the rows of speeds.
        impact: of the rows of the impact.
        bounds: of those of the coefficients and the share.
        points: of the rows of each point and of the bounds of its forces, shape `(points, k)`.
        apart: conditions of bodies with the multiplier of each.
    """

    speeds: Array
    impact: Array
    bounds: Array
    points: Array
    apart: Sequence[tuple[Conditions, Array]]


@dataclass(frozen=True, eq=False)
class Solution:
    """Unknowns that Ipopt returned, with what a next solution starts from.

    Attributes:
        rest: posture near which both ends are, shape `(n,)`.
        coefficients: of the splines, shape `(size, n)`.
        share: of the launch.
        times: of the points, before and after the impact [s].
        multipliers: None where a solution does not start from those.
        feasible: whether the rows are in their bounds, within `TOLERANCE`.
        iterations: number of its iterations.
    """

    rest: Array
    coefficients: Array
    share: float
    times: list[Array]
    multipliers: Multipliers | None = None
    feasible: bool = True
    iterations: int = 0


class Block(NamedTuple):
    """Rows at several points.

    Attributes:
        rows: of one point.
        matrix: sparse map to the unknowns of all points, stacked.
        parameters: of the points, shape `(m, points)`.
        weights: of the costs of the points, shape `(points,)`.
    """

    rows: Rows
    matrix: Any
    parameters: Array
    weights: Array


SAME_TIME = 1e-12
"""Difference up to which times are the same [s]."""


class MotionProblem:
    """The problem of a kick's motion.

    Attributes:
        task: the kick.
        splines: whose coefficients are unknown.
        limits: of the whole motion.
        impulse_limits: of the ground's impulse.
        margins: CasADi's function of q, v, a that gives the margins of all `limits`, stacked.
        forces: likewise the torques over their limits, and the ground's wrench on a robot that
            stands, over its weight, moments over `LENGTH` times it.
        impulse_margins: likewise of q, the jump of v, and the share, of `impulse_limits`.
        surroundings: which bodies can come near each other.
        iterations: number of those of all solutions so far.
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
        self._model, self._tree, self.iterations = model, SymbolicTree(model), 0
        tree = self._tree
        torque, wrench = tree.inverse_dynamics()
        weight = sum(body.mass for body in model.inertias) * 9.81
        scale = np.asarray(model.effortLimit)
        if task.standing is not None:
            scale = np.append(scale, weight * np.repeat([1.0, LENGTH], 3))
        sample = Sample(tree, torque, wrench, weight)
        margins = [limit.margins(sample) for limit in limits]
        self.margins = ca.Function("margins", [tree.q, tree.v, tree.a], [ca.vertcat(*margins)])
        needed = ca.vertcat(torque, wrench)[: len(scale)] / ca.DM(scale)
        self.forces = ca.Function("forces", [tree.q, tree.v, tree.a], [needed])
        self._most = np.append(
            np.full(self.n, 1.0 - TorqueLimit.reserve), np.full(len(scale) - self.n, np.inf)
        )
        forces = ca.SX.sym("forces", len(scale))
        given = ca.vertcat(ca.DM(scale) * forces, ca.SX(6, 1))
        sample = Sample(tree, given[: self.n], given[self.n : self.n + 6], weight)
        of_splines = (TorqueLimit, SpeedLimit, RangeLimit)  # and bounds of unknowns
        on_path = [limit for limit in limits if type(limit) not in of_splines]
        self._on_path = [(label, limit.unit) for limit in on_path for label in limit.labels]
        rows = [limit.rows(sample) for limit in on_path]
        rows.append((forces - needed, 0.0, 0.0))
        cost = ca.sumsqr(forces[: self.n]) / self.n
        self.path = make_rows(ca.vertcat(tree.q, tree.v, tree.a, forces), ca.SX(0, 1), rows, cost)
        self._add_impact(tree)
        offset = task.target.ball.radius * task.target.contact.normal
        self._ball_centre = ca.Function("ball", [tree.q], [self._point + ca.DM(offset)])
        self._apart: dict[tuple[int, int], Rows] = {}
        self.surroundings = Surroundings(task.robot, task.leg, task.target.ball.radius)

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
        self._point = point = tree.point(leg.contact_joint, lever.contact_lever)
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

    def ball_centre(self, q: Array) -> Array:
        """Return the centre of the ball that the foot touches at q, shape `(3,)` [m]."""
        return np.asarray(self._ball_centre(q)).ravel()

    def _rows_apart(self, joints: tuple[int, int]) -> Rows:
        """Return the row of `Conditions` of two joints, with the configuration as its unknown.

        For the ball, the configuration of the impact follows, where the foot touches the ball.
        """
        if joints not in self._apart:
            (first, second), tree, z, p = joints, self._tree, self._tree.q, ca.SX.sym("p", 9)
            if second >= 0:
                row = ca.dot(p[3:6], tree.seen_from(first, second, p[6:]) - p[:3]) - RESERVE
            else:
                at_impact, radius = ca.SX.sym("at_impact", self.n), self.task.target.ball.radius
                offset = tree.seen_from(first, 0, self._ball_centre(at_impact)) - p[:3]
                z, least = ca.vertcat(z, at_impact), radius + BALL_RESERVE
                row = (ca.sumsqr(offset) - least**2) / (2 * radius)
            self._apart[joints] = make_rows(z, p, [(row, 0.0, np.inf)], ca.SX(0.0))
        return self._apart[joints]

    def stand(self, near: Array, *, at_ball: bool) -> Array | None:
        """Return a posture at rest near one, shape `(n,)`; with `at_ball`, touching the ball."""
        q, forces = ca.MX.sym("q", self.n), ca.MX.sym("forces", len(self._most))
        rows = [self.path.values(ca.vertcat(q, ca.DM.zeros(2 * self.n), forces), [])[0]]
        lower, upper = [self.path.lower], [self.path.upper]
        if at_ball:
            rows.append(self.posture.values(q, [])[0])
            lower.append(self.posture.lower)
            upper.append(self.posture.upper)
        problem = {
            "x": ca.vertcat(q, forces),
            "f": ca.sumsqr(q - ca.DM(near)),
            "g": ca.vertcat(*rows),
        }
        options = {"error_on_fail": False, "print_time": False, "ipopt": OPTIONS}
        solver = ca.nlpsol("stand", "ipopt", problem, options)
        room = 0.02 * (self.upper - self.lower)
        start = np.append(near, np.asarray(self.forces(near, 0.0, 0.0)).ravel())
        end = solver(
            x0=start,
            lbx=np.append(self.lower + room, -self._most),
            ubx=np.append(self.upper - room, self._most),
            lbg=np.concatenate(lower),
            ubg=np.concatenate(upper),
        )
        return np.asarray(end["x"]).ravel()[: self.n] if solver.stats()["success"] else None

    def solve(
        self,
        start: Solution,
        rest: Array,
        times: list[Array],
        *,
        relaxation: float,
        shares: tuple[float, float],
        options: dict[str, Any],
        apart: Sequence[Conditions] = (),
    ) -> Solution:
        """Return the solution from another one, with other points, by Ipopt.

        Args:
            start: unknowns and multipliers to start from.
            rest: posture near which both ends are, shape `(n,)`.
            times: of the points, before and after the impact [s].
            relaxation: of the limits of the ground's impulse at the share 0.
            shares: bounds of the share.
            options: of Ipopt, besides `OPTIONS`.
            apart: conditions of bodies.
        """
        n, splines = self.n, self.splines
        size, moments, free = splines.size * n + 1, np.concatenate(times), len(self._most)
        to_speeds = per_joint(splines.speed_rows(), n, 1)
        to_speeds = sp.diags(np.resize(1.0 / self.task.speed_limit, to_speeds.shape[0])) @ to_speeds
        blocks = [*self._blocks(times, relaxation), *map(self._block_apart, apart)]
        most = np.full(to_speeds.shape[0], 1.0 - SpeedLimit.reserve)
        lower = [np.tile(block.rows.lower, len(block.weights)) for block in blocks]
        upper = [np.tile(block.rows.upper, len(block.weights)) for block in blocks]
        lowest, highest = np.concatenate([-most, *lower]), np.concatenate([most, *upper])
        room = RangeLimit.reserve * (self.upper - self.lower)
        bound = np.tile(self._most, len(moments))
        q, v, a = (splines.values(times, order) @ start.coefficients for order in range(3))
        forces = np.asarray(self.forces.map(len(q))(q.T, v.T, a.T)).T
        multipliers, bounds = self._multipliers(start, moments, apart, (len(most), size))
        if len(multipliers) != len(lowest):  # the ball's place had other equations
            multipliers = np.zeros(len(lowest))
        solver = self._solver(rest, blocks, to_speeds, options)
        end = solver(
            x0=np.concatenate([
                start.coefficients.ravel(), [np.clip(start.share, *shares)], forces.ravel()
            ]),
            lbx=np.concatenate([np.tile(self.lower + room, splines.size), shares[:1], -bound]),
            ubx=np.concatenate([np.tile(self.upper - room, splines.size), shares[1:], bound]),
            lbg=lowest,
            ubg=highest,
            lam_g0=multipliers,
            lam_x0=bounds,
        )  # fmt: skip
        x, rows, multipliers, bounds = (
            np.asarray(end[name]).ravel() for name in ("x", "g", "lam_g", "lam_x")
        )
        self.iterations += int(solver.stats()["iter_count"])
        sizes = [len(most), *map(len, lower)]
        of_speeds, of_points, of_impact, *of_apart = np.split(multipliers, np.cumsum(sizes)[:-1])
        of_points = of_points.reshape(len(moments), -1)
        return Solution(
            rest,
            x[: size - 1].reshape(splines.size, n),
            float(x[size - 1]),
            times,
            Multipliers(
                of_speeds,
                of_impact,
                bounds[:size],
                np.hstack([of_points, bounds[size:].reshape(len(moments), free)]),
                [*zip(apart, of_apart, strict=True)],
            ),
            bool(np.abs(rows - np.clip(rows, lowest, highest)).max() <= TOLERANCE),
            int(solver.stats()["iter_count"]),
        )

    def effects(self, solution: Solution) -> dict[str, float]:
        """Return about how much of the launch each limit takes, by name.

        It is the share that 10 % more, 1 cm or 0.1 rad would give, by the multipliers, without
        those limits where it is less than `LEAST_EFFECT`.
        """
        known, names, total = solution.multipliers, self.task.leg.joint_names, dict[str, float]()
        if known is None:
            return total

        def add(label: str, values: Array, amount: float = 0.1) -> None:
            total[label] = total.get(label, 0.0) + amount / SHARE * float(np.abs(values).sum())

        torques, ranges = known.points[:, len(self.path.lower) :], known.bounds[:-1]
        for i, name in enumerate(names):
            add(f"torque of {name}", torques[:, i])
            add(f"speed of {name}", known.speeds[i :: self.n])
            add(f"range of {name}", ranges[i :: self.n])
        for i, (label, unit) in enumerate(self._on_path):
            add(label, known.points[:, i], 0.01 if unit == "m" else 0.1)
        labels = [label for limit in self.impulse_limits for label in limit.labels]
        for label, value in zip(
            labels, known.impact[len(known.impact) - len(labels) :], strict=True
        ):
            add(label, value)
        for (joints, _, _), values in known.apart:
            first, second = (str(self._model.names[joint]) for joint in joints)
            other = "the ball" if joints[1] < 0 else f"those of {second}"
            add(f"distance of bodies of {first} from {other}", values, 0.01)
        return {label: value for label, value in total.items() if value > LEAST_EFFECT}

    def _multipliers(
        self, start: Solution, moments: Array, apart: Sequence[Conditions], sizes: tuple[int, int]
    ) -> tuple[Array, Array]:
        """Return the multipliers of all rows and bounds that those of a solution give.

        Args:
            start: the solution.
            moments: of the points, shape `(k,)` [s].
            apart: conditions of bodies.
            sizes: numbers of rows of speeds, and of the coefficients and the share.
        """
        k = len(self.path.lower)
        known = start.multipliers or Multipliers(
            np.zeros(sizes[0]), np.zeros(len(self.impact.lower)), np.zeros(sizes[1]),
            np.zeros((sum(map(len, start.times)), k + len(self._most))), [],
        )  # fmt: skip
        distance = np.abs(np.concatenate(start.times)[None] - moments[:, None])
        same = distance.min(axis=1) < SAME_TIME
        points = np.where(same[:, None], known.points[distance.argmin(axis=1)], 0.0)
        former = {conditions.joints: (conditions, values) for conditions, values in known.apart}
        of_apart = [
            multipliers_nearby(conditions, *former[conditions.joints])
            if conditions.joints in former
            else np.zeros(len(conditions.times))
            for conditions in apart
        ]
        rows = np.concatenate([known.speeds, points[:, :k].ravel(), known.impact, *of_apart])
        return rows, np.append(known.bounds, points[:, k:])

    def _blocks(self, times: list[Array], relaxation: float) -> list[Block]:
        """Return the rows of the points and of the impact."""
        n, splines, free = self.n, self.splines, len(self._most)
        maps = np.stack([splines.values(times, order) for order in range(3)], axis=1)
        to_states = per_joint(maps.reshape(3 * len(maps), -1), n, 1)
        to_points = sp.block_diag([to_states, sp.eye(len(maps) * free)]).tocsr()
        numbers = [
            np.arange(to_states.shape[0]).reshape(len(maps), -1),
            to_states.shape[0] + np.arange(len(maps) * free).reshape(len(maps), -1),
        ]
        to_points = to_points[np.hstack(numbers).ravel()]  # states and forces of each point
        last = splines.size * n
        to_share = sp.csr_matrix(([1.0], ([0], [last])), shape=(1, last + 1))
        to_impact = sp.vstack([per_joint(splines.at_impact(), n, 1), to_share])
        weights = np.concatenate([integration_weights(t) for t in times])
        return [
            Block(self.path, to_points, np.zeros((0, len(maps))), weights),
            Block(self.impact, to_impact, np.array([[relaxation]]), np.zeros(1)),
        ]

    def _block_apart(self, conditions: Conditions) -> Block:
        """Return the rows of the conditions of two joints."""
        times, splines, n = conditions.times, self.splines, self.n
        sides = [times[times <= 0.0], times[times > 0.0]]
        order = np.argsort(times > 0.0, kind="stable")
        maps = splines.values(sides, 0)
        if conditions.joints[1] < 0:
            at_impact = np.tile(splines.at_impact()[0], (len(maps), 1))
            maps = np.stack([maps, at_impact], axis=1).reshape(2 * len(maps), -1)
        rows = self._rows_apart(conditions.joints)
        to_points = per_joint(maps, n, 1)
        return Block(rows, to_points, conditions.parameters[:, order], np.zeros(len(times)))

    def _solver(
        self, rest: Array, blocks: Sequence[Block], speeds: Any, options: dict[str, Any]
    ) -> Any:
        """Return Ipopt's solver for the speeds of the splines and for blocks of rows."""
        last, size = self.splines.size * self.n, max(block.matrix.shape[1] for block in blocks)
        quadratic, to_speeds = _matrix(self._quadratic(), size, size), _matrix(speeds, size)
        centre = ca.DM(np.append(np.tile(rest, self.splines.size), np.zeros(size - last)))
        share = ca.DM(size, 1)
        share[last] = -SHARE
        sizes = [
            to_speeds.size1(),
            *(len(block.rows.lower) * len(block.weights) for block in blocks),
        ]
        x, p, cost_weight = ca.MX.sym("x", size), ca.MX.sym("p", 0), ca.MX.sym("weight")
        multipliers = ca.MX.sym("multipliers", sum(sizes))
        parts = ca.vertsplit(multipliers, np.cumsum([0, *sizes]).tolist())
        cost = 0.5 * ca.dot(x - centre, quadratic @ (x - centre)) + SHARE * (1.0 - x[last])
        gradient, hessian = quadratic @ (x - centre) + share, cost_weight * quadratic
        constraints, jacobian = [to_speeds @ x], [ca.MX(to_speeds)]
        for (rows, matrix, parameters, weights), part in zip(blocks, parts[1:], strict=True):
            count, to_points = len(weights), _matrix(matrix, size)
            m = matrix.shape[0] // count
            z, p_given, weight = (
                ca.reshape(to_points @ x, m, count),
                ca.DM(parameters),
                ca.DM(weights).T,
            )
            values, costs = rows.values.map(count)(z, p_given)
            cost += ca.dot(weight, costs)
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
                "nlp_grad_f", [x, p], [cost, ca.densify(gradient)], ["x", "p"], ["f", "grad_f_x"]
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
        problem = {"x": x, "p": p, "f": cost, "g": ca.vertcat(*constraints)}
        return ca.nlpsol("motion", "ipopt", problem, {
            **functions, "print_time": False, "error_on_fail": False, "calc_lam_p": False,
            "ipopt": {**OPTIONS, **options},
        })  # fmt: skip

    def _quadratic(self) -> Any:
        """Return the matrix of the quadratic part of the objective, for all unknowns."""
        splines = self.splines
        middles = [(grid[1:] + grid[:-1]) / 2 for grid in splines.grids]
        lengths = np.concatenate([np.diff(grid) for grid in splines.grids])
        jerk = splines.values(middles, 3)
        ends = np.zeros(splines.size)
        ends[[0, -1]] = ENDS
        weight = JERK[self.task.standing is not None] / self.n
        matrix = weight * jerk.T @ (lengths[:, None] * jerk) + np.diag(ends)
        every = sp.kron(sp.csr_matrix(matrix), sp.eye(self.n))
        return sp.block_diag([every, sp.csr_matrix((1, 1))])


def _matrix(matrix: Any, columns: int, rows: int | None = None) -> Any:
    """Return a sparse matrix of scipy, with zeros added to its size, as one of CasADi."""
    larger = sp.csc_matrix(matrix, copy=True)
    larger.resize(rows or matrix.shape[0], columns)
    return ca.DM(larger)


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
