"""Leg and ball just before they touch: checked input, and how fast the foot approaches the ball."""

import math
from typing import NamedTuple

import numpy as np

from kickdyn.ball import Ball, BallState
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.mechanics import Triple, largest
from kickdyn.core.representation import ReprMixin, stored
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput, NoImpact
from kickdyn.impact.contact_problem import (
    NO_VELOCITY,
    BallBody,
    ContactPoint,
    ContactProblem,
    LegBody,
)
from kickdyn.restitution import range_warnings, restitution_at
from kickdyn.robot.leg import Posture

EPS = float(np.finfo(float).eps)

MAX_SPEED = 1e140
"""[m/s]. Squares of it, times a mass, are energies that a float64 can still represent."""

IMMOBILE = 1e-12
"""Velocity of the foot along the normal, relative to its fastest direction, that is rounding."""

AT_REST = (0.0, 0.0, 0.0)
_AT_REST: Array = np.frombuffer(bytes(24))
"""The same as a read-only array, which needs no check."""


class Approach(NamedTuple):
    """Leg and ball just before the impact; what has no unit here is as in `AfterApproach`."""

    posture: Posture
    v: Array  # joint velocity, shape `(nv,)` [rad/s; m/s for prismatic joints]
    ball: Ball
    contact: Contact
    ball_velocity: Array  # of the ball's centre, shape `(3,)` [m/s, world frame]
    ball_spin: Array  # angular velocity of the ball, shape `(3,)` [rad/s, world frame]
    foot_velocity: Array
    centre_velocity: Triple  # of the ball's centre minus `foot_velocity` [m/s, world frame]
    speed: float  # of the foot towards the ball along the normal, above 0 [m/s]
    restitution: float

    def warnings(self) -> tuple[str, ...]:
        """Return a line for each joint out of its range or too fast, and for the restitution."""
        return (
            *self.posture.warnings,
            *self.posture.leg.too_fast(self.v),
            *range_warnings(self.contact.restitution, self.speed),
            *self.ball.warnings,
        )

    @property
    def ball_before(self) -> BallState:
        """State of the ball just before the impact."""
        position = self.posture.contact_point + self.ball.radius * self.contact.normal
        return BallState.computed(position, self.ball_velocity, self.ball_spin)

    def contact_problem(self) -> ContactProblem:
        """Return the problem for an impact law; raise `InvalidInput` if nothing moves along n."""
        posture, contact = self.posture, self.contact
        factor = posture.whitened_jacobian
        if self.ball.mass == math.inf:
            row = contact.normal.dot(factor)
            if validation.length(row) <= IMMOBILE * np.abs(factor).max():
                raise InvalidInput(
                    "ball mass is inf and the leg cannot move along the contact normal: "
                    "one of them must be able to move"
                )
        leg = LegBody(posture, posture.jacobian, factor)
        return ContactProblem((self.contact_point(),), (leg, self.ball_body()))

    def ball_body(self) -> BallBody:
        """Return the ball as a body that is touched at one point."""
        return BallBody(self.ball, (self.contact.normal,))

    def contact_point(self) -> ContactPoint:
        """Return the contact of foot and ball."""
        contact, surface_spin = self.contact, NO_VELOCITY
        if self.ball_spin is not _AT_REST:
            radius, (x, y, z) = self.ball.radius, self.ball_spin.tolist()
            surface_spin = radius * x, radius * y, radius * z
        return ContactPoint(
            contact.normal, self.restitution, contact.friction, self.centre_velocity, surface_spin
        )

    def reduced_mass(self) -> float:
        """Return the effective mass of leg and ball together along the normal [kg]."""
        return 1.0 / self.contact_problem().inverse_mass(self.contact.normal)

    def energy(self) -> float:
        """Return the kinetic energy of the approach along the normal [J]."""
        return 0.5 * self.reduced_mass() * self.speed**2


