"""Motion of leg and ball while they touch, with a compliant contact: equations and integration."""

import math
from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import blas, lapack

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import KickdynError
from kickdyn.impact.approach import Approach
from kickdyn.impact.contact_motion import (
    Vector,
    contact_axes,
    contact_motion,
    free_rise,
    free_sliding,
    slides,
    slip_direction,
    slip_end,
    slipping_force,
    sticking_force,
)
from kickdyn.impact.force_model import Load, NormalForce
from kickdyn.robot.constraints import ConstraintProjector
from kickdyn.robot.leg_model import Workspace
from kickdyn.robot.model_validation import cholesky_with_condition

Torque = Callable[[float, Array, Array], ArrayLike]
"""Joint torques as a function of time since first contact, q and v."""

STARTING = 1e-5
"""Sliding speed, relative to the approach speed, up to which points that begin to slide count as
`Friction.STARTS`: their direction of sliding changes faster than an explicit integrator follows."""

RESTING = 10.0
"""Sliding speed up to which points are at rest, relative to the approach speed times the tolerance
of the integrator."""

STABILIZATION_RATE = 10.0
"""Rate at which errors of supports, loops and sticking decay, over the expected contact time."""

MAX_EVALUATIONS = 60_000
"""Evaluations of the equations of motion, each some 40 us; ordinary contacts take some hundreds."""


class Friction(Enum):
    """What Coulomb's friction does to the contact points.

    In `SLIPS` they slide, and friction opposes the sliding. In `STICKS` friction stops them. In
    `STARTS` they are about to slide: friction opposes the direction in which the sliding grows.
    """

    SLIPS, STICKS, STARTS = range(3)


class Phase(NamedTuple):
    """A part of the contact in which the forces are smooth.

    Attributes:
        largest: largest deflection so far, 0 while it grows [m].
        friction: state of the friction.
        along: direction of the sliding at the beginning of the phase, in the plane of the foot.
    """

    largest: float
    friction: Friction
    along: tuple[float, float]


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


class Evaluation(NamedTuple):
    """The equations of motion at one time.

    Attributes:
        rates: derivative of the column.
        force: on the ball [N, world frame].
        deflection: of ball and foot [m].
        ends: values that are 0 where the phase ends, by the deflection and by the friction.
        sliding: sliding velocity of the ball over the foot, in the contact's axes [m/s].
    """

    rates: Array
    force: Array
    deflection: float
    ends: tuple[float, float]
    sliding: tuple[float, float]


