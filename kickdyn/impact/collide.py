"""The strike through a compliant contact: leg and ball integrated while they touch."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property, partial
from inspect import signature
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import OdeSolution
from scipy.optimize import minimize_scalar

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.core.vectors import largest
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.approach import AT_REST, Approach, find_approach
from kickdyn.impact.compliant_contact import CompliantContact, Torque
from kickdyn.impact.force_model import (
    HERTZ,
    LINEAR,
    SHORTEST_CONTACT,
    Dissipation,
    ForceModel,
    contact_stiffness,
    expected_contact_time,
    integrate_until,
    make_force_model,
)
from kickdyn.impact.leg_response import leg_response
from kickdyn.restitution import range_warnings
from kickdyn.robot.leg import Leg, Posture

PRESSURE_RANGE = 0.4
"""Deflection over radius up to which `Ball.stiffness` neglects at most 10 %, at 80 kPa."""

CONTACT_TIME = 0.010
"""[s] for which the force acts. With it, the visible contact takes 12.9 ms at e = 0.7; 9 to 14 ms
were seen in soccer, Australian football and rugby league (review in Ball, Ingleton, Peacock &
Nunome, Ball impact dynamics in the punt kick, ISBS 2013)."""

MAX_CONTACT_TIMES = 50.0
"""Expected contact times after which foot and ball count as not separating."""

Sample = Callable[[float], tuple[Array, Array, float]]


class _Motion(NamedTuple):
    """The integrated contact.

    Attributes:
        sol: column at a time.
        times: of the steps, shape `(n,)` [s].
        last: column at separation.
        begins: times at which a phase of compression or of restitution begins [s].
        largest: deflection before each phase, 0 while it grows [m].
    """

    sol: OdeSolution
    times: Array
    last: Array
    begins: list[float]
    largest: list[float]


class ContactSample(NamedTuple):
    """The contact at one time or many.

    Attributes:
        force: force on the ball, shape `(3,)` or `(n, 3)` [N, world frame].
        impulse: impulse on the ball so far, same shape [N s, world frame].
        deflection: deflection of ball and foot together, a number or shape `(n,)` [m].
    """

    force: Array
    impulse: Array
    deflection: Array


@dataclass(frozen=True, eq=False, repr=False)
class Collision(ReprMixin):
    """The result of a contact of finite stiffness, from first contact to separation.

    Attributes:
        leg, ball, contact: the leg, the ball and the contact of the call.
        approach_speed: speed of the foot towards the ball along the normal at first contact [m/s].
        restitution: coefficient e of the contact at that speed.
        force_model: stiffness and dissipation of the contact.
        impulse: impulse on the ball, shape `(3,)` [N s, world frame].
        contact_time: time for which the force acts, from first contact to separation [s].
        visible_contact_time: time for which foot and ball seem to touch [s]. The hysteretic spring
            of `walton-braun` ends with the ball still flattened by :math:`d_0`. A ball that regains
            its shape as fast as it leaves the foot, at the speed w of separation, touches it
            without a force for :math:`d_0 / w` longer:

            .. math:: T_v = T + d_0 / w .

            This is what high-speed video shows, where the ball is accelerated for about three
            fourths of the contact only (Nunome, Shinkai & Ikegami, ISBS 2012). It is the longest
            contact that the model allows: a ball that recovers later leaves the foot earlier. Of
            `hunt-crossley`, whose :math:`d_0` is 0, both times are the same.
        peak_force: largest contact force, friction included [N].
        deflection: largest deflection, of ball and foot together [m].
        foot_displacement: displacement of the contact frame in that time, shape `(3,)`
            [m, world frame].
        energy_lost: energy lost to damping and friction [J].
        ball_before, ball_after: the ball at first contact and at separation; times count from first
            contact.
        q_before, q_after: configuration at first contact and at separation, shape `(nq,)`
            [rad; m for prismatic joints].
        v_before, v_after: joint velocity at first contact and at separation, shape `(nv,)`
            [rad/s; m/s for prismatic joints].
        energy_residual: energy not accounted for, relative to the kinetic energy of the approach
            along the normal.
        evaluations: number of evaluations of the equations of motion.
        tol: relative tolerance of the integrator.
    """

    leg: Leg
    ball: Ball
    contact: Contact
    approach_speed: float
    restitution: float
    force_model: ForceModel
    impulse: Array
    contact_time: float
    visible_contact_time: float
    peak_force: float
    deflection: float
    foot_displacement: Array
    energy_lost: float
    ball_before: BallState
    ball_after: BallState
    q_before: Array
    q_after: Array
    v_before: Array
    v_after: Array
    energy_residual: float
    evaluations: int
    tol: float
    _sample: Sample = field(repr=False)
    _integrate_joints: Callable[[], Array] = field(repr=False)
    _again: "partial[Collision]" = field(repr=False)

    def _rows(self) -> Iterable[Row]:
        """Return what `print` shows: each quantity with its value and unit."""
        yield "contact time", 1e3 * self.contact_time, "ms"
        yield "visible contact time", 1e3 * self.visible_contact_time, "ms"
        yield "peak force", self.peak_force, "N"
        yield "deflection", 1e3 * self.deflection, "mm"
        yield "impulse on the ball", self.impulse, "N s"
        yield "ball after", self.ball_after.velocity, "m/s"
        yield "spin after", self.ball_after.spin, "rad/s"
        yield "energy lost", self.energy_lost, "J"
        yield "energy residual", self.energy_residual, ""
        yield from warned(self.warnings)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line for each joint outside its range, or faster before the impact than its limit.

        Further lines say so where the restitution is used outside its table, and where a ball whose
        stiffness is that of its pressure is flattened beyond the range of `Ball.stiffness`.
        """
        flat: tuple[str, ...] = ()
        share = self.deflection / self.ball.radius
        if self.force_model.exponent == LINEAR and share > PRESSURE_RANGE:
            flat = (
                f"the ball is flattened by {share:.2f} of its radius: its pressure gives the "
                f"stiffness within 10 % up to {PRESSURE_RANGE:g}",
            )
        return (
            *self.leg.outside_range(self.q_before),
            *self.leg.too_fast(self.v_before),
            *range_warnings(self.contact.restitution, self.approach_speed),
            *flat,
        )

    def __reduce__(self) -> "tuple[partial[Collision], tuple[()]]":
        """Pickle the arguments; unpickled, the collision runs again, to the same digits."""
        return (partial(self._again, tol=self.tol), ())

    @cached_property
    def error(self) -> float:
        """Estimate of the numerical error of the impulse [N s].

        It is twice the change of the impulse when the tolerance is 100 times tighter, and never
        less than `tol` times the impulse. It takes this second run when it is first read. Errors of
        the model are not part of it.
        """
        tighter = self._again(tol=max(self.tol * 1e-2, 1e-13))
        size = math.hypot(*self.impulse)
        return max(2.0 * math.hypot(*(tighter.impulse - self.impulse)), max(self.tol, 1e-12) * size)

    @cached_property
    def joint_impulses(self) -> Array:
        """Impulse of the contact force in each joint, shape `(njoints, 6)` [N s, N m s].

        Each row has the linear, then the angular impulse of the joint's parent on its child, about
        the joint's origin and in the joint's frame, which turns meanwhile; rows are in the order of
        `leg.joint_names`. It is the integral over time of what the contact force adds to the force
        in the joint, and tends to `Impact.joint_impulses` for short contacts. Weight, torques and
        the motion of the leg need further forces. It is computed when first read.
        """
        impulses = self._integrate_joints()
        impulses.setflags(write=False)
        return impulses

    def sample(self, t: ArrayLike) -> ContactSample:
        """Return the contact at one time or many.

        Args:
            t: time since first contact, 0 to `contact_time`, a number or shape `(n,)` [s].

        Raises:
            InvalidInput: a time outside the contact, or more than one dimension.
        """
        times = validation.times(t, self.contact_time, "the contact")
        found = [self._sample(float(at)) for at in times.flat]
        force, impulse, deflection = (np.array([one[i] for one in found]) for i in range(3))
        shape = (*times.shape, 3)
        return ContactSample(
            force.reshape(shape), impulse.reshape(shape), deflection.reshape(times.shape)
        )


