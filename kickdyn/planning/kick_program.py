r"""The nonlinear program for the posture and the joint velocity of a kick.

Its unknowns are :math:`q` and :math:`v` of the joints that move the foot, and the share
:math:`s \le 1` of the foot velocity that is reached:

.. math::
    \min_{q, v, s} f(q, v) \quad\text{subject to}\quad
    J(q)\,v = s\,u(q), \quad x(q) + r n = x_{ball}, \quad
    |\tau_i(q, v)| \le \tau_{max,i}, \quad |v_i| \le v_{max,i}, \quad q_{min} \le q \le q_{max}.

:math:`u(q)` is the foot velocity of the impact target, :math:`x` the contact point, :math:`n` its
normal and :math:`\tau` the torque that keeps the joint velocity. SLSQP of scipy solves it from
several postures, drawn with a fixed seed.
"""

import ctypes
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache, cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.linalg import _fblas
from scipy.optimize import minimize

from kickdyn.air import Air
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, NoImpact
from kickdyn.impact.leg_derivatives import leg_derivatives
from kickdyn.impact.leg_response import joint_impulses
from kickdyn.impact.strike import strike
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.launch import Launch
from kickdyn.planning.scatter import checked_spread, landing_covariances, landing_slopes
from kickdyn.planning.stance import Condition, Stance
from kickdyn.robot.kicking_chain import kicking_chain, rest_configuration
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.surgery import turn_body

FEASIBLE = 1e-4
"""Largest violation of a constraint, over its own scale. Velocities are then made exact, and limits
are kept by this margin."""

STEP = 1e-7
"""Step of the differences that stand for the derivatives of a cost."""

UNLIMITED = 100.0
"""Scale of the speed of a joint without a limit [rad/s]."""


RANGE_LEFT = 0.02
"""Share of the range of each joint that remains at either end at the impact, where there must be a
backswing: a joint that is at an end and moves away from it came from beyond."""


class KickObjective(StrEnum):
    r"""What a kick makes least, or most where the name says so.

    With speed limits :math:`v_{max}`, inertia matrix :math:`M`, foot Jacobian :math:`J` and the
    linear impulses :math:`p_i` that the joints transmit:
    """

    JOINT_SPEED = "joint-speed"
    r""":math:`\frac1n \sum_i (v_i / v_{max,i})^2`."""
    JOINT_IMPULSE = "joint-impulse"
    r""":math:`\max_i |p_i|` [N s]."""
    KINETIC_ENERGY = "kinetic-energy"
    r""":math:`\frac12 v^T M v` [J], which the swing must build up."""
    FOOT_SPEED = "foot-speed"
    r""":math:`|J v|` [m/s]: the posture that makes the most impulse of it."""
    MOST_JOINT_IMPULSE = "most-joint-impulse"
    SCATTER = "scatter"
    """Root mean square error of the landing [m], for errors of a given `uncertainty`."""

    @property
    def unit(self) -> str:
        """Unit of the value; `joint-speed` has none."""
        return {
            "joint-impulse": "N s",
            "most-joint-impulse": "N s",
            "kinetic-energy": "J",
            "foot-speed": "m/s",
            "scatter": "m",
        }.get(self.value, "")


Cost = Callable[[Posture, Array], float]
"""A function of posture and joint velocity, to be least."""


def scatter_cost(
    target: ImpactTarget, launch: Launch, air: Air | None, uncertainty: Mapping[str, float]
) -> Cost:
    """Return the root mean square error of the landing [m], for standard deviations by source."""
    sizes = checked_spread(uncertainty)
    _, slopes = landing_slopes(launch.state, target.ball, air)  # the launch stays
    contact = target.contact
    plain = Contact(contact.normal, contact.restitution, contact.friction)

    def radius(posture: Posture, v: Array) -> float:
        """Return the scatter's radius of a kick [m]."""
        try:
            impact = strike(posture, v, target.ball, plain)
        except NoImpact:  # far from feasible
            return 1e6
        covariances = landing_covariances(impact, slopes, sizes)
        return math.sqrt(sum(float(np.trace(part)) for part in covariances.values()))

    return radius


