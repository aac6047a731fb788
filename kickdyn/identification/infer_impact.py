r"""`infer_impact`: the impulse of a kick from how the ball moved before and after it.

The ball alone gives the impulse p and its moment L about the centre, without a coefficient of
restitution or friction. If p acted at one point of the ball's surface, with the normal n from that
point to the centre, then :math:`L = -r\, n \times p`. The foot can only push,
:math:`n \cdot p > 0`, so that

.. math::

    n = \sqrt{1 - |a|^2}\, \hat p + \hat p \times a,
    \qquad a = -\frac{L - (L \cdot \hat p)\, \hat p}{r |p|}, \qquad \hat p = \frac{p}{|p|} .

The part of L along p cannot come from one point: it is the residual.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.linalg import block_diag

from kickdyn.ball import Ball, BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput, NoImpact
from kickdyn.identification.leg_motion import (
    BALL_WINDOW,
    FLIES_AFTER,
    ContactMotion,
    LegMotion,
    ball_side,
)
from kickdyn.identification.track import Track
from kickdyn.impact.leg_response import LegResponse, leg_response
from kickdyn.robot.leg import Posture

LARGEST_IMPULSE_RESIDUAL = 0.05
"""Residual, relative to radius times impulse, up to which a point contact explains an impact whose
velocities have no deviations; above it a result has a warning."""

LARGEST_FRICTION = 0.63
"""Friction of a ball on leather that is taken to be the largest: nine balls had 0.37 to 0.63 (Fuss
et al. 2020, Proceedings 49:92)."""

COVERED = 1.96
"""Standard deviations to each side of a mean that an interval of 95 % has."""


@dataclass(frozen=True, eq=False, repr=False)
class InferredImpact(ReprMixin):
    """An impact that is inferred from the measured motion of the ball before and after it.

    Attributes:
        posture: posture of the leg, which takes the impulse at its contact point.
        v_before: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: the ball.
        ball_before, ball_after: states of the ball just before and just after.
        impulse: impulse on the ball, shape `(3,)` [N s, world frame].
        normal: unit vector from the contact point to the centre of the ball, shape `(3,)` [world
            frame].
        residual: the part of the ball's change of angular momentum along the impulse, which no
            impulse at one point explains, relative to radius times impulse; 0 or more.
        deviations: standard deviations of `restitution`, `friction`, `normal` (an angle [rad]),
            `residual`, `effective_mass` [kg], and of the sizes `impulse` [N s], `foot_speed` and
            `ball_speed` (after the impact) [m/s]; empty if the velocities have none.
        joint_deviations: likewise of the linear impulse in each joint, by name [N s].
        notes: quantities that the measurement does not determine.
    """

    posture: Posture
    v_before: Array
    ball: Ball
    ball_before: BallState
    ball_after: BallState
    impulse: Array
    normal: Array
    residual: float
    deviations: dict[str, float]
    joint_deviations: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def _leg_response(self) -> LegResponse:
        return leg_response(self.posture, self.v_before, self.impulse)

    @property
    def joint_impulses(self) -> Array:
        """Impulses in the joints, shape `(njoints, 6)` [N s, N m s], as `Impact.joint_impulses`."""
        return self._leg_response.joint_impulses

    @property
    def joint_sizes(self) -> dict[str, float]:
        """Sizes of the linear impulses in the joints, without a floating base, by name [N s]."""
        model = self.posture.leg.workspace.model
        sizes = np.linalg.norm(self.joint_impulses[:, :3], axis=1).tolist()
        names = zip(self.posture.leg.joint_names, sizes, list(model.nvs)[1:], strict=True)
        return {name: size for name, size, nv in names if nv < 6}

    @property
    def v_after(self) -> Array:
        """Joint velocity just after, shape `(nv,)` [rad/s; m/s for prismatic joints]."""
        return self._leg_response.v_after

    @property
    def foot_velocity(self) -> Array:
        """Velocity of the foot's contact point just before, shape `(3,)` [m/s, world frame]."""
        return self.posture.point_velocity(self.v_before)

    @property
    def effective_mass(self) -> float:
        """Effective mass of the leg along the normal [kg]."""
        return self.posture.effective_mass(self.normal)

    @property
    def contact_point(self) -> Array:
        """Point :math:`c - r n` of the ball on which the impulse acted, shape `(3,)` [m, world]."""
        return np.asarray(self.ball_before.position - self.ball.radius * self.normal)

    @property
    def approach_speed(self) -> float:
        """Speed of the foot towards the ball along the normal [m/s], as `Impact.approach_speed`."""
        return -float(self.normal @ self._sliding(self.v_before, self.ball_before))

    @property
    def restitution(self) -> float:
        r"""Ratio :math:`-u_n^+ / u_n^-` of the contact points' relative velocities along n."""
        after = float(self.normal @ self._sliding(self.v_after, self.ball_after))
        return after / self.approach_speed

    @property
    def friction(self) -> float:
        r"""Ratio :math:`|p - (n \cdot p)\, n| / (n \cdot p)` of the impulses across and along n.

        It is the least coefficient of friction that allows the impulse; if the contact points slid
        throughout, it is the coefficient.
        """
        along = float(self.normal @ self.impulse)
        return float(np.linalg.norm(self.impulse - along * self.normal)) / along

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines about what to know before using the numbers; empty if there is nothing."""
        deviation = self.deviations.get("residual", 0.0)
        spread = f" +- {100 * deviation:.2g}" if deviation else ""
        margin = 1e-9 + 3.0 * self.deviations.get("restitution", 0.0)
        distance = float(np.linalg.norm(self.contact_point - self.posture.contact_point))
        lines = {
            f"the residual is {100 * self.residual:.2g}{spread} % of radius times impulse: an "
            "impulse at one point does not explain the change of spin; check the spins":
                self.residual > (3.0 * deviation or LARGEST_IMPULSE_RESIDUAL),
            f"restitution is {self.restitution:.3g}, outside 0 to 1: posture, joint velocity "
            "and ball are inconsistent, or the sliding changed during the contact":
                not -margin <= self.restitution <= 1.0 + margin,
            f"the contact point on the ball is {distance:.2g} m from the contact point of the "
            "posture, where the leg takes the impulse":
                # distance between the contact points of ball and posture, in radii of the ball,
                # above which a result has a warning
                distance > 0.25 * self.ball.radius,
        }  # fmt: skip
        doubts = (line for line, holds in lines.items() if holds)
        return (*self.notes, *doubts, *self.posture.warnings, *self.ball.warnings)

    def plot(self) -> Any:
        """Return a matplotlib Figure of the joints' linear impulses, with standard deviations."""
        from kickdyn.core.plot_style import joint_figure

        return joint_figure(self.joint_sizes, self.joint_deviations)

    def _sliding(self, v: Array, state: BallState) -> Array:
        """Return the velocity of the ball's contact point relative to the foot's [m/s]."""
        surface = state.velocity - self.ball.radius * np.cross(state.spin, self.normal)
        return np.asarray(surface - self.posture.point_velocity(v))

    def _rows(self) -> Iterable[Row]:
        yield "impulse on the ball", self.impulse, "N s"
        yield "normal", self.normal, ""
        yield "contact point", self.contact_point, "m"
        yield "approach speed", self.approach_speed, "m/s"
        # a spin that is not known leaves the residual open
        for name in ("restitution", "friction", "residual")[: 2 if self.notes else 3]:
            spread = f" +- {self.deviations[name]:.2g}" if name in self.deviations else ""
            yield name, f"{getattr(self, name):.4g}{spread}", ""
        sizes = self.joint_sizes
        worst = max(sizes, key=sizes.__getitem__)
        yield f"worst joint, {worst}", sizes[worst], "N s"
        for name, deviation in self.joint_deviations.items():
            yield f"impulse in {name}", f"{sizes[name]:.4g} +- {deviation:.2g}", "N s"
        yield from warned(self.warnings)