class CompliantContact:
    """Leg and ball from first contact to separation, as a first-order system.

    Displacements and velocities of the ball are relative to the leg's base, which does not turn.

    A column y has the leg's displacement since first contact, in the tangent space, and what
    `State` lists.
    """

    def __init__(
        self,
        approach: Approach,
        force_model: NormalForce,
        torque: Array | Torque,
        expected: float,
        tol: float,
    ) -> None:
        posture, contact = approach.posture, approach.contact
        self.approach, self.force_model, self.torque = approach, force_model, torque
        self.leg, self.q, self.ball = posture.leg, posture.q, approach.ball
        self.base_velocity = posture.transport_velocity
        self.model = self.leg.model  # with gravity, which the leg's workspace leaves out
        self._space = Workspace(self.model)
        self.gravity = np.array(self.model.gravity.linear)
        self.evaluations, self.counts, self.expected = 0, True, expected
        # sliding speed up to which points are at rest
        self.resting = RESTING * tol * approach.speed
        self._set_axes(contact_axes(contact.normal))
        # where the ball's centre begins
        self._centre = posture.contact_point + self.ball.radius * contact.normal

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
        moved = contact_motion(reach, self._arm, *motion)
        return Kinematics(axes, motion, (bias, turn_bias), reach[2], *moved)

    def point(self, state: State) -> Array:
        """Return the contact point, shape `(3,)` [m, axes of the contact joint]."""
        return np.asarray(self._axes @ self.kinematics(state).point)

    def end_of(self, k: int, t: float, y: Array, phase: Phase) -> float:
        """Return the value that is 0 where the deflection (0) or the friction (1) ends a phase."""
        if k == 1 and phase.friction is not Friction.SLIPS:
            return self.evaluate(t, y, phase).ends[1]
        contact = self.kinematics(self.state(y))
        return self.slip_end(contact, phase) if k == 1 else self.deflection_end(contact, phase)

    def slip_end(self, contact: Kinematics, phase: Phase) -> float:
        """Return the value that is 0 where points stop sliding in about their first direction."""
        w1, w2, _ = contact.relative
        return slip_end(phase.along, w1, w2, self.resting)

    def time_left(self, y: Array, phase: Phase) -> float:
        """Return for how long the force acts if the ball leaves at its present speed [s].

        At the largest deflection, it is about half of the time in which two masses separate.
        """
        contact = self.kinematics(self.state(y))
        leaving, deflection = contact.relative[2], self.deflection(contact)
        if deflection < 0.99 * phase.largest and leaving > 0.0:
            return (deflection - self.force_model.separation(phase.largest)) / leaving
        e = self.approach.restitution
        return 0.5 * self.expected * e / (1.0 + e)

    def deflection(self, contact: Kinematics) -> float:
        """Return the deflection of ball and foot together [m]."""
        return self.force_model.deflection(self.ball.radius - contact.height)

    def deflection_end(self, contact: Kinematics, phase: Phase) -> float:
        """Return the value that falls to 0 where the deflection ends a phase."""
        if phase.largest == 0.0:  # it grows
            return min(-contact.relative[2], contact.height)
        deflection = self.deflection(contact)
        apart = self.force_model.separation(phase.largest)
        return min(deflection - apart, phase.largest - deflection)

    def evaluate(self, t: float, y: Array, phase: Phase) -> Evaluation:
        """Return the equations of motion at a time in a phase."""
        self._count(t)
        state, ball, nv = self.state(y), self.ball, self.leg.nv
        contact = self.kinematics(state)
        height, (w1, w2, w3) = contact.height, contact.relative
        load = self.force_model.load(ball.radius - height, -w3, phase.largest)
        torque = self._torque_at(t, state)
        inertia, acting = self._acting(state, contact, torque)
        response = self._response(state, inertia, acting)
        size, f1, f2, margin = self._force(contact, phase, load, acting, response)
        acceleration = response.dot((-f1, -f2, -size, 1.0))
        on_ball, turning = contact.axes.dot(((f1, height * f2), (f2, -height * f1), (size, 0.0))).T
        power = float(torque.dot(state.v))
        if ball.inertia == math.inf:  # a particle, whose spin stays
            power -= float(turning.dot(state.motion[1]))
        if self.leg.constraints is not None:
            pushed = acting.dot((-f1, -f2, -size, 1.0))
            power += float(state.v.dot(inertia.dot(acceleration) - pushed))
        displacement_rate = state.v
        if self.leg.nq != nv:  # of the displacement in the tangent space at q
            slope = pin.dDifference(self.model, self.q, state.q, pin.ArgumentPosition.ARG1)
            displacement_rate = slope @ state.v
        rates = np.empty(2 * nv + 11)
        rates[:nv], rates[nv : 2 * nv] = displacement_rate, acceleration
        of_ball = rates[2 * nv :]
        of_ball[:3], of_ball[3:6] = state.motion[0], on_ball / ball.mass + self.gravity
        of_ball[6:9] = turning / ball.inertia
        of_ball[9], of_ball[10] = load.lost - f1 * w1 - f2 * w2, power
        end = self.deflection_end(contact, phase)
        return Evaluation(rates, on_ball, self.deflection(contact), (end, margin), (w1, w2))

    def _count(self, t: float) -> None:
        """Count an evaluation of the integration; raise `KickdynError` where it makes no sense."""
        if not self.counts:  # samples of a motion that is known
            return
        self.evaluations += 1
        if not math.isfinite(t):
            raise KickdynError(
                "the integration exceeded double precision: torques, speeds or lengths are too "
                "large"
            )
        if self.evaluations > MAX_EVALUATIONS:
            raise KickdynError(
                f"the contact has not ended after {MAX_EVALUATIONS} evaluations, at {t:g} of "
                f"about {self.expected:g} s: the equations of motion are too stiff (friction "
                f"{self.approach.contact.friction:g}, a light foot or a ball of small inertia)"
            )

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
        self, contact: Kinematics, phase: Phase, load: Load, acting: Array, response: Array
    ) -> tuple[float, float, float, float]:
        r"""Return normal force and friction on the ball [N], and what falls to 0 as `_friction`.

        The force p follows from the law, and the inertia of the mass c that the foot carries:
        :math:`p = p_0 + c\,(a_f - g_n)`, with :math:`p / m + g_n - a_f = \ddot h`. It is linear
        in p where points slide or stick, so that the secant through two values meets it.
        """
        size = load.force
        if load.carried == 0.0:
            return size, *self._friction(contact, phase, size, acting, response)
        ball, ball_spin, _, spin = contact.motion
        g1, g2, g3, pushed = acting[:, 2].dot(response).tolist()
        rise = free_rise(
            contact.height, contact.point, contact.relative, ball, ball_spin, spin, *contact.bias,
            self.gravity.dot(contact.axes).tolist(),
        )  # fmt: skip
        size = (size + load.carried * (pushed - rise)) / (1.0 + load.carried * g3)
        f1, f2, margin = self._friction(contact, phase, size, acting, response)
        share, free, before, missing = load.carried / (1.0 + load.carried * g3), size, 0.0, size
        for _ in range(20):
            error = free - share * (g1 * f1 + g2 * f2) - size
            if abs(error) <= 1e-15 * free:
                break
            step = error
            if before and missing != error:
                step = error * before / (missing - error)
            before, missing, size = step, error, size + step
            f1, f2, margin = self._friction(contact, phase, size, acting, response)
        return size, f1, f2, margin

    def _friction(
        self, contact: Kinematics, phase: Phase, size: float, acting: Array, response: Array
    ) -> tuple[float, float, float]:
        """Return Coulomb's friction on the ball [N], and a value that is 0 as its kind changes."""
        largest = self.approach.contact.friction * size
        if self.approach.contact.friction == 0.0:
            return 0.0, 0.0, math.inf
        w1, w2, _ = contact.relative
        if phase.friction is Friction.SLIPS:
            return *slipping_force(largest, phase.along, w1, w2), self.slip_end(contact, phase)
        turning = 1.0 / self.ball.mass + contact.height**2 / self.ball.inertia
        give = acting[:, :2].T.dot(response)
        gravity = self.gravity.dot(contact.axes).tolist()
        ball, ball_spin, _, spin = contact.motion
        b1, b2 = free_sliding(
            contact.height, contact.point, contact.relative, ball, ball_spin, spin, *contact.bias,
            gravity,
        )  # fmt: skip
        (g11, g12, g13, a1), (_, g22, g23, a2) = give.tolist()
        mobility = g11 + turning, g12, g22 + turning
        free = b1 + g13 * size - a1, b2 + g23 * size - a2
        s1, s2 = sticking_force(mobility, free, STABILIZATION_RATE / self.expected, w1, w2)
        reserve = largest - math.hypot(s1, s2)
        if phase.friction is Friction.STICKS:
            return s1, s2, reserve
        slowest = STARTING * self.approach.speed + 3.0 * self.resting
        margin = min(slowest - math.hypot(w1, w2), -reserve)
        g11, g12, g22 = mobility
        d1, d2, _ = slip_direction(largest * g11, largest * g12, largest * g22, *free)
        return largest * d1, largest * d2, margin

    def first_phase(self) -> Phase:
        """Return the phase in which the contact begins."""
        return self._phase_at(0.0, self.start(), 0.0, None)

    def next_phase(self, t: float, y: Array, phase: Phase) -> Phase:
        """Return the phase that follows at a time where the friction of a phase ends."""
        return self._phase_at(t, y, phase.largest, phase.friction)

    def _phase_at(self, t: float, y: Array, largest: float, ended: Friction | None) -> Phase:
        """Return the phase after the end of one, or after none."""
        at_rest = Phase(largest, Friction.STICKS, (0.0, 0.0))
        evaluation = self.evaluate(t, y, at_rest)
        (w1, w2), (_, reserve) = evaluation.sliding, evaluation.ends
        speed = math.hypot(w1, w2)
        moves = slides(speed, self.resting, ended is Friction.SLIPS, reserve)
        if ended is not Friction.STICKS and moves:
            return Phase(largest, Friction.SLIPS, (w1 / speed, w2 / speed))
        starts = ended is Friction.STICKS or (ended is not Friction.STARTS and reserve < 0.0)
        return at_rest._replace(friction=Friction.STARTS) if starts else at_rest

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
