"""Leg and ball while they touch, for one contact of any leg and force: equations, integration."""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple, Self

import numpy as np
import pinocchio as pin
from scipy.linalg import blas, lapack

from kickdyn.core import validation
from kickdyn.core.dop853 import STAGES, TABLE
from kickdyn.core.lanes import blank_records
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import KickdynError
from kickdyn.impact import contact_phases as phases
from kickdyn.impact.approach import Approach
from kickdyn.impact.contact_phases import (
    AGAIN,
    AT_BEGINNING,
    FAILED,
    LANE,
    STABILIZATION_RATE,
    TAKEN,
    THROUGH,
    Vector,
)
from kickdyn.impact.force_model import ForceModel, Load, NormalForce
from kickdyn.robot.constraints import ConstraintProjector
from kickdyn.robot.leg_model import Workspace
from kickdyn.robot.model_validation import cholesky_with_condition

Torque = Callable[[float, Array, Array], ArrayLike]
"""Joint torques as a function of time since first contact, q and v."""

CREEP = 1e-3
"""Speed of a joint at which the friction of its drive is 1/sqrt(2) of Coulomb's, relative to the
speed that the energy of the approach would give it alone."""


class State(NamedTuple):
    """One column of the integrator, unpacked."""

    q: Array
    v: Array
    moved: Array  # displacement of the ball's centre since first contact [m]
    motion: Array  # velocity and spin of the ball, shape (2, 3) [m/s, rad/s]
    lost: float  # energy, to hysteresis and friction [J]
    work: float  # of joint torques, and of what maintains a particle's spin against friction [J]


class Kinematics(NamedTuple):
    """Kinematics of the contact; vectors are in its axes, see `contact_motion`."""

    axes: Array  # two tangents of the foot's plane and its normal, as columns [world frame]
    motion: tuple[Vector, ...]  # ball, its spin, foot, its spin [m/s, rad/s]
    bias: tuple[Vector, Vector]  # accelerations of the foot if no joint accelerates
    height: float  # of the ball's centre over the plane [m]
    point: Vector  # of the plane, nearest to that centre, from the joint's origin [m]
    relative: Vector  # velocity of the ball over that point [m/s]


