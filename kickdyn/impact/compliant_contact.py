"""Equations of motion of leg and ball while they press on each other."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.core.vectors import cross
from kickdyn.errors import KickdynError
from kickdyn.impact.hertz import HertzContact
from kickdyn.robot.leg import Posture, Workspace

CREEP = 1e-3
"""Share of the approach speed at which Coulomb's friction has faded to 1/sqrt(2) of itself: smooth,
as an integrator needs it, so that what sticks creeps about that fast. For mu above 1, mu times as
much: sticking asks for a smaller part of it, so that the creep is the same."""

MAX_EVALUATIONS = 100_000


class State(NamedTuple):
    """One column of the integrator, unpacked.

    Attributes:
        q, v: of the leg.
        moved: of the ball's centre since the touch [m].
        velocity, spin: of the ball.
        lost: energy, to damping and friction [J].
        work: of the joint torques, and of what keeps a particle's spin against friction [J].
    """

    q: Array
    v: Array
    moved: Array
    velocity: Array
    spin: Array
    lost: float
    work: float


class ContactKinematics(NamedTuple):
    """Where ball and foot press.

    Attributes:
        normal: of the foot's plane, from foot into ball.
        point: of the plane, nearest to the ball's centre, from the joint's origin [m].
        deflection: [m], negative where they are apart.
        rate: of the deflection [m/s].
        sliding: of the ball over the plane, in the plane [m/s].
    """

    normal: Array
    point: Array
    deflection: float
    rate: float
    sliding: Array


class CompliantContact:
    """Leg and ball from touch to separation, as a system of first order.

    The columns are the leg's displacement since the touch in the tangent space, its velocity, the
    ball's displacement, velocity and spin, the energy lost, and the work done.
    """

    def __init__(
        self,
        posture: Posture,
        ball: Ball,
        contact: Contact,
        hertz: HertzContact,
        before: BallState,
        speed: float,
        torque: Callable[[float, Array, Array], Array],
    ) -> None:
        leg, q = posture.leg, posture.q
        self.model = leg.model  # with gravity, which the leg's workspace leaves out
        self._space = Workspace(self.model)
        self.gravity = np.array(self.model.gravity.linear)
        self.leg, self.q, self.ball, self.hertz = leg, q, ball, hertz
        self.before, self.torque = before, torque
        self.friction, self.creep = contact.friction, CREEP * speed * max(contact.friction, 1.0)
        self.evaluations = 0
        pin.forwardKinematics(self.model, self.data, q)
        joint = self.data.oMi[leg.contact_joint]
        self.foot = posture.contact_point
        self.arm = joint.actInv(posture.contact_point)
        self.normal = joint.rotation.T @ contact.normal
        self.lever = ball.radius * contact.normal

    @property
    def data(self) -> Any:
        """This thread's `pin.Data`: a contact may be sampled by several."""
        return self._space.data

    def start(self, v: Array) -> Array:
        """Return the first column."""
        still = np.zeros(3)
        return np.concatenate(
            [np.zeros(self.leg.nv), v, still, self.before.velocity, self.before.spin, [0.0, 0.0]]
        )

    def scales(self, start: Array, time: float, speed: float, mass: float) -> Array:
        """Return what each entry of a column is large to, for absolute tolerances."""
        fast = float(np.abs(start[self.leg.nv : 2 * self.leg.nv]).max()) or speed
        spin = float(np.abs(self.before.spin).max()) or speed / self.ball.radius
        energy = 0.5 * mass * speed * speed
        nv = self.leg.nv
        sizes = [[fast * time] * nv, [fast] * nv, [speed * time] * 3, [speed] * 3, [spin] * 3]
        return np.concatenate([*sizes, [energy, energy]])

    def state(self, y: Array) -> State:
        """Return a column unpacked."""
        nv = self.leg.nv
        q = pin.integrate(self.model, self.q, y[:nv])
        ball = y[2 * nv :]
        return State(
            q,
            y[nv : 2 * nv].copy(),
            ball[:3],
            ball[3:6],
            ball[6:9],
            float(ball[9]),
            float(ball[10]),
        )

    def touching(self, state: State) -> ContactKinematics:
        """Return the contact's kinematics; runs the leg's."""
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, state.q, state.v)
        joint, motion = data.oMi[self.leg.contact_joint], data.v[self.leg.contact_joint]
        turn = joint.rotation
        normal, arm, spin = turn @ self.normal, turn @ self.arm, turn @ motion.angular
        reach = self.lever + state.moved - (joint.translation + arm - self.foot)
        height = float(normal @ reach)
        point = arm + reach - height * normal
        foot_point = turn @ motion.linear + cross(spin, point)
        apart = state.velocity - height * cross(state.spin, normal) - foot_point
        rate = -float(normal @ apart)
        return ContactKinematics(
            normal, point, self.ball.radius - height, rate, apart + rate * normal
        )

    def rubbing(self, contact: ContactKinematics, size: float) -> Array:
        """Return the friction on the ball [N], given the normal force: Coulomb's, made smooth."""
        if self.friction == 0.0:
            return np.zeros(3)
        fast = math.hypot(*contact.sliding, self.creep)
        return np.asarray(-self.friction / fast * size * contact.sliding)

    def rates(self, t: float, y: Array) -> Array:
        """Return the derivative of a column."""
        self.evaluations += 1
        if self.evaluations > MAX_EVALUATIONS:
            raise KickdynError(
                f"the contact is not over after {MAX_EVALUATIONS} evaluations, at {t:g} s: what "
                "acts is too stiff to be integrated"
            )
        state, ball = self.state(y), self.ball
        contact = self.touching(state)
        spring = self.hertz.spring(contact.deflection)
        size = self.hertz.force(contact.deflection, contact.rate)
        rubbing = self.rubbing(contact, size)
        push = size * contact.normal + rubbing
        moment_on_ball = cross((contact.deflection - ball.radius) * contact.normal, rubbing)

        turn = self.data.oMi[self.leg.contact_joint].rotation.T
        moment = turn @ cross(contact.point, -push)
        self._space.external[self.leg.contact_joint] = pin.Force(turn @ -push, moment)
        lost = (size - spring) * contact.rate - float(rubbing @ contact.sliding)
        torque = self.torque(t, state.q, state.v)
        power = float(torque @ state.v)
        if ball.inertia == math.inf:  # an endless store of energy, whose spin it does not change
            power -= float(moment_on_ball @ state.spin)
        acceleration = pin.aba(
            self.model, self.data, state.q, state.v, torque, self._space.external
        )
        return np.concatenate(
            [
                self._displacement_rate(state),
                acceleration,
                state.velocity,
                push / ball.mass + self.gravity,
                moment_on_ball / ball.inertia,
                [lost, power],
            ]
        )

    def _displacement_rate(self, state: State) -> Array:
        if self.leg.nq == self.leg.nv:
            return state.v
        slope = pin.dDifference(self.model, self.q, state.q, pin.ArgumentPosition.ARG1)
        return np.asarray(slope @ state.v)

    def gap(self, _: float, y: Array) -> float:
        """Return what falls through 0 at separation: the deflection, or what the radius spares."""
        deflection = self.touching(self.state(y)).deflection
        return min(deflection, self.ball.radius - deflection)

    def contact_at(self, t: float, y: Array) -> tuple[Array, Array, float]:
        """Return force [N] and impulse so far [N s] on the ball, and deflection [m]."""
        contact = self.touching(self.state(y))
        size = self.hertz.force(contact.deflection, contact.rate)
        push = size * contact.normal + self.rubbing(contact, size)
        return push, self.impulse(t, y), contact.deflection

    def foot_at(self, state: State) -> Array:
        """Return where the contact point of the foot is [m, world frame]."""
        pin.forwardKinematics(self.model, self.data, state.q)
        return np.array(self.data.oMi[self.leg.contact_joint].act(self.arm))

    def impulse(self, t: float, y: Array) -> Array:
        """Return what the contact gave the ball until t: its momentum, less gravity's share."""
        gained = self.state(y).velocity - self.before.velocity
        return np.asarray(self.ball.mass * (gained - self.gravity * t))

    def energy(self, y: Array) -> float:
        """Return kinetic and potential energy of leg, ball and spring [J]."""
        state, ball = self.state(y), self.ball
        # not computeKineticEnergy, which forgets the rotor of the first joint
        inertia = pin.crba(self.model, self.data, state.q)
        leg = 0.5 * float(state.v @ inertia @ state.v)
        leg += float(pin.computePotentialEnergy(self.model, self.data, state.q))
        speed, spin = state.velocity, state.spin
        turning = ball.inertia if ball.inertia < math.inf else 0.0  # nothing turns a particle
        moving = 0.5 * float(ball.mass * speed @ speed + turning * spin @ spin)
        height = -ball.mass * float(self.gravity @ state.moved)
        deflection = max(self.touching(state).deflection, 0.0)
        stored = 0.4 * self.hertz.spring(deflection) * deflection
        return leg + moving + height + stored