@validation.check_arguments
def collide(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    *,
    contact_time: float | None = None,
    stiffness: float | Literal["pressure"] | None = None,
    dissipation: str = Dissipation.WALTON_BRAUN,
    torque: ArrayLike | Torque | None = None,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    tol: float = 1e-9,
) -> Collision:
    """Strike a ball through a contact of finite stiffness, to the first separation.

    The leg moves meanwhile, under gravity, joint torques, centrifugal and Coriolis forces; supports
    stay at rest and loops stay closed. The foot is a plane through its contact point that rotates
    with it, and the ball is a rigid body behind a spring. The force of `ForceModel` acts along the
    normal of the plane through the centre of the ball, and Coulomb's friction across it, against
    the sliding. For growing stiffness the result with the
    dissipation `walton-braun` tends to that of `strike`, law `stronge`, whose restitution it has.
    With `hunt-crossley` it tends to the law `newton` if the contact slips in one direction
    throughout; if it sticks, only if friction does not change the normal velocity (a leg without
    coupling).

    Args:
        posture: posture of the leg at first contact, whose contact frame touches the ball.
        v: joint velocity at first contact, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: the ball; its centre is at `contact point + radius * normal` at first contact.
        contact: normal at first contact, restitution of 0.01 or more at the speed of approach,
            friction and offset. Points that stick creep, at about a thousandth of the approach
            speed.
        contact_time: duration of the contact for which the stiffness is chosen [s]. The contact
            lasts exactly so long if effective masses are constant and no other force acts. It is 10
            ms where neither this nor `stiffness` is given.
        stiffness: stiffness of a Hertz contact [N/m^1.5], in place of `contact_time`; or
            `"pressure"`, the linear spring of an inflated ball, `Ball.stiffness`, which has no
            fitted value.
        dissipation: `walton-braun` or `hunt-crossley`, see `ForceModel`. With both, the restitution
            is exact if effective masses are constant and no other force acts.
        torque: torques at the joints, shape `(nv,)` [N m; N for prismatic joints]: constant, or a
            function of the time since first contact, q and v. None is 0.
        ball_velocity: velocity of its centre at first contact, shape `(3,)` [m/s, world frame].
        ball_spin: angular velocity at first contact, shape `(3,)` [rad/s, world frame].
        tol: relative tolerance of the integrator, 1e-13 to 1e-3; above 1e-6 the energy lost is less
            exact than `error` says of the impulse.

    Raises:
        NoImpact: foot and ball do not approach each other along the normal.
        InvalidInput: a wrong shape, a value outside its range, both contact_time and stiffness, a
            ball of unknown pressure, or a velocity that moves a support or opens a loop.
        KickdynError: foot and ball do not separate, or the integrator failed.

    Example:
        >>> import kickdyn as kd
        >>> posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
        >>> contact = kd.Contact(normal=(2, 0, 1), restitution=0.8, friction=0.4)
        >>> collision = kd.collide(posture, [6.6, -14.5, 6.6], kd.Ball(), contact)
        >>> round(collision.peak_force)  # [N]
        1360
    """
    validation.number("tol", tol, at_least=1e-13, at_most=1e-3)
    torque = _checked_torque(torque, posture.leg.nv)
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin)
    ball.check_movable("a contact that takes time")
    far = max(largest(posture.contact_point), largest(posture.contact_lever))
    validation.number("ball radius", ball.radius, at_least=1e-12 * far, unit="m")  # else rounding
    # Below a micrometre per second gravity, not the impact, decides the motion.
    validation.number("approach speed", approach.speed, at_least=1e-6, unit="m/s")
    mass = approach.reduced_mass()
    kind = validation.choice("dissipation", dissipation, Dissipation)
    k, exponent = _stiffness(approach, mass, contact_time, stiffness, kind)
    model = make_force_model(k, exponent, approach.speed, approach.restitution, kind)
    expected = duration(approach, contact_time, stiffness, kind)
    contact_motion = CompliantContact(approach, model, torque, expected)
    again = partial(
        collide, posture, approach.v, ball, contact, torque=torque, dissipation=kind,
        stiffness=stiffness if exponent == LINEAR else k,
        ball_velocity=approach.ball_before.velocity, ball_spin=approach.ball_before.spin,
    )  # fmt: skip
    motion = _integrate(contact_motion, mass, tol)
    return _result(contact_motion, mass, motion, tol, again)