class AfterApproach(ReprMixin):
    """A result that begins with leg and ball just before they touch: an impact or a collision."""

    approach: Approach

    @property
    def posture(self) -> Posture:
        """Posture of the leg at first contact; its contact point is the point of the contact."""
        return self.approach.posture

    @property
    def ball(self) -> Ball:
        """The ball that is struck."""
        return self.approach.ball

    @property
    def contact(self) -> Contact:
        """The contact, as it was given: normal, restitution and friction."""
        return self.approach.contact

    @property
    def restitution(self) -> float:
        """Coefficient e of the contact at the speed of approach."""
        return self.approach.restitution

    @stored
    def ball_before(self) -> BallState:
        """State of the ball just before the contact; the times of a collision count from there."""
        return self.approach.ball_before

    @property
    def v_before(self) -> Array:
        """Joint velocity before the contact, shape `(nv,)` [rad/s; m/s for prismatic joints]."""
        return self.approach.v

    @property
    def foot_velocity(self) -> Array:
        """Velocity of the contact point before the contact, shape `(3,)` [m/s, world frame]."""
        return self.approach.foot_velocity

    @property
    def approach_speed(self) -> float:
        """Speed of the foot towards the ball along the normal [m/s]."""
        return self.approach.speed


def find_approach(
    posture: Posture,
    v: ArrayLike,
    ball: Ball,
    contact: Contact,
    ball_velocity: ArrayLike,
    ball_spin: ArrayLike,
    many: str = "strike_many",
) -> Approach:
    """Check the arguments of `strike` and return the motion just before the impact.

    Errors name the function `many` where a row for each of n impacts is given.
    """
    if not (type(posture) is Posture and type(ball) is Ball and type(contact) is Contact):
        validation.check_type(Posture, posture=posture)
        validation.check_type(Ball, ball=ball)
        validation.check_type(Contact, contact=contact)
    contact.check_normal()
    contact = contact.for_ball(ball)
    v = validation.vector("v", v, posture.leg.nv, many=many)
    if posture.constraint_projector is not None:
        posture.check_velocity(v)
    posture = posture.with_contact_offset(contact.offset)
    velocity, spin, ball_speed = _AT_REST, _AT_REST, 0.0
    if ball_velocity is not AT_REST:
        velocity = validation.vector("ball velocity", ball_velocity, 3, unit="m/s", many=many)
        ball_speed = largest(velocity)
    if ball_spin is not AT_REST:
        spin = validation.vector("ball spin", ball_spin, 3, unit="rad/s", many=many)
        ball_speed += largest(spin) * ball.radius
    # `dot` because `@` takes twice as long on three numbers.
    joint_speed = math.hypot(*v.tolist())
    fastest = posture.jacobian_norm * joint_speed + ball_speed
    if posture.leg.base_velocity is not None:
        transport = posture.transport_velocity
        fastest += largest(transport)
    if not fastest < MAX_SPEED:
        raise InvalidInput(
            f"foot and ball collide at up to {fastest:g} m/s in {posture!r}: it must be below "
            f"{MAX_SPEED:g} m/s, because larger energies exceed double precision"
        )
    foot_velocity = posture.jacobian.dot(v)
    if posture.leg.base_velocity is not None:
        foot_velocity = foot_velocity + transport
    validation.protect(v, foot_velocity, velocity, spin)
    fx, fy, fz = foot_velocity.tolist()
    bx, by, bz = velocity.tolist()
    nx, ny, nz = contact.normal.tolist()
    ux, uy, uz = centre_velocity = bx - fx, by - fy, bz - fz
    speed = -(nx * ux + ny * uy + nz * uz)
    if speed <= 0.0:
        outside = posture.leg.outside_range(posture.q)
        hint = f" (angles are in radians: {outside[0]})" if outside else ""
        raise NoImpact(
            f"foot and ball do not approach in {posture!r}: along the contact normal, which points "
            f"from foot to ball, the foot moves at {-speed:.6g} m/s away from the ball{hint}"
        )
    e = restitution_at(contact.restitution, speed)
    if speed < 1e-14 * fastest:  # the rounding itself takes longer to compute
        terms = abs(posture.jacobian).dot(abs(v)) + abs(foot_velocity) + abs(velocity)
        terms += abs(posture.transport_velocity)
        rounding = EPS * float(abs(contact.normal).dot(terms))
        if speed <= 4.0 * rounding:
            raise NoImpact(
                f"foot and ball approach along the normal at {speed:.3g} m/s in {posture!r}: that "
                f"is rounding, of {rounding:.1g} m/s in what cancels there"
            )
    return Approach(
        posture, v, ball, contact, velocity, spin, foot_velocity, centre_velocity, speed, e
    )
