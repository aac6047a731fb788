"""The strike through a compliant contact: leg and ball integrated while they touch."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from inspect import signature
from typing import Literal, NamedTuple

import numpy as np

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.compilation import MachineCode, Source
from kickdyn.core.representation import Row, warned
from kickdyn.core.validation import Array, ArrayLike, read_only
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.impact.approach import AT_REST, AfterApproach, Approach, find_approach
from kickdyn.impact.compliant_contact import (
    CompliantContact,
    IntegratedContact,
    State,
    Torque,
    integrate_contact,
)
from kickdyn.impact.contact_phases import PLACE_ROUNDING, light_contact_factor
from kickdyn.impact.force_model import (
    LINEAR,
    LONGEST_CONTACT,
    SHORTEST_CONTACT,
    ForceModel,
    InflatedForce,
    NormalForce,
    chosen_spring,
    spring_time,
)
from kickdyn.impact.leg_response import leg_response
from kickdyn.impact.patch_contact import FootPatch, PatchContact, PatchForce, patch_of
from kickdyn.restitution import LARGEST_DEFLECTION
from kickdyn.robot.leg import Posture

PRESSURE_RANGE = 0.4
"""Deflection over radius up to which `Ball.stiffness` neglects at most 10 %, at 80 kPa."""

STIFFNESSES = "pressure", "inflated"
"""Names that `collide` takes in place of a stiffness."""


class ContactSample(NamedTuple):
    """The contact at one time, or at n times with arrays of shape `(n, 3)` and `(n,)`.

    Attributes:
        force: force on the ball, shape `(3,)` [N, world frame].
        impulse: impulse on the ball so far, shape `(3,)` [N s, world frame].
        deflection: deflection of ball and foot together [m].
    """

    force: Array
    impulse: Array
    deflection: Array


@dataclass(frozen=True, eq=False, repr=False)
class Collision(AfterApproach):
    """The result of a contact of finite stiffness, from first contact to separation.

    Attributes:
        approach: leg and ball at first contact.
        tol: relative tolerance of the integrator.
    """

    approach: Approach
    tol: float
    _motion: IntegratedContact = field(repr=False)

    @cached_property
    def _end(self) -> State:
        end = self._motion.equations.state(self._motion.last)
        return end._replace(q=read_only(end.q), v=read_only(end.v))

    @property
    def force_model(self) -> NormalForce:
        """The law of the normal force: a `ForceModel`, or the `InflatedForce` of a ball."""
        return self._motion.equations.force_model

    @cached_property
    def impulse(self) -> Array:
        """Impulse on the ball, shape `(3,)` [N s, world frame]."""
        return read_only(self._motion.equations.impulse(self.contact_time, self._motion.last))

    @cached_property
    def peak_force(self) -> float:
        """Largest contact force, friction included [N]."""
        return self._motion.peak_force()

    @property
    def deflection(self) -> float:
        """Largest deflection, of ball and foot together [m].

        With a `FootPatch` it is that of a plane that presses out the same volume.
        """
        return max(float(self._motion.phases[:, 0].max()), self._left)

    @cached_property
    def flattening(self) -> float:
        """Largest distance by which the plane of the foot is inside the sphere of the ball [m].

        It is the deflection, unless a `FootPatch` presses a part of the ball only.
        """
        motion = self._motion
        if not isinstance(motion.equations, PatchContact):
            return self.deflection
        return max(map(motion.equations.flattened, motion.columns))

    @property
    def _left(self) -> float:
        """Deflection at separation [m]."""
        equations = self._motion.equations
        return equations.deflection(equations.kinematics(self._end))

    @property
    def contact_time(self) -> float:
        """Time for which the force acts, from first contact to separation [s]."""
        return float(self._motion.times[-1])

    @cached_property
    def visible_contact_time(self) -> float:
        r"""Time for which foot and ball seem to touch, :math:`T + d_0 / w` [s].

        The hysteretic spring ends with the ball still flattened by :math:`d_0`. A
        ball that regains its shape as fast as it leaves the foot, at the speed w of separation,
        touches it without a force for :math:`d_0 / w` longer. In high-speed video the ball is
        accelerated for about three fourths of the contact only (Nunome, Shinkai & Ikegami, ISBS
        2012). It is the longest contact that the model allows.
        """
        contact = self._motion.equations.kinematics(self._end)
        keeps = isinstance(self.force_model, ForceModel) and self.force_model.restitution < 1.0
        remaining = self._left if keeps else 0.0
        return self.contact_time + max(remaining, 0.0) / contact.relative[2]

    @property
    def energy_lost(self) -> float:
        """Energy lost to hysteresis and friction [J]."""
        return self._end.lost

    @cached_property
    def ball_after(self) -> BallState:
        """The ball at separation."""
        end, base = self._end, self._motion.equations.base_velocity
        position = self.ball_before.position + base * self.contact_time + end.moved
        velocity, spin = end.motion
        return BallState(position, velocity + base, spin, self.contact_time)

    @property
    def q_after(self) -> Array:
        """Configuration at separation, shape `(nq,)` [rad; m for prismatic joints]."""
        return self._end.q

    @property
    def v_after(self) -> Array:
        """Joint velocity at separation, shape `(nv,)` [rad/s; m/s for prismatic joints]."""
        return self._end.v

    @cached_property
    def energy_residual(self) -> float:
        """Energy not accounted for, over the kinetic energy of the approach, or the lost if larger.

        Where the foot grazes the ball, gravity and the leg supply more energy than the approach.
        """
        motion, end = self._motion, self._end
        before = motion.equations.energy(motion.equations.start(), 0.0) + end.work
        after = motion.equations.energy(motion.last, motion.phases[-1, 0]) + end.lost
        return abs(before - after) / max(self.approach.energy(), end.lost)

    @property
    def evaluations(self) -> int:
        """Number of evaluations of the equations of motion, without those for samples."""
        return self._motion.evaluations

    def _rows(self) -> Iterable[Row]:
        yield "contact time", 1e3 * self.contact_time, "ms"
        yield "visible contact time", 1e3 * self.visible_contact_time, "ms"
        yield "peak force", self.peak_force, "N"
        yield "deflection", 1e3 * self.deflection, "mm"
        yield "impulse on the ball", self.impulse, "N s"
        yield "ball after", self.ball_after.velocity, "m/s"
        yield "spin after", self.ball_after.spin, "rad/s"
        yield "energy lost", self.energy_lost, "J"
        for joint, number in self.posture.drive_number(self.contact_time).items():
            yield f"drive number, {joint}", number, ""
        yield "energy residual", self.energy_residual, ""
        yield from warned(self.warnings)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The lines of `Impact.warnings`, and one for a ball flattened beyond `Ball.stiffness`."""
        lines, fraction = self.approach.warnings(), self.deflection / self.ball.radius
        if isinstance(self.force_model, InflatedForce | PatchForce):
            fraction = self.flattening / self.ball.radius
            # what the force gives in place of e has a range of its own
            lines = tuple(line for line in lines if not line.startswith("restitution 'inflated'"))
            if fraction > LARGEST_DEFLECTION:
                lines += (
                    f"the ball is flattened by {fraction:.3f} of its radius at an approach speed "
                    f"of {self.approach_speed:.4g} m/s: the model 'inflated' goes up to "
                    f"{LARGEST_DEFLECTION:g}",
                )
            return lines
        assert isinstance(self.force_model, ForceModel)
        if self.force_model.exponent != LINEAR or fraction <= PRESSURE_RANGE:
            return lines
        return (
            *lines,
            f"the ball is flattened by {fraction:.2f} of its radius: its pressure gives the "
            f"stiffness within 10 % up to {PRESSURE_RANGE:g}",
        )

    @cached_property
    def error(self) -> float:
        """Estimate of the numerical error of the impulse [N s], `tol` times the impulse or more.

        It is twice the change of the impulse when the tolerance is 100 times tighter, or more where
        the deflection, or the impulse beside the momentum of the ball, is so small that it has
        fewer digits.
        """
        equations = self._motion.equations.with_tolerance(max(self.tol * 1e-2, 1e-13))
        tighter = Collision(self.approach, equations.tol, _motion_of(equations))
        size = math.hypot(*self.impulse)
        momentum = self.ball.mass * math.hypot(*self.ball_after.velocity)
        least = max(self.tol, 1e-12, PLACE_ROUNDING / self.deflection) * size
        least = max(least, 1e-15 * momentum)  # as the impulse is a difference of momenta
        return max(2.0 * math.hypot(*(tighter.impulse - self.impulse)), least)

    @cached_property
    def joint_impulses(self) -> Array:
        """Impulse of the contact force in each joint, shape `(njoints, 6)` [N s, N m s].

        It is the integral over time of what the contact force adds to the force in the joint, in
        the joint's frame, which turns meanwhile; it tends to `Impact.joint_impulses` for short
        contacts. Weight, torques and the motion of the leg need further forces.
        """
        motion, leg = self._motion, self.posture.leg
        if isinstance(motion.equations, PatchContact):
            raise InvalidInput(
                "joint impulses are computed for a force at a point, but model is 'patch': use "
                "'point'"
            )
        frame = leg.model.frames[leg.frame_id].placement
        nodes, weights = np.polynomial.legendre.leggauss(3)  # in each step
        total = np.zeros((leg.model.njoints - 1, 6))
        for begin, step in zip(motion.times, np.diff(motion.times), strict=False):
            for node, weight in zip(nodes, weights, strict=True):
                t = begin + 0.5 * step * (1.0 + node)
                state = motion.equations.state(motion.column(t))
                posture = leg.posture(state.q)
                touched = posture.with_contact_offset(frame.actInv(motion.equations.point(state)))
                impulse = 0.5 * step * weight * motion.sample(t)[0]
                total += leg_response(touched, state.v, impulse).joint_impulses
        return read_only(total)

    def sample(self, t: ArrayLike) -> ContactSample:
        """Return the contact at one time or many.

        Args:
            t: time since first contact, 0 to `contact_time`, a number or shape `(n,)` [s].

        Raises:
            InvalidInput: a time outside the contact, or more than one dimension.
        """
        times = validation.times(t, self.contact_time, "the contact")
        samples = [self._motion.sample(float(moment)) for moment in times.flat]
        force, impulse, deflection = (np.array([sample[i] for sample in samples]) for i in range(3))
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
    stiffness: float | Literal["pressure", "inflated"] | None = None,
    model: Literal["point", "patch"] | FootPatch = "point",
    torque: ArrayLike | Torque | None = None,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
    tol: float = 1e-9,
) -> Collision:
    """Strike a ball through a contact of finite stiffness, to the first separation.

    The leg moves meanwhile, under gravity, joint torques, centrifugal and Coriolis forces; supports
    stay at rest and loops stay closed. Joints have friction and position control where their
    `Drive` has. The foot is a plane through its contact point that rotates
    with it, and the ball is a rigid body behind a spring: the force of `ForceModel` along the
    normal of the plane, and Coulomb's friction across it. For growing stiffness the result tends
    to the result of `strike` with the law `stronge`.

    Fixed-base legs of hinges and slides with rigid drives, a spring and constant torques are
    computed by the machine code of `collide_many` in about 2 ms, as soon as the calls of a process
    have taken as long as it takes to load or compile it; others take some ten times as long. Both
    ways take the same steps, and agree but for rounding.

    Args:
        posture: posture of the leg at first contact, whose contact frame touches the ball.
        v: joint velocity at first contact, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: the ball; its centre is at `contact point + radius * normal` at first contact.
        contact: normal at first contact, restitution of 0.01 or more at the speed of approach,
            friction and offset.
        contact_time: duration of the contact for which the stiffness is chosen, exact for two
            masses on which no other force acts [s]; 10 ms where `stiffness` is None, too.
        stiffness: stiffness of a Hertz contact [N/m^1.5], in place of `contact_time`; or
            `"pressure"`, the linear spring of an inflated ball, `Ball.stiffness`; or `"inflated"`,
            the force that the restitution `"inflated"` is derived from, `InflatedForce`, which is
            also the default with that restitution.
        model: `"point"`; or `"patch"`, the contact of an inflated ball with a strip of the surface
            that the leg kicks with (`kick_with`), or with a `FootPatch`, without a contact time or
            a stiffness: friction with grip and slip, and edges of the foot.
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
    twist = posture.leg.base_velocity
    if twist is not None and twist[3:].any():
        posture.leg.check_base_at_rest("a contact that takes time, unless the base does not turn,")
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin, "collide_many")
    ball.check_movable("a contact that takes time")
    # Below a micrometre per second gravity, not the impact, decides the motion.
    validation.number("approach speed", approach.speed, at_least=1e-6, unit="m/s")
    patch = _checked_patch(approach, model, contact_time, stiffness)
    force = _force_model(approach, contact_time, "pressure" if patch else stiffness)
    expected = _expected_time(approach, force)
    if patch is None:
        equations = CompliantContact(approach, force, torque, expected, tol)
    else:
        equations = PatchContact(approach, patch, torque, expected, tol)
    try:
        motion = _motion_of(equations)
    except (KickdynError, ValueError):
        if isinstance(equations, PatchContact) and equations.lowest < 0.05 * ball.radius:
            raise _pressed_by(equations, force) from None
        # two masses alone press the ball by at least speed times contact time, divided by 3.22
        if patch is None and approach.speed * expected > 4.0 * ball.radius:
            raise _pressed_by(equations, force) from None
        raise
    collision = Collision(approach, tol, motion)
    if collision.flattening < ball.radius * (1.0 - 1e-9):
        return collision
    raise _pressed_by(equations, force)


SECONDS_OF_COLLIDE = 0.02
"""Processor time of one `collide` in Python, roughly [s]."""


def _source() -> Source:
    from kickdyn.impact import collide_kernel  # imports numba

    return collide_kernel.source()


COLLIDE = MachineCode(_source, "the kernel of contacts that take time", 8.0)
"""Contacts that take time in machine code, one or many."""


def _motion_of(equations: CompliantContact) -> IntegratedContact:
    """Return the motion from first contact to separation, with an error relative to its impulse."""
    motion, lane = _integrated(equations), equations.lane
    size = math.hypot(*equations.impulse(float(motion.times[-1]), motion.last))
    with np.errstate(divide="ignore"):  # by a deflection of 0
        tolerance_factor = light_contact_factor(
            lane, size, equations.reduced_mass, motion.phases[-1, 0], equations.tol
        )
    if tolerance_factor[0] < lane.tolerance_factor[0]:
        equations = equations.with_tolerance(equations.tol)
        equations.lane.tolerance_factor[:] = tolerance_factor
        motion = _integrated(equations)
    return motion


def _integrated(equations: CompliantContact) -> IntegratedContact:
    """Return the motion of a contact: by machine code if it has it and pays."""
    if equations.has_machine_code and COLLIDE.pays(SECONDS_OF_COLLIDE):
        from kickdyn.impact.collide_kernel import ContactKernel

        kernel = ContactKernel.of(equations.leg, equations.torque)
        motion = None if kernel is None else kernel.motion(COLLIDE(), equations)
        if motion is not None:
            return motion
    return integrate_contact(equations)


def _pressed_by(equations: CompliantContact, force: NormalForce) -> InvalidInput:
    """Return the error of a foot that reaches the centre of the ball."""
    ball, speed = equations.ball, f"at an approach speed of {equations.approach.speed:.4g} m/s"
    if callable(equations.torque) or equations.torque.any():
        speed += " and with these joint torques"
    if isinstance(equations, PatchContact):
        patch = equations.patch
        return InvalidInput(
            f"patch width is {patch.width:g} m: {speed} and with an offset of {patch.offset:g} m, "
            f"the strip would press the ball beyond its radius of {ball.radius:g} m; a wider "
            "strip, a smaller offset or a slower foot is within the model"
        )
    pressed = (
        "which is too low: the ball would be pressed beyond its radius of "
        f"{ball.radius:g} m {speed}"
    )
    if not isinstance(force, ForceModel) or force.exponent == LINEAR:
        return InvalidInput(f"ball pressure is {ball.pressure:g} Pa, {pressed}")
    return InvalidInput(
        f"stiffness is {force.stiffness:g} N/m^1.5, {pressed}; a shorter contact time makes it "
        "stiffer"
    )


def duration(
    approach: Approach, contact_time: float | None, stiffness: float | str | None
) -> float:
    """Return for how long the force of `collide` acts between the two masses alone [s]."""
    return _expected_time(approach, _force_model(approach, contact_time, stiffness))


def _expected_time(approach: Approach, model: NormalForce) -> float:
    """Return the contact time of the two masses alone, which must not be too short [s].

    That of an inflated ball is the time of its linear spring.
    """
    if not isinstance(model, ForceModel):
        model = ForceModel(approach.ball.stiffness, 1.0, LINEAR)
    spring, speed = (model.stiffness, model.restitution, model.exponent), approach.speed
    expected = float(spring_time(*spring, approach.reduced_mass(), speed))
    if expected < SHORTEST_CONTACT * (1.0 - 1e-9):
        raise InvalidInput(
            f"stiffness is {model.stiffness:.4g} N/m^{model.exponent:g}, which is too high: at an "
            f"approach speed of {speed:.4g} m/s the contact would take {expected:.3g} s, less than "
            f"{SHORTEST_CONTACT:g} s"
        )
    return expected


def _checked_torque(torque: ArrayLike | Torque | None, nv: int) -> Array | Torque:
    """Return a torque function of three values, or a copy of constant torques; else raise."""
    if not callable(torque):
        values = np.zeros(nv) if torque is None else torque
        return validation.vector("torque", values, nv, unit="N m")
    try:
        signature(torque).bind(0.0, torque, torque)
    except TypeError:
        raise InvalidInput(f"torque is {torque!r}: it must take three values, t, q, v") from None
    except ValueError:  # functions written in C have no signature
        pass
    return torque


def _force_model(
    approach: Approach, contact_time: float | None, stiffness: float | str | None
) -> NormalForce:
    given, e = checked_stiffness(contact_time, stiffness), approach.restitution
    if takes_inflated_force(approach.contact, contact_time, given):
        return InflatedForce.of(approach.ball)
    of_ball = approach.ball.stiffness if given == "pressure" else math.nan
    masses = approach.reduced_mass(), approach.speed
    with np.errstate(over="ignore"):  # of a contact that is too short
        k, n, _ = chosen_spring((contact_time, given), of_ball, *masses, e)
    return ForceModel(float(k), e, n)


def _checked_patch(
    approach: Approach,
    model: str | FootPatch,
    contact_time: float | None,
    stiffness: float | str | None,
) -> FootPatch | None:
    """Return the patch of a model; None is the point."""
    if isinstance(model, str) and model == "point":
        return None
    if not isinstance(model, FootPatch) and not (isinstance(model, str) and model == "patch"):
        raise InvalidInput(
            f"model is {validation.brief(model)}: it must be 'point', 'patch' or a FootPatch"
        )
    if contact_time is not None or stiffness is not None:
        both = f"contact_time is {contact_time!r} and stiffness {stiffness!r}"
        raise InvalidInput(f"{both}: a patch follows from the ball's pressure, give none of them")
    return model if isinstance(model, FootPatch) else patch_of(approach)


def takes_inflated_force(
    contact: Contact, contact_time: float | None, stiffness: float | str | None
) -> bool:
    """Return whether the force is of an inflated ball; raise where its e is another one."""
    is_inflated = contact.restitution == "inflated"
    if stiffness == "inflated" and not is_inflated:
        raise InvalidInput(
            "stiffness is 'inflated': it needs a contact with the restitution 'inflated', which is "
            "derived from the same force"
        )
    return stiffness == "inflated" or (is_inflated and stiffness is None and contact_time is None)


def checked_stiffness(
    contact_time: float | None, stiffness: float | str | None
) -> float | str | None:
    """Return a stiffness from outside, which a contact time excludes; else raise."""
    if contact_time is not None:
        validation.number(
            "contact time", contact_time, at_least=SHORTEST_CONTACT, at_most=LONGEST_CONTACT,
            unit="s",
        )  # fmt: skip
    if contact_time is not None and stiffness is not None:
        raise InvalidInput(
            f"contact_time is {contact_time!r} and stiffness {stiffness!r}: give only one of them"
        )
    if isinstance(stiffness, str) and stiffness not in STIFFNESSES:
        raise InvalidInput(
            f"stiffness is {stiffness!r}: it must be a number [N/m^1.5], 'pressure' or 'inflated'"
        )
    if stiffness is None or isinstance(stiffness, str):
        return stiffness
    return validation.number("stiffness", stiffness, above=0, unit="N/m^1.5")