def duration(
    approach: Approach,
    contact_time: float | None,
    stiffness: float | str | None,
    dissipation: Dissipation,
) -> float:
    """Return for how long the force of `collide` acts between the two masses alone [s]."""
    mass, e = approach.reduced_mass(), approach.restitution
    k, exponent = _stiffness(approach, mass, contact_time, stiffness, dissipation)
    expected = expected_contact_time(k, mass, approach.speed, e, dissipation, exponent)
    return validation.number("contact time", expected, at_least=SHORTEST_CONTACT, unit="s")


def _checked_torque(torque: ArrayLike | Torque | None, nv: int) -> Array | Torque:
    """Return a torque function of three values, or a copy of constant torques; else raise."""
    if torque is None:
        return np.zeros(nv)
    if not callable(torque):
        return validation.vector("torque", torque, nv, unit="N m")
    try:
        signature(torque).bind(0.0, torque, torque)
    except TypeError:
        raise InvalidInput(f"torque is {torque!r}: it must take three values, t, q, v") from None
    except ValueError:  # functions written in C have no signature
        pass
    return torque


def _stiffness(
    approach: Approach,
    mass: float,
    contact_time: float | None,
    stiffness: float | str | None,
    dissipation: Dissipation,
) -> tuple[float, float]:
    """Return stiffness [N/m^n] and exponent n; a contact time is that of the two masses alone."""
    given = checked_stiffness(approach.ball, contact_time, stiffness)
    if isinstance(given, str):
        return approach.ball.stiffness, LINEAR
    if given is None:
        time = CONTACT_TIME if contact_time is None else contact_time
        given = contact_stiffness(time, mass, approach.speed, approach.restitution, dissipation)
    return given, HERTZ


