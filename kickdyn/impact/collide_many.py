"""Many contacts that take time: the answers of `collide`, in machine code."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.lanes import blank_records
from kickdyn.core.validation import Array, ArrayLike, length
from kickdyn.impact.approach import AT_REST
from kickdyn.impact.collide import (
    COLLIDE,
    SECONDS_OF_COLLIDE,
    checked_stiffness,
    collide,
    takes_inflated_force,
)
from kickdyn.impact.contact_phases import LANE, light_contact_factor, set_lanes
from kickdyn.impact.force_model import ForceModel, chosen_spring
from kickdyn.impact.strike_kernel import FASTEST
from kickdyn.impact.strike_many import (
    ContactRows,
    StrikeStatus,
    contact_frames,
    failed_rows,
    fill_rows,
    one_or_many,
    put_rows,
    rows_of,
    unit_warnings,
    vector_rows,
)
from kickdyn.restitution import restitution_at
from kickdyn.robot.leg import Leg

if TYPE_CHECKING:
    from kickdyn.impact.collide_kernel import ContactKernel

CHUNK = 8192
"""Rows that are computed at once, to bound the memory."""


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
    contact_rows = ContactRows.of(contacts)
    for one_contact in contacts:
        inflated |= takes_inflated_force(one_contact, contact_time, stiffness)
        if isinstance(one_contact.restitution, float):
            ForceModel(1.0, one_contact.restitution)  # refuses what no spring has
    for one_ball in balls:
        one_ball.check_movable("a contact that takes time")
        if stiffness == "pressure":
            _ = one_ball.stiffness
    shapes = *[(3,)] * 4, (leg.nq,), (leg.nv,), *[()] * 5
    collisions, remaining = failed_rows(Collisions, n, *shapes), np.ones(n, bool)
    options: dict[str, Any] = {"contact_time": contact_time, "stiffness": stiffness}
    kernel = None
    if not inflated and COLLIDE.pays(n * SECONDS_OF_COLLIDE):
        from kickdyn.impact.collide_kernel import ContactKernel  # imports numba

        kernel = ContactKernel.of(leg, torques)
    if kernel is not None:
        for start in range(0, n, CHUNK):
            rows = slice(start, min(start + CHUNK, n))
            bodies = balls[rows] if len(balls) > 1 else balls, contact_rows.part(rows)
            motion = angles[rows], speeds[rows], velocity[rows], spin[rows]
            remaining[rows] = _collide(kernel, collisions, rows, motion, bodies, options, tol)

    def single(i: int) -> tuple[Any, ...]:
        one = collide(
            leg.posture(angles[i]), speeds[i], balls[i % len(balls)], contacts[i % len(contacts)],
            torque=torques, ball_velocity=velocity[i], ball_spin=spin[i], tol=tol, **options,
        )  # fmt: skip
        after, sticks = one.ball_after, one._motion.sticks
        return (
            one.impulse, after.velocity, after.spin, after.position, one.q_after, one.v_after,
            one.contact_time, one.deflection, one.approach_speed, one.energy_lost,
            one.energy_residual, StrikeStatus.of_points(sticks).flag,
        )  # fmt: skip

    fill_rows(collisions, remaining, single)
    return replace(collisions, warnings=unit_warnings(leg, angles, balls))


def _collide(
    kernel: "ContactKernel", collisions: Collisions, rows: slice, motion: tuple[Array, ...],
    bodies: tuple[list[Ball], ContactRows], options: dict[str, Any], tol: float,
) -> NDArray[np.bool_]:  # fmt: skip
    """Write rows of results; return which of them are left to `collide`."""
    from kickdyn.impact import collide_kernel as code

    (q, v, velocity, spin), (balls, contacts), nv = motion, bodies, kernel.leg.nv
    n, senses = len(q), kernel.senses
    # all is relative to the base, which does not turn
    base = np.zeros(3) if kernel.leg.base_velocity is None else kernel.leg.base_velocity[:3]
    velocity = velocity - base
    (lanes,), angles = blank_records(LANE, 1, n), (senses * q).T
    lanes.axes[:] = contact_frames(contacts.normal).reshape(-1, 9).T
    lanes.arm[:] = kernel.foot_axes.T @ contacts.levers(kernel.leg).T
    lanes.inverse_mass[:] = [1.0 / ball.mass for ball in balls]
    lanes.inverse_inertia[:] = [1.0 / ball.inertia for ball in balls]
    lanes.radius[:] = [ball.radius for ball in balls]
    lanes.friction[:] = contacts.friction
    still, nothing = np.zeros((n, nv)), np.zeros((n, 3))
    columns = np.hstack([still, senses * v, nothing, velocity, spin, np.zeros((n, 2))]).T
    mobility, inertia, sound = kernel.begin(lanes, angles, columns)
    speed, mass = -lanes.sliding[2], 1.0 / (mobility + lanes.inverse_mass)
    parting = sound & (speed < -code.LEAST_SPEED) & (speed > -FASTEST)
    ready = sound & (speed > code.LEAST_SPEED)
    with np.errstate(all="ignore"):
        stiffness, exponent, restitution, time = _spring(speed, mass, bodies, options, ready)
        ready &= (restitution >= 0.01) & np.isfinite(stiffness) & (time >= code.LEAST_TIME)
        set_lanes(
            lanes, speed, mass, lanes.sliding[:2], (stiffness, exponent, restitution, time),
            np.abs(spin).max(axis=1), tol,
        )  # fmt: skip
        fast = np.sqrt(2.0 * lanes.energy / inertia)
    chosen = np.flatnonzero(ready)
    for name, field in vars(lanes).items():
        setattr(lanes, name, field[..., chosen])
    table = angles[:, chosen], fast[:, chosen], columns[:, chosen]
    answer = kernel.run(COLLIDE(), lanes, table, tol, np.empty((0, 0)))
    fallen = answer[1][:, None] * np.array(kernel.leg.model.gravity.linear)
    with np.errstate(all="ignore"):
        gained = answer[code.RESULT + 2 * nv + 3 :][:3].T - velocity[chosen] - fallen
        size = length(gained) / lanes.inverse_mass
        tolerance_factor = light_contact_factor(lanes, size, mass[chosen], answer[2], tol)
    again = np.flatnonzero(tolerance_factor < lanes.tolerance_factor)
    if again.size:
        lanes.tolerance_factor = tolerance_factor
        few = SimpleNamespace(**{name: field[..., again] for name, field in vars(lanes).items()})
        rows_again = tuple(field[:, again] for field in table)
        answer[:, again] = kernel.run(COLLIDE(), few, rows_again, tol, np.empty((0, 0)))
    exact = (answer[0] < code.DOUBTFUL) & np.isfinite(answer).all(axis=0)
    failed, chosen = chosen[answer[0] == code.PRESSED_THROUGH], chosen[exact]
    answer, place = answer[:, exact], np.arange(rows.start, rows.stop)[chosen]
    column = answer[code.RESULT :]
    change, speeds, ball = column[:nv].T, column[nv : 2 * nv].T, column[2 * nv :]
    fallen = answer[1][:, None] * np.array(kernel.leg.model.gravity.linear)
    position = kernel.first_joint + (lanes.centre[:, exact] + ball[:3]).T
    position += answer[1][:, None] * base
    after = ball[3:6].T
    put_rows(
        collisions, place,
        (after - velocity[chosen] - fallen) / lanes.inverse_mass[exact][:, None], after + base,
        ball[6:9].T, position, q[chosen] + senses * change, senses * speeds, answer[1], answer[2],
        speed[chosen], ball[9], np.abs(answer[3]) / np.maximum(lanes.energy[exact], ball[9]),
        np.where(answer[0] == code.PARTED_STICKING, StrikeStatus.STICKS.flag,
                 StrikeStatus.SLIPS.flag),
    )  # fmt: skip
    collisions.status[rows][parting] = StrikeStatus.NO_IMPACT.flag
    remaining: NDArray[np.bool_] = ~parting
    remaining[failed] = remaining[chosen] = False
    return remaining


def _spring(
    speed: Array, mass: Array, bodies: tuple[list[Ball], ContactRows], options: dict[str, Any],
    ready: NDArray[np.bool_],
) -> tuple[Any, float, Array, Any]:  # fmt: skip
    (balls, contacts), n = bodies, len(speed)
    restitution = contacts.restitution * np.ones(n)
    for i in np.flatnonzero(ready & np.isnan(restitution)).tolist():
        contact = contacts[i % len(contacts)]
        restitution[i] = restitution_at(contact.restitution, float(speed[i]))
    given = options["contact_time"], options["stiffness"]
    pressed = [ball.stiffness for ball in balls] if given[1] == "pressure" else [0.0]
    k, exponent, time = chosen_spring(given, np.array(pressed), mass, speed, restitution)
    return k, exponent, restitution, time
