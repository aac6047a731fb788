r"""The nonlinear program of a motion, for Ipopt.

Unknowns are the coefficients c of `MotionSplines`, the share s of the launch, and at each point the
torques and the ground's wrench. Position, velocity and acceleration at each point, and position,
velocity and its jump at the impact, are constant linear maps of c. With torques and wrench unknown,
the objective and most limits are quadratic or linear in the unknowns, which makes the Hessian
cheaper, and the solver's equations sparser, than those of c alone. The objective is

.. math::
    \int \frac1n \sum_i (\tau_i / \tau_{max,i})^2 dt + \epsilon \int |\dddot q|^2 dt
    + w\, (|q(t_0) - q_0|^2 + |q(t_1) - q_0|^2) + W (1 - s).

With :math:`W (1 - s)`, standing still nearly solves the problem, and the solver always has a way
in.
"""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.motion.kick_task import KickTask, impact_rows, limits_of, limits_on_both, resting_limit
from kickdyn.motion.limits import (
    LENGTH,
    Clearance,
    RangeLimit,
    RestingTorqueLimit,
    Sample,
    SpeedLimit,
    TorqueLimit,
)
from kickdyn.motion.motion import settling
from kickdyn.motion.motion_program import (
    OPTIONS,
    TOLERANCE,
    Block,
    Cost,
    MotionSolution,
    MotionSplines,
    Multipliers,
    Rows,
    SymbolicTree,
    block_solver,
    integration_weights,
    make_rows,
    multipliers_of,
    per_joint,
    taken_over,
)
from kickdyn.motion.separation import BALL_RESERVE, RESERVE, Conditions, Surroundings
from kickdyn.motion.weight_shift import Feet
from kickdyn.robot.standing import rest_configuration

JERK, ENDS, SHARE = {False: 1e-8, True: 1e-7}, 0.1, 3.0
"""Weights of the objective: of the jerk over n [s5/rad2], by whether the robot stands on a foot, of
the posture at both ends [1/rad2] and of the share of the launch that is not reached, against about
0.1 s of squared torque."""

NEARNESS = 0.1
"""Weight of the squared distance from other coefficients [1/rad2]: the optimum is flat in some
directions, in which motions of neighbouring kicks would differ by tenths of a radian."""

LEAST_EFFECT, LEAST_MULTIPLIER = 1e-3, 0.05
"""Share of the launch below which a limit does not count as one that reduces it, and multiplier
below which a row does not count: Ipopt gives those that are not reached small ones, too."""

WHOLE_SHARE = 1.0 - 1e-4
"""Share of the launch from which on a solution counts as the whole launch: interior points are this
far from their bounds, and limits have larger reserves."""

IMPACT_STEPS = 3
"""Steps of Newton's method after which the equations of the impact have no error but rounding."""

REST_ITERATIONS = 200
"""Iterations of Ipopt for a posture at rest, at most: a ball out of reach takes all of them."""

LIFTING = 0.2
"""Time from both ends within which a foot that is lifted keeps no reserve of height [s]."""


