"""The launch of a scene's ball and the end of its path, and how far errors move that end."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.ball import Ball, BallState
from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.derivatives import fly_with_launch_slopes
from kickdyn.flight.flight_result import Flight, FlightStatus
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course, follow
from kickdyn.flight.forces import acceleration_function
from kickdyn.impact.collide import Collision, collide, duration, takes_inflated_force
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.impact.uncertainty import Uncertainty
from kickdyn.scene.scene import Compliance, Scene

STATUSES_WITH_END = (FlightStatus.LANDED, FlightStatus.AT_PLANE, FlightStatus.AT_REST)
"""Statuses of a path that has an end; any other says why the integration was given up."""

SMALLEST_TOLERANCE = 1e-9
"""Relative tolerance of the integrators of flight and, at tightest, of contact."""

USUAL_TOLERANCE = 1e-6
"""Relative tolerance of the integrator of the contact at first; larger ones save no time."""

COLLIDE_SAFETY = 10.0
"""Relative error of a launch by `collide` over the integrator's tolerance; it was less in 98 % of
200 random kicks, with tolerances from 1e-5 to 1e-3. What `end_error` adds covers the others."""

END_SAFETY = 1.2
"""Factor on the error of an end for what `end_error` leaves out: lift that turns the error of a
velocity, a drag coefficient that falls with speed. In 400 random paths the end moved by at most 0.9
of the result."""

BOUNCE_SAFETY = 2.0
"""Further factor on the error of the velocity after a bounce."""

VELOCITY_SAFETY, SPIN_SAFETY = 2.0, 8.0
"""Factors on the changes of the launch. In 140 random kicks the launch by `collide` differed by at
most 0.8 of the estimate in velocity, and 0.7 in spin."""


class LaunchError(NamedTuple):
    """By how much velocity [m/s], spin [rad/s] and position [m] of a launch may be wrong."""

    velocity: float
    spin: float
    position: float


UNKNOWN = LaunchError(math.inf, math.inf, math.inf)
"""Error of a launch of which nothing is known."""


class EndSlopes(NamedTuple):
    """Derivatives of the end by velocity [s] and spin [m s] of the launch, `(3, 3)`, or inf."""

    velocity: Array
    spin: Array

    def deviation(self, launch: Uncertainty) -> float:
        r"""Return the standard deviation of the end, to first order [m].

        It is :math:`\sqrt{\mathrm{tr}(A V A^T)} + \sqrt{\mathrm{tr}(B W B^T)}` with these
        slopes A, B and covariances V, W of velocity and spin, which depend on the same
        sources.
        """
        if not np.isfinite(self.velocity).all():
            return math.inf
        pairs = ((self.velocity, launch.velocity), (self.spin, launch.spin))
        variances = (float(np.trace(slope @ cov @ slope.T)) for slope, cov in pairs)
        return math.fsum(math.sqrt(max(variance, 0.0)) for variance in variances)


def strike_scene(scene: Scene, **changes: Any) -> Impact:
    """Return the instantaneous impact of a scene, by `newton` if its contact takes time."""
    law = "newton" if scene.is_compliant else scene.law
    return strike(**{**scene._impact_arguments, "law": law, **changes})


def collide_scene(scene: Scene, tol: float) -> Collision:
    """Return the impact of a scene whose contact takes time, to a relative tolerance."""
    assert isinstance(scene.law, Compliance)
    return collide(**scene._impact_arguments, **scene.law.options, tol=tol)


def fly_scene(scene: Scene, launch: BallState, tol: float = SMALLEST_TOLERANCE) -> Flight | Course:
    """Return the path of a scene's ball: by `follow` where the ground has a surface, else `fly`."""
    method = follow if scene.is_followed else fly
    return method(launch, scene.ball, scene.air, scene.ground, tol, plane=scene.plane)


def end_of(path: Flight | Course) -> BallState:
    """Return the ball at the end of its path."""
    return path.rest if isinstance(path, Course) else path.landing


