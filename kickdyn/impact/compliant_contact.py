"""Motion of leg and ball while they touch, with a compliant contact: equations and integration."""

import math
from bisect import bisect_right
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.integrate import OdeSolution, solve_ivp
from scipy.linalg import blas
from scipy.optimize import minimize_scalar

from kickdyn.core import validation
from kickdyn.core.mechanics import cross
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import KickdynError
from kickdyn.impact.approach import Approach
from kickdyn.impact.force_model import ForceModel
from kickdyn.robot.constraints import ConstraintProjector
from kickdyn.robot.leg import Workspace
from kickdyn.robot.model_validation import cholesky_with_condition

Torque = Callable[[float, Array, Array], ArrayLike]
"""Joint torques as a function of time since first contact, q and v."""

CREEP = 1e-3
"""Sliding speed, relative to the approach speed, at which friction is 1/sqrt(2) of Coulomb's: an
integrator needs a smooth force, so that sticking points creep about that fast. For mu above 1 it is
mu times as much: sticking needs a smaller part of the friction then, so that the creep is the same.
"""

STABILIZATION_RATE = 10.0
"""Rate at which errors of supports and loops decay, over the expected contact time."""

MAX_EVALUATIONS = 60_000
"""Evaluations of the equations of motion, each some 60 us; ordinary contacts take a few thousand,
those that stick at a tolerance of 1e-13 up to 40,000."""

MAX_CONTACT_TIMES = 50.0
"""Expected contact times after which foot and ball count as not separating."""


class State(NamedTuple):
    """One column of the integrator, unpacked."""

    q: Array
    v: Array
    moved: Array  # displacement of the ball's centre since first contact [m]
    velocity: Array  # of the ball
    spin: Array
    lost: float  # energy, to hysteresis and friction [J]
    work: float  # of joint torques, and of what maintains a particle's spin against friction [J]


class ContactKinematics(NamedTuple):
    """Kinematics of the contact between ball and foot."""

    normal: Array  # of the foot's plane, from foot into ball
    point: Array  # of the plane, nearest to the ball's centre, from the joint's origin [m]
    deflection: float  # [m], negative where they are apart
    rate: float  # of the deflection [m/s]
    sliding: Array  # of the ball over the plane, in the plane [m/s]