class CompliantContact:
    """Leg and ball from first contact to separation, as a first-order system.

    Displacements and velocities of the ball are relative to the leg's base, which does not turn.

    A column y has the leg's displacement since first contact, in the tangent space, and what
    `State` lists. A lane has the constants of the contact, its phase and its last forces, see
    `contact_phases.LANE`.
    """

    def __init__(
        self, approach: Approach, force_model: NormalForce, torque: Array | Torque,
        expected: float, tol: float,
    ) -> None:  # fmt: skip
        posture, contact = approach.posture, approach.contact
        self.approach, self.force_model, self._torque = approach, force_model, torque
        self.leg, self.q, self.ball = posture.leg, posture.q, approach.ball
        self.torque = _with_drives(approach, torque)
        self.base_velocity = posture.transport_velocity
        self.model = self.leg.model  # with gravity, which the leg's workspace leaves out
        self._space = Workspace(self.model)
        self.gravity = np.array(self.model.gravity.linear)
        self.expected, self.tol, self.reduced_mass = expected, tol, approach.reduced_mass()
        self._set_axes(phases.contact_axes(contact.normal))
        # where the ball's centre begins
        self._centre = posture.contact_point + self.ball.radius * contact.normal
        self.lane = self._first_lane()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the arguments."""
        return type(self), (*self._arguments(), self.tol)

    def _arguments(self) -> tuple[Any, ...]:
        return self.approach, self.force_model, self._torque, self.expected

    def with_tolerance(self, tol: float) -> Self:
        """Return the same equations for another tolerance."""
        make: Any = type(self)
        return make(*self._arguments(), tol)  # type: ignore[no-any-return]

    @property
    def has_machine_code(self) -> bool:
        """Whether a spring and constant torques act, of which there is machine code."""
        return isinstance(self.force_model, ForceModel) and not callable(self.torque)

    def _first_lane(self) -> SimpleNamespace:
        (lane,), ball, posture = blank_records(LANE, 1, 1), self.ball, self.approach.posture
        frame = self.leg.workspace.model.jointPlacements[1].translation
        lane.axes[:], lane.arm[:] = self._axes.T.reshape(9, 1), np.array([self._arm]).T
        lane.centre[:] = (self._centre - frame)[:, None]
        lane.inverse_mass[:], lane.inverse_inertia[:] = 1.0 / ball.mass, 1.0 / ball.inertia
        lane.radius[:], lane.friction[:] = ball.radius, self.approach.contact.friction
        force, y = self.force_model, self.start()
        spring = (0.0, 1.0, self.approach.restitution, self.expected)
        if isinstance(force, ForceModel):
            spring = force.stiffness, force.exponent, force.restitution, self.expected
        sliding = np.array(self.kinematics(self.state(y)).relative[:2])[:, None]
        spin = float(np.abs(self.approach.ball_before.spin).max())
        speed = self.approach.speed
        phases.set_lanes(lane, speed, self.reduced_mass, sliding, spring, spin, self.tol)
        self.fast = np.sqrt(2.0 * lane.energy / posture.inertia.diagonal())
        return lane

    def _set_axes(self, world_axes: Array) -> None:
        """Set the contact's axes, which turn with the foot, and what follows from them.

        Unit forces at a point along the axes are the wrenches `_forces` and `_moments` times the
        point, flattened.
        """
        posture = self.approach.posture
        self._axes = axes = posture.rotation_world_joint.T @ world_axes
        self._arm = tuple((axes.T @ posture.contact_lever).tolist())
        self._forces, moments = np.zeros(18), [axes @ pin.skew(unit) for unit in np.eye(3)]
        self._forces[:9] = axes.ravel()
        self._moments = np.zeros((18, 3))
        self._moments[9:] = np.reshape(moments, (3, 9)).T

    @property
    def data(self) -> Any:
        """The `pin.Data` of this thread: several threads may sample one contact."""
        return self._space.data

    def start(self) -> Array:
        """Return the first column."""
        before, v = self.approach.ball_before, self.approach.v
        velocity = before.velocity - self.base_velocity
        return np.concatenate(
            [np.zeros(self.leg.nv), v, np.zeros(3), velocity, before.spin, [0.0, 0.0]]
        )

    def scales(self) -> Array:
        """Return the scale of each entry of a column, for absolute tolerances.

        That of a joint is the speed that the energy of the approach would give it alone: hinges
        and slides alike.
        """
        time, speed, lane = self.expected, self.approach.speed, self.lane
        energy = lane.energy[0]
        sizes = [self.fast * time, self.fast, [speed * time] * 3, [speed] * 3, [lane.spin[0]] * 3]
        return np.concatenate([*sizes, [energy, energy]])

    def lane_of(self, phase: Array | None) -> SimpleNamespace:
        """Return a new lane in a phase, of `ContactMotion.phases`; in the first one for None."""
        (lane,) = blank_records(LANE, 1, 1)
        for name in phases.GIVEN:
            getattr(lane, name)[:] = getattr(self.lane, name)
        if phase is not None:
            lane.largest[:], lane.kind[:], lane.along[:, 0] = phase[0], phase[1], phase[2:]
        return lane

    def state(self, y: Array) -> State:
        """Return a column unpacked."""
        nv = self.leg.nv
        change = y[:nv]
        q = self.q + change if self.leg.nq == nv else pin.integrate(self.model, self.q, change)
        ball = y[2 * nv :]
        lost, work = ball[9:11].tolist()
        return State(q, y[nv : 2 * nv], ball[:3], ball[3:9].reshape(2, 3), lost, work)

    def kinematics(self, state: State) -> Kinematics:
        """Return the kinematics of the contact; it runs the leg's."""
        joint, space, fixed = self.leg.contact_joint, self._space, self._axes
        pin.forwardKinematics(self.model, space.data, state.q, state.v, space.zero_velocity)
        placement = space.placements[joint]
        axes = placement.rotation.dot(fixed)
        rise = (self._centre + state.moved - placement.translation).dot(axes).tolist()
        ax, ay, az = self._arm
        reach = rise[0] - ax, rise[1] - ay, rise[2] - az
        ball, ball_spin = state.motion.dot(axes).tolist()
        foot, spin = space.velocities[joint].vector.reshape(2, 3).dot(fixed).tolist()
        bias, turn_bias = space.accelerations[joint].vector.reshape(2, 3).dot(fixed).tolist()
        motion = ball, ball_spin, foot, spin
        moved = phases.contact_motion(reach, self._arm, *motion)
        return Kinematics(axes, motion, (bias, turn_bias), reach[2], *moved)

    def point(self, state: State) -> Array:
        """Return the contact point, shape `(3,)` [m, axes of the contact joint]."""
        return np.asarray(self._axes @ self.kinematics(state).point)

    def deflection(self, contact: Kinematics) -> float:
        """Return the deflection of ball and foot together [m]."""
        return self.force_model.deflection(self.ball.radius - contact.height)

    def begin_phase(self, which: int) -> bool:
        """Begin the phase after an end of one, or return whether foot and ball part."""
        return bool(phases.begin_phase(self.lane, 0, which))

    def evaluate(self, t: float, y: Array, lane: Any) -> tuple[Array, Array]:
        """Return the derivative of a column and the force on the ball; fill in the lane."""
        state, ball = self.state(y), self.ball
        contact = self.kinematics(state)
        lane.height[0], lane.sliding[:, 0] = contact.height, contact.relative
        largest = float(lane.largest[0])
        load = self.force_model.load(ball.radius - contact.height, -contact.relative[2], largest)
        torque = self._torque_at(t, state)
        inertia, acting = self._acting(state, contact, torque)
        response = self._response(state, inertia, acting)
        size, f1, f2 = self._force(contact, lane, load, acting, response)
        separation = self.force_model.separation(largest)
        deflection = self.deflection(contact)
        phases.put_forces(lane, 0, (f1, f2, size), load.lost, deflection, separation)
        acceleration = response.dot((-f1, -f2, -size, 1.0))
        pushed = None
        if self.leg.constraints is not None:
            pushed = inertia.dot(acceleration) - acting.dot((-f1, -f2, -size, 1.0))
        height = contact.height
        forces = contact.axes.dot(((f1, height * f2), (f2, -height * f1), (size, 0.0))).T
        lost = float(lane.lost[0])
        return self._rates(state, acceleration, forces, lost, (torque, pushed)), forces[0]

    def _rates(
        self, state: State, acceleration: Array, forces: Array, lost: float,
        pushed: tuple[Array, Array | None],
    ) -> Array:  # fmt: skip
        """Return the derivative of a column.

        `forces` are force and torque on the ball, shape `(2, 3)` [N, N m]; `lost` is a power [W];
        `pushed` has the torques of the joints, and of constraints, if there are any.
        """
        ball, nv, (torque, constrained) = self.ball, self.leg.nv, pushed
        power = float(torque.dot(state.v))
        if ball.inertia == math.inf:  # a particle, whose spin stays
            power -= float(forces[1].dot(state.motion[1]))
        if constrained is not None:
            power += float(state.v.dot(constrained))
        rates = np.empty(2 * nv + 11)
        rates[:nv], rates[nv : 2 * nv] = state.v, acceleration
        if self.leg.nq != nv:  # of the displacement in the tangent space at q
            slope = pin.dDifference(self.model, self.q, state.q, pin.ArgumentPosition.ARG1)
            rates[:nv] = slope @ state.v
        of_ball = rates[2 * nv :]
        of_ball[:3], of_ball[3:6] = state.motion[0], forces[0] / ball.mass + self.gravity
        of_ball[6:9], of_ball[9], of_ball[10] = forces[1] / ball.inertia, lost, power
        return rates

    def _torque_at(self, t: float, state: State) -> Array:
        """Return the torques of the joints, shape `(nv,)` [N m; N for prismatic joints]."""
        if not callable(self.torque):
            return self.torque
        value = self.torque(t, state.q, state.v)
        return validation.vector("torque", value, self.leg.nv, unit="N m")

    def _acting(self, state: State, contact: Kinematics, torque: Array) -> tuple[Array, Array]:
        """Return the joint-space inertia, and what acts on it as columns, shape `(nv, 4)`.

        The first three are the Jacobian of the contact point, transposed, in the contact's axes,
        the last one is all but the contact force.
        """
        model, data, q = self.model, self.data, state.q
        local = pin.computeJointJacobian(model, data, q, self.leg.contact_joint)
        wrenches = (self._forces + self._moments.dot(contact.point)).reshape(6, 3)
        acting = np.empty((self.leg.nv, 4), order="F")
        acting[:, :3] = local.T.dot(wrenches)
        acting[:, 3] = torque - pin.nonLinearEffects(model, data, q, state.v)
        return pin.crba(model, data, q, pin.Convention.LOCAL), acting

    def _response(self, state: State, inertia: Array, acting: Array) -> Array:
        r"""Return the accelerations that columns of joint torques cause, shape `(nv, 4)`.

        With :math:`M = L L^T`, constraints add the least change :math:`L^{-T} c` in kinetic energy
        after which :math:`A a + \dot A v = -2 \alpha A v - \alpha^2 g`: the terms with
        :math:`\alpha = 10 / T`, of the contact time T that is expected, let the integrator's
        errors of velocity and of the loops' gaps g decay (Baumgarte, Computer Methods in Applied
        Mechanics and Engineering 1, 1972).
        """
        constraints, model, data = self.leg.constraints, self.model, self.data
        if constraints is None:
            return np.asarray(lapack.dposv(inertia, acting, lower=1)[1])
        factor, _ = cholesky_with_condition(inertia)
        bias = constraints.bias(model, data, state.q, state.v)
        rows, blocks = constraints.rows(model, data, state.q)
        whitened = blas.dtrsm(1.0, factor, rows.T, lower=1)
        projector = ConstraintProjector(constraints, rows, blocks, whitened, self.approach.posture)
        rate = STABILIZATION_RATE / self.expected
        moving = rows.dot(state.v)
        moving[constraints.stiff_rows] -= self.approach.v[constraints.stiff_joints]
        missing = bias + 2.0 * rate * moving
        missing[constraints.loop_rows] += rate * rate * constraints.gaps(model, data).ravel()
        allowed = projector.project(blas.dtrsm(1.0, factor, acting, lower=1))
        allowed[:, 3] -= projector.correction(missing)
        return np.asarray(blas.dtrsm(1.0, factor, allowed, lower=1, trans_a=1))

    def _force(
        self, contact: Kinematics, lane: Any, load: Load, acting: Array, response: Array
    ) -> tuple[float, float, float]:
        r"""Return normal force and friction on the ball [N].

        The force p follows from the law, and the inertia of the mass c that the foot carries:
        :math:`p = p_0 + c\,(a_f - g_n)`, with :math:`p / m + g_n - a_f = \ddot h`. It is linear
        in p where points slide or stick, so that the secant through two values meets it.
        """
        ball, ball_spin, _, spin = contact.motion
        moving = (
            contact.height, contact.point, contact.relative, ball, ball_spin, spin, *contact.bias,
            self.gravity.dot(contact.axes).tolist(),
        )  # fmt: skip
        (g11, g12, g13, a1), (_, g22, g23, a2), (*_, g33, pushed) = (
            acting[:, :3].T.dot(response).tolist()
        )
        turning = 1.0 / self.ball.mass + contact.height**2 / self.ball.inertia
        mobility, (b1, b2) = (g11 + turning, g12, g22 + turning), phases.free_sliding(*moving)

        def friction(size: float) -> tuple[float, float]:
            free = b1 + g13 * size - a1, b2 + g23 * size - a2
            f1, f2 = phases.friction_force(lane, 0, size, mobility, free)
            return float(f1), float(f2)

        size = load.force
        if load.carried == 0.0:
            return size, *friction(size)
        carried = load.carried
        size = (size + carried * (pushed - phases.free_rise(*moving))) / (1.0 + carried * g33)
        f1, f2 = friction(size)
        share, free, before, missing = carried / (1.0 + carried * g33), size, 0.0, size
        for _ in range(20):
            error = free - share * (g13 * f1 + g23 * f2) - size
            if abs(error) <= 1e-15 * free:
                break
            step = error
            if before and missing != error:
                step = error * before / (missing - error)
            before, missing, size = step, error, size + step
            f1, f2 = friction(size)
        return size, f1, f2

    def impulse(self, t: float, y: Array) -> Array:
        """Return the contact's impulse on the ball until t: its momentum, less gravity's share."""
        before = self.approach.ball_before.velocity - self.base_velocity
        gained = self.state(y).motion[0] - before
        return np.asarray(self.ball.mass * (gained - self.gravity * t))

    def energy(self, y: Array, largest: float) -> float:
        """Return kinetic and potential energy of leg, ball and spring [J]."""
        state = self.state(y)
        contact = self.kinematics(state)
        travel, rate = self.ball.radius - contact.height, -contact.relative[2]
        return self.energy_of(state) + self.force_model.energy(travel, rate, largest)

    def energy_of(self, state: State) -> float:
        """Return kinetic and potential energy of leg and ball [J]."""
        ball = self.ball
        # Not computeKineticEnergy, which omits the rotor of the first joint.
        leg = 0.5 * float(state.v @ pin.crba(self.model, self.data, state.q) @ state.v)
        leg += float(pin.computePotentialEnergy(self.model, self.data, state.q))
        speed, spin = state.motion
        turning = ball.inertia if ball.inertia < math.inf else 0.0  # nothing turns a particle
        moving = 0.5 * float(ball.mass * speed @ speed + turning * spin @ spin)
        height = -ball.mass * float(self.gravity @ state.moved)
        return leg + moving + height