class MotionProblem:
    """The problem of a kick's motion.

    Attributes:
        task: the kick.
        splines: whose coefficients are unknown.
        limited: joints at rest whose torques have rows.
        limits: of the whole motion.
        impulse_limits: of the ground's impulse.
        margins: CasADi's function of q, v, a of all joints, those at rest too, that gives the
            margins of all `limits`, stacked.
        forces: likewise, of the joints that move alone, their torques over their limits, and the
            ground's wrench on a robot that stands, over its weight, moments over `LENGTH` times it.
        impulse_margins: likewise of q, and of the jump of v of all joints with the whole launch, of
            `impulse_limits`.
        surroundings: which bodies can come near each other.
        feet: both feet, where the motion starts and ends on them; else None.
    """

    def __init__(self, task: KickTask, splines: MotionSplines, limited: Sequence[str] = ()) -> None:
        self.task, self.splines, self.limited = task, splines, tuple(limited)
        self.limits, self.impulse_limits = limits_of(task)
        model, whole = task.leg.model, task.whole
        self.n = int(model.nv)
        self.lower = np.maximum(model.lowerPositionLimit, -np.pi)
        self.upper = np.minimum(model.upperPositionLimit, np.pi)
        self._tree = tree = SymbolicTree(model)
        self._at_rest = rest_configuration(whole, task.aside)
        self._moving, self._resting = (
            [whole.velocity_index(name) for name in names]
            for names in (task.leg.joint_names, task.resting)
        )
        at_rest, still = self._at_rest, np.zeros(whole.nv)
        states = [
            self._among_all(at_rest, tree.q), self._among_all(still, tree.v),
            self._among_all(still, tree.a),
        ]  # fmt: skip
        torques, _ = SymbolicTree(whole.model, states).inverse_dynamics()
        self._resting_torque = torques[self._resting]
        self._weight = sum(body.mass for body in model.inertias) * 9.81
        scale = np.asarray(model.effortLimit)
        if task.standing is not None:
            scale = np.append(scale, self._weight * np.repeat([1.0, LENGTH], 3))
        self._scale, of_ground = ca.DM(scale), len(scale) - self.n
        most = np.repeat([1.0 - TorqueLimit.reserve, np.inf], [self.n, of_ground])
        self._most = np.asarray(most)
        needed = ca.vertcat(*tree.inverse_dynamics())[: len(scale)] / self._scale
        self.forces = ca.Function("forces", [tree.q, tree.v, tree.a], [needed])
        self.margins, self._all_forces = self._of_all_joints()
        self._on_path, self._is_height, self.path = self._path_rows(needed)
        self.impact, self.posture, self.impulse_margins, self._jump, self._ball_centre = (
            impact_rows(task, tree, states[0], self.impulse_limits)
        )
        self._apart: dict[tuple[int, int], Rows] = {}
        self.surroundings = Surroundings(task.robot, task.leg, task.target.ball.radius)
        self.feet: Feet | None = None
        if task.standing is not None and task.other is not None:
            self.feet = Feet(task.leg, task.standing, task.other)
            self.feet.following()  # refused now if there are too few joints
            pose, joint = task.other.pose, task.leg.contact_joint
            relative = ca.DM(pose.rotation).T @ tree.rotation(joint)
            placed = tree.point(joint, np.zeros(3)) - ca.DM(pose.translation)
            closed = ca.vertcat(placed, ca.inv_skew(relative - relative.T) / 2)
            self._closed = make_rows(tree.q, ca.SX(0, 1), [(closed, 0.0, 0.0)], ca.SX(0.0))

    def _of_all_joints(self) -> tuple[Any, Any]:
        """Return `margins`, and `forces` with all joints, then torques of those at rest."""
        tree, every = self._tree, SymbolicTree(self.task.whole.model)
        torque, wrench = every.inverse_dynamics()
        state, moving, resting = (
            [every.q, every.v, every.a],
            torque[self._moving],
            torque[self._resting],
        )
        sample = Sample(
            tree, ca.SX.sym("torque", self.n), ca.SX.sym("wrench", 6), self._weight,
            ca.SX.sym("resting", len(self._resting)),
        )  # fmt: skip
        margins = ca.Function(
            "margins",
            [tree.q, tree.v, tree.a, sample.torque, sample.wrench, sample.resting],
            [ca.vertcat(*(limit.margins(sample) for limit in self.limits))],
        )
        margins = margins(*(x[self._moving] for x in state), moving, wrench, resting)
        forces = ca.vertcat(moving, wrench)[: self._scale.numel()] / self._scale
        return (
            ca.Function("margins", state, [margins]),
            ca.Function("forces", state, [ca.vertcat(forces, resting)]),
        )

    def _path_rows(self, needed: Any) -> tuple[list[tuple[str, str]], NDArray[np.bool_], Rows]:
        """Return labels and units of the limits at a point, which rows are heights, and the rows.

        The unknowns are q, v, a and the forces over their scale, which are `needed` of q, v and a;
        parameters are the changes, by joints at rest that gave way, of these forces and of the
        torques of joints at rest.
        """
        tree, count = self._tree, self._scale.numel()
        forces = ca.SX.sym("forces", count)
        change = ca.SX.sym("change", count + len(self._resting))
        loads = ca.vertcat(self._scale * forces, ca.SX(6, 1))
        sample = Sample(tree, loads[: self.n], loads[self.n : self.n + 6], self._weight,
                        self._resting_torque + change[count:])  # fmt: skip
        # splines keep some limits, and bounds of unknowns others
        others = (TorqueLimit, SpeedLimit, RangeLimit, RestingTorqueLimit)
        limits = [limit for limit in self.limits if type(limit) not in others]
        if self.limited:
            limits.append(resting_limit(self.task, self.limited))
        rows = [limit.rows(sample) for limit in limits]
        rows.append((forces - needed - change[:count], 0.0, 0.0))
        labels = [(label, limit.unit) for limit in limits for label in limit.labels]
        of_heights = [[isinstance(limit, Clearance)] * len(limit.labels) for limit in limits]
        is_height = np.concatenate([*of_heights, np.zeros(count, bool)]).astype(bool)
        unknowns = ca.vertcat(tree.q, tree.v, tree.a, forces)
        cost = ca.sumsqr(forces[: self.n]) / self.n
        return labels, is_height, make_rows(unknowns, change, rows, cost)

    @property
    def row_labels(self) -> list[str]:
        """Names of the rows of `margins`, with their units."""
        return [name for limit in self.limits for name in limit.names]

    def ball_centre(self, q: Array) -> Array:
        """Return the centre of the ball that the foot touches at q, shape `(3,)` [m]."""
        return np.asarray(self._ball_centre(q)).ravel()

    def _among_all(self, rest: Array, moving: Any) -> Any:
        """Return values of all joints, symbols of those that move among numbers of the others."""
        values = ca.SX(ca.DM(rest))
        values[self._moving] = moving
        return values

    def jump(self, q: Array) -> Array:
        """Return the jump of v of all joints with the whole launch at q, `(nv,)` [rad/s; m/s]."""
        inertia, force = self._jump(q)
        return np.linalg.solve(np.asarray(inertia), np.asarray(force).ravel())

    def pushed(self, coefficients: Array, share: float) -> dict[str, float]:
        """Return the velocities that the impact gives to joints at rest [rad/s; m/s]."""
        jump = share * self.jump(self.splines.at_impact()[0] @ coefficients)[self._resting]
        return dict(zip(self.task.resting, jump.tolist(), strict=True))

    def states(self, times: list[Array], coefficients: Array, share: float) -> Array:
        """Return q, v and a of all joints at times of a motion, shape `(3, moments, nv)`."""
        states = np.zeros((3, sum(map(len, times)), self.task.whole.nv))
        states[0] = self._at_rest
        for order, values in enumerate(states):
            values[:, self._moving] = self.splines.values(times, order) @ coefficients
        pushed = np.array([*self.pushed(coefficients, share).values()])
        states[:, len(times[0]) :, self._resting] += settling(times[1])[:, :, None] * pushed
        return states

    def all_forces(self, states: Array) -> Array:
        """Return `forces` with all joints, then torques of those at rest, `(k, moments)`."""
        return np.asarray(self._all_forces.map(states.shape[1])(*states.transpose(0, 2, 1)))

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
        """Return a posture at rest near one, shape `(n,)`; with `at_ball`, touching the ball.

        Without, both feet are on the ground if the motion starts there, with all weight on the
        supporting one.
        """
        if at_ball or self.feet is None:
            return self._rest_near(near, self.path.lower, self.posture if at_ball else None)
        return self.stand_on_both(near, self.feet.standing.sole.mean(axis=0), alone=True)

    def stand_on_both(self, near: Array, centre: Array, *, alone: bool = False) -> Array | None:
        """Return a posture at rest on both feet with the centre of mass above a point [m].

        With `alone`, the supporting foot has all the weight.
        """
        assert self.feet is not None
        tree, lower = self._tree, self.path.lower
        free = (lower < self.path.upper) & (self._is_height if alone else True)
        wrench = self.forces(tree.q, 0.0, 0.0)[self.n :]
        balance = LENGTH * ca.vertcat(-wrench[4], wrench[3]) / wrench[2] - ca.DM(centre)
        closed, _ = self._closed.values(tree.q, [])
        rows = [(closed, 0.0, 0.0), (balance, 0.0, 0.0)]
        on_both = make_rows(tree.q, ca.SX(0, 1), rows, ca.SX(0.0))
        posture = self._rest_near(near, np.where(free, -np.inf, lower), on_both, alone=alone)
        return None if posture is None else self.feet.closed(posture)

    def _rest_near(
        self, near: Array, lowest: Array, others: Rows | None, *, alone: bool = True
    ) -> Array | None:
        """Return the nearest posture at rest that keeps rows of the path, and others of q.

        `lowest` bounds the rows of the path. With `alone`, torques are those of a robot on its
        supporting foot alone, and limited.
        """
        q, forces = ca.MX.sym("q", self.n), ca.MX.sym("forces", len(self._most))
        unknowns = ca.vertcat(q, ca.DM.zeros(2 * self.n), forces)
        rows = [(self.path.values(unknowns, 0.0)[0], lowest,
                 np.where(np.isneginf(lowest), np.inf, self.path.upper))]  # fmt: skip
        most = self._most if alone else np.full(len(self._most), np.inf)
        if others is not None:
            rows.append((others.values(q, [])[0], others.lower, others.upper))
        values, lower, upper = zip(*rows, strict=True)
        x, distance = ca.vertcat(q, forces), ca.sumsqr(q - ca.DM(near))
        ipopt = {**OPTIONS, "max_iter": REST_ITERATIONS}
        options = {"error_on_fail": False, "print_time": False, "ipopt": ipopt}
        problem = {"x": x, "f": distance, "g": ca.vertcat(*values)}
        solver = ca.nlpsol("stand", "ipopt", problem, options)
        room = 0.02 * (self.upper - self.lower)
        start = np.append(near, np.asarray(self.forces(near, 0.0, 0.0)).ravel())
        end = solver(
            x0=start,
            lbx=np.append(self.lower + room, -most),
            ubx=np.append(self.upper - room, most),
            lbg=np.concatenate(lower),
            ubg=np.concatenate(upper),
        )
        return np.asarray(end["x"]).ravel()[: self.n] if solver.stats()["success"] else None

    def solve(
        self,
        start: MotionSolution,
        rest: Array,
        times: list[Array],
        *,
        shares: tuple[float, float],
        options: dict[str, Any],
        apart: Sequence[Conditions] = (),
        near: Array | None = None,
    ) -> MotionSolution:
        """Return the solution from another one, with other points, by Ipopt.

        Args:
            start: unknowns and multipliers to start from.
            rest: posture near which both ends are, shape `(n,)`.
            times: of the points, before and after the impact [s].
            shares: bounds of the share.
            options: of Ipopt, besides `OPTIONS`.
            apart: conditions of bodies.
            near: coefficients near which those of the solution are, by `NEARNESS`.
        """
        n, splines = self.n, self.splines
        moments, free = np.concatenate(times), len(self._most)
        last = splines.size * n  # number of the share, which the jump of the whole launch follows
        size = last + 1 + self.task.whole.nv
        to_speeds = per_joint(splines.speed_rows(), n, 1)
        to_speeds = sp.diags(np.resize(1.0 / self.task.speed_limit, to_speeds.shape[0])) @ to_speeds
        reference = start.coefficients
        if start.linearized is not None:  # without the mean, two solutions can alternate for ever
            reference = (reference + start.linearized) / 2
        # forces change by joints at rest that gave way; torques of these follow, without a scale
        given, none = (self.states(times, reference, share) for share in (start.share, 0.0))
        changes = np.asarray(self.all_forces(given) - self.all_forces(none))
        blocks = [*self._blocks(times, changes), *map(self._block_apart, apart)]
        most = np.full(to_speeds.shape[0], 1.0 - SpeedLimit.reserve)
        lower = [np.tile(block.rows.lower, len(block.weights)) for block in blocks]
        upper = [np.tile(block.rows.upper, len(block.weights)) for block in blocks]
        if self.feet is not None:
            lower = self._lower_on_both(lower, times, apart)
        lowest, highest = np.concatenate([-most, *lower]), np.concatenate([most, *upper])
        least, largest = self._range_of_coefficients(rest)
        bound, free_jump = np.tile(self._most, len(moments)), np.full(size - last - 1, np.inf)
        q, v, a = (splines.values(times, order) @ start.coefficients for order in range(3))
        forces = np.asarray(self.forces.map(len(q))(q.T, v.T, a.T)).T
        empty = Multipliers(
            np.zeros(len(most)), np.zeros(len(self.impact.lower)), np.zeros(size),
            np.zeros((1, len(self.path.lower) + free)), [],
        )  # fmt: skip
        multipliers, bounds = taken_over(start, moments, apart, empty, free)
        if len(multipliers) != len(lowest):  # the ball's place had other equations
            multipliers = np.zeros(len(lowest))
        columns = size + bound.size
        solver = block_solver(blocks, to_speeds, self._cost(rest, near), columns, options)
        end = solver(
            x0=np.concatenate([
                start.coefficients.ravel(), [np.clip(start.share, *shares)],
                self.jump(splines.at_impact()[0] @ start.coefficients), forces.ravel(),
            ]),
            lbx=np.concatenate([least.ravel(), shares[:1], -free_jump, -bound]),
            ubx=np.concatenate([largest.ravel(), shares[1:], free_jump, bound]),
            lbg=lowest,
            ubg=highest,
            lam_g0=multipliers,
            lam_x0=bounds,
        )  # fmt: skip
        names = "x", "g", "lam_g", "lam_x"
        x, rows, multipliers, bounds = (np.asarray(end[name]).ravel() for name in names)
        sizes = [len(most), *map(len, lower), size]
        feasible = bool(np.abs(rows - np.clip(rows, lowest, highest)).max() <= TOLERANCE)
        coefficients, share = x[:last].reshape(splines.size, n), float(x[last])
        share = 1.0 if share >= WHOLE_SHARE else share
        return MotionSolution(
            rest,
            self._with_exact_impact(coefficients, share) if feasible else coefficients,
            share,
            times,
            multipliers_of(multipliers, bounds, sizes, moments, apart),
            feasible,
            int(solver.stats()["iter_count"]),
            self.limited,
            reference,
        )

    def continues(self, solution: MotionSolution) -> bool:
        """Return whether a solution has multipliers of the rows that points have here."""
        multipliers, rows = solution.multipliers, len(self.path.lower) + len(self._most)
        return multipliers is not None and multipliers.points.shape[1] == rows

    def _range_of_coefficients(self, rest: Array) -> tuple[Array, Array]:
        """Return bounds of the coefficients; both ends are given if the robot is on both feet."""
        room = RangeLimit.reserve * (self.upper - self.lower)
        least, largest = (
            np.tile(limit, (self.splines.size, 1))
            for limit in (self.lower + room, self.upper - room)
        )
        if self.feet is not None:
            least[[0, -1]] = largest[[0, -1]] = rest
        return least, largest

    def _with_exact_impact(self, coefficients: Array, share: float) -> Array:
        """Return the nearest coefficients that keep the equations of the impact to rounding.

        Ipopt leaves them with an error up to `TOLERANCE`, which Newton's method takes away.
        """
        maps, equal = self.splines.at_impact(), self.impact.lower == self.impact.upper
        jump = self.jump(maps[0] @ coefficients)
        for _ in range(IMPACT_STEPS):
            state = maps @ coefficients
            z = np.concatenate([state.ravel(), [share], jump])
            error = np.asarray(self.impact.values(z, [])[0]).ravel()[equal]
            slope = np.asarray(self.impact.jacobian(z, []))[equal]
            of_state, of_jump = slope[:, : state.size], slope[:, state.size + 1 :]
            rows = np.einsum("kin,is->ksn", of_state.reshape(len(slope), len(maps), -1), maps)
            rows = np.hstack([rows.reshape(len(rows), -1), of_jump])
            change = np.linalg.lstsq(rows, -error)[0]
            coefficients = coefficients + change[: coefficients.size].reshape(coefficients.shape)
            jump = jump + change[coefficients.size :]
        return coefficients

    def _lower_on_both(
        self, lower: Sequence[Array], times: list[Array], apart: Sequence[Conditions]
    ) -> list[Array]:
        """Return the lower bounds of rows without inequalities at both ends, which are given.

        While the kicking foot is lifted from the ground, it has no reserve.
        """
        moments, ends = np.concatenate(times), (times[0][0], times[1][-1])
        distance = np.minimum(moments - ends[0], ends[1] - moments)
        rows = np.tile(self.path.lower, (len(moments), 1))
        rows[np.ix_(distance < LIFTING, self._is_height)] = 0.0
        rows[np.ix_(distance == 0.0, self.path.lower < self.path.upper)] = -np.inf
        of_bodies = []
        for conditions, row in zip(apart, lower[2:], strict=True):
            of_bodies.append(np.where(np.isin(conditions.times, ends), -np.inf, row))
        return [rows.ravel(), lower[1], *of_bodies]

    def limits_of_shift(self) -> tuple[tuple[Any, Any], tuple[str, ...]]:
        """Return functions for the margins of a `WeightShift`, and the labels of their rows.

        The first gives torques of the joints on the supporting foot alone, and the ground's wrench,
        for q, v and a; the second gives margins for these, torques and the wrenches on both feet.
        """
        tree, limits = self._tree, limits_on_both(self.task)
        forces = ca.Function("forces", [tree.q, tree.v, tree.a], [*tree.inverse_dynamics()])
        torque, *wrenches = (ca.SX.sym("x", size) for size in (self.n, 6, 6))
        margins, labels = [], []
        for of_foot, wrench, foot in zip(limits, wrenches, ("supporting", "other"), strict=True):
            sample = Sample(tree, torque, wrench, 1.0, self._resting_torque)
            margins += [limit.margins(sample) for limit in of_foot]
            names = (name for limit in of_foot for name in limit.names)
            labels += [name.replace("the supporting foot", f"the {foot} foot") for name in names]
        unknowns = [tree.q, tree.v, tree.a, torque, *wrenches]
        return (forces, ca.Function("margins", unknowns, [ca.vertcat(*margins)])), tuple(labels)

    def effects(self, solution: MotionSolution) -> dict[str, float]:
        """Return about how much of the launch each limit takes, by name.

        It is the share that 10 % more, 1 cm or 0.1 rad would give, by the multipliers, without
        those limits where it is less than `LEAST_EFFECT`.
        """
        duals, names, total = solution.multipliers, self.task.leg.joint_names, dict[str, float]()
        if duals is None:
            return total

        def add(label: str, values: Array, amount: float = 0.1) -> None:
            sizes = np.abs(values)
            effect = amount / SHARE * float(sizes[sizes > LEAST_MULTIPLIER].sum())
            total[label] = total.get(label, 0.0) + effect

        torques = duals.points[:, len(self.path.lower) :]
        ranges = duals.bounds[: self.splines.size * self.n]
        for i, name in enumerate(names):
            add(f"torque of {name}", torques[:, i])
            add(f"speed of {name}", duals.speeds[i :: self.n])
            add(f"range of {name}", ranges[i :: self.n])
        for i, (label, unit) in enumerate(self._on_path):
            add(label, duals.points[:, i], 0.01 if unit == "m" else 0.1)
        labels = [label for limit in self.impulse_limits for label in limit.labels]
        of_ground = duals.impact[len(duals.impact) - len(labels) :]
        for label, value in zip(labels, of_ground, strict=True):
            add(label, value)
        for conditions in duals.apart:
            add(self.surroundings.label(conditions.joints), conditions.multipliers, 0.01)
        return {label: value for label, value in total.items() if value > LEAST_EFFECT}

    def _blocks(self, times: list[Array], changes: Array) -> list[Block]:
        """Return the rows of the points and of the impact."""
        n, splines, free = self.n, self.splines, len(self._most)
        maps = np.stack([splines.values(times, order) for order in range(3)], axis=1)
        jump = self.task.whole.nv
        to_states = per_joint(maps.reshape(3 * len(maps), -1), n, 1 + jump)
        to_points = sp.block_diag([to_states, sp.eye(len(maps) * free)]).tocsr()
        numbers = [
            np.arange(to_states.shape[0]).reshape(len(maps), -1),
            to_states.shape[0] + np.arange(len(maps) * free).reshape(len(maps), -1),
        ]
        to_points = to_points[np.hstack(numbers).ravel()]  # states and forces of each point
        to_impact = sp.block_diag([per_joint(splines.at_impact(), n, 0), sp.eye(1 + jump)])
        weights = np.concatenate([integration_weights(t) for t in times])
        return [
            Block(self.path, to_points, changes, weights),
            Block(self.impact, to_impact, np.zeros((0, 1)), np.zeros(1)),
        ]

    def _block_apart(self, conditions: Conditions) -> Block:
        """Return the rows of the conditions of two joints."""
        times, splines, n = conditions.times, self.splines, self.n
        maps = splines.values([times[times <= 0.0], times[times > 0.0]], 0)
        if conditions.is_of_ball:
            at_impact = np.tile(splines.at_impact()[0], (len(maps), 1))
            maps = np.stack([maps, at_impact], axis=1).reshape(2 * len(maps), -1)
        rows = self._rows_apart(conditions.joints)
        return Block(rows, per_joint(maps, n, 1), conditions.parameters, np.zeros(len(times)))

    def _cost(self, rest: Array, near: Array | None) -> Cost:
        """Return jerk, posture at both ends, share and nearness in the objective."""
        splines = self.splines
        middles = [(grid[1:] + grid[:-1]) / 2 for grid in splines.grids]
        lengths = np.concatenate([np.diff(grid) for grid in splines.grids])
        jerk = splines.values(middles, 3)
        ends = np.zeros(splines.size)
        ends[[0, -1]] = ENDS
        weight = JERK[self.task.standing is not None] / self.n
        matrix = weight * jerk.T @ (lengths[:, None] * jerk) + np.diag(ends)
        every = sp.kron(sp.csr_matrix(matrix), sp.eye(self.n))
        slope = np.zeros(splines.size * self.n + 1)
        slope[-1] = -SHARE
        centre = np.tile(rest, splines.size)
        if near is not None:
            slope[:-1] = -(every @ centre + NEARNESS * near.ravel())
            every, centre = every + NEARNESS * sp.eye(len(centre)), np.zeros_like(centre)
        return Cost(every, centre, slope)
