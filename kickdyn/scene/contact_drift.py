"""The strike of a scene, and what a contact that takes time may change, by strikes alone."""

import math
from typing import Any

import pinocchio as pin

from kickdyn.contact import Contact
from kickdyn.core.gravity import GRAVITY
from kickdyn.errors import KickdynError
from kickdyn.impact.collide import duration
from kickdyn.impact.force_model import Dissipation
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.scene.envelope import LaunchError
from kickdyn.scene.scene import Scene

CREEP = 2e-3
"""Share of the launch's speed: what sticks in a compliant contact creeps; the largest change of
spin by that, times the radius, was half of this in some 140 random kicks."""

SAFETY, SPIN_SAFETY = 2.0, 8.0
"""Factors on the change of the strike and of its spin, which also depends on whether the contact
sticks. Of some 140 random kicks the largest change of velocity was 0.8 of the result, of spin 0.7.
"""

UNKNOWN = LaunchError(math.inf, math.inf, math.inf)


def contact_drift(scene: Scene, impact: Impact) -> LaunchError:
    """Estimate how far the launch by `collide` is from the one by `strike` at most.

    The leg goes on with the mean of its velocities before and after the impact, its forces of
    inertia included, and the contact's normal turns with the foot. Half way and at the end of the
    contact the ball is struck anew; the result is the largest change, times a safety factor. Where
    that is no strike, nothing is known: inf. However brief, a contact that sticks does not tend to
    the law `newton` but to `stronge` (see `collide`): the difference of these laws is added. With
    supports, loops and mimic joints, which the leg would leave on a straight way, nothing is known
    either, nor with the dissipation `hunt-crossley` and friction, which tends to no law.
    """
    damped = scene.dissipation is Dissipation.HUNT_CROSSLEY and scene.contact.friction > 0.0
    if scene.leg.constraints is not None or damped:
        return UNKNOWN
    # it lasts up to half longer than of two masses, while the leg's inertia changes
    time = 1.5 * duration(impact.approach, scene.contact_time, scene.stiffness, scene.dissipation)
    leg, contact = scene.leg, scene.contact
    space, posture, launch = leg.workspace, impact.posture, impact.ball_after
    bias = pin.nonLinearEffects(space.model, space.data, scene.q, scene.v).copy()
    acceleration = posture.solve(-bias)
    mean = 0.5 * (impact.v_before + impact.v_after)
    velocity = spin = 0.0
    for share in (0.5, 1.0):
        moved = leg.posture(pin.integrate(space.model, scene.q, share * time * mean))
        turn = moved.rotation_world_joint @ posture.rotation_world_joint.T
        turned = Contact(
            turn @ contact.normal, contact.restitution, contact.friction, contact.offset
        )
        try:
            v = scene.v + share * time * acceleration
            again = strike_scene(scene, posture=moved, v=v, contact=turned)
        except KickdynError:
            return UNKNOWN
        velocity = max(velocity, math.dist(again.ball_after.velocity, launch.velocity))
        spin = max(spin, math.dist(again.ball_after.spin, launch.spin))
    by_law = law_spin = 0.0
    if contact.friction > 0.0:
        other = strike_scene(scene, law="stronge").ball_after
        creep = CREEP * float(launch.speed)
        by_law = math.dist(other.velocity, launch.velocity) + creep
        law_spin = math.dist(other.spin, launch.spin) + creep / scene.ball.radius
    fastest = max(float(launch.speed), math.hypot(*scene.ball_velocity))
    error = LaunchError(
        SAFETY * (velocity + by_law) + GRAVITY * time,
        SPIN_SAFETY * spin + SAFETY * law_spin + GRAVITY * time / scene.ball.radius,
        time * (fastest + velocity),
    )
    return error if _stays_clear(scene, impact, error) else UNKNOWN


def strike_scene(scene: Scene, **changes: Any) -> Impact:
    """Return the instantaneous impact of a scene, with some arguments of `strike` changed."""
    names = ("posture", "v", "ball", "contact", "law", "ball_velocity", "ball_spin")
    return strike(**{name: getattr(scene, name) for name in names} | changes)


def _stays_clear(scene: Scene, impact: Impact, error: LaunchError) -> bool:
    """Return whether the foot certainly does not press the ball into the ground or a plane."""
    before, after = impact.ball_before, impact.ball_after
    if scene.ground is not None:
        clearance = float(after.position[2]) - scene.ball.radius - scene.ground.height
        rise = float(before.velocity[2] + after.velocity[2]) - error.velocity
        if clearance < error.position and rise <= 0.0:
            return False
    return scene.plane is None or scene.plane.gap(scene.ball, after.position) > error.position
