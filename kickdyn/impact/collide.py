"""The strike that takes its time: leg and ball integrated through a contact that gives way."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.approach import AT_REST, approach
from kickdyn.impact.compliant_contact import CompliantContact
from kickdyn.impact.constraint_impulses import check_free
from kickdyn.impact.hertz import (
    BRIEFEST,
    HertzContact,
    contact_stiffness,
    expected_contact_time,
    matched_damping,
    until,
)
from kickdyn.impact.joint_torque import Torque, acting, check_pickles, own_torque
from kickdyn.robot.leg import Leg, Posture

CONTACT_TIME = 0.010
"""[s]. 9 to 14 ms were measured in soccer, Australian football and rugby league (review in Ball,
Ingleton, Peacock & Nunome, Ball impact dynamics in the punt kick, ISBS 2013)."""

PATIENCE = 50.0
"""Expected contact times after which a leg that does not let go of the ball is given up."""

SLOWEST = 1e-6
"""Approach speed below which gravity decides and not the impact [m/s]."""

Sample = Callable[[float], tuple[Array, Array, float]]


class ContactSample(NamedTuple):
    """The contact at one time or many.

    Attributes:
        force: on the ball, shape `(3,)` or `(n, 3)` [N, world frame].
        impulse: on the ball so far, same shape [N s].
        deflection: of ball and foot together, a number or shape `(n,)` [m].
    """

    force: Array
    impulse: Array
    deflection: Array


@dataclass(frozen=True, eq=False, repr=False)
class Collision(ReprMixin):
    """What a contact of finite stiffness does, from touch to separation.

    Attributes:
        leg, ball, contact: what met.
        hertz: stiffness and damping.
        impulse: on the ball, shape `(3,)` [N s, world frame].
        contact_time: from touch to separation [s].
        peak_force: largest contact force, friction included [N].
        deflection: largest, of ball and foot together [m].
        foot_displacement: of the contact frame meanwhile, shape `(3,)` [m, world frame].
        energy_lost: to damping and friction [J].
        ball_before, ball_after: at touch and at separation; times count from the touch.
        q_before, q_after: shape `(nq,)` [rad].
        v_before, v_after: shape `(nv,)` [rad/s].
        energy_residual: energy that is unaccounted for, relative to what the two bring into the
            contact along the normal.
        evaluations: of the equations of motion.
        tol: relative tolerance of the integrator.
    """

    leg: Leg
    ball: Ball
    contact: Contact
    hertz: HertzContact
    impulse: Array
    contact_time: float
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
    _again: partial[Collision] = field(repr=False)

    def _rows(self) -> Iterable[Row]:
        yield "contact time", 1e3 * self.contact_time, "ms"
        yield "peak force", self.peak_force, "N"
        yield "deflection", 1e3 * self.deflection, "mm"
        yield "impulse on the ball", self.impulse, "N s"
        yield "ball after", self.ball_after.velocity, "m/s"
        yield "spin after", self.ball_after.spin, "rad/s"
        yield "energy lost", self.energy_lost, "J"
        yield "energy residual", self.energy_residual, ""
        yield from warned(
            [*self.leg.outside_range(self.q_before), *self.leg.too_fast(self.v_before)]
        )

    def __reduce__(self) -> tuple[partial[Collision], tuple[()]]:
        """Pickle what it was asked; unpickled, it runs again, to the same digits."""
        check_pickles(self._again.keywords["torque"])
        return (partial(self._again, tol=self.tol), ())

    def __copy__(self) -> Collision:
        """Return itself, for it does not change."""
        return self

    def __deepcopy__(self, memo: dict[int, object]) -> Collision:
        """Return itself."""
        return self

    @cached_property
    def error(self) -> float:
        """Estimate of the impulse's error [N s]: twice what a 100 times tighter run changes.

        Never less than the tolerance's share of it; computed when asked for, by that run. What the
        model leaves out is not in it.
        """
        finer = self._again(tol=max(self.tol * 1e-2, 1e-13))
        size = math.hypot(*self.impulse)
        return max(2.0 * math.hypot(*(finer.impulse - self.impulse)), max(self.tol, 1e-12) * size)

    def sample(self, t: ArrayLike) -> ContactSample:
        """Return the contact at one time or many.

        Args:
            t: since the touch, 0 to `contact_time`, a number or shape `(n,)` [s].

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


