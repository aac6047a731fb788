"""Many contacts that take time: the answers of `collide`, in machine code."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.compilation import MachineCode, Source
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import KickdynError
from kickdyn.impact.approach import AT_REST
from kickdyn.impact.batch_arguments import (
    contact_frames,
    one_or_many,
    rows_of,
    unit_warnings,
    vector_rows,
)
from kickdyn.impact.collide import (
    CONTACT_TIME,
    checked_stiffness,
    collide,
    takes_inflated_force,
)
from kickdyn.impact.compliant_contact import RESTING, STABILIZATION_RATE, Friction
from kickdyn.impact.force_model import (
    HERTZ,
    LINEAR,
    LONGEST_CONTACT,
    ForceModel,
    hertz_stiffness,
    spring_time,
)
from kickdyn.impact.integrate_contact import FIRST_STEP
from kickdyn.impact.strike_kernel import FASTEST
from kickdyn.impact.strike_many import StrikeStatus, failed_rows, put_rows
from kickdyn.restitution import restitution_at
from kickdyn.robot.leg import Leg

CHUNK = 8192
"""Rows that are computed at once, to bound the memory."""

LEAST_TIME, LEAST_SPEED = 1e-7, 1e-5
"""Contact time [s] and speed of approach [m/s] below which a row is left to `collide`."""


@dataclass(frozen=True, eq=False)
class Collisions:
    """The results of n contacts that take time; rows without one are nan.

    Attributes:
        impulse: on the ball, shape `(n, 3)` [N s, world frame].
        ball_velocity: of the ball at separation, shape `(n, 3)` [m/s, world frame].
        ball_spin: of the ball at separation, shape `(n, 3)` [rad/s, world frame].
        ball_position: centre of the ball at separation, shape `(n, 3)` [m, world frame].
        q_after: configuration at separation, shape `(n, nq)` [rad; m if prismatic].
        v_after: joint velocity at separation, shape `(n, nv)` [rad/s; m/s if prismatic].
        contact_time: time for which the force acts, shape `(n,)` [s].
        deflection: largest deflection, shape `(n,)` [m].
        approach_speed: of foot and ball along the normal, shape `(n,)` [m/s].
        energy_lost: to hysteresis and friction, shape `(n,)` [J].
        energy_residual: as `Collision.energy_residual`, shape `(n,)`.
        status: a `StrikeStatus` by its flag, shape `(n,)`: 0 the points stick at separation, 1 they
            slip, 2 no impact, 3 failed.
        warnings: lines about balls and angles that seem to be in other units.
    """

    impulse: Array
    ball_velocity: Array
    ball_spin: Array
    ball_position: Array
    q_after: Array
    v_after: Array
    contact_time: Array
    deflection: Array
    approach_speed: Array
    energy_lost: Array
    energy_residual: Array
    status: NDArray[np.int8]
    warnings: tuple[str, ...] = ()

    @property
    def ball_after(self) -> BallState:
        """The balls at separation, for `fly_many`; refused where a row has no impact."""
        return BallState(self.ball_position, self.ball_velocity, self.ball_spin, self.contact_time)


@validation.check_arguments
def collide_many(
    leg: Leg,
    q: ArrayLike,
    v: ArrayLike,
    ball: Ball | Sequence[Ball],
    contact: Contact | Sequence[Contact],
    *,
    contact_time: float | None = None,
    stiffness: float | Literal["pressure", "inflated"] | None = None,
    torque: ArrayLike | None = None,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    tol: float = 1e-7,
) -> Collisions:
    """Strike n balls through contacts of finite stiffness: the answers of `collide`, much faster.

    Fixed-base legs of hinges and slides with rigid drives are computed in machine code, with the
    spring of a contact time, a stiffness or `"pressure"`; other legs, the force of an inflated
    ball, and rows that lose digits there, by `collide` one after the other. So are batches of some
    ten rows, which take less time than loading machine code, and of some hundred if it is not
    compiled yet. Both ways keep the tolerance, with errors of their own.

    Args:
        leg: the leg.
        q: configurations at first contact, shape `(n, nq)` [rad; m for prismatic joints].
        v: joint velocities at first contact, shape `(n, nv)` [rad/s; m/s for prismatic joints].
        ball: one ball, or n.
        contact: one contact, or n.
        contact_time: duration of the contact, as for `collide` [s].
        stiffness: stiffness of the contact, as for `collide` [N/m^1.5].
        torque: constant torques at the joints, of all rows, shape `(nv,)` [N m; N if prismatic].
        ball_velocity: velocity of the balls at first contact, shape `(3,)` or `(n, 3)`
            [m/s, world frame].
        ball_spin: angular velocity then, shape `(3,)` or `(n, 3)` [rad/s, world frame].
        tol: relative tolerance of the integrator, 1e-13 to 1e-3; impulses are exact to about that.

    Raises:
        InvalidInput: arrays or lists of unequal length, an entry that is not finite, or a value
            that no row can have. What concerns one row alone is its status.

    Example:
        >>> import numpy as np
        >>> import kickdyn as kd
        >>> q = np.array([[0.7, 0.5, -0.3]] * 2)
        >>> v = np.array([[6.6, -14.5, 6.6], [5.0, -12.0, 5.0]])
        >>> contact = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
        >>> many = kd.collide_many(kd.Leg.human(), q, v, kd.Ball(), contact)
        >>> (1e3 * many.contact_time).round(2).tolist()  # [ms]
        [10.0, 10.0]
    """
    validation.check_type(Leg, leg=leg)
    validation.number("tol", tol, at_least=1e-13, at_most=1e-3)
    torques = validation.vector("torque", np.zeros(leg.nv) if torque is None else torque, leg.nv,
                                unit="N m")  # fmt: skip
    angles, speeds = rows_of((leg.nq, leg.nv), q, v, "collide")
    n = len(angles)
    balls = one_or_many("ball", ball, Ball, n)
    contacts = one_or_many("contact", contact, Contact, n)
    velocity = vector_rows("ball velocity", ball_velocity, n)
    spin = vector_rows("ball spin", ball_spin, n)
    checked_stiffness(contact_time, stiffness)
    inflated = False
    for one_contact in contacts:
        one_contact.check_normal()
        inflated |= takes_inflated_force(one_contact, contact_time, stiffness)
        if isinstance(one_contact.restitution, float):
            ForceModel(1.0, one_contact.restitution)  # refuses what no spring has
    for one_ball in balls:
        one_ball.check_movable("a contact that takes time")
        if stiffness == "pressure":
            _ = one_ball.stiffness
    if contact_time is not None:
        validation.number("contact time", contact_time, above=0, at_most=LONGEST_CONTACT, unit="s")
    shapes = *[(3,)] * 4, (leg.nq,), (leg.nv,), *[()] * 5
    collisions, remaining = failed_rows(Collisions, n, *shapes), np.ones(n, bool)
    options: dict[str, Any] = {"contact_time": contact_time, "stiffness": stiffness}
    kernel = None
    if not inflated and COLLIDE.pays(n * SECONDS_OF_COLLIDE):
        kernel = _Kernel.of(leg, torques)
    if kernel is not None:
        for start in range(0, n, CHUNK):
            rows = slice(start, min(start + CHUNK, n))
            bodies = (
                balls[rows] if len(balls) > 1 else balls,
                contacts[rows] if len(contacts) > 1 else contacts,
            )
            motion = angles[rows], speeds[rows], velocity[rows], spin[rows]
            remaining[rows] = kernel.collide(collisions, rows, motion, bodies, options, tol)
    for i in np.flatnonzero(remaining).tolist():
        try:
            given = leg.posture(angles[i]), speeds[i], balls[i % len(balls)]
            single = collide(
                *given, contacts[i % len(contacts)], torque=torques, ball_velocity=velocity[i],
                ball_spin=spin[i], tol=tol, **options,
            )  # fmt: skip
        except KickdynError as error:
            collisions.status[i] = StrikeStatus.of(error).flag
            continue
        after, sticks = single.ball_after, single._motion.phases[-1].friction is Friction.STICKS
        sticks = sticks and single.contact.friction > 0.0
        status = StrikeStatus.STICKS if sticks else StrikeStatus.SLIPS
        put_rows(collisions, i, single.impulse, after.velocity, after.spin, after.position,
                 single.q_after, single.v_after, single.contact_time, single.deflection,
                 single.approach_speed, single.energy_lost, single.energy_residual,
                 status.flag)  # fmt: skip
    return replace(collisions, warnings=unit_warnings(leg, angles, balls))


SECONDS_OF_COLLIDE = 0.025
"""Processor time of one `collide`, roughly [s]."""


def _source() -> Source:
    from kickdyn.impact import collide_kernel  # imports numba

    return collide_kernel.source()


COLLIDE = MachineCode(_source, "the kernel of contacts that take time", 10.0)


class _Beginning(NamedTuple):
    """Where contacts begin.

    Attributes:
        speed: of approach [m/s].
        inverse_mass: of the foot along the normal [1/kg].
        sliding: of the contact points along both tangents, shape `(2, n)` [m/s].
        inertia: diagonal of the joint-space inertia, shape `(nv, n)` [kg m2; kg].
        sound: whether these are computed to full precision.
    """

    speed: Array
    inverse_mass: Array
    sliding: Array
    inertia: Array
    sound: NDArray[np.bool_]


class _Kernel:
    """The machine code of contacts for one leg and its constant torques."""

    def __init__(self, leg: Leg, joints: Any, torque: Array) -> None:
        from kickdyn.core.lanes import BATCH, aligned_zeros
        from kickdyn.impact.collide_equations import START
        from kickdyn.impact.collide_kernel import Work
        from kickdyn.impact.strike_kernel import TASK
        from kickdyn.robot.tree_kernel import BODY, MOTION, STATE, joint_tree

        self._leg, nv = leg, leg.nv
        self._tree, frames, senses = joint_tree(leg, joints, np.eye(3))
        self._senses, self._foot_axes = senses[1:], frames[leg.contact_joint]
        self._torque = np.ascontiguousarray(self._senses * torque)
        self._first = leg.workspace.model.jointPlacements[1].translation
        task, self._dim, self._lane_rows = np.zeros(1, TASK), 2 * nv + 11, START + 2 * nv
        task["foot"] = leg.contact_joint
        motion = aligned_zeros((nv + 1,), MOTION)
        motion["acceleration"][0] = -np.array(leg.model.gravity.linear)[:, None]
        self._given_leg = self._tree, task, self._torque
        self._work = Work(
            aligned_zeros((self._lane_rows, BATCH)), aligned_zeros((2, self._dim, BATCH)),
            aligned_zeros((13, self._dim, BATCH)), aligned_zeros((9 + 3 * self._dim, BATCH)),
            np.full(BATCH, -1), aligned_zeros((nv + 1,), BODY), motion,
            aligned_zeros((nv + 1, nv + 1, BATCH)), aligned_zeros((1,), STATE),
        )  # fmt: skip

    @classmethod
    def of(cls, leg: Leg, torque: Array) -> "_Kernel | None":
        """Return the kernel of a leg, or None if there is none."""
        from kickdyn.robot.tree_kernel import hinges_and_slides

        joints = hinges_and_slides(leg)
        if joints is None or leg.nq != leg.nv or leg.compliant_drives:
            return None
        return cls(leg, joints, torque)

    def collide(
        self, collisions: Collisions, rows: slice, motion: tuple[Array, ...],
        bodies: tuple[list[Ball], list[Contact]], options: dict[str, Any], tol: float,
    ) -> NDArray[np.bool_]:  # fmt: skip
        """Write rows of results; return which of them are left to `collide`."""
        from kickdyn.impact.collide_equations import CENTRE, INVERSE_MASS, RESULT

        (q, v, velocity, spin), (balls, contacts), nv = motion, bodies, self._leg.nv
        n = len(q)
        inputs = self._given(q, v, velocity, spin, balls, contacts)
        begin = self._begin(inputs)
        speed, mass = begin.speed, 1.0 / (begin.inverse_mass + inputs[INVERSE_MASS])
        parting = begin.sound & (speed < -LEAST_SPEED) & (speed > -FASTEST)
        ready = begin.sound & (speed > LEAST_SPEED)
        with np.errstate(all="ignore"):
            self._choose(inputs, begin, speed, mass, (balls, contacts), options, tol, ready)
        chosen = np.flatnonzero(ready)
        answer = np.empty((RESULT + self._dim, len(chosen)))
        table = inputs if len(chosen) == n else np.ascontiguousarray(inputs[:, chosen])
        COLLIDE()(*self._given_leg, table, answer, self._work, tol)
        through, exact = answer[0] == 3.0, (answer[0] < 2.0) & np.isfinite(answer).all(axis=0)
        failed, chosen, answer = chosen[through], chosen[exact], answer[:, exact]
        column, place = answer[RESULT:], np.arange(rows.start, rows.stop)[chosen]
        change, speeds, ball = column[:nv].T, column[nv : 2 * nv].T, column[2 * nv :]
        mass_of_ball = 1.0 / inputs[INVERSE_MASS, chosen][:, None]
        fallen = answer[1][:, None] * np.array(self._leg.model.gravity.linear)
        energy = 0.5 * (mass * speed * speed)[chosen]
        position = self._first + inputs[CENTRE : CENTRE + 3, chosen].T + ball[:3].T
        after = ball[3:6].T.copy()
        put_rows(
            collisions, place, mass_of_ball * (after - velocity[chosen] - fallen), after,
            ball[6:9].T, position, q[chosen] + self._senses * change, self._senses * speeds,
            answer[1], answer[2], speed[chosen], ball[9], np.abs(answer[3]) / energy,
            np.where(answer[0] == 1.0, StrikeStatus.STICKS.flag, StrikeStatus.SLIPS.flag),
        )  # fmt: skip
        collisions.status[rows][parting] = StrikeStatus.NO_IMPACT.flag
        remaining: NDArray[np.bool_] = ~parting
        remaining[failed] = remaining[chosen] = False
        return remaining

    def _begin(self, given: Array) -> _Beginning:
        """Return the motion at first contact, and put axes, arm and centre into `given`.

        The machine code's functions compute it on arrays of all rows. Before, the axes are in the
        world frame, and the arm is from the joint's origin to the contact point in its frame.
        """
        from kickdyn.core.lanes import LARGEST_ANGLE, blank_records, namespaces
        from kickdyn.impact.collide_equations import (
            ARM,
            AXES,
            CENTRE,
            RADIUS,
            SLIDING,
            START,
            contact_terms,
            from_first_joint,
            place,
        )
        from kickdyn.robot.tree_kernel import BODY, D33, MOTION, STATE

        tree, task, torque = self._given_leg
        joints, (foot,), count = namespaces(tree), namespaces(task), len(tree)
        lanes, column = given[: self._lane_rows], given[self._lane_rows :]
        n = given.shape[1]
        bodies, motion = blank_records(BODY, count, n), blank_records(MOTION, count, n)
        (state,) = blank_records(STATE, 1, n)
        motion[0].acceleration[:] = -np.array(self._leg.model.gravity.linear)[:, None]
        inertia = np.zeros((count, count, n))
        with np.errstate(all="ignore"):  # of rows that have lost their digits
            place(joints, lanes, column, bodies)
            rotation, axes = bodies[foot.foot].rotation, lanes[AXES:ARM].reshape(3, 3, n)
            lever = lanes[ARM:CENTRE]
            lanes[CENTRE : CENTRE + 3] = np.array(from_first_joint(joints, bodies, foot.foot))
            lanes[CENTRE : CENTRE + 3] += np.einsum("ijn,jn->in", rotation, lever)
            lanes[CENTRE : CENTRE + 3] += lanes[RADIUS] * axes[2]
            axes[:] = np.einsum("jin,ajn->ain", rotation, axes)
            lanes[ARM:CENTRE] = np.einsum("ain,in->an", axes, lever)
            memory = np.zeros((9, n)), bodies, motion, inertia, state
            contact_terms(joints, foot, torque, lanes, column, memory)
        angles = np.abs(lanes[START : START + count - 1]).max(axis=0)
        return _Beginning(
            -lanes[SLIDING + 2], state.delassus[D33].copy(), lanes[SLIDING : SLIDING + 2].copy(),
            inertia[0, 1:], (state.doubt == 0.0) & (angles < LARGEST_ANGLE),
        )  # fmt: skip

    def _given(
        self, q: Array, v: Array, velocity: Array, spin: Array, balls: list[Ball],
        contacts: list[Contact],
    ) -> Array:  # fmt: skip
        """Return the inputs before the first contact is computed, as `_begin` takes them."""
        from kickdyn.impact.collide_equations import (
            ARM,
            AXES,
            FRICTION,
            INVERSE_INERTIA,
            INVERSE_MASS,
            RADIUS,
            START,
        )  # fmt: skip

        leg, nv, n = self._leg, self._leg.nv, len(q)
        inputs = np.zeros((self._lane_rows + self._dim, n))
        frames = contact_frames(np.array([contact.normal for contact in contacts]))
        inputs[AXES : AXES + 9] = frames.reshape(-1, 9).T
        frame = leg.workspace.model.frames[leg.frame_id].placement
        offsets = np.array([(0.0, 0.0, 0.0) if contact.offset is None else contact.offset
                            for contact in contacts])  # fmt: skip
        levers = leg.contact_lever + offsets @ frame.rotation.T
        inputs[ARM : ARM + 3] = self._foot_axes.T @ levers.T
        inputs[INVERSE_MASS] = [1.0 / ball.mass for ball in balls]
        inputs[INVERSE_INERTIA] = [1.0 / ball.inertia for ball in balls]
        inputs[RADIUS] = [ball.radius for ball in balls]
        inputs[FRICTION] = [contact.friction for contact in contacts]
        inputs[START : START + nv] = (self._senses * q).T
        row = self._lane_rows
        inputs[row + nv : row + 2 * nv] = (self._senses * v).T
        inputs[row + 2 * nv + 3 : row + 2 * nv + 6] = velocity.T
        inputs[row + 2 * nv + 6 : row + 2 * nv + 9] = spin.T
        return inputs

    def _choose(
        self, inputs: Array, begin: _Beginning, speed: Array, mass: Array,
        bodies: tuple[list[Ball], list[Contact]], options: dict[str, Any], tol: float,
        ready: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        """Fill in spring, scales, first step and first phase; clear `ready` where there is none."""
        from kickdyn.impact import collide_equations as rows

        (balls, contacts), nv, n = bodies, self._leg.nv, len(speed)
        restitution = np.array([
            contact.restitution if isinstance(contact.restitution, float) else math.nan
            for contact in contacts
        ]) * np.ones(n)  # fmt: skip
        for i in np.flatnonzero(ready & np.isnan(restitution)).tolist():
            contact = contacts[i % len(contacts)]
            restitution[i] = restitution_at(contact.restitution, float(speed[i]))
        stiffness, exponent = options["stiffness"], HERTZ
        if stiffness is None:
            time = np.full(n, options["contact_time"] or CONTACT_TIME)
            stiffness = hertz_stiffness(time, mass, speed, restitution)
        else:
            if stiffness == "pressure":
                stiffness, exponent = np.array([ball.stiffness for ball in balls]), LINEAR
            stiffness = stiffness * np.ones(n)
            time = spring_time(stiffness, restitution, exponent, mass, speed)
        ready &= (restitution >= 0.01) & np.isfinite(stiffness) & (time >= LEAST_TIME)
        inputs[rows.STIFFNESS], inputs[rows.SHARE] = stiffness, restitution**2
        inputs[rows.EXPONENT], inputs[rows.RATE] = exponent, STABILIZATION_RATE / time
        resting = RESTING * tol * speed
        inputs[rows.RESTING], inputs[rows.SPEED], inputs[rows.EXPECTED] = resting, speed, time
        inputs[rows.FIRST] = time * min(FIRST_STEP * tol ** (2 / 7), 0.3)
        energy = 0.5 * mass * speed * speed
        inputs[rows.ENERGY] = energy
        row = self._lane_rows + 2 * nv + 6
        spin = np.abs(inputs[row : row + 3]).max(axis=0)
        inputs[rows.SPIN] = np.where(spin > 0.0, spin, speed / inputs[rows.RADIUS])
        sliding = np.hypot(*begin.sliding)
        slips = sliding > 2.0 * resting
        inputs[rows.KIND] = np.where(slips, Friction.SLIPS.value, Friction.STARTS.value)
        inputs[rows.ALONG : rows.ALONG + 2] = np.where(slips, begin.sliding / sliding, 0.0)
        row = rows.START + nv
        inputs[row : row + nv] = np.sqrt(2.0 * energy / begin.inertia)
