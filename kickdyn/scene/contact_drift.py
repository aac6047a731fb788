"""What a contact that takes time may change, from the instant's strike alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin

from kickdyn.contact import Contact
from kickdyn.errors import KickdynError
from kickdyn.flight.forces import GRAVITY
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.scene.envelope import Jump
from kickdyn.scene.scene import Scene

CREEP = 2e-3
"""Of the speed of the launch: what sticks in a contact that takes time creeps; the largest change
of spin by it, times the radius, was half of that in some 140 random kicks."""

LONGER = 1.5
"""Contact time that comes out over the one asked for, at most, while the leg's inertia changes."""

SAFETY, SPIN_SAFETY = 2.0, 8.0
"""On the change of the strike and of its spin, which also depends on whether the contact sticks. Of
some 140 random kicks the largest change of velocity was 0.8 of what comes out, of spin 0.7."""


def contact_drift(scene: Scene, hit: Impact) -> Jump:
    """Estimate how far `collide` is from `strike` at most: along the way, with a factor.

    The leg goes on with the mean of its velocities before and after, its forces of inertia
    included, and the foot's plane turns with it. Half way and at the end the ball is struck anew.
    Where that is not a strike, nothing is known: inf. However brief, a contact that sticks does not
    tend to `newton` (see `collide`); it stays nearer to `stronge`, which follows the sliding, too:
    what these laws differ by comes on top.

    Args:
        scene: with a contact time.
        hit: its strike.
    """
    assert scene.contact_time is not None
    time, leg, contact = LONGER * scene.contact_time, scene.leg, scene.contact
    space, posture = leg.workspace, hit.posture
    bias = pin.nonLinearEffects(space.model, space.data, scene.q, scene.v).copy()
    drift = posture.solve(-bias)
    mean = 0.5 * (hit.v_before + hit.v_after)
    motion: dict[str, Any] = {"ball_velocity": scene.ball_velocity, "ball_spin": scene.ball_spin}
    velocity = spin = 0.0
    for share in (0.5, 1.0):
        there = leg.posture(pin.integrate(space.model, scene.q, share * time * mean))
        turn = there.joint_rotation @ posture.joint_rotation.T
        tilted = Contact(
            turn @ contact.normal, contact.restitution, contact.friction, contact.offset
        )
        try:
            again = strike(
                there,
                scene.v + share * time * drift,
                scene.ball,
                tilted,
                **motion,
            )
        except KickdynError:
            return Jump(math.inf, math.inf, math.inf)
        velocity = max(
            velocity, float(np.linalg.norm(again.ball_after.velocity - hit.ball_after.velocity))
        )
        spin = max(spin, float(np.linalg.norm(again.ball_after.spin - hit.ball_after.spin)))
    law, turned = _between_laws(scene, hit, motion)
    fastest = max(float(hit.ball_after.speed), float(np.linalg.norm(scene.ball_velocity)))
    jump = Jump(
        SAFETY * (velocity + law) + GRAVITY * time,
        SPIN_SAFETY * spin + SAFETY * turned + GRAVITY * time / scene.ball.radius,
        time * (fastest + velocity),
    )
    return jump if _stays_clear(scene, hit, jump) else Jump(math.inf, math.inf, math.inf)


def _between_laws(scene: Scene, hit: Impact, motion: dict[str, Any]) -> tuple[float, float]:
    """Return what a contact that sticks may change in velocity and spin, however brief it is."""
    if scene.contact.friction == 0.0:
        return 0.0, 0.0
    other = strike(scene.posture, scene.v, scene.ball, scene.contact, "stronge", **motion)
    creep = CREEP * float(hit.ball_after.speed)
    law = float(np.linalg.norm(other.ball_after.velocity - hit.ball_after.velocity))
    turned = float(np.linalg.norm(other.ball_after.spin - hit.ball_after.spin))
    return law + creep, turned + creep / scene.ball.radius


def _stays_clear(scene: Scene, hit: Impact, jump: Jump) -> bool:
    """Return whether the foot surely does not press the ball into the ground or a plane."""
    if scene.ground is not None:
        over = float(hit.ball_after.position[2]) - scene.ball.radius - scene.ground.height
        rise = float(hit.ball_before.velocity[2] + hit.ball_after.velocity[2]) - jump.velocity
        if over < jump.moved and rise <= 0.0:
            return False
    return scene.plane is None or scene.plane.gap(scene.ball, hit.ball_after.position) > jump.moved