def _with_drives(approach: Approach, torque: Array | Torque) -> Array | Torque:
    r"""Return joint torques with the drives', of stiffness k and friction f.

    A drive adds :math:`k (q_0 + v_0 t - q) - f v / \sqrt{v^2 + c^2}`: position control whose
    reference moves on with the velocity before the impact, and Coulomb's friction, made smooth over
    a speed c, so that a joint at rest creeps. What the motor needs against
    friction before the impact is part of the torque.
    """
    posture, v_before = approach.posture, approach.v
    leg, model = posture.leg, posture.leg.workspace.model
    if not leg.compliant_drives:
        return torque
    stiffness, friction = np.zeros(leg.nv), np.zeros(leg.nv)
    for joint, drive in leg.compliant_drives.items():
        index = leg.velocity_index(joint)
        stiffness[index], friction[index] = drive.stiffness, drive.friction
    creep = CREEP * np.sqrt(2.0 * approach.energy() / posture.inertia.diagonal())

    def driven(t: float, q: Array, v: Array) -> Array:
        applied = torque(t, q, v) if callable(torque) else torque
        behind = v_before * t - pin.difference(model, posture.q, q)
        applied = validation.vector("torque", applied, leg.nv, unit="N m")
        return np.asarray(applied + stiffness * behind - friction * v / np.hypot(v, creep))

    return driven