def path_error(scene: Scene, path: Flight | Course) -> float:
    """Estimate the numerical error of the end of a path [m]."""
    if isinstance(path, Flight):
        return path.error
    finer = fly_scene(scene, path.launch, 1e-2 * path.flights[0].tol)
    if finer.status != path.status:
        return math.inf
    return 2.0 * math.dist(end_of(finer).position, path.rest.position)


def end_slopes(scene: Scene, path: Flight | Course) -> EndSlopes:
    """Return the derivatives of a path's end by its launch; after a bounce, by differences."""
    launch, unknown = path.launch, EndSlopes(*np.full((2, 3, 3), math.inf))
    if path.status not in STATUSES_WITH_END or float(launch.speed) == 0.0:
        return unknown
    if path.duration == 0.0:  # the ball starts where its path ends
        return EndSlopes(*np.zeros((2, 3, 3)))
    with suppress(KickdynError):
        if isinstance(path, Flight):
            time = path.duration
            flight = fly_with_launch_slopes(launch, scene.ball, scene.air, time, SMALLEST_TOLERANCE)
            slopes, _ = flight.slopes_at_plane(_normal_at_end(scene, path), time)
            return EndSlopes(slopes[:, :3], slopes[:, 3:6])
        differences, speed = np.zeros((2, 3, 3)), float(launch.speed)
        for kind, size in (("velocity", speed), ("spin", speed / scene.ball.radius)):
            step = 1e-4 * size  # more than what integration and bounces round
            for axis, way in enumerate(np.eye(3)):
                changed = replace(launch, **{kind: getattr(launch, kind) + step * way})
                neighbour = fly_scene(scene, changed)
                if neighbour.status not in STATUSES_WITH_END:
                    return unknown
                change = end_of(neighbour).position - path.rest.position
                differences[int(kind == "spin"), :, axis] = change / step
        return EndSlopes(*differences)
    return unknown


def _normal_at_end(scene: Scene, flight: Flight) -> Array:
    if flight.status == FlightStatus.AT_PLANE and scene.plane is not None:
        return scene.plane.normal
    return np.array([0.0, 0.0, 1.0])


def end_error(scene: Scene, path: Flight | Course, error: LaunchError) -> float:
    r"""Return the largest displacement of a path's end by an error of its launch, roughly [m].

    .. math:: s\left(c\,(\delta x + \delta v\, t + \tfrac12 \delta a\, t^2)
        + \delta v'\,(c\, t' + t'')\right)

    with the time t of the first flight, the change :math:`\delta a` of the acceleration at the
    launch by the error of the spin, and :math:`c = |v| / |n \cdot v|` where the ball meets the
    ground or a plane of normal n: an error of the time moves the end along it. Drag lets errors
    decay. In the further flights, of time :math:`t'`, and for the time :math:`t''` on the ground,
    the velocity is wrong by the spin, too, and by the bounces, of which there may be one more.
    """
    if path.status not in STATUSES_WITH_END or not error.velocity < math.inf:
        return math.inf
    if path.duration == 0.0:  # the ball starts where its path ends
        return error.position
    flights = path.flights if isinstance(path, Course) else (path,)
    in_air = math.fsum(passage.duration for passage in flights)
    flight, time = flights[0], float(flights[0].duration)
    arrival = flight.landing.velocity
    normal_speed = abs(float(_normal_at_end(scene, flight) @ arrival))
    slant = math.hypot(*arrival) / normal_speed if normal_speed > 0.0 else math.inf
    slant = slant if time > 0.0 else 1.0
    lift_change = 0.0  # of the acceleration at the launch, by the error of the spin [m/s2]
    if scene.air is not None and scene.air.lift is not None and error.spin > 0.0:
        acceleration = acceleration_function(scene.ball, scene.air)
        state = float(path.launch.position[2]), *path.launch.velocity.tolist()
        spins = path.launch.spin + error.spin * np.vstack([np.zeros(3), np.eye(3)])
        first, *changed = (acceleration(*state, *spin)[:3] for spin in spins.tolist())
        lift_change = max(math.dist(rates, first) for rates in changed)
    faster = error.velocity + 0.5 * lift_change * time
    displacement = error.position + faster * time
    bounced = BOUNCE_SAFETY * (error.velocity + scene.ball.radius * error.spin)
    displacement = slant * (displacement + bounced * (in_air - time))
    return END_SAFETY * float(displacement + bounced * (path.duration - in_air))


