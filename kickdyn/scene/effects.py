"""The physical effects of a scene: which it has, and the scene without one."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.scene.scene import Scene


@dataclass(frozen=True)
class Effect:
    """A physical effect; `without` returns the scene without it, given the launch.

    With `in_flight` it changes the flight only, not the launch.
    """

    name: str
    is_in: Callable[[Scene], bool]
    without: Callable[[Scene, BallState], Scene]
    in_flight: bool = False


@dataclass(frozen=True)
class EffectSize:
    """What neglecting one effect changes, everything else modelled.

    Attributes:
        effect: name of the effect.
        end: distance that the end of the ball's path moves [m]; nan where there is no answer.
        impulse: magnitude of the change of the impulse on the ball [N s]; likewise.
        why_not: why there is no answer.
        seconds: processor time of the answer without the effect; of its path alone, where the
            effect does not change the launch [s].
    """

    effect: str
    end: float
    impulse: float
    why_not: str = ""
    seconds: float = 0.0


def effects_of(scene: Scene) -> list[Effect]:
    """Return the effects that a scene has."""
    return [effect for effect in EFFECTS if effect.is_in(scene)]


def _constant_drag(air: Air, ball: Ball, launch: BallState) -> Air:
    assert air.drag is not None
    speed = max(math.dist(launch.velocity, air.wind_at(float(launch.position[2]))), 1e-9)
    surface_speed = ball.radius * math.hypot(*launch.spin.tolist())
    reynolds = 2.0 * ball.radius * air.density / air.viscosity * speed
    return replace(air, drag=constant(air.drag(reynolds, surface_speed / speed)))


def _of_air(
    name: str, acts: Callable[[Air], bool], change: Callable[[Air, Ball, BallState], Air]
) -> Effect:
    def without(scene: Scene, launch: BallState) -> Scene:
        assert scene.air is not None
        return scene.replace(air=change(scene.air, scene.ball, launch))

    def is_in(scene: Scene) -> bool:
        return scene.air is not None and scene.air.density > 0.0 and acts(scene.air)

    return Effect(name, is_in, without, in_flight=True)


def _has_force(air: Air) -> bool:
    """Return whether drag or lift acts, through which wind and spin decay change the path."""
    return air.drag is not None or air.lift is not None


EFFECTS = (
    Effect("contact time", lambda scene: scene.is_compliant, lambda scene, _: scene.as_instant()),
    Effect(
        "friction",
        lambda scene: scene.contact.friction > 0.0,
        lambda scene, _: scene.replace(contact=replace(scene.contact, friction=0.0)),
    ),
    Effect(
        "ball rotation",
        lambda scene: scene.ball.inertia_factor < math.inf,
        lambda scene, _: scene.replace(ball=replace(scene.ball, inertia_factor=math.inf)),
    ),
    Effect(
        "armature",
        lambda scene: bool(scene.leg.workspace.model.armature.any()),
        lambda scene, _: scene.with_leg(scene.leg.without_rotors()),
    ),
    Effect(
        "supports",
        lambda scene: scene.leg.constraints is not None and bool(scene.leg.constraints.supports),
        lambda scene, _: scene.with_leg(scene.leg.with_supports()),
    ),
    _of_air("drag", lambda air: air.drag is not None, lambda air, *_: replace(air, drag=None)),
    _of_air("drag crisis", lambda air: air.drag is not None, _constant_drag),
    _of_air("lift", lambda air: air.lift is not None, lambda air, *_: replace(air, lift=None)),
    _of_air(
        "spin decay",
        lambda air: air.torque is not None and _has_force(air),
        lambda air, *_: replace(air, torque=None),
    ),
    _of_air(
        "wind",
        lambda air: (callable(air.wind) or bool(air.wind.any())) and _has_force(air),
        lambda air, *_: replace(air, wind=(0.0, 0.0, 0.0)),
    ),
    _of_air("buoyancy", lambda air: air.buoyancy, lambda air, *_: replace(air, buoyancy=False)),
)
"""Every effect that can be neglected by itself."""
