r"""Coming to rest from a moving posture within all limits: an optimal control problem for Ipopt.

A kick needs it twice. The follow-through stops from the velocity just after the impact. The
backswing is a stop from the negative velocity just before, seen backwards in time: the torques of
the equations of motion are even in velocity.

.. math::
    \min_{a(t),\, T} \int_0^T \frac1n \sum_i (\tau_i / \tau_{max,i})^2\, dt \quad\text{or } T,
    \qquad q(0) = q_0,\ v(0) = s\, v_0,\ v(T) = 0,

within the limits of range, speed and torque, and with the largest share :math:`s \le 1` of the
velocity.
"""

from enum import StrEnum
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.planning.swing_phase import SwingPhase, make_phase
from kickdyn.robot.kicking_chain import KickingChain

UNIT = 0.1
"""Accelerations are scaled by the speed limit over this time [s], to the order of 1."""

MARGIN = 1e-7
"""Distance of positions and speeds from their limits, over the limits: Ipopt's rounding."""

EAGER = 100.0
"""Weight of the share against the objective, of the order of 1."""

SHORT = 0.2
"""Duration of the first guess [s]."""

SLACK = 0.005
"""Share of the torque limits left over at first, for torques between the solver's points."""

BUDGET = 67_000
"""Iterations of Ipopt for a swing of one joint and 24 nodes, after which none are started; for n
joints, n^3 times fewer. An iteration takes 0.016 s of a processor with six joints."""

OPTIONS = {
    "expand": True,  # into scalars: a quarter faster
    "print_time": False,
    "error_on_fail": False,
    "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 130, "tol": 1e-8},
}


class SwingObjective(StrEnum):
    r"""What a swing makes least."""

    TORQUE_SQUARED = "torque-squared"
    r""":math:`\int \frac1n \sum_i (\tau_i / \tau_{max,i})^2 dt` [s]."""
    TIME = "time"
    """Sum of both durations [s]."""


class Stop(NamedTuple):
    """A stop to be found.

    Attributes:
        sign: -1 of the backswing, 1 of the follow-through.
        q: posture at the impact, shape `(n,)` [rad].
        v: velocity away from it, shape `(n,)` [rad/s].
        rest: posture at rest, shape `(n,)` [rad]; None leaves it free.
        longest: duration [s].
    """

    sign: int
    q: Array
    v: Array
    rest: Array | None
    longest: float

    @property
    def name(self) -> str:
        """Name of the phase of the swing."""
        return "backswing" if self.sign < 0 else "follow-through"


class StopSolution(NamedTuple):
    """A stop that Ipopt found.

    Attributes:
        phase: of the swing.
        share: of the velocity.
        binding: limit and joint whose widening would raise the share most.
    """

    phase: SwingPhase
    share: float
    binding: tuple[str, int]