class CompliantContact:
    """Leg and ball from first contact to separation, as a first-order system.

    A column y has the leg's displacement since first contact, in the tangent space, and what
    `State` lists. `largest` is the largest deflection so far, 0 while it grows.
    """

    def __init__(
        self, approach: Approach, force_model: ForceModel, torque: Array | Torque, expected: float
    ) -> None:
        posture, contact = approach.posture, approach.contact
        self.approach, self.force_model, self.torque = approach, force_model, torque
        self.leg, self.q, self.ball = posture.leg, posture.q, approach.ball
        self.model = self.leg.model  # with gravity, which the leg's workspace leaves out
        self._space = Workspace(self.model)
        self.gravity = np.array(self.model.gravity.linear)
        self.friction = contact.friction
        self.creep = CREEP * approach.speed * max(contact.friction, 1.0)
        self.evaluations, self.expected = 0, expected
        self.foot = posture.contact_point
        self.arm = posture.contact_lever
        self.normal = posture.rotation_world_joint.T @ contact.normal
        self.lever = self.ball.radius * contact.normal

    @property
    def data(self) -> Any:
        """The `pin.Data` of this thread: several threads may sample one contact."""
        return self._space.data

    def start(self) -> Array:
        """Return the first column."""
        before, v = self.approach.ball_before, self.approach.v
        return np.concatenate(
            [np.zeros(self.leg.nv), v, np.zeros(3), before.velocity, before.spin, [0.0, 0.0]]
        )

    def scales(self) -> Array:
        """Return the scale of each entry of a column, for absolute tolerances."""
        time, speed = self.expected, self.approach.speed
        spin = float(np.abs(self.approach.ball_before.spin).max()) or speed / self.ball.radius
        energy = self.approach.energy()
        # of each joint as fast as that energy would make it alone: hinges and slides alike
        fast = np.sqrt(2.0 * energy / self.approach.posture.inertia.diagonal())
        sizes = [fast * time, fast, [speed * time] * 3, [speed] * 3, [spin] * 3]
        return np.concatenate([*sizes, [energy, energy]])

    def state(self, y: Array) -> State:
        """Return a column unpacked."""
        nv = self.leg.nv
        q = pin.integrate(self.model, self.q, y[:nv])
        ball = y[2 * nv :]
        lost, work = ball[9:].tolist()
        return State(q, y[nv : 2 * nv].copy(), ball[:3], ball[3:6], ball[6:9], lost, work)

    def kinematics(self, state: State) -> ContactKinematics:
        """Return the contact's kinematics; it runs the leg's."""
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, state.q, state.v)
        joint, motion = data.oMi[self.leg.contact_joint], data.v[self.leg.contact_joint]
        rotation = joint.rotation
        normal, arm, spin = rotation @ self.normal, rotation @ self.arm, rotation @ motion.angular
        reach = self.lever + state.moved - (joint.translation + arm - self.foot)
        height = float(normal @ reach)
        point = arm + reach - height * normal
        foot_point = rotation @ motion.linear + cross(spin, point)
        apart = state.velocity - height * cross(state.spin, normal) - foot_point
        rate = -float(normal @ apart)
        deflection, sliding = self.ball.radius - height, apart + rate * normal
        return ContactKinematics(normal, point, deflection, rate, sliding)

    def forces(self, contact: ContactKinematics, largest: float) -> tuple[float, Array]:
        """Return the normal force and the friction on the ball [N]: Coulomb's law, made smooth."""
        normal_force = self.force_model.force(contact.deflection, largest)
        if self.friction == 0.0:
            return normal_force, np.zeros(3)
        fast = math.hypot(*contact.sliding, self.creep)
        return normal_force, -self.friction / fast * normal_force * contact.sliding

    def rates(self, t: float, y: Array, largest: float) -> Array:
        """Return the derivative of a column."""
        self.evaluations += 1
        if not math.isfinite(t):
            raise KickdynError(
                "the integrator left double precision: torques, speeds or lengths are too large"
            )
        if self.evaluations > MAX_EVALUATIONS:
            raise KickdynError(
                f"the contact has not ended after {MAX_EVALUATIONS} evaluations, at {t:g} of "
                f"about {self.expected:g} s: the equations of motion are too stiff (friction "
                f"{self.friction:g}, a light foot or a ball of small inertia)"
            )
        state, ball = self.state(y), self.ball
        contact = self.kinematics(state)
        returned = self.force_model.returned(contact.deflection, largest)
        size, friction = self.forces(contact, largest)
        force = size * contact.normal + friction
        moment_on_ball = cross((contact.deflection - ball.radius) * contact.normal, friction)

        rotation = self.data.oMi[self.leg.contact_joint].rotation.T
        moment = rotation @ cross(contact.point, -force)
        self._space.external[self.leg.contact_joint] = pin.Force(rotation @ -force, moment)
        lost = (size - returned) * contact.rate - float(friction @ contact.sliding)
        torque = self.torque
        if callable(torque):
            value = torque(t, state.q, state.v)
            torque = validation.vector("torque", value, self.leg.nv, unit="N m")
        power = float(torque @ state.v)
        if ball.inertia == math.inf:  # a particle, whose spin stays
            power -= float(moment_on_ball @ state.spin)
        external = self._space.external
        acceleration = pin.aba(self.model, self.data, state.q, state.v, torque, external)
        if self.leg.constraints is not None:
            change, absorbed = self._constrain(state, acceleration)
            acceleration, power = acceleration + change, power + absorbed
        displacement_rate = state.v
        if self.leg.nq != self.leg.nv:  # of the displacement in the tangent space at q
            slope = pin.dDifference(self.model, self.q, state.q, pin.ArgumentPosition.ARG1)
            displacement_rate = slope @ state.v
        of_leg = [displacement_rate, acceleration]
        of_ball = [state.velocity, force / ball.mass + self.gravity, moment_on_ball / ball.inertia]
        return np.concatenate([*of_leg, *of_ball, [lost, power]])

    def _constrain(self, state: State, acceleration: Array) -> tuple[Array, float]:
        r"""Return what the constraints add to an acceleration a, and their power [W].

        With :math:`M = L L^T`, it is the least change :math:`L^{-T} c` in kinetic energy after
        which :math:`A a + \dot A v = -2 \alpha A v - \alpha^2 g`: the terms with
        :math:`\alpha = 10 / T`, of the contact time T that is expected, let the integrator's errors
        of velocity and of the loops' gaps g decay (Baumgarte, Computer Methods in Applied Mechanics
        and Engineering 1, 1972).
        """
        constraints, model, data = self.leg.constraints, self.model, self.data
        assert constraints is not None
        bias = constraints.bias(model, data, state.q, state.v)
        rows, blocks = constraints.rows(model, data, state.q)
        inertia = pin.crba(model, data, state.q, pin.Convention.LOCAL)
        factor, _ = cholesky_with_condition(inertia)
        whitened = blas.dtrsm(1.0, factor, rows.T, lower=1)
        projector = ConstraintProjector(constraints, rows, blocks, whitened, self.approach.posture)
        rate = STABILIZATION_RATE / self.expected
        moving = rows.dot(state.v)
        moving[constraints.stiff_rows] -= self.approach.v[constraints.stiff_joints]
        missing = rows.dot(acceleration) + bias + 2.0 * rate * moving
        missing[constraints.loop_rows] += rate * rate * constraints.gaps(model, data).ravel()
        change = blas.dtrsv(factor, projector.correction(-missing), lower=1, trans=1)
        return change, float(state.v @ inertia @ change)

    def deflection(self, y: Array) -> float:
        """Return the deflection of a column [m]."""
        return self.kinematics(self.state(y)).deflection

    def compression_ends(self, _: float, y: Array) -> float:
        """Return what falls to 0 as the deflection stops growing, or reaches the radius."""
        contact = self.kinematics(self.state(y))
        return min(contact.rate, self.ball.radius - contact.deflection)

    def restitution_ends(self, _: float, y: Array, largest: float) -> float:
        """Return what falls to 0 at separation, or as the deflection outgrows the largest one."""
        deflection = self.deflection(y)
        limit = largest or self.ball.radius
        return min(deflection - self.force_model.separation(largest), limit - deflection)

    def impulse(self, t: float, y: Array) -> Array:
        """Return the contact's impulse on the ball until t: its momentum, less gravity's share."""
        gained = self.state(y).velocity - self.approach.ball_before.velocity
        return np.asarray(self.ball.mass * (gained - self.gravity * t))

    def energy(self, y: Array, largest: float) -> float:
        """Return kinetic and potential energy of leg, ball and spring [J]."""
        state, ball = self.state(y), self.ball
        # Not computeKineticEnergy, which omits the rotor of the first joint.
        inertia = pin.crba(self.model, self.data, state.q)
        leg = 0.5 * float(state.v @ inertia @ state.v)
        leg += float(pin.computePotentialEnergy(self.model, self.data, state.q))
        speed, spin = state.velocity, state.spin
        turning = ball.inertia if ball.inertia < math.inf else 0.0  # nothing turns a particle
        moving = 0.5 * float(ball.mass * speed @ speed + turning * spin @ spin)
        height = -ball.mass * float(self.gravity @ state.moved)
        stored = self.force_model.stored(self.deflection(y), largest)
        return leg + moving + height + stored


