"""Parameters of a MuJoCo contact with which a simulated kick gives the ball that kickdyn computes.

MuJoCo has no coefficient of restitution. Its contact is a spring and a damper per unit of mass,
which act once per time step and on a ball that has already entered the foot at the first of them.
"""

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from kickdyn.accuracy.mujoco_kick import (
    IMPEDANCE,
    MujocoContact,
    MujocoKick,
    SimulatedBall,
    damping_ratio,
    load_mujoco,
    pair,
    release_phase,
    row,
    scene,
)
from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError, NoImpact
from kickdyn.impact.approach import AT_REST, Approach, find_approach
from kickdyn.impact.collide import collide
from kickdyn.impact.strike import strike
from kickdyn.robot.leg import Posture

LEAST_RESTITUTION = 0.2
"""Below about 0.14 a damped spring is overdamped, and has no contact time of its own."""

LONGEST_STEP = 0.02
"""Largest time step [s]."""

STEPS = (5e-3, 4e-3, 3e-3, 2e-3, 1.5e-3, 1e-3, 7.5e-4, 5e-4, 3e-4, 2e-4, 1e-4)
"""Time steps among which the largest one is sought that meets a tolerance [s]."""

STEPS_PER_CONTACT = (4, 6, 10, 16)
"""Durations of the contact that are tried, in time steps, where none is asked for."""

WIDTHS = (0.0, 0.3, 0.6)
"""Depths that are tried, over which the contact's impedance grows, in deepest deflections."""

SPEEDS = (0.5, 1.5, 0.75, 1.25)
"""Factors on all velocities at which errors are given; the first two are tuned for, too."""

TURNED = 0.1
"""Largest change of a joint between neighbouring postures [rad; m]."""


OTHERS, SPIN, KEPT = 0.5, 0.3, 0.03
"""Weights beside 1 for the ball's velocity in the tuned kick: of other kicks, of the spin times the
radius, and of the logarithms by which friction's coefficient and damping change. The last one keeps
the coefficient where a kick sticks and thus does not determine it."""


EARLY = 1e-3
"""Share of an interval between moments by which the simulation begins before the first contact: if
it began at once, rounding would decide whether the two touch already."""


class MujocoIntegrator(StrEnum):
    """Integrators of MuJoCo."""

    EULER = "Euler"
    IMPLICIT = "implicit"
    IMPLICITFAST = "implicitfast"
    RK4 = "RK4"


class KickError(NamedTuple):
    """Largest errors of a kick simulated in MuJoCo, wherever in a time step the contact begins.

    Attributes:
        change: what differs from the kick that was tuned; empty for that kick.
        velocity: of the ball, length of the difference relative to its speed, or to that of the
            approach along the normal if that is larger.
        speed: of the ball, relative alike.
        direction: angle between the ball's velocities [rad].
        spin: length of the difference [rad/s].
    """

    change: str
    velocity: float
    speed: float
    direction: float
    spin: float


class KickCase(NamedTuple):
    """A kick, and the ball that kickdyn computes."""

    change: str
    approach: Approach
    target: BallState

    @property
    def scale(self) -> float:
        """Speed to which errors are relative [m/s]."""
        return max(float(self.target.speed), self.approach.speed)


class FittedContact(NamedTuple):
    """Parameters, what they leave, and the simulated contact time [s]."""

    score: float
    contact: MujocoContact
    errors: tuple[KickError, ...]
    contact_time: float
    seconds: float