@validation.check_arguments
def infer_impact(
    posture: Posture | LegMotion,
    v: ArrayLike | Track,
    ball: Ball | None = None,
    ball_before: BallState | None = None,
    ball_after: BallState | None = None,
    *,
    velocity_deviation: ArrayLike = 0.0,
    spin_deviation: ArrayLike = 0.0,
    joint_deviation: ArrayLike = 0.0,
    contact: float | Sequence[float] | None = None,
) -> InferredImpact:
    r"""Return the impulse of a kick, and the contact that explains it, from the ball's motion.

    The impulse is :math:`p = m (v_b^+ - v_b)`, and the normal the one for which p, at one point of
    the ball's surface, turns the ball as measured, :math:`I_b (\omega_b^+ - \omega_b) = -r\, n
    \times p`. Deviations are carried through by differences of one standard deviation, all
    components independent.

    `infer_impact(motion, track)` takes posture, joint velocity and their covariance from the motion
    of the leg just before the contact, and the ball's velocities from quadratics through its
    positions before and after. Positions do not show the spin, which is 0 before. The coefficient
    of friction is uniformly distributed from 0 to 0.63, and the points of contact stick if it
    suffices. What depends on it has the value for the mean of the friction that is used, with
    deviations so large that 95 % intervals include an impact without friction.

    Args:
        posture: posture of the leg in the impact, whose contact point touched the ball; or the
            motion of the leg, by `fit_motion`.
        v: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints]; with a
            motion, the `Track` of the ball, on the same clock and in the same frame.
        ball: the ball; its mass, radius and inertia count. With a motion, None is a ball of size 5.
        ball_before: measured state just before; its position is the ball's centre [m, world frame].
        ball_after: measured state just after.
        velocity_deviation: standard deviation of each component of the ball's velocity [m/s]: a
            number, or shape `(2,)`, before and after.
        spin_deviation: likewise of its spin [rad/s].
        joint_deviation: likewise of the joint velocity, a number or shape `(nv,)` [rad/s; m/s].
        contact: with a motion, the time of the contact [s], or time and standard deviation; None
            takes the motion's.

    Raises:
        NoImpact: the ball's velocity did not change, or foot and ball do not approach each other.
        InvalidInput: a change of spin that is too large for the impulse, or a wrong argument.
    """
    if isinstance(posture, LegMotion):
        return _infer_from_motion(posture, v, ball or Ball(), contact)
    if ball is None or ball_before is None or ball_after is None:
        raise InvalidInput("ball, ball_before and ball_after are needed with a posture")
    _check_ball(ball)
    for name, state in (("ball_before", ball_before), ("ball_after", ball_after)):
        if state.position.shape != (3,):
            shape = state.position.shape
            raise InvalidInput(f"position of {name} has shape {shape}: it must be one state, (3,)")
    count = posture.leg.nv
    speed = validation.vector("v", v, count, unit="rad/s or m/s")  # type: ignore[arg-type]
    posture.check_velocity(speed)
    of_velocity = np.repeat(_deviations("velocity deviation", velocity_deviation, 2), 3)
    of_spin = np.repeat(_deviations("spin deviation", spin_deviation, 2), 3)
    of_joints = _deviations("joint deviation", joint_deviation, count)
    noise = np.concatenate([of_velocity, of_spin, np.zeros(count), of_joints])
    steps = np.diag(noise)[noise > 0.0]
    return _with_deviations(posture, speed, ball, (ball_before, ball_after), steps)