class ContactMotion(NamedTuple):
    """Leg and ball from first contact to separation, as they were integrated."""

    equations: CompliantContact
    column: OdeSolution  # of the integrator, at a time
    times: Array  # of the integrator's steps, shape `(n,)` [s]
    last: Array  # column at separation
    begins: list[float]  # times at which a phase of compression or of restitution begins [s]
    largest: list[float]  # deflection before each phase, 0 while it grows [m]

    def sample(self, t: float) -> tuple[Array, Array, float]:
        """Return force [N] and impulse so far [N s] on the ball, and deflection [m] at a time."""
        equations, y = self.equations, self.column(t)
        contact = equations.kinematics(equations.state(y))
        size, friction = equations.forces(contact, self.largest[bisect_right(self.begins, t) - 1])
        return size * contact.normal + friction, equations.impulse(t, y), contact.deflection

    def peak(self, quantity: Callable[[float], float]) -> float:
        """Return the largest value of a function of time: the largest of the steps, refined."""
        values = [quantity(t) for t in self.times.tolist()]
        best = int(np.argmax(values))
        refined = minimize_scalar(
            lambda t: -quantity(float(t)),
            bounds=(self.times[max(best - 1, 0)], self.times[min(best + 1, len(values) - 1)]),
            method="bounded",
            options={"xatol": 1e-6 * float(self.times[-1])},
        )
        return max(-float(refined.fun), values[best])