@dataclass(frozen=True, eq=False)
class IntegratedContact:
    """Leg and ball from first contact to separation, as they were integrated."""

    equations: CompliantContact
    times: Array  # of the integrator's steps and of separation, shape `(n + 1,)` [s]
    columns: Array  # of the integrator at these times, shape `(n + 1, dim)`
    # of each step, largest deflection so far [m], kind of friction, and direction of the sliding as
    # the phase began, shape `(n, 4)`
    phases: Array
    evaluations: int  # of the equations that the integration took

    @property
    def last(self) -> Array:
        """Column at separation."""
        return np.asarray(self.columns[-1])

    @property
    def sticks(self) -> bool:
        """Whether the points stick at separation."""
        return bool(self.phases[-1, 1] == phases.STICKS and self.equations.lane.friction[0] > 0.0)

    def column(self, t: float) -> Array:
        """Return the column at a time: a step of the integrator from the last one before."""
        k = self._step_at(t)
        if t in (self.times[k], self.times[k + 1]):
            return np.asarray(self.columns[k if t == self.times[k] else k + 1])
        lane, y, h = self.equations.lane_of(self.phases[k]), self.columns[k], t - self.times[k]
        rates = np.empty((STAGES, len(y)))
        return _stages(self.equations, lane, (float(self.times[k]), y, h), rates)

    def sample(self, t: float) -> tuple[Array, Array, float]:
        """Return force [N] and impulse so far [N s] on the ball, and deflection [m] at a time."""
        y, lane = self.column(t), self.equations.lane_of(self.phases[self._step_at(t)])
        with np.errstate(all="ignore"):  # as the contact begins
            _, force = self.equations.evaluate(t, y, lane)
        return force, self.equations.impulse(t, y), float(lane.deflection[0])

    def _step_at(self, t: float) -> int:
        return min(max(bisect_right(self.times, t) - 1, 0), len(self.phases) - 1)

    def peak_force(self) -> float:
        """Return the largest force [N]: the largest of the steps, refined."""
        from scipy.optimize import minimize_scalar  # here, because it takes long to import

        def size(t: float) -> float:
            return math.hypot(*self.sample(float(t))[0])

        values = [size(t) for t in self.times.tolist()]
        best = int(np.argmax(values))
        refined = minimize_scalar(
            lambda t: -size(t),
            bounds=(self.times[max(best - 1, 0)], self.times[min(best + 1, len(values) - 1)]),
            method="bounded",
            options={"xatol": 1e-6 * float(self.times[-1])},
        )
        return max(-float(refined.fun), values[best])