def collision_error(ball: Ball, launch: BallState, tol: float) -> LaunchError:
    """Return the usual error, by `COLLIDE_SAFETY`, of a launch by `collide` to a tolerance."""
    speed, spin = float(launch.speed), float(np.linalg.norm(launch.spin))
    share = COLLIDE_SAFETY * tol
    return LaunchError(share * speed, share * max(spin, speed / ball.radius), share * ball.radius)


def contact_time_error(scene: Scene, impact: Impact) -> LaunchError:
    """Estimate how far the launch by `collide` is at most from the launch by `strike`.

    The leg moves on with the mean of its velocities before and after the impact, its forces of
    inertia included, and the normal of the contact turns with the foot. The ball is struck again at
    the end of the contact and in its middle; the estimate is the largest change, times a safety
    factor, and the difference of the laws `stronge` and `newton`: a brief contact that sticks tends
    to the former (see `collide`).

    The error is inf, as it is not known, where one of these strikes has no impact; with supports,
    loops and mimic joints, which a straight motion leaves; with drives of some stiffness or
    friction; with the force of an inflated ball, whose restitution is another one; and where the
    foot may press the ball into the ground or a plane.
    """
    law, leg, contact = scene.law, scene.leg, scene.contact
    assert isinstance(law, Compliance)
    inflated = takes_inflated_force(contact, **law.options)
    if leg.constraints is not None or leg.compliant_drives or inflated:
        return UNKNOWN
    # it lasts up to half longer than of two masses, while the leg's inertia changes
    time = 1.5 * duration(impact.approach, **law.options)
    space, posture, launch = leg.workspace, impact.posture, impact.ball_after
    bias = pin.nonLinearEffects(space.model, space.data, scene.q, scene.v).copy()
    acceleration = posture.solve(-bias)
    mean_velocity = 0.5 * (impact.v_before + impact.v_after)
    try:
        launches = []
        for fraction in (1.0, 0.5):
            q = pin.integrate(space.model, scene.q, fraction * time * mean_velocity)
            displaced = leg.posture(q)
            turn = displaced.rotation_world_joint @ posture.rotation_world_joint.T
            rotated = replace(contact, normal=turn @ contact.normal)
            v = scene.v + fraction * time * acceleration
            launches.append(strike_scene(scene, posture=displaced, v=v, contact=rotated).ball_after)
        law_launch = strike_scene(scene, law="stronge").ball_after if contact.friction else launch
    except KickdynError:
        return UNKNOWN

    def change(of: str, balls: Sequence[BallState]) -> float:
        return max(math.dist(getattr(ball, of), getattr(launch, of)) for ball in balls)

    velocity, spin = change("velocity", launches), change("spin", launches)
    fastest = max(float(launch.speed), math.hypot(*scene.incoming.velocity))
    error = LaunchError(
        VELOCITY_SAFETY * (velocity + change("velocity", [law_launch])) + GRAVITY * time,
        SPIN_SAFETY * spin
        + VELOCITY_SAFETY * change("spin", [law_launch])
        + GRAVITY * time / scene.ball.radius,
        time * (fastest + velocity),
    )
    if scene.ground is not None:
        clearance = float(launch.position[2]) - scene.ball.radius - scene.ground.height
        rise = float(impact.ball_before.velocity[2] + launch.velocity[2]) - error.velocity
        if clearance < error.position and rise <= 0.0:
            return UNKNOWN
    is_clear = scene.plane is None or scene.plane.gap(scene.ball, launch.position) > error.position
    return error if is_clear else UNKNOWN