@dataclass(frozen=True, eq=False, repr=False)
class MujocoTuning(ReprMixin):
    """A contact for MuJoCo, as `tune_mujoco` finds it.

    Attributes:
        solref: -stiffness [1/s2] and -damping [1/s] along the normal, per unit of mass.
        solimp: impedance at first contact and at depth, that depth [m], midpoint and power.
        friction: coefficient of sliding.
        solreffriction: as `solref`, across the normal, where MuJoCo reads only the damping; (0, 0)
            without friction. MuJoCo takes it for a `<pair>` of geoms only.
        condim: 1 without friction, else 3.
        margin: 0: a margin would only make the ball larger.
        timestep: of the simulation [s].
        integrator: of MuJoCo.
        contact_time: of the simulated kick, a mean [s].
        errors: of the tuned kick, then of others: slower, faster, earlier and later in the swing.
        tolerance: the largest error of the ball's velocity that was asked for, relative.
        largest_timestep: that meets the tolerance, of those tried [s]; None if none does.
        seconds: that one simulated kick takes on this machine.
        scene: MJCF model of leg and ball just before they touch.
        ball: the ball.
    """

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    friction: float
    solreffriction: tuple[float, float]
    condim: int
    margin: float
    timestep: float
    integrator: str
    contact_time: float
    errors: tuple[KickError, ...]
    tolerance: float
    largest_timestep: float | None
    seconds: float
    scene: str
    ball: Ball

    @property
    def within_tolerance(self) -> bool:
        """Whether the tuned kick's ball velocity is within the tolerance."""
        return self.errors[0].velocity <= self.tolerance

    @property
    def solref_time(self) -> tuple[float, float] | None:
        r"""The same as `solref` in MuJoCo's other form: time constant [s] and damping ratio.

        .. math:: t = 2 / b, \qquad \zeta = 1 / (t \sqrt{k}) .

        None where it cannot be written so: without damping, or where MuJoCo would raise the time
        constant to two time steps.
        """
        k, b = -self.solref[0], -self.solref[1]
        if b * self.timestep > 1.0 or b == 0.0:
            return None
        return 2.0 / b, 0.5 * b / math.sqrt(k)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line if the tolerance is not met, with the largest time step that meets it."""
        if self.within_tolerance:
            return ()
        best = "no time step that was tried meets it"
        if self.largest_timestep is not None:
            best = f"the largest time step that meets it is {1e3 * self.largest_timestep:g} ms"
        return (
            f"at {1e3 * self.timestep:g} ms the ball's velocity is up to "
            f"{self.errors[0].velocity:.1%} off, {self.tolerance:.1%} is asked for: {best}",
        )

    def mjcf(self, foot: str = "foot") -> str:
        """Return a model with the ball and its contact, for an `<include>` in a robot's MJCF.

        Args:
            foot: name of the geom that strikes the ball; only a contact with friction names it.

        Raises:
            InvalidInput: `foot` is no name that MJCF can have.
        """
        validation.check_type(str, foot=foot)
        if not foot.isprintable() or set(foot) & set("<>&\"'") or not foot:
            raise InvalidInput(f"foot is {foot[:40]!r}: it must be the name of a geom")
        contact = self._contact
        inertia = row([self.ball.inertia] * 3)
        pairs = f"\n  <contact>\n    {pair(contact, foot)}\n  </contact>" if self.friction else ""
        return f"""<mujoco>
  <option timestep="{self.timestep!r}" integrator="{self.integrator}" cone="elliptic" \
impratio="100"/>
  <worldbody>
    <body name="ball">
      <freejoint/>
      <inertial pos="0 0 0" mass="{self.ball.mass!r}" diaginertia="{inertia}"/>
      <geom name="ball" type="sphere" size="{self.ball.radius!r}" priority="1" \
condim="{self.condim}" margin="0"
        solref="{row(self.solref)}" solimp="{row(self.solimp)}" \
friction="{float(self.friction)!r} 0 0"/>
    </body>
  </worldbody>{pairs}