def _stages(
    equations: CompliantContact, lane: Any, begin: tuple[float, Array, float], rates: Array,
    first: int = 0,
) -> Array:  # fmt: skip
    """Fill in the rates of a step from stage `first` on; return its last column.

    `begin` has time, column and length of the step.
    """
    t, y, h = begin
    for k in range(first, STAGES):
        new = y + h * TABLE[k, :k].dot(rates[:k])
        rates[k] = equations.evaluate(t + TABLE[k].sum() * h, new, lane)[0]
    return np.asarray(y + h * TABLE[STAGES].dot(rates[:STAGES]))


def integrate_contact(equations: CompliantContact) -> IntegratedContact:
    """Return the motion from first contact to separation, or raise `KickdynError`.

    It ends, too, where the foot reaches the centre of the ball.
    """
    with np.errstate(all="ignore"):  # what is not finite is reported
        return _integrate(equations)


def _integrate(equations: CompliantContact) -> IntegratedContact:
    """Integrate by DOP853 with its error estimate, step by step as `collide_kernel`.

    The tolerance is relative to how far a column departs from uniform motion: of a foot that grazes
    the ball, far less than the column itself.
    """
    lane, y, rtol = equations.lane, equations.start(), max(equations.tol, 3e-14)
    start, drift, nv = y, np.zeros(len(y)), equations.leg.nv
    drift[:nv], drift[2 * nv : 2 * nv + 3] = y[nv : 2 * nv], y[2 * nv + 3 : 2 * nv + 6]
    rates, precision = np.empty((STAGES + 1, len(y))), phases.event_precision(rtol)
    scales, begins, columns, kinds = equations.scales(), [0.0], [y], []
    is_new, outcome = True, TAKEN
    while True:
        t = begins[-1]
        if is_new:
            rates[0] = equations.evaluate(t, y, lane)[0]
            is_new = False
        if outcome != AGAIN:
            phases.limit_step(lane, 0)
        h = float(lane.step[0])
        new = _stages(equations, lane, (t, y, h), rates, 1)
        rates[STAGES] = equations.evaluate(t + h, new, lane)[0]
        moved, later = start + t * drift, start + (t + h) * drift
        size = scales + np.maximum(np.abs(y - moved), np.abs(new - later))
        per = 1.0 / (rtol * lane.tolerance_factor[0] * size)
        five, three = np.square(TABLE[STAGES + 1 :].dot(rates[:STAGES]) * per).sum(axis=1).tolist()
        square = (five + 0.01 * three) * len(y)
        error = h * five / math.sqrt(square) if square != 0.0 else 0.0
        phase = lane.largest[0], lane.kind[0], *lane.along[:, 0]
        outcome = phases.finish_step(lane, 0, error, precision)
        if outcome == FAILED:
            raise KickdynError(_failure(equations, error))
        if outcome in (TAKEN, THROUGH) or 0 <= outcome < AT_BEGINNING:
            begins.append(t + h)
            columns.append(new)
            kinds.append(phase)
            y, rates[0] = new, rates[STAGES]
        is_new = outcome >= 0
        parted = is_new and equations.begin_phase(outcome % AT_BEGINNING)
        if parted:  # nothing but gravity acts since then
            late = float(lane.ends[0, 0] / lane.sliding[2, 0])
            begins[-1], columns[-1] = begins[-1] + late, y + late * rates[STAGES]
        if parted or outcome == THROUGH:
            evaluations = int(lane.calls[0])
            times, steps = np.array(begins), np.array(kinds)
            return IntegratedContact(equations, times, np.array(columns), steps, evaluations)


def _failure(equations: CompliantContact, error: float) -> str:
    lane, expected = equations.lane, equations.expected
    t = float(lane.time[0])
    if not math.isfinite(error):
        return "the integration exceeded double precision: torques, speeds or lengths are too large"
    if t > 2.0 * expected:
        return (
            f"foot and ball are still in contact after {t:.3g} s, {t / expected:.3g} times the "
            "time that the two alone would take: the motion of the leg, gravity or a torque "
            "presses them together"
        )
    if lane.calls[0] > phases.MAX_EVALUATIONS:
        return (
            f"the contact has not ended after {phases.MAX_EVALUATIONS} evaluations, at {t:g} of "
            f"about {expected:g} s: the equations of motion are too stiff (friction "
            f"{equations.approach.contact.friction:g}, a light foot or a ball of small inertia)"
        )
    return (
        f"the integrator failed at {t:g} s: the motion changes in less than 1e-13 of the contact "
        f"time of {expected:g} s that foot and ball alone would take; speeds or torques are too "
        "large"
    )
