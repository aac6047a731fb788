"""The search for contact parameters with which a kick in MuJoCo gives the ball of `collide`."""

import math
from collections.abc import Sequence
from contextlib import suppress
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from kickdyn.ball import BallState
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput, KickdynError, NoImpact
from kickdyn.impact.approach import Approach, find_approach
from kickdyn.impact.collide import collide
from kickdyn.impact.force_model import ForceModel
from kickdyn.robot.leg import Posture
from kickdyn.simulators.mujoco_kick import (
    IMPEDANCE,
    TIME_LIMIT,
    MujocoContact,
    MujocoKick,
    damping_ratio,
    release_phase,
)

SHAPES = (
    (1.0, 1.0), (0.6, 1.0), (1.5, 1.0), (1.0, 2.0), (1.5, 2.0), (2.5, 2.0), (2.5, 3.0), (0.0, 1.0),
)  # fmt: skip
"""Growths of the contact's impedance that are tried: the depth over which it grows, in deepest
deflections, and MuJoCo's exponent. The higher the exponent, the later is the force."""

SUFFICIENT_SCORE = 0.5
"""Share of the accepted errors at which no other growth is tried."""

SPEEDS = (0.5, 1.5, 0.75, 1.25)
"""Factors on all velocities at which errors are given; the first two are fitted, too."""

POSTURE_CHANGE = 0.1
"""Largest change of a joint between neighbouring postures [rad; m]."""

DIRECTION_LIMIT = math.radians(1.0)
"""Error of the ball's direction that is accepted [rad]."""

NEIGHBOUR_FACTOR = 2.0
"""Accepted error of the ball's speed in other kicks, over the accepted error in the tuned kick."""

CONTACT_TIME_TOLERANCE = 0.1
"""Error of the contact time, relative, from which on the result has a warning."""

SPIN_WEIGHT, FRICTION_WEIGHT = 0.3, 0.03
"""Weights of the fit beside 1 for the ball's velocity: of the spin times the radius, and of the
logarithms by which friction's coefficient and damping change. The last one keeps the coefficient
where a kick sticks and thus does not determine it."""