class StopEquations:
    """A stop in CasADi's symbols: accelerations linear between nodes, the duration free.

    Positions are then cubic and speeds quadratic in time, and bounded by their Bezier points: they
    keep their limits everywhere, not at nodes only. Torques keep theirs at nodes and half-way.

    Args:
        chain: of the joints that move.
        nodes: intervals.
        q, v: symbols for posture and velocity at the start.

    Attributes:
        unknowns: positions, scaled speeds and accelerations at the nodes, and the duration.
        constraints: to be bounded by `constraint_bounds`.
        labels: limit and joint of each constraint; no limit for an equation.
        torque_squared, time: the objectives.
    """

    def __init__(self, chain: KickingChain, nodes: int, q: Any, v: Any) -> None:
        n, self.nodes, self.chain = len(chain.names), nodes, chain
        torque = torque_function(chain.model)
        speed, effort = ca.DM(chain.velocity_limit), ca.DM(chain.effort_limit)
        lower, width = ca.DM(chain.lower), ca.DM(chain.upper - chain.lower)
        positions, speeds, accelerations = (
            ca.MX.sym(name, n, nodes + 1) for name in ("q", "v", "a")
        )
        self.time = ca.MX.sym("t")
        self.unknowns = ca.vertcat(
            *(ca.vec(x) for x in (positions, speeds, accelerations)), self.time
        )
        v_all, a_all = speeds * speed, accelerations * (speed / UNIT)
        h = self.time / nodes
        q0, q1, v0, v1, a0, a1 = (
            end for x in (positions, v_all, a_all) for end in (x[:, :-1], x[:, 1:])
        )
        links = [
            (v1 - v0 - h / 2 * (a0 + a1)) / speed,
            (q1 - q0 - h * v0 - h * h / 6 * (2 * a0 + a1)) / width,
            (positions[:, 0] - q) / width,
            speeds[:, 0] - v / speed,
        ]
        bends = [(q0 + h / 3 * v0 - lower) / width, (q1 - h / 3 * v1 - lower) / width]
        peaks = (v0 + h / 2 * a0) / speed
        half_way = (
            q0 + h / 2 * v0 + h * h / 48 * (5 * a0 + a1),
            v0 + h / 8 * (3 * a0 + a1),
            (a0 + a1) / 2,
        )
        at_nodes = torque.map(nodes + 1)(positions, v_all, a_all) / effort
        between = torque.map(nodes)(*half_way) / effort
        at_rest = torque(positions[:, -1], ca.DM(n, 1), ca.DM(n, 1)) / effort
        squares = [ca.sum1(use**2) / n for use in (at_nodes, between)]
        ends = ca.sum2(squares[0][:-1]) + ca.sum2(squares[0][1:])
        self.torque_squared = h / 6 * (ends + 4 * ca.sum2(squares[1]))  # Simpson's rule
        blocks = [
            ("", links, 0.0, 0.0),
            ("range", bends, MARGIN, 1.0 - MARGIN),
            ("speed", [peaks], -1.0 + MARGIN, 1.0 - MARGIN),
            ("torque", [at_nodes, between, at_rest], -1.0, 1.0),
        ]
        values = [ca.vertcat(*map(ca.vec, matrices)) for _, matrices, _, _ in blocks]
        sizes = [int(value.numel()) for value in values]
        self.constraints = ca.densify(ca.vertcat(*values))
        self.labels = [
            (block[0], i % n)
            for block, size in zip(blocks, sizes, strict=True)
            for i in range(size)
        ]
        self._low, self._high = (
            np.repeat([block[end] for block in blocks], sizes) for end in (2, 3)
        )
        self._of_torque = np.repeat([block[0] == "torque" for block in blocks], sizes)

    def constraint_bounds(self, slack: float) -> tuple[Array, Array]:
        """Return bounds of the constraints; `slack` is the share of torque that is left over."""
        scale = np.where(self._of_torque, 1.0 - slack, 1.0)
        return scale * self._low, scale * self._high

    def bounds(self, longest: float, rest: Array | None) -> tuple[Array, Array]:
        """Return bounds of the unknowns, for a longest duration [s] and a posture at rest."""
        n, count = len(self.chain.names), self.nodes + 1
        margin = MARGIN * (self.chain.upper - self.chain.lower)
        low, high = (
            np.tile(end, (count, 1))
            for end in (self.chain.lower + margin, self.chain.upper - margin)
        )
        low[0], high[0] = -np.inf, np.inf  # the posture at the start is given
        if rest is not None:
            low[-1] = high[-1] = rest
        speeds = np.full((count, n), 1.0 - MARGIN)
        speeds[-1] = 0.0
        free = np.full(count * n, np.inf)
        shortest = 1e-3  # duration [s]
        return (
            np.concatenate([low.ravel(), -speeds.ravel(), -free, [shortest]]),
            np.concatenate([high.ravel(), speeds.ravel(), free, [longest]]),
        )

    def guess(self, q: Array, v: Array, time: float) -> Array:
        """Return the unknowns of even decelerations, cut off at the ends of the range."""
        s, speed = np.linspace(0.0, 1.0, self.nodes + 1)[:, None], self.chain.velocity_limit
        turns = np.clip(q + v * time * (s - s * s / 2), self.chain.lower, self.chain.upper)
        speeds = np.clip(v / speed, -1, 1) * (1 - s)
        pulls = np.ones_like(s) * (-v / time) / (speed / UNIT)
        return np.concatenate([turns.ravel(), speeds.ravel(), pulls.ravel(), [time]])

    def phase(self, sign: int, q: Array, v: Array, x: Array) -> SwingPhase:
        """Return unknowns as a phase that starts exactly at a posture and a velocity."""
        n, count = len(self.chain.names), self.nodes + 1
        turns, _, pulls = x[: 3 * count * n].reshape(3, count, n)
        accelerations = pulls * self.chain.velocity_limit / UNIT
        times = np.linspace(0.0, float(x[3 * count * n]), count)
        return make_phase(self.chain, sign, q, v, accelerations, times, turns[-1])