def _infer_from_motion(
    motion: LegMotion, track: object, ball: Ball, contact: float | Sequence[float] | None
) -> InferredImpact:
    validation.check_type(Track, v=track)
    assert isinstance(track, Track)
    _check_ball(ball)
    leg = motion.at_contact(contact)
    moment = leg.moment.time
    begin = moment + FLIES_AFTER
    sides = (
        ball_side(track, "before", moment - BALL_WINDOW, moment, moment),
        ball_side(track, "after", begin, begin + BALL_WINDOW, moment),
    )
    before = BallState(sides[0].position, sides[0].velocity)
    spins, largest = _spins_by_friction(leg, ball, before.velocity, sides[1].velocity)
    after = BallState(sides[1].position, sides[1].velocity, spins[1])
    blocks = [side.velocity_deviation for side in sides]
    values, vectors = np.linalg.eigh(leg.covariance)
    of_leg = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    steps = block_diag(np.diag(np.concatenate(blocks)), np.zeros((0, 6)), of_leg)
    ends = np.zeros((2, steps.shape[1]))
    ends[:, 9:12] = spins[[0, 2]] - spins[1]
    impact = _with_deviations(leg.posture, leg.v, ball, (before, after), steps, ends)
    note = (
        "the track does not show the spin of the ball: normal, restitution, friction and effective "
        f"mass are those with a friction between 0 and {largest:.2g}, which their deviations "
        "include"
    )
    return replace(impact, notes=(note,))