def collide(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    *,
    contact_time: float | None = None,
    stiffness: float | None = None,
    torque: ArrayLike | Torque | None = None,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    tol: float = 1e-9,
) -> Collision:
    """Strike a ball through a Hertz contact, to the first separation.

    The leg moves meanwhile, under gravity, joint torques, centrifugal and Coriolis forces. The foot
    is a plane through its contact point that turns with it, the ball a rigid body behind a spring;
    the force acts along the plane's normal through the ball's centre, and Coulomb's friction across
    it, against the sliding. For growing stiffness this tends to `strike`, law `newton`, where the
    contact slips one way all along; where it comes to stick, only if friction does not change the
    normal velocity (a leg without coupling), for damping is no law of Newton's then.

    Args:
        posture: of the leg at touch, whose contact frame touches the ball.
        v: joint velocity at touch, shape `(nv,)` [rad/s].
        ball: its centre is at `hertz point + radius * normal` at touch.
        contact: normal at touch, restitution 0.01 or more, and friction. What sticks creeps, at
            about a thousandth of the approach speed.
        contact_time: for which the stiffness is chosen, exactly so where effective masses are
            constant and nothing else acts [s]; `CONTACT_TIME`, 10 ms, when neither is named.
        stiffness: [N/m^1.5], in place of it.
        torque: at the joints, shape `(nv,)` [N m; N], constant or a function of time since touch,
            q and v; 0 when not named.
        ball_velocity: of its centre at touch, shape `(3,)` [m/s, world frame].
        ball_spin: at touch, shape `(3,)` [rad/s, world frame].
        tol: relative tolerance of the motion, 1e-13 to 1e-3; above 1e-6 the energy lost is less
            exact than `error` says of the impulse.

    Raises:
        NoImpact: foot and ball do not approach each other along the normal.
        InvalidInput: a wrong shape, a value outside its range, both contact_time and stiffness,
            or a leg that supports or loops hold.
        KickdynError: foot and ball do not separate, or the integrator gave up.
    """
    validation.number("tol", tol, at_least=1e-13, at_most=1e-3)
    validation.check_type(Posture, posture=posture)
    leg = posture.leg
    check_free(leg, "a contact that takes time is")
    torque = own_torque(torque, leg.nv)
    met = approach(posture, v, ball, contact, ball_velocity, ball_spin)
    posture, v, _, before, speed = met
    validation.number("approach speed", speed, at_least=SLOWEST, unit="m/s")
    mass = 1.0 / (1.0 / posture.mass_along(contact.normal) + 1.0 / ball.mass)
    hertz = _contact(contact_time, stiffness, mass, speed, contact.restitution)
    expected = expected_contact_time(hertz.stiffness, mass, speed, contact.restitution)

    validation.number("contact time", expected, at_least=BRIEFEST, unit="s")

    squeeze = CompliantContact(posture, ball, contact, hertz, before, speed, acting(torque, leg.nv))
    start = squeeze.start(v)
    scale = squeeze.scales(start, expected, speed, mass)
    step, limit = expected / 20.0, PATIENCE * expected
    with np.errstate(over="ignore", invalid="ignore"):  # said below
        found = until(squeeze.gap, squeeze.rates, start, limit, tol, tol * scale, step)
    if not found.success or not np.isfinite(found.y[:, -1]).all():
        raise KickdynError(f"the integrator gave up at {found.t[-1]:g} s: {found.message}")
    if found.status != 1:
        raise KickdynError(
            f"foot and ball are still in contact after {limit:g} s, {PATIENCE:g} times the time "
            "that the two alone would take"
        )
    end, last = float(found.t[-1]), found.y[:, -1]

    def sample(t: float) -> tuple[Array, Array, float]:
        return squeeze.contact_at(t, found.sol(t))

    peak_force, deflection = _peaks(sample, found.t)
    if deflection >= ball.radius * (1.0 - 1e-9):
        raise InvalidInput(
            f"stiffness is {hertz.stiffness:g} N/m^1.5: too low, the ball would be pressed by "
            f"{deflection:g} m, beyond its radius of {ball.radius:g} m"
        )
    again = partial(
        collide, posture, v, ball, contact, stiffness=hertz.stiffness, torque=torque,
        ball_velocity=before.velocity, ball_spin=before.spin,
    )  # fmt: skip

    state = squeeze.state(last)
    energies = squeeze.energy(start) + state.work - state.lost - squeeze.energy(last)
    after = BallState(before.position + state.moved, state.velocity, state.spin, end)
    foot = squeeze.foot_at(state) - posture.contact_point
    impulse = squeeze.impulse(end, last)
    for array in (impulse, v, state.q, state.v, foot):
        array.setflags(write=False)
    return Collision(
        leg=leg,
        ball=ball,
        contact=contact,
        hertz=hertz,
        impulse=impulse,
        contact_time=end,
        peak_force=peak_force,
        deflection=deflection,
        foot_displacement=foot,
        energy_lost=state.lost,
        ball_before=before,
        ball_after=after,
        q_before=posture.q,
        q_after=state.q,
        v_before=v,
        v_after=state.v,
        energy_residual=abs(energies) / (0.5 * mass * speed**2),
        evaluations=int(found.nfev),
        tol=tol,
        _sample=sample,
        _again=again,
    )


def _contact(
    contact_time: float | None, stiffness: float | None, mass: float, speed: float, e: float
) -> HertzContact:
    if contact_time is not None and stiffness is not None:
        raise InvalidInput(
            f"contact_time is {contact_time!r} and stiffness {stiffness!r}: name one of them"
        )
    damping = matched_damping(e) / speed
    if stiffness is not None:
        return HertzContact(
            validation.number("stiffness", stiffness, above=0, unit="N/m^1.5"), damping
        )
    time = CONTACT_TIME if contact_time is None else contact_time
    return HertzContact(contact_stiffness(time, mass, speed, e), damping)


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