class StopSolver:
    """Solves stops of one chain from given postures and velocities.

    Args:
        chain: of the joints that move.
        nodes: intervals.
        objective: to be least.
    """

    def __init__(
        self,
        chain: KickingChain,
        nodes: int,
        objective: str = SwingObjective.TORQUE_SQUARED,
    ) -> None:
        n = len(chain.names)
        self._left = BUDGET * 24 // (nodes * n**3)
        q, v, share = ca.MX.sym("q1", n), ca.MX.sym("v1", n), ca.MX.sym("share")
        self._equations = stop = StopEquations(chain, nodes, q, share * v)
        cost = stop.time if objective == SwingObjective.TIME else stop.torque_squared
        self._solver = ca.nlpsol(
            "stop",
            "ipopt",
            {
                "x": ca.vertcat(stop.unknowns, share),
                "g": stop.constraints,
                "f": cost - EAGER * share,
                "p": ca.vertcat(q, v),
            },
            OPTIONS,
        )

    def find_both(self, back: Stop, on: Stop) -> tuple[tuple[SwingPhase, SwingPhase], float, str]:
        """Return backswing and follow-through, from the largest share of the velocity for both.

        The limit that leaves no more comes with them, in a line; it is empty where the share is 1.

        Raises:
            InvalidInput: the solver finds none.
        """
        solutions, share, limit = dict[int, StopSolution](), 1.0, ""
        for stop in (back, on, back):
            if stop.sign in solutions and solutions[stop.sign].share == share:
                break
            solutions[stop.sign] = solution = self.find(stop, share)
            if solution.share < share:
                share, (what, joint) = solution.share, solution.binding
                limit = (
                    f"{stop.name}: the {what} limit of {self._equations.chain.names[joint]} leaves "
                    f"{share:.4g} of the planned speed"
                )
        return (solutions[-1].phase, solutions[1].phase), share, limit

    def find(self, stop: Stop, most: float = 1.0) -> StopSolution:
        """Return a stop from the largest share, up to `most`, of the velocity.

        Torques are bounded at nodes and half-way; where they leave their limits between those, the
        stop is solved again with so much more slack.

        Raises:
            InvalidInput: the solver finds none.
        """
        slack = SLACK
        for _ in range(5):
            solved = self.solve(stop, slack, most)
            excess = solved.phase.torque_use - 1.0
            if excess <= 0.0:
                return solved
            slack += excess + SLACK / 2
        raise InvalidInput(
            f"no {stop.name} is found whose torques keep their limits between "
            f"{self._equations.nodes} intervals: take more nodes"
        )

    def solve(self, stop: Stop, slack: float = 0.0, most: float = 1.0) -> StopSolution:
        """Return the better of the stops that Ipopt finds from a short and from a long guess."""
        solutions, reason = list[StopSolution](), "no iterations left"
        for time in sorted({min(SHORT, stop.longest), stop.longest}):
            if self._left <= 0:
                break
            low, high = self._equations.bounds(stop.longest, stop.rest)
            lowest, highest = self._equations.constraint_bounds(slack)
            end = self._solver(
                x0=np.append(self._equations.guess(stop.q, stop.v, time), most),
                lbx=np.append(low, 0.0),
                ubx=np.append(high, most),
                lbg=lowest,
                ubg=highest,
                p=np.concatenate([stop.q, stop.v]),
            )
            state, x = self._solver.stats(), np.asarray(end["x"]).ravel()
            self._left -= int(state["iter_count"])
            reason = f"Ipopt ends with {state['return_status']}"
            if not state["success"]:
                continue
            share = most if x[-1] > most * (1 - 1e-6) else float(x[-1])
            phase = self._equations.phase(stop.sign, stop.q, share * stop.v, x)
            multipliers = (np.asarray(end[name]).ravel() for name in ("lam_x", "lam_g"))
            solutions.append(StopSolution(phase, share, self._binding(*multipliers)))
            if share == most:
                break
        if not solutions:
            raise InvalidInput(f"no {stop.name} is found: {reason}")
        return max(solutions, key=lambda solution: solution.share)

    def _binding(self, of_unknowns: Array, of_constraints: Array) -> tuple[str, int]:
        """Return the limit and joint whose widening would gain most, by multipliers of bounds."""
        chain, count = self._equations.chain, self._equations.nodes + 1
        n, gains = len(chain.names), dict[tuple[str, int], float]()
        bounds = np.abs(of_unknowns[: 2 * count * n]).reshape(2, count, n)
        for joint, width in enumerate(chain.upper - chain.lower):
            gains["range", joint] = float(bounds[0, 1:, joint].sum() * width)
            gains["speed", joint] = float(bounds[1, :-1, joint].sum())
        sizes = np.abs(of_constraints).tolist()
        for label, size in zip(self._equations.labels, sizes, strict=True):
            if label[0]:
                gains[label] = gains.get(label, 0.0) + size
        return max(gains, key=lambda label: gains[label])