def _spins_by_friction(
    leg: ContactMotion, ball: Ball, v_ball: Array, v_ball_after: Array
) -> tuple[Array, float]:
    r"""Return the least, mean and largest spin by an unknown friction, and the largest friction.

    With the ball's velocity u relative to the foot after the impact, that of its contact point is
    :math:`(u + r^2 p / I)_t`, the part across the normal n. Friction is opposite to it, or the
    points stick: n is in the plane of p and u, at an angle :math:`\theta` to p, from 0 without
    friction to the direction of :math:`u + r^2 p / I`. The spin is :math:`(r |p| / I) \sin\theta`,
    about the plane's normal.
    """
    impulse = ball.mass * (v_ball_after - v_ball)
    size = float(validation.length(impulse))
    if size == 0.0:
        return np.zeros((3, 3)), 0.0
    posture, along = leg.posture, impulse / size
    foot = posture.point_velocity(leg_response(posture, leg.v, impulse).v_after)
    separating = v_ball_after - foot + ball.radius**2 / ball.inertia * impulse
    turn = np.cross(along, separating)
    transverse, normal = float(validation.length(turn)), float(along @ separating)
    sticking = transverse / normal if normal > 0.0 else math.inf
    friction = min(sticking, LARGEST_FRICTION)
    used = np.array([0.0, friction - friction**2 / (2.0 * LARGEST_FRICTION), friction])
    sines = used / np.sqrt(1.0 + used**2)
    axis = turn / transverse if transverse else turn
    return np.outer(sines * ball.radius * size / ball.inertia, axis), friction


def _check_ball(ball: Ball) -> None:
    """Raise `InvalidInput` for a ball whose motion does not show the impulse."""
    ball.check_movable("an inferred impact")
    if not math.isfinite(ball.inertia):
        raise InvalidInput(
            "inertia factor is inf: the normal follows from how the ball turns, which needs a "
            "finite inertia"
        )


def _with_deviations(
    posture: Posture,
    v: Array,
    ball: Ball,
    states: tuple[BallState, BallState],
    steps: Array,
    ends: Iterable[Array] = (),
) -> InferredImpact:
    """Return the impact of measured velocities, with deviations.

    Each row of `steps` is an independent change of one standard deviation: of the velocities of the
    ball before and after, of its spins, of q in its tangent space, and of v. Intervals of 95 %
    include the changes `ends`.
    """
    leg, (ball_before, ball_after) = posture.leg, states
    velocities = [ball_before.velocity, ball_after.velocity, ball_before.spin, ball_after.spin]
    measured = np.concatenate([*velocities, np.zeros(leg.nv), v])

    def inferred_from(values: Array) -> tuple[InferredImpact, float]:
        before, after = (
            BallState(state.position, values[i : i + 3], values[i + 6 : i + 9])
            for i, state in ((0, ball_before), (3, ball_after))
        )
        turn, displaced = values[12 : 12 + leg.nv], posture
        if turn.any():
            q = pin.integrate(leg.workspace.model, posture.q, turn)
            displaced = leg.posture(q).with_contact_offset(posture.contact_offset)
        return _inferred(displaced, ball, before, after, values[12 + leg.nv :])

    inferred, _ = inferred_from(measured)
    if inferred.approach_speed <= 0.0:
        raise NoImpact(
            f"foot and ball separate at {-inferred.approach_speed:.3g} m/s along the normal "
            f"{inferred.normal.round(4).tolist()} of this impulse: they must approach each other"
        )
    if not len(steps):
        return inferred

    def values(change: Array) -> Array:
        impact, twist = inferred_from(measured + change)
        joints = impact.joint_sizes.values()
        foot, ball_speed = np.linalg.norm(impact.foot_velocity), impact.ball_after.speed
        numbers = [impact.restitution, impact.friction, twist, np.linalg.norm(impact.impulse)]
        numbers += [foot, ball_speed, impact.effective_mass]
        return np.array([*numbers, *impact.normal, *joints], dtype=float)

    changes = [0.5 * (values(step) - values(-step)) for step in steps]
    at_ends = [np.abs(values(end) - values(np.zeros(end.size))) / COVERED for end in ends]
    if at_ends:
        changes.append(np.max(at_ends, axis=0))
    sizes = np.linalg.norm(changes, axis=0).tolist()
    names = "restitution", "friction", "residual", "impulse", "foot_speed", "ball_speed"
    deviations = dict(zip((*names, "effective_mass"), sizes[:7], strict=True))
    deviations["normal"] = math.hypot(*sizes[7:10])
    joints = dict(zip(inferred.joint_sizes, sizes[10:], strict=True))
    return replace(inferred, deviations=deviations, joint_deviations=joints)


