"""The table of effects: how a scene looks without each, and how far that can move the end."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import BallState
from kickdyn.contact import Contact
from kickdyn.scene.envelope import Envelope
from kickdyn.scene.scene import Scene

Bound = Callable[[Envelope], float]


@dataclass(frozen=True)
class Effect:
    """One physical effect that a scene can name.

    Attributes:
        name: of it.
        named: whether a scene has it.
        without: the scene without it, given the launch.
        bound: how far leaving it out can move the end of the flight [m]; None: not bounded, for
            it costs no time to model.
        argument: why the bound holds.
        within: effects that take this one along when all of them go: it acts through them, and
            their bounds hold with it and without.
    """

    name: str
    named: Callable[[Scene], bool]
    without: Callable[[Scene, BallState], Scene]
    bound: Bound | None
    argument: str
    within: tuple[str, ...] = ()


def changed(scene: Scene, **parts: Any) -> Scene:
    """Return a scene with some of its parts, valid ones, replaced; another leg stands anew."""
    other = copy.copy(scene)
    other.__dict__.update(parts)
    if "leg" in parts:
        posture = other.leg.posture(scene.q).with_contact_offset(scene.contact.offset)
        other.__dict__.update(posture=posture)
    return other


def with_air(scene: Scene, **parts: Any) -> Scene:
    """Return a scene whose air has some of its parts replaced."""
    air = scene.air
    assert air is not None
    names = ("density", "viscosity", "wind", "drag", "lift", "torque", "buoyancy")
    return changed(scene, air=Air(**{**{name: getattr(air, name) for name in names}, **parts}))


def _air(name: str) -> Callable[[Scene], bool]:
    return lambda scene: (
        scene.air is not None and scene.air.density > 0 and getattr(scene.air, name) is not None
    )


def _windy(scene: Scene) -> bool:
    air = scene.air
    return air is not None and air.density > 0 and (callable(air.wind) or bool(air.wind.any()))


def _buoyant(scene: Scene) -> bool:
    return scene.air is not None and scene.air.buoyancy and scene.air.density > 0


def _rough(scene: Scene) -> bool:
    return scene.contact.friction > 0.0


def _smooth(scene: Scene, _: BallState) -> Scene:
    contact = scene.contact
    return changed(scene, contact=Contact(contact.normal, contact.restitution, 0.0, contact.offset))


def _particle(scene: Scene, _: BallState) -> Scene:
    return changed(scene, ball=replace(scene.ball, inertia_factor=math.inf))


def _rotorless(scene: Scene, _: BallState) -> Scene:
    leg = scene.leg
    sizes = list(leg.workspace.model.nvs)[1:]
    single = [name for name, size in zip(leg.joint_names, sizes, strict=True) if size == 1]
    return changed(scene, leg=leg.with_armature(dict.fromkeys(single, 0.0)))


def _let_go(scene: Scene, _: BallState) -> Scene:
    return changed(scene, leg=scene.leg.with_supports())


def _constant_drag(scene: Scene, launch: BallState) -> Scene:
    """With the coefficient of the launch, whatever the speed and the spin."""
    air, radius = scene.air, scene.ball.radius
    assert air is not None
    assert air.drag is not None
    blown = np.zeros(3) if callable(air.wind) else air.wind
    speed = max(math.hypot(*(launch.velocity - blown).tolist()), 1e-9)
    turning = radius * math.hypot(*launch.spin.tolist())
    reynolds = 2.0 * radius * air.density / air.viscosity * speed
    return with_air(scene, drag=constant(air.drag(reynolds, turning / speed)))


def _decay(envelope: Envelope) -> float:
    air, ball = envelope.way.air, envelope.way.ball
    assert air is not None
    assert air.torque is not None
    if not math.isfinite(envelope.time):
        return envelope.shift(1.0)
    fastest, per_speed = max(envelope.speeds), 2.0 * ball.radius * air.density / air.viscosity
    most = max(air.torque(per_speed * speed, 0.0) for speed in envelope.speeds)
    rate = air.density * ball.cross_section * ball.radius**2 * most * fastest
    rate += 8.0 * math.pi * air.viscosity * ball.radius**3
    lost = -math.expm1(-rate / ball.inertia * envelope.time)
    return envelope.shift(envelope.by_spin * envelope.spin * lost)


EFFECTS = (
    Effect(
        "compliance",
        lambda scene: scene.contact_time is not None,
        lambda scene, _: changed(scene, contact_time=None),
        lambda envelope: envelope.shift(jump=envelope.jump),
        "twice what the strike changes while the foot moves on",
    ),
    Effect("friction", _rough, _smooth, None, "of foot and ball"),
    Effect(
        "turning of the ball",
        lambda scene: scene.ball.inertia_factor < math.inf,
        _particle,
        None,
        "a shell, not a particle",
    ),
    Effect(
        "armature",
        lambda scene: bool(scene.leg.workspace.model.armature.any()),
        _rotorless,
        None,
        "rotors behind the joints",
    ),
    Effect(
        "stance",
        lambda scene: scene.leg.constraints is not None and bool(scene.leg.constraints.supports),
        _let_go,
        None,
        "feet that hold the robot",
    ),
    Effect(
        "drag",
        _air("drag"),
        lambda scene, _: with_air(scene, drag=None),
        lambda envelope: envelope.shift(envelope.drag),
        "the largest of the flight, all the time",
    ),
    Effect(
        "drag crisis",
        _air("drag"),
        _constant_drag,
        lambda envelope: envelope.shift(envelope.crisis),
        "the largest change from a constant coefficient",
        within=("drag",),
    ),
    Effect(
        "lift",
        _air("lift"),
        lambda scene, _: with_air(scene, lift=None),
        lambda envelope: envelope.shift(envelope.lift),
        "the largest of the flight, all the time",
    ),
    Effect(
        "spin decay",
        _air("torque"),
        lambda scene, _: with_air(scene, torque=None),
        _decay,
        "the fastest decay, times what spin changes",
        within=("drag", "lift"),
    ),
    Effect(
        "wind",
        _windy,
        lambda scene, _: with_air(scene, wind=(0.0, 0.0, 0.0)),
        lambda envelope: envelope.shift(envelope.by_wind),
        "the largest change of drag and lift, all the time",
        within=("drag", "lift"),
    ),
    Effect(
        "buoyancy",
        _buoyant,
        lambda scene, _: with_air(scene, buoyancy=False),
        lambda envelope: envelope.shift(envelope.buoyancy),
        "its acceleration, all the time",
    ),
)
"""Every effect that can be told apart. Those of the impact without a bound cost no time."""
