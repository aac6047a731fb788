"""Many strikes at once: the answers of `strike`, in machine code."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.differences import difference_slopes
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput, KickdynError, NoImpact
from kickdyn.impact.approach import AT_REST
from kickdyn.impact.batch_arguments import contact_frames, one_or_many, rows_of, vector_rows
from kickdyn.impact.laws import find_law, names_of_laws
from kickdyn.impact.strike import strike
from kickdyn.restitution import restitution_at
from kickdyn.robot.leg import Leg

DIFFERENCE = 1e-3
"""Step of the differences of `Impacts` by q and v, relative to 1 rad (1 m) and to the speed."""


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

    Fixed-base legs of hinges and slides are computed in machine code, which agrees with `strike`
    to 1e-10; other legs, and postures that lose digits there, by `strike` one after the other. The
    first call in a process loads the machine code, the very first compiles it for some seconds.

    Args:
        leg: the leg.
        q: configurations, shape `(n, nq)` [rad; m for prismatic joints].
        v: joint velocities just before, shape `(n, nv)` [rad/s; m/s for prismatic joints].
        ball: one ball, or n.
        contact: one contact, or n.
        law: `newton`; the other laws have no machine code.
        ball_velocity: velocity of the balls just before, shape `(3,)` or `(n, 3)`
            [m/s, world frame].
        ball_spin: angular velocity just before, shape `(3,)` or `(n, 3)` [rad/s, world frame].
        slopes: whether to differentiate the launches by q and v, by differences of fourth order,
            which are exact to about 1e-8 where points neither begin to slip nor to stick; it takes
            8 nv times as long.

    Raises:
        InvalidInput: arrays or lists of unequal length, an entry that is not finite, or a law
            without machine code. What concerns one row alone is its status.

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
    velocity = vector_rows("ball velocity", ball_velocity, n)
    given = _Given(leg, balls, contacts, velocity, vector_rows("ball spin", ball_spin, n))
    impacts = given.strike(angles, speeds)
    if not validation.flag("slopes", slopes):
        return impacts
    return replace(impacts, slopes=_slopes(given, angles, speeds))


class _Given:
    """Leg, balls and contacts of n strikes, to which q and v are added."""

    def __init__(
        self, leg: Leg, balls: list[Ball], contacts: list[Contact], velocity: Array, spin: Array
    ) -> None:
        for contact in contacts:
            contact.check_normal()
        self.leg, self.balls, self.contacts = leg, balls, contacts
        self.velocity, self.spin = velocity, spin
        self.normal = np.array([contact.normal for contact in contacts])
        self.radius = np.array([ball.radius for ball in balls])
        self._kernel = _Kernel.of(self)

    def strike(self, q: Array, v: Array) -> Impacts:
        """Return the impacts at configurations and joint velocities."""
        n, leg = len(q), self.leg
        if self._kernel is None or n == 0:
            impacts, doubtful = _empty(n, leg), np.ones(n, bool)
        else:
            impacts, doubtful = self._kernel.strike(q, v)
        for i in np.flatnonzero(doubtful).tolist():
            ball, contact = self.balls[i % len(self.balls)], self.contacts[i % len(self.contacts)]
            try:
                impact = strike(
                    leg.posture(q[i]), v[i], ball, contact,
                    ball_velocity=self.velocity[i], ball_spin=self.spin[i],
                )  # fmt: skip
            except KickdynError as error:
                none = isinstance(error, NoImpact)
                _put(impacts, i, StrikeStatus.NO_IMPACT if none else StrikeStatus.FAILED)
                continue
            after = impact.ball_after
            status = StrikeStatus.STICKS if impact.sticking else StrikeStatus.SLIPS
            _put(impacts, i, status, impact.impulse, after.velocity, after.spin, after.position,
                 impact.v_after, impact.joint_impulses, impact.approach_speed,
                 impact.energy_lost)  # fmt: skip
        return impacts


def _empty(n: int, leg: Leg) -> Impacts:
    impulse, velocity, spin, position = (np.full((n, 3), np.nan) for _ in range(4))
    inside, speed = np.full((n, len(leg.joint_names), 6), np.nan), np.full(n, np.nan)
    return Impacts(
        impulse, velocity, spin, position, np.full((n, leg.nv), np.nan), inside, speed,
        speed.copy(), np.full(n, StrikeStatus.FAILED.flag, np.int8),
    )  # fmt: skip


def _put(impacts: Impacts, i: int, status: StrikeStatus, *values: Any) -> None:
    """Write a row: the values of the first fields, or nan."""
    arrays = [getattr(impacts, name) for name in list(Impacts.__dataclass_fields__)[:8]]
    for array, value in zip(arrays, values or [np.nan] * len(arrays), strict=True):
        array[i] = value
    impacts.status[i] = status.flag


class _Kernel:
    """The machine code of strikes for one leg, and what is the same for all q and v."""

    def __init__(self, given: _Given, joints: Any) -> None:
        from kickdyn.impact.strike_kernel import TASK, compiled_kernel
        from kickdyn.robot.tree_kernel import joint_tree

        self._code, self._given, leg = compiled_kernel(), given, given.leg
        self._tree, frames, self._senses = joint_tree(leg, joints, np.eye(3))
        self._task, self._frames = np.zeros(1, TASK), np.ascontiguousarray(frames)
        self._task["foot"] = leg.contact_joint
        self._first = leg.workspace.model.jointPlacements[1].translation
        frame = leg.workspace.model.frames[leg.frame_id].placement
        foot = frames[leg.contact_joint].T
        offsets = np.array([(0.0, 0.0, 0.0) if contact.offset is None else contact.offset
                            for contact in given.contacts])  # fmt: skip
        levers = leg.contact_lever + offsets @ frame.rotation.T
        count = max(len(given.balls), len(given.contacts))
        self._count = count if count > 1 else 1
        table = np.zeros((19, count))
        table[:9] = contact_frames(given.normal).reshape(-1, 9).T
        table[9:12] = foot @ levers.T
        self._varies = [not isinstance(contact.restitution, float) for contact in given.contacts]
        table[15] = [contact.restitution if isinstance(contact.restitution, float) else 0.5
                     for contact in given.contacts]  # fmt: skip
        table[16] = [contact.friction for contact in given.contacts]
        inverse = np.array([1.0 / ball.mass for ball in given.balls])
        table[17] = inverse + [
            0.0 if ball.mass == math.inf else ball.turning for ball in given.balls
        ]
        table[18] = inverse
        self._table = table

    @classmethod
    def of(cls, given: _Given) -> "_Kernel | None":
        """Return the kernel of a leg, or None where there is none."""
        from kickdyn.robot.tree_kernel import hinges_and_slides

        joints = None if given.leg.base_velocity is not None else hinges_and_slides(given.leg)
        movable = all(ball.mass < math.inf for ball in given.balls)
        fits = given.leg.nq == given.leg.nv and movable
        return cls(given, joints) if joints is not None and fits else None

    def strike(self, q: Array, v: Array) -> tuple[Impacts, NDArray[np.bool_]]:
        """Return the impacts, and which of them are to be computed anew."""
        from kickdyn.core.simd import BATCH

        n, given = len(q), self._given
        batches = -(-n // BATCH)
        padded = batches * BATCH
        shared = self._table.shape[1] == 1 and not any(self._varies)
        # one velocity for all rows takes no memory for each
        shared = shared and given.velocity.strides[0] == given.spin.strides[0] == 0
        m, width = (1, BATCH) if shared else (n, padded)
        table = np.empty((19, width))
        table[:, :m] = self._table
        turning = np.cross(given.spin[:m], given.normal) * given.radius[:, None]
        table[12:15, :m] = (given.velocity[:m] - turning).T
        table[:, m:] = table[:, m - 1 : m]
        motion = np.empty((2 * given.leg.nv, padded))
        np.multiply(self._senses[1:, None], q.T, out=motion[::2, :n])
        np.multiply(self._senses[1:, None], v.T, out=motion[1::2, :n])
        motion[:, n:] = motion[:, n - 1 : n]
        answer = self._run(table, motion, batches)
        if any(self._varies):
            self._set_restitution(table, answer, n)
            answer = self._run(table, motion, batches)
        return self._impacts(answer[:, :n], v)

    def _run(self, table: Array, motion: Array, batches: int) -> Array:
        """Return the answers of the kernel, shape `(rows, 16 batches)`."""
        from kickdyn.core.simd import BATCH, aligned_zeros
        from kickdyn.impact.strike_kernel import FIRST, LANE
        from kickdyn.robot.tree_kernel import BODY, STATE

        count = len(self._tree)
        rows = FIRST + 7 * (count - 1)
        answer = np.empty((rows, batches, BATCH))
        memory = (
            aligned_zeros((1,), LANE), aligned_zeros((count,), BODY),
            aligned_zeros((count, count, BATCH)), aligned_zeros((1,), STATE),
        )  # fmt: skip
        self._code(
            self._tree, self._frames, self._task, table.reshape(19, -1, BATCH),
            motion.reshape(-1, batches, BATCH), memory, answer,
        )  # fmt: skip
        return answer.reshape(rows, -1)

    def _set_restitution(self, table: Array, answer: Array, n: int) -> None:
        """Put in the restitution at the speeds of approach where it depends on them."""
        from kickdyn.impact.strike_kernel import SPEED

        contacts = self._given.contacts
        for i in range(n):
            contact = contacts[i % len(contacts)]
            table[15, i] = restitution_at(contact.restitution, max(float(answer[SPEED, i]), 0.0))

    def _impacts(self, answer: Array, v: Array) -> tuple[Impacts, NDArray[np.bool_]]:
        from kickdyn.impact.strike_kernel import (
            DOUBT,
            FIRST,
            IMPULSE,
            LOST,
            POINT,
            SPEED,
            STICKS,
        )  # fmt: skip

        given, (n, nv) = self._given, v.shape
        # arrays have a column for each strike, as the answer: along rows numpy is several times
        # slower
        impulse, inverse = answer[IMPULSE : IMPULSE + 3], self._table[18]
        velocity = impulse * inverse
        velocity += given.velocity.T
        x, y, z = given.normal.T * ((self._table[17] - inverse) / given.radius)
        a, b, c = impulse
        spin = np.stack([z * b - y * c, x * c - z * a, y * a - x * b])
        spin += given.spin.T
        position = (
            answer[POINT : POINT + 3] + (self._first + given.radius[:, None] * given.normal).T
        )
        after = self._senses[1:, None] * answer[FIRST : FIRST + nv]
        after += v.T
        inside = answer[FIRST + nv :].reshape(nv, 6, n).transpose(2, 0, 1)
        flags = np.int8(StrikeStatus.STICKS.flag), np.int8(StrikeStatus.SLIPS.flag)
        speed = answer[SPEED]
        impacts = Impacts(
            impulse.T, velocity.T, spin.T, position.T, after.T, inside, speed, answer[LOST],
            np.where(answer[STICKS] > 0.0, *flags),
        )  # fmt: skip
        doubtful = (answer[DOUBT] != 0.0) | ~np.isfinite(answer[LOST]) | ~(speed > 1e-12)
        return impacts, doubtful


def _slopes(given: _Given, q: Array, v: Array) -> LaunchSlopes:
    n, nv = v.shape
    speed = np.maximum(np.abs(v).max(axis=1), 1e-9)

    def moved(change: Array) -> Array:
        if q.shape == v.shape:
            return q + change
        import pinocchio as pin

        model = given.leg.workspace.model
        return np.array([pin.integrate(model, a, b) for a, b in zip(q, change, strict=True)])

    def launches(q: Array, v: Array) -> Array:
        impacts = given.strike(q, v)
        return np.hstack([impacts.ball_velocity, impacts.ball_spin])

    by_q = difference_slopes(lambda change: launches(moved(change), v), np.full(n, DIFFERENCE), nv)
    by_v = difference_slopes(lambda change: launches(q, v + change), DIFFERENCE * speed, nv)
    return LaunchSlopes(by_q[:, :3], by_v[:, :3], by_q[:, 3:], by_v[:, 3:])