PHASE_OFFSET = 1e-3
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

    Velocity and speed are relative to the speed of the ball, or to the speed of approach along the
    normal if this is larger; the direction is an angle [rad], the spin the length of a difference
    [rad/s]. `change` is the difference from the kick that was tuned; empty for that kick.
    """

    change: str
    velocity: float
    speed: float
    direction: float
    spin: float


class MujocoGoal(NamedTuple):
    """An error of a tuned contact and its limit, relative; of a direction [rad].

    `name` is `speed` or `direction` of the ball in the tuned kick, or `speed around` at the others.
    """

    name: str
    error: float
    limit: float

    @property
    def met(self) -> bool:
        """Whether the error is accepted at the time step asked for."""
        return self.error <= self.limit

    @property
    def texts(self) -> tuple[str, str]:
        """The error and its accepted size, with their units."""
        if self.name == "direction":
            return f"{math.degrees(self.error):.2g} deg", f"{math.degrees(self.limit):.2g} deg"
        return f"{self.error:.1%}", f"{self.limit:.1%}"


class KickCase(NamedTuple):
    """A kick, the ball that kickdyn computes, and the mean deflection over the impulse [m]."""

    change: str
    approach: Approach
    target: BallState
    deflection: float

    @property
    def scale(self) -> float:
        """Speed to which errors are relative [m/s]."""
        return max(float(self.target.speed), self.approach.speed)


class FittedContact(NamedTuple):
    """A contact that was fitted: its errors in the order of the cases, and a mean contact time [s].

    The smaller `score` is better: the largest error of a goal over its limit, or 1 if all are met;
    and the largest of all errors, including the spin, other postures and the contact time. `kick`
    is the simulation of the first case.
    """

    score: tuple[float, float]
    contact: MujocoContact
    errors: tuple[KickError, ...]
    contact_time: float
    kick: MujocoKick


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


def other_speed(factor: float) -> str:
    """Return the name of the kick with all velocities times a factor."""
    return f"speed x {factor:g}"


def find_goals(errors: Sequence[KickError], tolerance: float) -> tuple[MujocoGoal, ...]:
    """Return the goals of a contact by the errors of its kicks and a tolerance of the speed."""
    tuned, names = errors[0], [other_speed(factor) for factor in SPEEDS]
    around = max((error.speed for error in errors if error.change in names), default=0.0)
    return (
        MujocoGoal("speed", tuned.speed, tolerance),
        MujocoGoal("direction", tuned.direction, DIRECTION_LIMIT),
        MujocoGoal("speed around", around, NEIGHBOUR_FACTOR * tolerance),
    )


def kick_cases(approach: Approach, contact_time: float) -> list[KickCase]:
    """Return the kick, and those around it that can be computed.

    The stiffness is that with which the first one has a contact time [s].
    """
    posture, before = approach.posture, approach.ball_before

    def compute(change: str, other: Approach, **compliance: Any) -> tuple[KickCase, float]:
        hit = collide(
            other.posture, other.v, other.ball, other.contact, **compliance, tol=1e-6,
            ball_velocity=other.ball_before.velocity, ball_spin=other.ball_before.spin,
        )  # fmt: skip
        during = hit.sample(np.linspace(0.0, hit.contact_time, 33))
        forces = np.linalg.norm(during.force, axis=1)
        mean = float(forces @ during.deflection / forces.sum())
        assert isinstance(hit.force_model, ForceModel)  # a spring, because of its contact time
        return KickCase(change, other, hit.ball_after, mean), hit.force_model.stiffness

    tuned, stiffness = compute("", approach, contact_time=contact_time)
    cases = [tuned]

    def add(change: str, nearby: Posture, factor: float = 1.0) -> None:
        motion = factor * before.velocity, factor * before.spin
        other = find_approach(nearby, factor * approach.v, approach.ball, approach.contact, *motion)
        cases.append(compute(change, other, stiffness=stiffness)[0])

    for factor in SPEEDS:
        with suppress(InvalidInput):  # a ball that would be pressed beyond its radius
            add(other_speed(factor), posture, factor)
    ahead = POSTURE_CHANGE * approach.v / float(np.abs(approach.v).max())
    for change, sign in (("earlier in the swing", -1.0), ("later in the swing", 1.0)):
        q = pin.integrate(posture.leg.model, posture.q, sign * ahead)
        with suppress(NoImpact):  # a foot that misses the ball there
            add(change, posture.leg.posture(q).with_contact_offset(approach.contact.offset))
    return cases


def find_best(
    cases: Sequence[KickCase],
    timestep: float,
    integrator: str,
    contact_time: float,
    tolerance: float,
) -> FittedContact:
    """Return the best contact at a time step [s] for a contact time [s].

    One whose errors are all accepted is preferred.
    """
    friction = cases[0].approach.contact.friction
    margin = _rounded(cases[0].deflection) if friction else 0.0
    plain = MujocoContact(friction=friction, margin=margin)
    kicks = [MujocoKick(case.approach, timestep, plain, integrator, gravity=True) for case in cases]
    fits: list[FittedContact] = []
    for shape in SHAPES:
        if fit := fit_contact(cases, kicks, contact_time, shape, integrator, tolerance):
            fits.append(fit)
            if fit.score[1] < SUFFICIENT_SCORE:
                break
    if not fits:
        raise KickdynError(f"no kick in MuJoCo ends with a time step of {timestep:g} s")
    return min(fits, key=lambda fit: fit.score)


def fit_contact(
    cases: Sequence[KickCase],
    kicks: Sequence[MujocoKick],
    contact_time: float,
    shape: tuple[float, float],
    integrator: str,
    tolerance: float,
) -> FittedContact | None:
    """Return the contact fitted to the first three kicks; None if they do not end.

    The impedance grows as one of `SHAPES`.
    """
    approach, step = cases[0].approach, kicks[0].timestep
    e, mu = approach.restitution, approach.contact.friction
    stiffness, damping = closed_form_contact(e, contact_time, step, integrator)
    unit = math.sqrt(stiffness)
    width, power = shape
    depth = _rounded(width * approach.speed / unit)
    solimp = (IMPEDANCE, IMPEDANCE, 1.0, 0.5, 1.0)
    if width:
        solimp = (1e-4, IMPEDANCE, depth, 0.5, power)
    friction_rate = min(4.0 / contact_time, 0.8 / step)

    def contact_of(unknowns: Array) -> MujocoContact:
        x = unknowns - 1.0
        push, brake = stiffness * math.exp(x[0]), max(damping + unit * x[1], 0.0)
        solref = -_rounded(push), -_rounded(brake)
        if not mu:
            return MujocoContact(solref, solimp)
        solreffriction = (-1.0, -_rounded(friction_rate * math.exp(x[3])))
        friction = _rounded(mu * math.exp(x[2]))
        return MujocoContact(solref, solimp, friction, solreffriction, kicks[0].margin)

    def residuals(x: Array) -> Array:
        blocks: list[Array] = []
        weights = 1.0, 1.0 / NEIGHBOUR_FACTOR, 1.0 / NEIGHBOUR_FACTOR
        for weight, case, kick in zip(weights, cases, kicks, strict=False):
            kick.set_contact(contact_of(x))
            velocities, spins, times = simulate(kick, 4, 20.0 * contact_time)
            weight /= case.scale
            blocks.append(weight * (velocities - case.target.velocity).ravel())
            if mu:
                spin_errors = (spins - case.target.spin).ravel()
                blocks.append(SPIN_WEIGHT * weight * approach.ball.radius * spin_errors)
            if case is cases[0]:
                blocks.append(np.array([0.2 * (times.mean() / contact_time - 1.0)]))
        blocks.append(FRICTION_WEIGHT * (x[2:] - 1.0))
        return np.concatenate(blocks)

    start = np.ones(4 if mu else 2)  # scipy's steps are relative to it
    try:
        solved = least_squares(
            residuals, start, bounds=(-0.5, 2.5), diff_step=0.02, x_scale=0.1, max_nfev=10,
            ftol=1e-4, xtol=1e-4,
        )  # fmt: skip
        contact = contact_of(solved.x)
        pairs = zip(cases, kicks, strict=True)
        errors = tuple(find_error(case, kick, contact) for case, kick in pairs)
        lasted = float(simulate(kicks[0], 8)[-1].mean())
    except KickdynError:
        return None
    worst = max(goal.error / goal.limit for goal in find_goals(errors, tolerance))
    largest = max(worst, abs(lasted / contact_time - 1.0) / CONTACT_TIME_TOLERANCE)
    for case, error in zip(cases, errors, strict=True):
        turning = SPIN_WEIGHT * approach.ball.radius * error.spin / case.scale if mu else 0.0
        limit = tolerance if case is cases[0] else NEIGHBOUR_FACTOR * tolerance
        largest = max(largest, error.speed / limit, turning / limit)
    score = (max(worst, 1.0), largest)
    return FittedContact(score, contact, errors, lasted, kicks[0])


def _rounded(value: float) -> float:
    """Return a parameter to the six digits with which people copy it."""
    return float(f"{value:.6g}")


def simulate(kick: MujocoKick, count: int, longest: float = TIME_LIMIT) -> list[Array]:
    """Return arrays of velocity, spin and contact time of simulated kicks, a row for each kick.

    They reach the ball at moments spread evenly over a time step.
    """
    runs = (kick.run((number + PHASE_OFFSET) / count, longest=longest) for number in range(count))
    return [np.array(values) for values in zip(*runs, strict=True)]


def find_error(case: KickCase, kick: MujocoKick, contact: MujocoContact) -> KickError:
    """Return the largest errors of a kick with a contact."""
    kick.set_contact(contact)
    target, (velocities, spins, _) = case.target, simulate(kick, 8)
    sines = np.linalg.norm(np.cross(velocities, target.velocity), axis=1)
    errors = (
        np.linalg.norm(velocities - target.velocity, axis=1) / case.scale,
        np.abs(np.linalg.norm(velocities, axis=1) - target.speed) / case.scale,
        np.arctan2(sines, velocities @ target.velocity),
        np.linalg.norm(spins - target.spin, axis=1),
    )
    return KickError(case.change, *(float(error.max()) for error in errors))