def _largest_impulse(impulse: Array, posture: Posture) -> float:
    """Return the largest linear impulse in a joint [N s], smoothed, for one on the ball."""
    jump, of_constraints = posture.respond(-impulse @ posture.jacobian)
    transmitted, _ = joint_impulses(posture, jump, -impulse, of_constraints)
    sizes = np.linalg.norm(transmitted[:, :3], axis=1)
    top = float(sizes.max())
    # the norm of power 12 is the largest within 10 % for six joints
    return top * math.pow(float(np.sum((sizes / top) ** 12)), 1 / 12)


@dataclass(frozen=True, eq=False)
class KickSolution:
    """A feasible point of the program, its cost, and the share of the foot velocity it reaches."""

    posture: Posture
    v: Array
    share: float
    value: float


class KickProgram:
    """The nonlinear program for a leg on a fixed base and an impact target.

    The ball has a height of its centre, or a position, shape `(3,)` [m, world frame], or is free.
    A leg whose foot moves in a plane may `turn` towards the launch; one with a `stance`, on the
    supporting foot, does not, and keeps its margins.

    Attributes:
        leg: turned by `heading` [rad] to the left about the vertical.
        directions: in which its foot can move at all, orthonormal rows.
        position_rows: directions in which the ball's position is given, as rows.
        contact_normal_cone: of the leg; no rows where that is unknown or the contact is elsewhere
            on the foot, any side of which may then turn to the ball.
        velocity_scale: speed limits, or `UNLIMITED`, shape `(n,)` [rad/s].
    """

    def __init__(
        self,
        leg: Leg,
        target: ImpactTarget,
        ball_position: float | Array | None = None,
        *,
        limits: bool = True,
        turn: bool = True,
        stance: Stance | None = None,
    ) -> None:
        chain = kicking_chain(leg)
        self.target, self.ball_position, self.limits = target, ball_position, limits
        self.stance = stance
        self.names, self.qs, self.vs = chain.names, chain.qs, chain.vs
        self.n = len(self.names)
        self.lower, self.upper = chain.lower, chain.upper
        self.velocity_limit = self._checked_limit("speed", leg.velocity_limit[self.vs])
        self.torque_limit = self._checked_limit("torque", leg.effort_limit[self.vs])
        finite = np.isfinite(self.velocity_limit)
        self.velocity_scale = np.where(finite, self.velocity_limit, UNLIMITED)
        cone = leg.contact_normal_cone if target.contact.offset is None else None
        self.contact_normal_cone = np.zeros((0, 3)) if cone is None else cone
        self._draw = np.random.default_rng(0)
        self._set_leg(leg)
        self.heading = 0.0
        if turn and stance is None and self._leaves_directions(target.impulse):
            self.heading = _heading_towards(self.directions, target.impulse)
            if self.heading:
                self._set_leg(turn_leg(leg, self.heading))
        self._check_directions()
        self.ball_centre, self.position_rows = self._position_constraint()

    def posture(self, q: Array) -> Posture:
        """Return the posture for the coordinates of the joints that move the foot."""
        whole = self._rest.copy()
        whole[self.qs] = q
        return self.leg.posture(whole).with_contact_offset(self.target.contact.offset)

    def whole_velocity(self, v: Array) -> Array:
        """Return the joint velocity of the whole leg, shape `(nv,)`."""
        whole = np.zeros(self.leg.nv)
        whole[self.vs] = v
        return whole

    def cost(self, objective: KickObjective) -> Cost:
        """Return the cost of an objective other than `scatter`; what shall be most is below 0."""
        scale, impulse = self.velocity_scale, self.target.impulse
        return {
            KickObjective.JOINT_SPEED: lambda _, v: float(np.mean((v[self.vs] / scale) ** 2)),
            KickObjective.KINETIC_ENERGY: lambda posture, v: 0.5 * float(v @ posture.inertia @ v),
            KickObjective.FOOT_SPEED: lambda posture, v: math.hypot(*(posture.jacobian @ v)),
            KickObjective.JOINT_IMPULSE: lambda posture, _: _largest_impulse(impulse, posture),
            KickObjective.MOST_JOINT_IMPULSE: lambda posture, _: (
                -_largest_impulse(impulse, posture)
            ),
        }[objective]

    def torque(self, q: Array, v: Array) -> Array:
        """Return the torque that keeps the joint velocity, gravity included, shape `(n,)` [N m]."""
        zero = np.zeros(self.leg.nv)
        return np.asarray(pin.rnea(self._model, self._data, q, v, zero)[self.vs])

    def torque_slopes(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return derivatives of that torque by q and v, each of shape `(n, n)`."""
        zero, both = np.zeros(self.leg.nv), np.ix_(self.vs, self.vs)
        by_q, by_v, _ = pin.computeRNEADerivatives(self._model, self._data, q, v, zero)
        shape = (self.leg.nv, self.leg.nv)
        return np.reshape(by_q, shape)[both], np.reshape(by_v, shape)[both]

    def ball_centre_at(self, posture: Posture) -> Array:
        """Return the centre of a ball that the foot touches, shape `(3,)` [m, world frame]."""
        normal = self.target.contact.normal
        return np.asarray(posture.contact_point + self.target.ball.radius * normal)

    def solve(self, cost: Cost) -> KickSolution | None:
        """Return the best solution from several starts.

        Where none reaches the whole foot velocity, that of the largest share; None where no posture
        is feasible at all.
        """
        starts = self._starts()
        found = self.solve_whole(cost, starts)
        if found is not None:
            return found
        weaker = [one for x in starts if (one := self._solve_from(x, None)) is not None]
        if not weaker:
            return None
        best = max(weaker, key=lambda one: one.share)
        if best.share < 1.0 - 1e-6:
            return best
        return self._solve_from(self.unknowns(best), cost) or replace(best, share=1.0)

    def solve_whole(self, cost: Cost, starts: list[Array] | None = None) -> KickSolution | None:
        """Return the best solution that reaches the whole foot velocity; None without any."""
        found = self.solve_all(cost, starts)
        return min(found, key=lambda one: one.value) if found else None

    def solve_all(self, cost: Cost, starts: list[Array] | None = None) -> list[KickSolution]:
        """Return the solutions from each start that reach the whole foot velocity."""
        starts = self._starts() if starts is None else starts
        return [one for x in starts if (one := self._solve_from(x, cost)) is not None]

    def improve(self, found: KickSolution, cost: Cost) -> KickSolution:
        """Return the best solution near one, or that one with its value of the cost."""
        value = cost(found.posture, found.v)
        better = self._solve_from(self.unknowns(found), cost if found.share == 1.0 else None)
        if better is None or not better.value < value:
            return replace(found, value=value)
        return better

    def with_exact_velocity(self, posture: Posture, v: Array, share: float) -> Array:
        """Return v with the last digits of the foot's velocity put right."""
        scale = self.velocity_scale
        missed = self.target.foot_velocity(posture, share) - posture.jacobian @ v
        rows = self.velocity_rows @ posture.jacobian[:, self.vs] * scale
        change = np.linalg.pinv(rows, rcond=1e-9) @ self.velocity_rows @ missed
        return v + self.whole_velocity(change * scale)

    @property
    def velocity_rows(self) -> Array:
        """Directions in which the foot's velocity is given, as rows."""
        contact = self.target.contact
        return self.directions if contact.friction > 0.0 else contact.normal[None]

    def facing(self, posture: Posture) -> Array:
        """Return the components of the contact normal along the cone: 0 or more inside it."""
        axes = [
            posture.with_contact_offset(row).contact_point - posture.contact_point
            for row in self.contact_normal_cone
        ]
        return np.reshape(axes, (-1, 3)) @ self.target.contact.normal

    def position_error(self, posture: Posture) -> Array:
        """Return the distance of the ball from its position, in its radii, shape `(k,)`."""
        off = self.ball_centre_at(posture) - self.ball_centre
        return np.asarray(self.position_rows @ off / self.target.ball.radius)

    def _set_leg(self, leg: Leg) -> None:
        """Take a leg, and find the directions in which its foot can move, by drawn postures."""
        self.leg, self._model, self._data = leg, leg.model, leg.model.createData()
        self._rest = rest_configuration(leg)
        drawn = (self._draw.uniform(self.lower, self.upper) for _ in range(8))
        stacked = np.hstack([self.posture(q).jacobian for q in drawn])
        left, gains, _ = np.linalg.svd(stacked)
        self.directions = np.asarray(left[:, gains > 1e-9 * gains[0]].T)

    def _checked_limit(self, what: str, limit: Array) -> Array:
        """Return limits of speed or torque; where limits are lifted, one of 0 is infinite."""
        if self.limits and not (limit > 0.0).all():
            name = self.names[int(np.argmin(limit > 0.0))]
            raise InvalidInput(
                f"{what} limit of {name} is {limit.min():g}: it must be above 0, or all limits "
                "lifted (limits=False, --no-limits)"
            )
        return np.where(limit > 0.0, limit, np.inf)

    def _leaves_directions(self, vector: Array) -> bool:
        """Return whether a vector leaves the directions in which the foot can move."""
        outside = vector - self.directions.T @ (self.directions @ vector)
        return bool(np.linalg.norm(outside) > 1e-6 * np.linalg.norm(vector))

    def _check_directions(self) -> None:
        """Refuse a launch or a spin that takes the foot out of its plane."""
        if self._leaves_directions(self.target.impulse):
            launch = (self.target.impulse / self.target.ball.mass).round(4).tolist()
            raise InvalidInput(
                f"{self.leg.name} cannot kick so: its foot moves in a plane only, and the launch "
                f"{launch} m/s leaves that"
            )
        if self._leaves_directions(self.target.contact.normal):
            raise InvalidInput(
                f"{self.leg.name} cannot give this spin: its foot moves in a plane only, and side "
                "spin takes a foot that moves aside (a robot's leg, such as g1, does)"
            )

    def _position_constraint(self) -> tuple[Array, Array]:
        """Return the ball's position and the directions in which it is given, as rows."""
        ball_position = self.ball_position
        if ball_position is None:
            return np.zeros(3), np.zeros((0, 3))
        if isinstance(ball_position, float | int):
            return np.array([0.0, 0.0, ball_position]), np.array([[0.0, 0.0, 1.0]])
        q = self._draw.uniform(self.lower, self.upper)
        off = self.ball_centre_at(self.posture(q)) - ball_position
        beside = float(np.linalg.norm(off - self.directions.T @ (self.directions @ off)))
        if beside > FEASIBLE * self.target.ball.radius:
            raise InvalidInput(
                f"the ball at {ball_position.tolist()} m is {beside:.4g} m beside the plane that "
                f"the foot of {self.leg.name} moves in"
            )
        return ball_position, self.directions

    def _starts(self) -> list[Array]:
        """Return the unknowns of the 4 postures, of 80 drawn, that need the least joint speed."""
        rated = []
        far = 1.0 if self.stance is None else 0.5  # farther: tangled; standing, a trunk lies down
        low, high = np.maximum(self.lower, -far), np.minimum(self.upper, far)
        for number in range(80):
            q = self._draw.uniform(np.minimum(low, self.upper), np.maximum(high, self.lower))
            posture = self.posture(q)
            rows = posture.jacobian[:, self.vs] * self.velocity_scale
            v = np.linalg.pinv(rows, rcond=1e-2) @ self.target.foot_velocity(posture)
            off = float(np.linalg.norm(self.position_error(posture)))
            off -= float(self.facing(posture).clip(max=0.0).sum())
            if self.stance is not None:
                moving = self.whole_velocity(v * self.velocity_scale)
                off -= float(self.stance.margins(posture, moving).clip(max=0.0).sum())
            rated.append((float(np.abs(v).max()) + off, number, np.array([*q, *v, 1.0])))
        return [start for _, _, start in sorted(rated)[:4]]

    def unknowns(self, found: KickSolution) -> Array:
        """Return a solution as the unknowns of the program."""
        v = found.v[self.vs] / self.velocity_scale
        return np.array([*found.posture.q[self.qs], *v, found.share])

    def _solve_from(self, start: Array, cost: Cost | None) -> KickSolution | None:
        """Return the solution that SLSQP finds, if any; without a cost, of the largest share."""
        scale = 1.0
        if cost is not None:  # of the order of 1
            first = ProgramPoint(self, start, None, 1.0)
            scale = abs(cost(first.posture, first.v)) or 1.0
        most = np.where(np.isfinite(self.velocity_limit) & self.limits, 1.0 - FEASIBLE, math.inf)
        has_backswing = self.stance is not None and self.stance.lift is not None
        gap = (RANGE_LEFT if has_backswing else 0.0) * (self.upper - self.lower)
        low = np.array([*(self.lower + gap), *-most, 0.0 if cost is None else 1.0])
        high = np.array([*(self.upper - gap), *most, 1.0])
        latest = ProgramPoint(self, np.clip(start, low, high), cost, scale)

        def at(x: Array) -> ProgramPoint:
            """Return the point of the program at the unknowns, computed once."""
            nonlocal latest
            if not np.array_equal(latest.x, x):
                latest = ProgramPoint(self, x, cost, scale)
            return latest

        equal = slice(1, 1 + len(self.velocity_rows) + len(self.position_rows))
        above = slice(equal.stop, None)
        constraints = [
            {
                "type": kind,
                "fun": lambda x, rows=rows: at(x).values[rows],
                "jac": lambda x, rows=rows: at(x).slopes[rows],
            }
            for kind, rows in (("eq", equal), ("ineq", above))
            if kind == "eq" or self.limits or self.stance or len(self.contact_normal_cone)
        ]
        with one_blas_thread():
            found = minimize(
                lambda x: at(x).values[0],
                latest.x,
                jac=lambda x: at(x).slopes[0],
                method="SLSQP",
                bounds=list(zip(low, high, strict=True)),
                constraints=constraints,
                options={"maxiter": 80, "ftol": 1e-7},
            )
        x = np.clip(found.x, low, high)
        if not np.isfinite(x).all():
            return None
        end = at(x)
        if np.abs(end.values[equal]).max() > FEASIBLE or (end.values[above] < -FEASIBLE).any():
            return None
        v = self.with_exact_velocity(end.posture, end.v, end.share)
        return KickSolution(end.posture, v, end.share, scale * float(end.values[0]))


class ProgramPoint:
    """The program's functions at one value of its unknowns, computed when they are needed.

    The unknowns are q, v over its scale, and the share: shape `(2n + 1,)`. Without a cost, the
    share is made largest.
    """

    def __init__(self, program: KickProgram, x: Array, cost: Cost | None, scale: float) -> None:
        n = program.n
        self.program, self.x, self.cost, self.scale = program, x.copy(), cost, scale
        self.posture = program.posture(x[:n])
        self.v = program.whole_velocity(x[n : 2 * n] * program.velocity_scale)
        self.share = float(x[-1])
        self.change = program.target.velocity_change(self.posture)
        self.wanted = program.target.foot_velocity_for(self.change)
        self.reached = program.target.foot_velocity_for(self.change, self.share)

    @cached_property
    def values(self) -> Array:
        """Cost, equalities (foot velocity, ball position) and inequalities (torque, facing)."""
        program, wanted = self.program, self.wanted
        missed = self.posture.jacobian @ self.v - self.reached
        parts: list[ArrayLike] = [
            [self._scaled_cost(self.posture, self.v)],
            program.velocity_rows @ missed / math.sqrt(wanted @ wanted),
            program.position_error(self.posture),
        ]
        if program.limits:
            use = program.torque(self.posture.q, self.v) / program.torque_limit
            parts.append(1.0 - 2 * FEASIBLE - use * use)
        parts.append(program.facing(self.posture))
        if program.stance is not None:
            parts.append(program.stance.margins(self.posture, self.v) - 2 * FEASIBLE)
        return np.concatenate(parts)

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of `values` by the unknowns, one row each."""
        program, posture, v, wanted = self.program, self.posture, self.v, self.wanted
        n, scale, jacobian = program.n, program.velocity_scale, posture.jacobian
        target, at_v = program.target, slice(n, 2 * n)
        v_after = v + posture.solve(-target.impulse @ jacobian)
        leg = leg_derivatives(posture, v, v_after, target.impulse, np.zeros(0))
        # of J M^-1 J^T p by q
        change = leg.foot_q - leg.foot_q_after - jacobian @ leg.v_after_q
        wanted_q = target.foot_gain(self.change) @ change
        gain = target.foot_gain(self.share * self.change)
        fast = math.sqrt(wanted @ wanted)
        off = np.outer(jacobian @ v - self.reached, wanted @ wanted_q) / fast**2
        missed = np.zeros((3, len(self.x)))
        missed[:, :n] = ((leg.foot_q - self.share * (gain @ change) - off) / fast)[:, program.vs]
        missed[:, at_v] = jacobian[:, program.vs] * (scale / fast)
        missed[:, -1] = -(gain @ self.change) / fast
        rows = [self._cost_slope(), *program.velocity_rows @ missed]
        for row in program.position_rows @ jacobian[:, program.vs] / target.ball.radius:
            rows.append(np.append(row, np.zeros(n + 1)))
        if program.limits:
            by_q, by_v = program.torque_slopes(posture.q, v)
            use = (program.torque(posture.q, v) / program.torque_limit**2)[:, None]
            rows += list(np.hstack([-2 * use * by_q, -2 * use * by_v * scale, np.zeros((n, 1))]))
        for row in program.contact_normal_cone:
            turning = target.contact.normal @ (posture.with_contact_offset(row).jacobian - jacobian)
            rows.append(np.append(turning[program.vs], np.zeros(n + 1)))
        if program.stance is not None:
            by_q, by_v = program.stance.slopes(posture, v, program.vs)
            rows += list(np.hstack([by_q, by_v * scale, np.zeros((len(by_q), 1))]))
        return np.array(rows)

    def _scaled_cost(self, posture: Posture, v: Array) -> float:
        """Return the cost in its scale, to be least."""
        if self.cost is None:
            return -self.share
        return self.cost(posture, v) / self.scale

    def _cost_slope(self) -> Array:
        """Return the derivatives of the cost by the unknowns, by differences."""
        program, n, slope = self.program, self.program.n, np.zeros(len(self.x))
        if self.cost is None:
            slope[-1] = -1.0
        else:
            for i in range(2 * n):
                there = self.x.copy()
                there[i] += STEP
                posture = program.posture(there[:n]) if i < n else self.posture
                v = program.whole_velocity(there[n : 2 * n] * program.velocity_scale)
                slope[i] = (self._scaled_cost(posture, v) - float(self.values[0])) / STEP
        return slope


@cache
def _blas_threads() -> tuple[Any, int] | None:
    """Return how to set the threads of SciPy's OpenBLAS, and their number; None where unknown."""
    library = ctypes.CDLL(_fblas.__file__)
    try:
        return library.scipy_openblas_set_num_threads, library.scipy_openblas_get_num_threads()
    except AttributeError:  # another BLAS, or one that is linked in another way
        return None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep OpenBLAS from using threads for matrices of 100 rows, where they take 5 times as long.

    That is on a free machine; on a busy one they wait for each other.
    """
    found = _blas_threads()
    if found is None:
        yield
        return
    set_threads, threads = found
    set_threads(1)
    try:
        yield
    finally:
        set_threads(threads)


def explain_infeasible(program: KickProgram) -> str:
    """Return why a program has no feasible point.

    It is a condition of its stance, its limits, the ball, or the joints' ranges.
    """
    leg, target, wanted = program.leg, program.target, program.ball_position
    stance, limits = program.stance, program.limits

    def is_feasible(stance: Stance | None, limits: bool) -> bool:
        """Return whether the program has a point with another stance or without limits."""
        other = KickProgram(leg, target, wanted, limits=limits, stance=stance)
        return other.solve(lambda _, v: float(v @ v)) is not None

    if stance is not None:
        for condition in Condition:
            if is_feasible(Stance(stance.standing, stance.impulse, condition), limits):
                return f"it has one if this may be violated: {condition}"
    if limits and is_feasible(stance, False):
        return "it has one without its speed and torque limits"
    if wanted is not None:
        anywhere = KickProgram(leg, target, limits=limits, stance=stance)

        def distance(posture: Posture, v: Array) -> float:
            """Return how far the ball is from its place, squared [m2]."""
            off = program.position_rows @ (anywhere.ball_centre_at(posture) - program.ball_centre)
            return float(off @ off)

        found = anywhere.solve(distance)
        if found is not None:
            centre = np.round(anywhere.ball_centre_at(found.posture), 6) + 0.0
            near = ", ".join(f"{part:.4g}" for part in centre)
            return f"the nearest position of the ball for which it has one is ({near}) m"
    return "the ranges of its joints allow none"


def turn_leg(leg: Leg, heading: float) -> Leg:
    """Return a leg on a fixed base, turned to the left about the world's vertical [rad]."""
    return leg.with_model(turn_body(leg.model, 0, pin.rpy.rpyToMatrix(0.0, 0.0, heading)))


def _heading_towards(directions: Array, vector: Array) -> float:
    """Return the turn that brings a vector into the vertical plane that the foot moves in [rad]."""
    across = np.cross(*directions) if len(directions) == 2 else np.array([0.0, 0.0, 1.0])
    if abs(across[2]) > 1e-9 or not math.hypot(vector[0], vector[1]) > 0.0:
        return 0.0  # no such plane, or no horizontal part to turn to
    ahead = np.array([across[1], -across[0]])
    if ahead[0] < 0.0:  # legs face x
        ahead = -ahead
    turn = math.atan2(vector[1], vector[0]) - math.atan2(ahead[1], ahead[0])
    return math.remainder(turn, 2 * math.pi)