</mujoco>
"""

    @property
    def _contact(self) -> MujocoContact:
        """The parameters in one."""
        return MujocoContact(self.solref, self.solimp, self.friction, self.solreffriction)

    def _rows(self) -> Iterable[Row]:
        """Return what `print` shows: each quantity with its value and unit."""
        yield "time step", 1e3 * self.timestep, f"ms, {self.integrator}"
        yield "solref", digits(self.solref), ""
        if self.solref_time is not None:
            yield "the same", digits(self.solref_time), ""
        yield "solimp", digits(self.solimp), ""
        yield "condim", self.condim, ""
        if self.friction:
            yield "friction", self.friction, ""
            yield "solreffriction", digits(self.solreffriction), "(of a <pair>)"
        yield "contact time", 1e3 * self.contact_time, "ms"
        for error in self.errors:
            text = f"speed {error.speed:.2%}, direction {math.degrees(error.direction):.2f} deg"
            if self.friction:
                text += f", spin {error.spin:.2g} rad/s"
            yield f"error, {error.change}" if error.change else "error", text, ""
        yield "cost of a kick", 1e3 * self.seconds, "ms"
        yield from warned(self.warnings)


@validation.check_arguments
def tune_mujoco(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    *,
    timestep: float = 0.002,
    integrator: str = "implicitfast",
    contact_time: float | None = None,
    tolerance: float = 0.03,
    ball_velocity: ArrayLike = AT_REST,
    ball_spin: ArrayLike = AT_REST,
) -> MujocoTuning:
    r"""Find the contact with which MuJoCo gives the ball that kickdyn computes.

    Needs MuJoCo: `pip install "kickdyn[mjcf]"`. Along the normal MuJoCo's contact is a spring and a
    damper per unit of mass that do not pull. Of damping ratio :math:`\zeta` and frequency
    :math:`\omega`, with :math:`s = \sqrt{1 - \zeta^2}`, it ends at the phase
    :math:`\varphi = \mathrm{atan2}(2 \zeta s, 2 \zeta^2 - 1)`, and

    .. math:: e = \exp(-\zeta \varphi / s), \qquad T = \varphi / (s\, \omega),

    for masses of any size. With a step h, Euler's method has that frequency and decay for the
    damping :math:`b = (1 - e^{-2 \zeta \omega h}) / h` and the stiffness
    :math:`k = (2 - b h - 2 e^{-\zeta \omega h} \cos(s\, \omega h)) / h^2`. From there k and b, and
    with friction its coefficient and damping, are fitted by least squares to simulated kicks that
    reach the ball at several moments within a time step. An impedance that grows with the depth
    makes this moment matter less, and the speed more: what has the smaller error is taken.

    The leg is simulated without motors, its foot as a plane, as in `collide`.

    Args:
        posture: of a leg without supports, loops, mimic and stiff joints.
        v: joint velocity just before, shape `(nv,)` [rad/s; m/s for prismatic joints].
        ball: its centre is at `contact point + radius * normal`.
        contact: normal, friction, and a restitution of at least 0.2 at this
            speed of approach; one that depends on the speed is met at this speed best.
        timestep: of the simulation [s], at most 0.02 and half of `contact_time`.
        integrator: `Euler`, `implicit`, `implicitfast` or `RK4`.
        contact_time: the ball is that of `collide` with this contact time [s] and the dissipation
            `hunt-crossley`, a damped spring as MuJoCo's. None: it is that of
            `strike`, and the simulation without gravity lasts a few time steps, as many as come
            nearest to it.
        tolerance: error of the ball's velocity that is accepted, relative, above 0; if it is not
            met, the largest time step that meets it is sought.
        ball_velocity: of its centre just before, shape `(3,)` [m/s, world frame].
        ball_spin: just before, shape `(3,)` [rad/s, world frame].

    Raises:
        NoImpact: foot and ball do not approach each other along the normal.
        InvalidInput: a value outside its range, a leg that is not a tree of joints, or MuJoCo is
            not installed.
        KickdynError: no simulated kick ends.
    """
    load_mujoco()
    step = validation.number("timestep", timestep, above=0, at_most=LONGEST_STEP, unit="s")
    chosen = validation.choice("integrator", integrator, MujocoIntegrator)
    validation.number("tolerance", tolerance, above=0, at_most=1)
    if contact_time is not None:
        validation.number("contact time", contact_time, above=0, unit="s")
        if step > 0.5 * contact_time:
            raise InvalidInput(
                f"timestep is {step:g} s: a contact of {contact_time:g} s takes two steps or more, "
                f"so it must be at most {0.5 * contact_time:g} s"
            )
    approach = find_approach(posture, v, ball, contact, ball_velocity, ball_spin)
    validation.number("restitution", approach.restitution, at_least=LEAST_RESTITUTION)
    scene(approach, step, MujocoContact())  # refuses a leg before the work
    cases = kick_cases(approach, contact_time)
    found = find_best(cases, step, chosen, contact_time)
    largest: float | None = step
    if found.errors[0].velocity > tolerance:
        smaller = (each for each in STEPS if each < step)
        meets = (
            each
            for each in smaller
            if find_best(cases, each, chosen, contact_time).errors[0].velocity <= tolerance
        )
        largest = next(meets, None)
    best = found.contact
    return MujocoTuning(
        solref=best.solref,
        solimp=best.solimp,
        friction=best.friction,
        solreffriction=best.solreffriction,
        condim=best.condim,
        margin=0.0,
        timestep=step,
        integrator=chosen.value,
        contact_time=found.contact_time,
        errors=found.errors,
        tolerance=tolerance,
        largest_timestep=largest,
        seconds=found.seconds,
        scene=scene(approach, step, best, chosen.value, contact_time is not None),
        ball=ball,
    )


def closed_form_contact(
    restitution: float, contact_time: float, timestep: float, integrator: str = "Euler"
) -> tuple[float, float]:
    """Return stiffness [1/s2] and damping [1/s] of a restitution and a contact time [s].

    For two masses that touch just at the beginning of a time step [s]; RK4 is taken as exact.
    """
    ratio = damping_ratio(restitution)
    swing = math.sqrt(1.0 - ratio * ratio)
    frequency = release_phase(ratio) / (swing * contact_time)
    if integrator == MujocoIntegrator.RK4:
        return frequency**2, 2.0 * ratio * frequency
    decay, turn = ratio * frequency * timestep, swing * frequency * timestep
    damping = -math.expm1(-2.0 * decay)
    stiffness = 2.0 - damping - 2.0 * math.exp(-decay) * math.cos(turn)
    return stiffness / timestep**2, damping / timestep


def kick_cases(approach: Approach, contact_time: float | None) -> list[KickCase]:
    """Return the kick, and those around it that can be computed."""
    posture, ball, contact, before = (
        approach.posture, approach.ball, approach.contact, approach.ball_before,
    )  # fmt: skip
    stiffness = None

    def case(change: str, at: Posture, factor: float) -> KickCase:
        """Return a kick at a posture, with all velocities times a factor."""
        nonlocal stiffness
        motion = factor * before.velocity, factor * before.spin
        near = find_approach(at, factor * approach.v, ball, contact, *motion)
        given = {"ball_velocity": motion[0], "ball_spin": motion[1]}
        if contact_time is None:
            target = strike(at, near.v, ball, contact, **given).ball_after  # type: ignore[arg-type]
            return KickCase(change, near, target)
        time = contact_time if stiffness is None else None
        hit = collide(
            at, near.v, ball, contact, contact_time=time, stiffness=stiffness,
            dissipation="hunt-crossley", tol=1e-6, **given,
        )  # fmt: skip
        stiffness = hit.force_model.stiffness
        return KickCase(change, near, hit.ball_after)

    cases = [case("", posture, 1.0)]
    cases += [case(f"speed x {factor:g}", posture, factor) for factor in SPEEDS]
    ahead = TURNED * approach.v / float(np.abs(approach.v).max())
    for change, sign in (("earlier in the swing", -1.0), ("later in the swing", 1.0)):
        q = pin.integrate(posture.leg.model, posture.q, sign * ahead)
        at = posture.leg.posture(q).with_contact_offset(contact.offset)
        try:
            cases.append(case(change, at, 1.0))
        except NoImpact:  # a foot that misses the ball there
            continue
    return cases


def find_best(
    cases: Sequence[KickCase], timestep: float, integrator: str, contact_time: float | None
) -> FittedContact:
    """Return the best contact at a time step [s]; without a contact time, of several."""
    times: Sequence[float] = (contact_time,) if contact_time is not None else ()
    times = times or [steps * timestep for steps in STEPS_PER_CONTACT]
    gravity = contact_time is not None
    plain = MujocoContact(friction=cases[0].approach.contact.friction)
    kicks = [MujocoKick(case.approach, timestep, plain, integrator, gravity) for case in cases]
    found = [
        one
        for duration in times
        for width in WIDTHS
        if (one := fit_contact(cases, kicks, duration, width, integrator)) is not None
    ]
    if not found:
        raise KickdynError(f"no kick in MuJoCo ends with a time step of {timestep:g} s")
    best = min(found, key=lambda one: one.score)
    kicks[0].set_contact(best.contact)
    began = time.perf_counter()
    simulate(kicks[0], 8)
    seconds = (time.perf_counter() - began) / 8
    return best._replace(seconds=seconds)


def fit_contact(
    cases: Sequence[KickCase],
    kicks: Sequence[MujocoKick],
    contact_time: float,
    width: float,
    integrator: str,
) -> FittedContact | None:
    """Return the contact fitted to the first three kicks; None if they do not end.

    The impedance reaches its largest value at `width` deepest deflections.
    """
    approach, step = cases[0].approach, kicks[0].timestep
    e, mu = approach.restitution, approach.contact.friction
    stiffness, damping = closed_form_contact(e, contact_time, step, integrator)
    unit = math.sqrt(stiffness)
    depth = _rounded(width * approach.speed / unit)
    solimp = (1e-4, IMPEDANCE, depth, 0.5, 1.0) if width else (IMPEDANCE, IMPEDANCE, 1.0, 0.5, 1.0)
    across = min(4.0 / contact_time, 0.8 / step)

    def contact_of(unknowns: Array) -> MujocoContact:
        """Return the contact of the unknowns, which are 1 at the closed form."""
        x = unknowns - 1.0
        solref = (
            -_rounded(stiffness * math.exp(x[0])),
            -_rounded(max(damping + unit * x[1], 0.0)),
        )
        if not mu:
            return MujocoContact(solref, solimp)
        solreffriction = (-1.0, -_rounded(across * math.exp(x[3])))
        return MujocoContact(solref, solimp, _rounded(mu * math.exp(x[2])), solreffriction)

    def residuals(x: Array) -> Array:
        """Return the weighted errors, relative to the ball's speed."""
        parts: list[Array] = []
        for weight, case, kick in zip((1.0, OTHERS, OTHERS), cases, kicks, strict=False):
            kick.set_contact(contact_of(x))
            speed = case.scale
            balls = simulate(kick, 4, 20.0 * contact_time)
            for found in balls:
                parts.append(weight * (found.velocity - case.target.velocity) / speed)
                if mu:
                    turned = found.spin - case.target.spin
                    parts.append(SPIN * weight * approach.ball.radius * turned / speed)
            if case is cases[0]:
                mean = float(np.mean([ball.contact_time for ball in balls]))
                parts.append(np.array([0.2 * (mean / contact_time - 1.0)]))
        parts.append(KEPT * (x[2:] - 1.0))
        return np.concatenate(parts)

    start = np.ones(4 if mu else 2)  # scipy's steps are relative to it
    try:
        solved = least_squares(
            residuals, start, bounds=(-0.5, 2.5), diff_step=0.02, x_scale=0.1, max_nfev=10,
            ftol=1e-4, xtol=1e-4,
        )  # fmt: skip
        contact = contact_of(solved.x)
        errors = tuple(
            find_error(case, kick, contact) for case, kick in zip(cases, kicks, strict=True)
        )
        lasted = float(np.mean([ball.contact_time for ball in simulate(kicks[0], 8)]))
    except KickdynError:
        return None
    score = 0.0
    for case, error in zip(cases, errors, strict=True):
        size = error.velocity
        if mu:
            size = max(size, SPIN * approach.ball.radius * error.spin / case.scale)
        score = max(score, size if case is cases[0] else OTHERS * size)
    return FittedContact(score, contact, errors, lasted, 0.0)


