"""Many strikes at once: the answers of `strike`, on arrays or in machine code."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.lanes import BATCH, LARGEST_ANGLE, aligned_zeros, blank_records, namespaces
from kickdyn.core.mechanics import cross3, difference_slopes
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput, KickdynError, NoImpact
from kickdyn.impact import strike_kernel as kernel
from kickdyn.impact.approach import AT_REST
from kickdyn.impact.laws import find_law, names_of_laws
from kickdyn.impact.strike import strike
from kickdyn.restitution import restitution_at
from kickdyn.robot.joint_table import DEGREES, look_like_degrees
from kickdyn.robot.leg import Leg
from kickdyn.robot.tree_kernel import BODY, STATE, tree_in_world_axes


def rows_of(
    leg_size: tuple[int, int], q: ArrayLike, v: ArrayLike, single: str
) -> tuple[Array, Array]:
    """Return q and v of shape `(n, nq)` and `(n, nv)`, or raise `InvalidInput`."""
    arrays = []
    for name, value, size in zip("qv", (q, v), leg_size, strict=True):
        array = validation.floats(name, value)
        if array.ndim != 2 or array.shape[1] != size:
            raise InvalidInput(
                f"{name} has shape {array.shape}: it must be (n, {size}); {single} takes one"
            )
        arrays.append(array)
    if len(arrays[0]) != len(arrays[1]):
        raise InvalidInput(
            f"q has {len(arrays[0])} rows and v {len(arrays[1])}: both must have the same number"
        )
    return arrays[0], arrays[1]


def one_or_many(name: str, value: Any, kind: type, n: int) -> list[Any]:
    """Return a list of one object, or of n, or raise `InvalidInput`."""
    if isinstance(value, kind):
        return [value]
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise InvalidInput(
            f"{name} is {validation.brief(value)}: it must be a {kind.__name__} or {n} of them"
        )
    if len(value) != n:
        raise InvalidInput(f"{name} has length {len(value)}: it must be one or {n}, as q has rows")
    for item in value:
        validation.check_type(kind, **{name: item})
    return list(value)


def unit_warnings(leg: Leg, q: Array, balls: Iterable[Ball]) -> tuple[str, ...]:
    """Return lines about balls and configurations, `(n, nq)`, that seem to be in other units."""
    lines = dict.fromkeys(line for ball in balls for line in ball.warnings)
    doubtful = np.flatnonzero(look_like_degrees(leg, q))
    if doubtful.size:
        lines[f"{doubtful.size} rows of q, the first {doubtful[0]}: {DEGREES}"] = None
    return tuple(lines)


def vector_rows(name: str, value: ArrayLike, n: int) -> Array:
    """Return n vectors of three numbers, of one or of n, or raise `InvalidInput`."""
    array = validation.floats(name, value)
    if array.shape not in ((3,), (n, 3)):
        raise InvalidInput(f"{name} has shape {array.shape}: it must be (3,) or ({n}, 3)")
    return np.broadcast_to(array, (n, 3))


def contact_frames(normals: Array) -> Array:
    """Return two tangents and the normal of n unit normals as rows, shape `(n, 3, 3)`."""
    axes = np.empty((len(normals), 3, 3))
    tangent = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    tangent -= normals * (tangent * normals).sum(axis=1, keepdims=True)
    tangent /= np.sqrt((tangent * tangent).sum(axis=1, keepdims=True))
    axes[:, 0].T[:], axes[:, 1], axes[:, 2] = cross3(tangent.T, normals.T), tangent, normals
    return axes


@dataclass(frozen=True, eq=False)
class ContactRows:
    """One contact or n as arrays."""

    given: Sequence[Contact]  # the contacts; or one, which the arrays change in each of n rows
    normal: Array  # unit vectors, shape `(n, 3)`
    restitution: Array  # shape `(n,)`, nan where it depends on the speed of approach
    friction: Array  # shape `(n,)`
    changed: bool = False  # whether the arrays change the contact that is given

    @classmethod
    def of(cls, contacts: Sequence[Contact]) -> "ContactRows":
        """Return contacts as arrays; refuse one without a normal."""
        for contact in contacts:
            contact.check_normal()
        restitution = [
            contact.restitution if isinstance(contact.restitution, float) else math.nan
            for contact in contacts
        ]
        return cls(
            contacts, np.array([contact.normal for contact in contacts]), np.array(restitution),
            np.array([contact.friction for contact in contacts]),
        )  # fmt: skip

    def levers(self, leg: Leg) -> Array:
        """Return the contact points in the frame of their joint, `(n, 3)` or `(1, 3)` [m]."""
        if all(one.offset is None for one in self.given):
            return leg.contact_lever[None]
        still = (0.0, 0.0, 0.0)
        offsets = np.array([still if one.offset is None else one.offset for one in self.given])
        frame = leg.workspace.model.frames[leg.frame_id].placement
        return np.asarray(leg.contact_lever + offsets @ frame.rotation.T)

    def part(self, rows: slice) -> "ContactRows":
        """Return some of n contacts, or the one."""
        if len(self) == 1:
            return self
        arrays = self.normal[rows], self.restitution[rows], self.friction[rows]
        return ContactRows(self.given if self.changed else self.given[rows], *arrays, self.changed)

    def __len__(self) -> int:
        return len(self.normal)

    def __getitem__(self, i: int) -> Contact:
        if not self.changed:
            return self.given[i]
        contact, e = self.given[0], float(self.restitution[i])
        return replace(
            contact, normal=self.normal[i], friction=float(self.friction[i]),
            restitution=contact.restitution if math.isnan(e) else e,
        )  # fmt: skip


DIFFERENCE = 1e-3
"""Step of the differences of `Impacts` by q and v, relative to 1 rad (1 m) and to the speed."""


SECONDS_IN_PYTHON, BLOCK = 5e-6, 4096
"""Processor time of a strike by arrays of Python, roughly [s], and how many go at once."""

Rows = TypeVar("Rows")
"""A dataclass of arrays with a row for each strike."""


class StrikeStatus(StrEnum):
    """How a strike ended: points stick or slip, there is no impact, or it cannot be computed."""

    STICKS = "sticks"
    SLIPS = "slips"
    NO_IMPACT = "no-impact"
    FAILED = "failed"

    @property
    def flag(self) -> int:
        """The number that stands for the status in an array."""
        return list(StrikeStatus).index(self)

    @classmethod
    def of_points(cls, sticking: bool) -> "StrikeStatus":
        """Return the status of an impact whose points stick, or slip."""
        return cls.STICKS if sticking else cls.SLIPS

    @classmethod
    def of(cls, error: KickdynError) -> "StrikeStatus":
        """Return the status of a strike that raised an error."""
        return cls.NO_IMPACT if isinstance(error, NoImpact) else cls.FAILED


@dataclass(frozen=True, eq=False)
class LaunchSlopes:
    """Derivatives of n launches by the motion of the leg.

    Attributes:
        velocity_by_q: of the velocity of the ball by q, shape `(n, 3, nv)` [m/s per rad].
        velocity_by_v: by v, shape `(n, 3, nv)` [m/s per rad/s].
        spin_by_q: of its spin by q, shape `(n, 3, nv)` [rad/s per rad].
        spin_by_v: by v, shape `(n, 3, nv)` [rad/s per rad/s].
    """

    velocity_by_q: Array
    velocity_by_v: Array
    spin_by_q: Array
    spin_by_v: Array


@dataclass(frozen=True, eq=False)
class Impacts:
    """The results of n strikes; rows without an impact are nan.

    Attributes:
        impulse: on the ball, shape `(n, 3)` [N s, world frame].
        ball_velocity: of the ball after the impact, shape `(n, 3)` [m/s, world frame].
        ball_spin: of the ball after the impact, shape `(n, 3)` [rad/s, world frame].
        ball_position: centre of the ball, shape `(n, 3)` [m, world frame].
        v_after: joint velocity after the impact, shape `(n, nv)` [rad/s; m/s if prismatic].
        joint_impulses: as `Impact.joint_impulses`, shape `(n, njoints, 6)` [N s, N m s].
        approach_speed: of foot and ball along the normal, shape `(n,)` [m/s].
        energy_lost: shape `(n,)` [J].
        status: a `StrikeStatus` by its flag, shape `(n,)`: 0 sticks, 1 slips, 2 no impact,
            3 failed.
        slopes: derivatives of the launches; None unless they were asked for.
        warnings: lines about balls and angles that seem to be in other units.
    """

    impulse: Array
    ball_velocity: Array
    ball_spin: Array
    ball_position: Array
    v_after: Array
    joint_impulses: Array
    approach_speed: Array
    energy_lost: Array
    status: NDArray[np.int8]
    slopes: LaunchSlopes | None = None
    warnings: tuple[str, ...] = ()

    @property
    def ball_after(self) -> BallState:
        """The balls after the impacts, for `fly_many`; refused where a row has no impact."""
        return BallState(self.ball_position, self.ball_velocity, self.ball_spin)


@validation.check_arguments
def strike_many(
    leg: Leg,
    q: ArrayLike,
    v: ArrayLike,
    ball: Ball | Sequence[Ball],
    contact: Contact | Sequence[Contact],
    law: str = "newton",
    *,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    slopes: bool = False,
) -> Impacts:
    """Strike n balls: the answers of `strike`, thousands of times as fast.

    Fixed-base legs of hinges and slides are computed at once, which agrees with `strike` to 1e-10,
    or to `Impact.digits` where these are fewer; other legs by `strike` one after the other. A row
    costs the same whatever its status is. Some thousand strikes are computed on arrays in some 5
    microseconds each. Machine code, in which a strike takes half of one, is loaded or compiled when
    the calls of a process have taken as long as that would, half a second or seven; the results
    have the same digits.

    Args:
        leg: the leg.
        q: configurations, shape `(n, nq)` [rad; m for prismatic joints].
        v: joint velocities just before, shape `(n, nv)` [rad/s; m/s for prismatic joints].
        ball: one ball, or n.
        contact: one contact, or n.
        law: `newton`; the other laws are not computed at once.
        ball_velocity: velocity of the balls just before, shape `(3,)` or `(n, 3)`
            [m/s, world frame].
        ball_spin: angular velocity just before, shape `(3,)` or `(n, 3)` [rad/s, world frame].
        slopes: whether to differentiate the launches by q and v, by differences of fourth order,
            which are exact to about 1e-8 where points neither begin to slip nor to stick; it takes
            8 nv times as long.

    Raises:
        InvalidInput: arrays or lists of unequal length, an entry that is not finite, or a law
            that is not computed at once. What concerns one row alone is its status.

    Example:
        >>> import numpy as np
        >>> import kickdyn as kd
        >>> q = np.array([[0.7, 0.5, -0.3]] * 2)
        >>> v = np.array([[6.6, -14.5, 6.6], [5.0, -12.0, 5.0]])
        >>> contact = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
        >>> impacts = kd.strike_many(kd.Leg.human(), q, v, kd.Ball(), contact)
        >>> np.linalg.norm(impacts.ball_velocity, axis=1).round(2).tolist()
        [16.94, 13.48]
    """
    validation.check_type(Leg, leg=leg)
    if not find_law(law).has_kernel:
        raise InvalidInput(
            f"impact law is {law!r}: strike_many takes {names_of_laws('has_kernel')}; strike takes "
            "every law"
        )
    angles, speeds = rows_of((leg.nq, leg.nv), q, v, "strike")
    n = len(angles)
    balls = one_or_many("ball", ball, Ball, n)
    contacts = one_or_many("contact", contact, Contact, n)
    if n:
        pairs = [(i % len(contacts), i % len(balls)) for i in range(max(len(contacts), len(balls)))]
        contacts = [contacts[i].for_ball(balls[k]) for i, k in pairs]
    velocity = vector_rows("ball velocity", ball_velocity, n)
    spin = vector_rows("ball spin", ball_spin, n)
    strikes = Strikes(leg, balls, ContactRows.of(contacts), velocity, spin)
    derivatives = _slopes(strikes, angles, speeds) if validation.flag("slopes", slopes) else None
    impacts, warnings = strikes.compute(angles, speeds), unit_warnings(leg, angles, balls)
    return replace(impacts, slopes=derivatives, warnings=warnings)


class Strikes:
    """Leg, balls and contacts of n strikes, to which q and v are added.

    The strikes of a fixed-base leg of hinges and slides are computed at once, on arrays or in
    machine code.
    """

    def __init__(
        self, leg: Leg, balls: list[Ball], contacts: ContactRows, velocity: Array, spin: Array
    ) -> None:
        self.leg, self.balls, self.contacts = leg, balls, contacts
        self.velocity, self.spin = velocity, spin
        movable = all(ball.mass < math.inf for ball in balls) and leg.nq == leg.nv
        movable = movable and leg.base_velocity is None and len(velocity) > 0
        geometry = tree_in_world_axes(leg) if movable else None
        self._at_once = geometry is not None
        if geometry is None:
            return
        tree, frames, senses = geometry
        task = np.zeros(1, kernel.TASK)
        task["foot"] = leg.contact_joint
        self._tree = tree, np.ascontiguousarray(frames), task, np.ascontiguousarray(senses)
        self._columns = kernel.FIRST + 7 * leg.nv
        self._varies = bool(np.isnan(contacts.restitution).any())
        self._table = self._inputs(frames[leg.contact_joint].T)

    def compute(self, q: Array, v: Array) -> Impacts:
        """Return the impacts at configurations and joint velocities."""
        n, leg = len(q), self.leg
        if self._at_once:
            impacts, doubtful = self._strike(q, v)
        else:
            inside = len(leg.joint_names), 6
            impacts = failed_rows(Impacts, n, *[(3,)] * 4, (leg.nv,), inside, (), ())
            doubtful = np.ones(n, bool)

        def single(i: int) -> tuple[Any, ...]:
            ball, contact = self.balls[i % len(self.balls)], self.contacts[i % len(self.contacts)]
            impact = strike(
                leg.posture(q[i]), v[i], ball, contact,
                ball_velocity=self.velocity[i], ball_spin=self.spin[i],
            )  # fmt: skip
            after = impact.ball_after
            return (
                impact.impulse, after.velocity, after.spin, after.position, impact.v_after,
                impact.joint_impulses, impact.approach_speed, impact.energy_lost,
                StrikeStatus.of_points(impact.sticking).flag,
            )  # fmt: skip

        fill_rows(impacts, doubtful, single)
        return impacts

    def _inputs(self, foot_axes: Array) -> Array:
        """Return the inputs of the strikes beside q and v, shape `(rows, batches, 16)`."""
        rows, leg, contacts = kernel, self.leg, self.contacts
        shared = max(len(self.balls), len(contacts)) == 1 and not self._varies
        # one velocity for all rows takes no memory for each
        shared = shared and self.velocity.strides[0] == self.spin.strides[0] == 0
        n = 1 if shared else len(self.velocity)
        table = np.empty((rows.GIVEN, -(-n // BATCH) * BATCH))
        table[rows.AXES : rows.LEVER, :n] = contact_frames(contacts.normal).reshape(-1, 9).T
        table[rows.LEVER : rows.CENTRE, :n] = foot_axes @ contacts.levers(leg).T
        table[rows.RADIUS, :n] = [ball.radius for ball in self.balls]
        root = leg.workspace.model.jointPlacements[1].translation
        table[rows.CENTRE : rows.VELOCITY, :n] = root[:, None] + table[rows.RADIUS, :n] * (
            contacts.normal.T
        )
        table[rows.VELOCITY : rows.SPIN, :n] = self.velocity[:n].T
        table[rows.SPIN : rows.RADIUS, :n] = self.spin[:n].T
        restitution = contacts.restitution
        table[rows.RESTITUTION, :n] = np.where(np.isnan(restitution), 0.5, restitution)
        table[rows.FRICTION, :n] = contacts.friction
        table[rows.INVERSE_MASS, :n] = [1.0 / ball.mass for ball in self.balls]
        table[rows.TURNING, :n] = [ball.turning for ball in self.balls]
        table[:, n:] = table[:, n - 1 : n]
        return table.reshape(rows.GIVEN, -1, BATCH)

    def _strike(self, q: Array, v: Array) -> tuple[Impacts, NDArray[np.bool_]]:
        """Return the impacts, and which of them are to be computed anew."""
        rows = kernel
        if max(q.max(), -q.min()) >= LARGEST_ANGLE:
            large = (np.abs(q) >= LARGEST_ANGLE) & ~self._tree[0]["slides"][1:]
            q = np.where(large, np.arctan2(np.sin(q), np.cos(q)), q)
        run = self._run if kernel.KERNEL.pays(len(q) * SECONDS_IN_PYTHON) else self._in_python
        answer, flags = run(q, v)
        if self._varies:
            restitution = self._table[kernel.RESTITUTION].reshape(-1)
            for i, speed in enumerate(answer[:, rows.APPROACH].tolist()):
                contact = self.contacts[i % len(self.contacts)]
                restitution[i] = restitution_at(contact.restitution, speed if speed > 0.0 else 0.0)
            answer, flags = run(q, v)
        (n, nv), end = q.shape, rows.FIRST + self.leg.nv
        fields: list[Any] = [
            answer[:, k : k + 3]
            for k in (rows.IMPULSE, rows.BALL_VELOCITY, rows.BALL_SPIN, rows.BALL_POSITION)
        ]
        fields += [answer[:, rows.FIRST : end], answer[:, end:].reshape(n, nv, 6)]
        fields += [answer[:, rows.APPROACH], answer[:, rows.LOST], flags]
        impacts = Impacts(*fields)
        return impacts, flags == rows.ANEW

    def _run(self, q: Array, v: Array) -> tuple[Array, NDArray[np.int8]]:
        """Return the answers of the kernel, shape `(n, columns)`, and their flags."""
        answer = np.empty((len(q), self._columns)), np.empty(len(q), np.int8)
        motion, count = (np.ascontiguousarray(q), np.ascontiguousarray(v)), len(self._tree[0])
        memory = (
            aligned_zeros((count,), BODY), aligned_zeros((count, count, BATCH)),
            aligned_zeros((1,), STATE),
            aligned_zeros((2 * len(q.T) + self._columns + 1, BATCH)),
        )  # fmt: skip
        kernel.KERNEL()(*self._tree, self._table, motion, memory, answer)
        return answer

    def _in_python(self, q: Array, v: Array) -> tuple[Array, NDArray[np.int8]]:
        """Return the result of `_run`, by the same functions on arrays of `BLOCK` strikes."""
        tree, frames, task, senses = self._tree
        leg = namespaces(tree), frames, senses, *namespaces(task)
        table, nv, count = self._table.reshape(kernel.GIVEN, 1, -1), self.leg.nv, len(tree)
        answer = np.empty((len(q), self._columns)), np.empty(len(q), np.int8)
        for begin in range(0, len(q), BLOCK):
            rows = slice(begin, min(begin + BLOCK, len(q)))
            n = rows.stop - begin
            part = table[..., rows] if table.shape[2] >= len(q) else table[..., :1]
            inputs = np.broadcast_to(part, (kernel.GIVEN, 1, n))
            row_of = np.empty((2 * nv + self._columns + 1, n))
            row_of[:nv], row_of[nv : 2 * nv] = (senses[1:] * q[rows]).T, (senses[1:] * v[rows]).T
            (state,), inertia = blank_records(STATE, 1, n), np.zeros((count, count, n))
            memory = blank_records(BODY, count, n), inertia, state, state, row_of
            with np.errstate(all="ignore"):  # of strikes that are computed anew
                kernel.strike_batch(*leg, inputs, inputs, 0, memory)
            row_of[2 * nv : -1, row_of[-1] == kernel.PARTING] = np.nan
            answer[0][rows], answer[1][rows] = row_of[2 * nv : -1].T, row_of[-1]
        return answer


def failed_rows(kind: Callable[..., Rows], n: int, *shapes: tuple[int, ...]) -> Rows:
    """Return a result of n rows that failed, its fields of some shapes, then the status."""
    fields: list[Any] = [np.full((n, *shape), np.nan) for shape in shapes]
    return kind(*fields, np.full(n, StrikeStatus.FAILED.flag, np.int8))


def put_rows(result: Any, rows: Any, *values: Any) -> None:
    """Write the first fields of some rows of a result."""
    for name, value in zip(result.__dataclass_fields__, values, strict=False):
        getattr(result, name)[rows] = value


def fill_rows(
    result: Any, remaining: NDArray[np.bool_], single: Callable[[int], tuple[Any, ...]]
) -> None:
    """Write the rows that remain, one after the other; those that raise are nan, with a status.

    `single` returns the first fields of a row, the status last.
    """
    for i in np.flatnonzero(remaining).tolist():
        try:
            values = single(i)
        except KickdynError as error:
            nothing = [np.nan] * (list(result.__dataclass_fields__).index("status"))
            values = *nothing, StrikeStatus.of(error).flag
        put_rows(result, i, *values)


def _slopes(given: Strikes, q: Array, v: Array) -> LaunchSlopes:
    n, nv = v.shape
    speed = np.maximum(np.abs(v).max(axis=1), 1e-9)

    def moved(change: Array) -> Array:
        if q.shape == v.shape:
            return q + change
        import pinocchio as pin

        model = given.leg.workspace.model
        return np.array([pin.integrate(model, a, b) for a, b in zip(q, change, strict=True)])

    def launches(q: Array, v: Array) -> Array:
        impacts = given.compute(q, v)
        return np.hstack([impacts.ball_velocity, impacts.ball_spin])

    by_q = difference_slopes(lambda change: launches(moved(change), v), np.full(n, DIFFERENCE), nv)
    by_v = difference_slopes(lambda change: launches(q, v + change), DIFFERENCE * speed, nv)
    return LaunchSlopes(by_q[:, :3], by_v[:, :3], by_q[:, 3:], by_v[:, 3:])