def _inferred(
    posture: Posture, ball: Ball, before: BallState, after: BallState, v: Array
) -> tuple[InferredImpact, float]:
    """Return the impact of measured velocities, and the residual with its sign."""
    impulse = ball.mass * (after.velocity - before.velocity)
    size = float(validation.length(impulse))
    if size == 0.0:
        raise NoImpact("the ball's velocity is the same before and after: there was no impulse")
    direction = impulse / size
    spin_change = after.spin - before.spin
    largest = ball.radius * size / ball.inertia  # change of spin of an impulse across the normal
    arm = -spin_change / largest
    twist = float(arm @ direction)
    arm = arm - twist * direction
    square = float(arm @ arm)
    if not square < 1.0:
        raise InvalidInput(
            f"the spin changes by {validation.length(spin_change):.4g} rad/s (with its deviation, "
            f"where one is given): an impulse of {size:.4g} N s at a point of the ball changes it "
            f"by less than {largest:.4g} rad/s"
        )
    normal = math.sqrt(1.0 - square) * direction + np.cross(direction, arm)
    v, impulse, normal = (validation.read_only(vector) for vector in (v, impulse, normal))
    impact = InferredImpact(posture, v, ball, before, after, impulse, normal, abs(twist), {})
    return impact, twist


def _deviations(name: str, value: ArrayLike, count: int) -> Array:
    """Return standard deviations of shape `(count,)`, of which a number makes all."""
    array = validation.floats(name, value)
    if array.shape not in ((), (count,)):
        raise InvalidInput(f"{name} has shape {array.shape}: it must be a number or ({count},)")
    if (array < 0.0).any():
        raise InvalidInput(f"{name} is {array.tolist()}: it must not be below 0")
    return np.array(np.broadcast_to(array, (count,)))


@dataclass(frozen=True, eq=False, repr=False)
class RestitutionFit(ReprMixin):
    """Restitution over approach speed, from several kicks.

    Attributes:
        table: rows (approach speed [m/s], restitution), speeds increasing, shape `(k, 2)`. Between
            its rows the restitution is linear, outside it is constant.
        deviations: standard deviation of each restitution of the table, shape `(k,)`.
        scatter: standard deviation of the restitution of a kick around the table.
    """

    table: Array
    deviations: Array
    scatter: float

    def _rows(self) -> Iterable[Row]:
        for (speed, e), deviation in zip(self.table.tolist(), self.deviations, strict=True):
            yield f"at {speed:.4g} m/s", f"{e:.4g} +- {deviation:.2g}", ""
        yield "scatter of a kick", self.scatter, ""