def checked_stiffness(
    ball: Ball, contact_time: float | None, stiffness: float | str | None
) -> float | str | None:
    """Return a stiffness from outside, which a contact time excludes; else raise."""
    if contact_time is not None and stiffness is not None:
        raise InvalidInput(
            f"contact_time is {contact_time!r} and stiffness {stiffness!r}: give only one of them"
        )
    if isinstance(stiffness, str):
        if stiffness != "pressure":
            raise InvalidInput(
                f"stiffness is {stiffness!r}: it must be a number [N/m^1.5] or 'pressure'"
            )
        _ = ball.stiffness  # raises where the pressure is unknown
        return stiffness
    if stiffness is None:
        return None
    return validation.number("stiffness", stiffness, above=0, unit="N/m^1.5")


def _integrate(contact: CompliantContact, mass: float, tol: float) -> _Motion:
    """Return the motion from first contact to separation, or raise `KickdynError`.

    A contact with hysteresis is cut where compression ends, and where the deflection outgrows the
    largest one before, so that the force is smooth in every phase.
    """
    model, expected, radius = contact.force_model, contact.expected, contact.ball.radius
    limit, atol = MAX_CONTACT_TIMES * expected, tol * contact.scales(mass)
    parts: list[Any] = []
    begins, of_phases = [], []
    t, y, largest, touching = 0.0, contact.start(), 0.0, True
    while touching:
        event: Any = contact.compression_ends
        if model.restitution == 1.0 or largest > 0.0:
            event = partial(contact.restitution_ends, largest=largest)
        rates = partial(contact.rates, largest=largest)
        with np.errstate(over="ignore", invalid="ignore"):  # reported below
            part = integrate_until(event, rates, y, limit, tol, atol, expected / 20.0, t)
        if not part.success or not np.isfinite(part.y[:, -1]).all():
            raise KickdynError(f"the integrator failed at {part.t[-1]:g} s: {part.message}")
        if part.status != 1:
            raise KickdynError(
                f"foot and ball are still in contact after {limit:g} s, {MAX_CONTACT_TIMES:g} "
                "times the time that the two alone would take"
            )
        parts.append(part)
        begins.append(t)
        of_phases.append(largest)
        t, y = float(part.t[-1]), part.y[:, -1]
        deflection = contact.deflection(y)
        apart = deflection - model.separation(largest) < largest - deflection
        touching = model.restitution < 1.0 and not apart and deflection < radius * (1.0 - 1e-9)
        largest = 0.0 if largest else deflection
    times = np.concatenate([[0.0], *(part.t[1:] for part in parts)])
    stuck = times[1:][np.diff(times) <= 0.0]
    if stuck.size:
        raise KickdynError(
            f"the integrator failed at {stuck[0]:g} s: at an approach speed of "
            f"{contact.approach.speed:.3g} m/s gravity or a torque, not the impact, decides the "
            "motion"
        )
    sol = OdeSolution(times, [one for part in parts for one in part.sol.interpolants])
    return _Motion(sol, times, y, begins, of_phases)