def torque_function(model: Any) -> Any:
    r"""Return the CasADi function of q, v and a: :math:`M a + c(q, v) + g(q)` [N m].

    Newton-Euler as Featherstone, Rigid Body Dynamics Algorithms, Table 5.1; armature is included.
    The wheel of Pinocchio has no `pinocchio.casadi`. `adam-robotics` reads files only, not a
    Pinocchio model with locked or turned joints and armature, and takes twice the operations.

    Args:
        model: `pin.Model` of joints of one degree of freedom, one after the other.
    """
    q, v, a = (ca.SX.sym(name, model.nv) for name in "qva")
    axes = [_axis(model, joint) for joint in range(1, model.njoints)]
    turning, turned, lifted = ca.SX(3, 1), ca.SX(3, 1), ca.SX(ca.DM(-model.gravity.linear))
    steps, forces = [], []
    for i, (linear, turn) in enumerate(axes):
        rotation, origin = _step(model.jointPlacements[i + 1], linear, turn, q[i])
        moved = lifted + ca.cross(turned, origin) + ca.cross(turning, ca.cross(turning, origin))
        back, slide, spin = rotation.T, ca.DM(linear), ca.DM(turn)
        turning, before = back @ turning + spin * v[i], back @ turning
        turned = back @ turned + spin * a[i] + ca.cross(before, spin) * v[i]
        lifted = back @ moved + slide * a[i] + 2 * ca.cross(before, slide) * v[i]
        body = model.inertias[i + 1]
        centre, inertia = ca.DM(body.lever), ca.DM(body.inertia)
        force = body.mass * (
            lifted + ca.cross(turned, centre) + ca.cross(turning, ca.cross(turning, centre))
        )
        moment = inertia @ turned + ca.cross(turning, inertia @ turning)
        steps.append((rotation, origin))
        forces.append((force, moment + ca.cross(centre, force)))
    torques, force, moment = [], ca.SX(3, 1), ca.SX(3, 1)
    for i in reversed(range(len(axes))):
        linear, turn = axes[i]
        force, moment = force + forces[i][0], moment + forces[i][1]
        rotor = model.armature[i] * a[i]
        torques.append(ca.dot(ca.DM(linear), force) + ca.dot(ca.DM(turn), moment) + rotor)
        rotation, origin = steps[i]
        force = rotation @ force
        moment = rotation @ moment + ca.cross(origin, force)
    return ca.Function("torque", [q, v, a], [ca.vertcat(*reversed(torques))])


def point_function(model: Any) -> Any:
    """Return the CasADi function of q and a point in the last joint's axes: it in the world frame.

    Args:
        model: as of `torque_function`.
    """
    q, local = ca.SX.sym("q", model.nv), ca.SX.sym("point", 3)
    point = local
    for joint in range(model.nv, 0, -1):
        axis = _axis(model, joint)
        rotation, origin = _step(model.jointPlacements[joint], *axis, q[joint - 1])
        point = rotation @ point + origin
    return ca.Function("point", [q, local], [point])


def _step(fixed: Any, linear: Array, turn: Array, angle: Any) -> tuple[Any, Any]:
    """Return rotation and origin of a joint's frame in its parent's."""
    rotation = ca.DM(fixed.rotation)
    if not turn.any():
        return rotation, ca.DM(fixed.translation) + rotation @ (ca.DM(linear) * angle)
    skew = ca.DM(pin.skew(turn))
    about = ca.DM.eye(3) + ca.sin(angle) * skew + (1 - ca.cos(angle)) * (skew @ skew)
    return rotation @ about, ca.DM(fixed.translation)


def _axis(model: Any, joint: int) -> tuple[Array, Array]:
    """Return the linear and the angular part of a joint's axis, in its own frame."""
    data = model.joints[joint].createData()
    model.joints[joint].calc(data, np.zeros(model.nq), np.ones(model.nv))
    axis = np.asarray(data.S).ravel()
    return axis[:3], axis[3:]