def integrate_contact(equations: CompliantContact, tol: float) -> ContactMotion:
    """Return the motion from first contact to separation, or raise `KickdynError`.

    A contact with hysteresis is cut where compression ends, and where the deflection outgrows the
    largest one before, so that the force is smooth in every phase.
    """
    model, expected, radius = equations.force_model, equations.expected, equations.ball.radius
    limit, atol = MAX_CONTACT_TIMES * expected, tol * equations.scales()
    phases: list[Any] = []
    begins, largest_before = [], []
    t, y, largest, touching = 0.0, equations.start(), 0.0, True
    while touching:
        event: Any = equations.compression_ends
        if model.restitution == 1.0 or largest > 0.0:
            event = partial(equations.restitution_ends, largest=largest)
        rates = partial(equations.rates, largest=largest)
        with np.errstate(over="ignore", invalid="ignore"):  # reported below
            phase = _integrate_until(event, rates, y, limit, tol, atol, expected / 20.0, t)
        if not phase.success or not np.isfinite(phase.y[:, -1]).all():
            raise KickdynError(f"the integrator failed at {phase.t[-1]:g} s: {phase.message}")
        if phase.status != 1:
            raise KickdynError(
                f"foot and ball are still in contact after {limit:g} s, {MAX_CONTACT_TIMES:g} "
                "times the time that the two alone would take"
            )
        phases.append(phase)
        begins.append(t)
        largest_before.append(largest)
        t, y = float(phase.t[-1]), phase.y[:, -1]
        deflection = equations.deflection(y)
        apart = deflection - model.separation(largest) < largest - deflection
        touching = model.restitution < 1.0 and not apart and deflection < radius * (1.0 - 1e-9)
        largest = 0.0 if largest else deflection
    times = np.concatenate([[0.0], *(phase.t[1:] for phase in phases)])
    stuck = times[1:][np.diff(times) <= 0.0]
    if stuck.size:
        raise KickdynError(
            f"the integrator failed at {stuck[0]:g} s: at an approach speed of "
            f"{equations.approach.speed:.3g} m/s gravity or a torque, not the impact, decides the "
            "motion"
        )
    column = OdeSolution(times, [step for phase in phases for step in phase.sol.interpolants])
    return ContactMotion(equations, column, times, y, begins, largest_before)


def _integrate_until(
    event: Any,
    rates: Any,
    start: ArrayLike,
    limit: float,
    rtol: float,
    atol: Any,
    step: float,
    begin: float = 0.0,
) -> Any:
    """Run scipy's DOP853 until an event of (t, y) falls to 0; return what `solve_ivp` returns.

    States at an event are an interpolant's, which is far less exact than the step. So the last step
    is taken anew, to just beyond the event.
    """

    def falling(t: float, y: Array) -> float:
        return float(event(t, y))

    falling.terminal, falling.direction = True, -1  # type: ignore[attr-defined]
    run = partial(solve_ivp, rates, method="DOP853", rtol=rtol, atol=atol, max_step=step,
                  events=falling, dense_output=True)  # fmt: skip
    solution = run((begin, limit), np.asarray(start, np.float64))
    if solution.status != 1:
        return solution
    began, ended = solution.t[-2:]
    if ended <= began:
        return solution
    beyond = ended + 0.01 * (ended - began)
    last = run((began, beyond), solution.y[:, -2], first_step=beyond - began)
    times = np.concatenate([solution.t[:-1], last.t[1:]])
    solution.sol = OdeSolution(times, [*solution.sol.interpolants[:-1], *last.sol.interpolants])
    solution.t, solution.y = times, np.hstack([solution.y[:, :-1], last.y[:, 1:]])
    return solution