def digits(values: Iterable[float]) -> str:
    """Return parameters as text, without the zeros after a decimal point."""
    return " ".join(f"{value:.6g}" for value in values)


def _rounded(value: float) -> float:
    """Return a parameter to the six digits with which people copy it."""
    return float(f"{value:.6g}")


def simulate(kick: MujocoKick, count: int, longest: float = 1.0) -> list[SimulatedBall]:
    """Return the balls of kicks that reach the ball at moments spread evenly over a time step."""
    return [kick.run((part + EARLY) / count, longest=longest) for part in range(count)]


def find_error(case: KickCase, kick: MujocoKick, contact: MujocoContact) -> KickError:
    """Return the largest errors of a kick with a contact."""
    kick.set_contact(contact)
    target, speed = case.target, case.scale
    rows = []
    for ball in simulate(kick, 8):
        size = float(np.linalg.norm(ball.velocity))
        sine = float(np.linalg.norm(np.cross(ball.velocity, target.velocity)))
        rows.append(
            (
                float(np.linalg.norm(ball.velocity - target.velocity)) / speed,
                abs(size - float(target.speed)) / speed,
                math.atan2(sine, float(ball.velocity @ target.velocity)),
                float(np.linalg.norm(ball.spin - target.spin)),
            )
        )
    return KickError(case.change, *(max(column) for column in zip(*rows, strict=True)))