def _result(
    motion: CompliantContact, mass: float, solution: _Motion, tol: float, again: Any
) -> Collision:
    """Return the collision of an integrated motion, which `again` computes anew at another tol."""
    approach = motion.approach
    posture, ball, contact, before = (
        approach.posture, approach.ball, approach.contact, approach.ball_before,
    )  # fmt: skip
    start, end, last = motion.start(), float(solution.times[-1]), solution.last

    def sample(t: float) -> tuple[Array, Array, float]:
        """Return the contact's quantities at a time [s]."""
        largest = solution.largest[bisect_right(solution.begins, t) - 1]
        return motion.contact_at(t, solution.sol(t), largest)

    def integrate_joints() -> Array:
        """Return the impulses of the joints, by Gauss's rule in each step of the integrator."""
        leg = posture.leg
        frame = leg.model.frames[leg.frame_id].placement
        nodes, weights = np.polynomial.legendre.leggauss(3)
        total = np.zeros((leg.model.njoints - 1, 6))
        for begin, length in zip(solution.times, np.diff(solution.times), strict=False):
            for node, weight in zip(nodes, weights, strict=True):
                t = begin + 0.5 * length * (1.0 + node)
                y = solution.sol(t)
                force, _, _ = sample(t)
                state = motion.state(y)
                at = leg.posture(state.q)
                lever = at.rotation_world_joint.T @ motion.kinematics(state).point
                moved = at.with_contact_offset(frame.actInv(lever))
                part = leg_response(moved, state.v, 0.5 * length * weight * force)
                total += part.joint_impulses
        return total

    peak_force, deflection = _peaks(sample, solution.times)
    if deflection >= ball.radius * (1.0 - 1e-9):
        pressed = f"too low, the ball would be pressed beyond its radius of {ball.radius:g} m"
        if motion.force_model.exponent == LINEAR:
            raise InvalidInput(f"ball pressure is {ball.pressure:g} Pa: {pressed}")
        raise InvalidInput(
            f"stiffness is {motion.force_model.stiffness:g} N/m^1.5: {pressed}; a shorter contact "
            "time makes it stiffer"
        )
    state = motion.state(last)
    left = motion.energy(last, solution.largest[-1])
    energies = motion.energy(start, 0.0) + state.work - state.lost - left
    foot = motion.foot_at(state) - posture.contact_point
    impulse = motion.impulse(end, last)
    apart = motion.kinematics(state)
    flattened = max(apart.deflection, 0.0) if motion.force_model.restitution < 1.0 else 0.0
    for array in (impulse, state.q, state.v, foot):
        array.setflags(write=False)
    return Collision(
        leg=posture.leg,
        ball=ball,
        contact=contact,
        approach_speed=approach.speed,
        restitution=approach.restitution,
        force_model=motion.force_model,
        impulse=impulse,
        contact_time=end,
        visible_contact_time=end + flattened / -apart.rate if flattened else end,
        peak_force=peak_force,
        deflection=deflection,
        foot_displacement=foot,
        energy_lost=state.lost,
        ball_before=before,
        ball_after=BallState(before.position + state.moved, state.velocity, state.spin, end),
        q_before=posture.q,
        q_after=state.q,
        v_before=approach.v,
        v_after=state.v,
        energy_residual=abs(energies) / (0.5 * mass * approach.speed**2),
        evaluations=motion.evaluations,
        tol=tol,
        _sample=sample,
        _integrate_joints=integrate_joints,
        _again=again,
    )


def _peaks(sample: Sample, steps: Array) -> tuple[float, float]:
    """Return the largest force [N] and deflection [m]: best of the integrator's steps, refined."""
    found = [sample(float(t)) for t in steps]
    peaks = []
    for read in (lambda one: math.hypot(*one[0]), lambda one: one[2]):
        best = int(np.argmax([read(one) for one in found]))
        bounds = steps[max(best - 1, 0)], steps[min(best + 1, len(steps) - 1)]
        refined = minimize_scalar(
            lambda t, read=read: -read(sample(float(t))), bounds=bounds, method="bounded",
            options={"xatol": 1e-6 * float(steps[-1])},
        )  # fmt: skip
        peaks.append(max(-float(refined.fun), read(found[best])))
    return peaks[0], peaks[1]