@validation.check_arguments
def fit_restitution(impacts: Sequence[InferredImpact], knots: int = 2) -> RestitutionFit:
    r"""Return restitution over approach speed as a table, fitted to several kicks.

    The table is the piecewise linear function of the approach speed that is nearest to the kicks'
    restitutions in the sense of least squares; its knots are at quantiles of their speeds, from the
    lowest to the highest. `Contact(restitution=fit.table)` takes it, unless one of its restitutions
    is outside 0 to 1. With n kicks, k knots and the residuals :math:`\rho`, the scatter is
    :math:`\sqrt{\sum \rho^2 / (n - k)}`.

    Args:
        impacts: several kicks, by `infer_impact`.
        knots: number of rows of the table: 1 gives a constant, 2 a straight line.

    Raises:
        InvalidInput: a wrong argument, fewer than `knots + 1` kicks, or speeds too much alike.
    """
    for i, impact in enumerate(impacts):
        validation.check_type(InferredImpact, **{f"impact {i}": impact})
    if type(knots) is not int or knots not in range(1, len(impacts)):
        raise InvalidInput(
            f"knots is {validation.brief(knots)} and there are {len(impacts)} kicks: a table needs "
            "one row or more, and more kicks than it has rows"
        )
    speeds = np.array([impact.approach_speed for impact in impacts])
    restitutions = np.array([impact.restitution for impact in impacts])
    rows = np.quantile(speeds, np.linspace(0.0, 1.0, knots)) if knots > 1 else [speeds.mean()]
    if knots > 1 and not (np.diff(rows) > 1e-6 * speeds.max()).all():
        raise InvalidInput(
            f"knots is {knots}, but many of the approach speeds from {speeds.min():.4g} to "
            f"{speeds.max():.4g} m/s are equal: take fewer knots"
        )
    weights = np.column_stack([np.interp(speeds, rows, unit) for unit in np.eye(knots)])
    inverse = np.linalg.pinv(weights)
    fitted = inverse @ restitutions
    residuals = weights @ fitted - restitutions
    scatter = math.sqrt(float(residuals @ residuals) / (len(impacts) - knots))
    table = validation.read_only(np.column_stack([rows, fitted]))
    deviations = validation.read_only(scatter * np.linalg.norm(inverse, axis=1))
    return RestitutionFit(table, deviations, scatter)


@validation.check_arguments
def kick_table(kicks: Mapping[str, InferredImpact]) -> Any:
    """Return measured kicks as a table, a pandas `DataFrame`, with their standard deviations.

    Each row is a quantity with its unit. Each kick has two columns: its name, and its name with
    `+-` for the standard deviations, NaN if unknown.

    Args:
        kicks: impacts of legs with joints of the same names, by name of the kick.

    Raises:
        InvalidInput: no kick, or legs with other joints.
    """
    from xarray import DataArray  # loaded when a table is asked for

    if not validation.mapping("kicks", kicks):
        raise InvalidInput("kicks is empty: it must have impacts by the name of the kick")
    for name, impact in kicks.items():
        validation.check_type(InferredImpact, **{f"kick {name}": impact})
    rows = dict[str, dict[str, tuple[float, float]]]()
    for name, impact in kicks.items():
        values = {
            "foot speed [m/s]": (math.hypot(*impact.foot_velocity), "foot_speed"),
            "ball speed [m/s]": (float(impact.ball_after.speed), "ball_speed"),
            "impulse on the ball [N s]": (math.hypot(*impact.impulse), "impulse"),
            "effective mass [kg]": (impact.effective_mass, "effective_mass"),
            "restitution": (impact.restitution, "restitution"),
        }
        spreads, of_joints = impact.deviations, impact.joint_deviations
        rows[name] = {title: (x, spreads.get(key, math.nan)) for title, (x, key) in values.items()}
        for joint, size in impact.joint_sizes.items():
            rows[name][f"impulse in {joint} [N s]"] = size, of_joints.get(joint, math.nan)
    titles = list(next(iter(rows.values())))
    for name, of_kick in rows.items():
        if list(of_kick) != titles:
            raise InvalidInput(f"kick {name!r} has other joints than {next(iter(kicks))!r}")
    numbers = np.hstack([list(of_kick.values()) for of_kick in rows.values()])
    columns = [title for name in kicks for title in (name, f"{name} +-")]
    table = DataArray(numbers, {"quantity": titles, "kick": columns}, ("quantity", "kick"))
    return table.to_pandas()
