"""The physical effects of a scene: which it has, the scene without one, and bounds of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import BallState
from kickdyn.scene.envelope import Envelope
from kickdyn.scene.scene import Scene


@dataclass(frozen=True)
class Effect:
    """One physical effect that a scene can have.

    Attributes:
        name: of the effect.
        is_in: whether a scene has it.
        without: returns the scene without it, given the launch.
        bound: how far neglecting it can move the end of the flight [m]; None where it is not
            bounded, because it costs no time to model.
        reason: why the bound holds.
        through: names of the effects that this one acts through: where all of them are neglected,
            so is this one, and their bounds hold with it and without.
    """

    name: str
    is_in: Callable[[Scene], bool]
    without: Callable[[Scene, BallState], Scene]
    bound: Callable[[Envelope], float] | None = None
    reason: str = ""
    through: tuple[str, ...] = ()


class EffectVerdict(NamedTuple):
    """Whether one effect of the scene is modelled.

    Attributes:
        effect: its name.
        modelled: whether it is; otherwise it is neglected.
        bound: how far neglecting it can move the end [m]; inf where no bound is known, nan where
            none was needed.
        why: the reason.
    """

    effect: str
    modelled: bool
    bound: float
    why: str


def effects_of(scene: Scene) -> list[Effect]:
    """Return the effects that a scene has."""
    return [effect for effect in EFFECTS if effect.is_in(scene)]


def judge_effects(
    effects: Sequence[Effect], envelope: Envelope, allowed: float
) -> tuple[EffectVerdict, ...]:
    """Leave out the effects with the least bounds while their sum is at most what is allowed [m].

    The envelope is around the flight of the scene whose effects these are.
    """
    bounds = {effect.name: effect.bound(envelope) for effect in effects if effect.bound is not None}
    through = {effect.name: [o for o in effect.through if o in bounds] for effect in effects}

    def is_implied(name: str, out: list[str]) -> bool:
        return bool(through[name]) and all(outer in out for outer in through[name])

    out: list[str] = []
    for name in sorted(bounds, key=lambda name: bounds[name]):
        more = [*out, name]
        if math.fsum(bounds[other] for other in more if not is_implied(other, more)) <= allowed:
            out = more
    implied = [name for name in bounds if is_implied(name, out)]
    verdicts = []
    for effect in effects:
        name, bound = effect.name, bounds.get(effect.name, math.nan)
        if effect.bound is None:
            verdicts.append(EffectVerdict(name, True, bound, "costs no time"))
        elif name in implied:
            verdicts.append(EffectVerdict(name, False, 0.0, effect.reason))
        elif name in out:
            verdicts.append(EffectVerdict(name, False, bound, effect.reason))
        else:
            why = "not bounded here" if bound == math.inf else "its bound exceeds the tolerance"
            verdicts.append(EffectVerdict(name, True, bound, why))
    return tuple(verdicts)


def without_neglected(scene: Scene, verdicts: Sequence[EffectVerdict], launch: BallState) -> Scene:
    """Return the scene without the effects that the verdicts neglect, itself if there are none.

    The launch is that of the ball from the foot.
    """
    reduced, out = scene, [verdict.effect for verdict in verdicts if not verdict.modelled]
    for effect in effects_of(scene):
        if effect.name in out and effect.is_in(reduced):
            reduced = effect.without(reduced, launch)
    return reduced


def _with_air(scene: Scene, **changes: Any) -> Scene:
    """Return a scene with some arguments of its air changed."""
    assert scene.air is not None
    return scene.replace(air=replace(scene.air, **changes))


def _has_air(condition: Callable[[Air], bool]) -> Callable[[Scene], bool]:
    """Return a function that says whether a scene has air for which a condition holds."""
    return lambda scene: scene.air is not None and scene.air.density > 0 and condition(scene.air)


def _without_rotors(scene: Scene, _: BallState) -> Scene:
    """Return a scene whose joints of one degree of freedom have no armature."""
    leg = scene.leg
    sizes = list(leg.workspace.model.nvs)[1:]
    single = [name for name, size in zip(leg.joint_names, sizes, strict=True) if size == 1]
    return scene.replace(leg=leg.with_armature(dict.fromkeys(single, 0.0)))


def _with_constant_drag(scene: Scene, launch: BallState) -> Scene:
    """Return a scene with the drag coefficient of the launch, whatever the speed and the spin."""
    air, radius = scene.air, scene.ball.radius
    assert air is not None
    assert air.drag is not None
    wind = np.zeros(3) if callable(air.wind) else air.wind
    speed = max(math.hypot(*(launch.velocity - wind).tolist()), 1e-9)
    surface_speed = radius * math.hypot(*launch.spin.tolist())
    reynolds = 2.0 * radius * air.density / air.viscosity * speed
    return _with_air(scene, drag=constant(air.drag(reynolds, surface_speed / speed)))


def _spin_decay_bound(envelope: Envelope) -> float:
    """Return how far the fastest decay of the spin can move the end [m]."""
    ball, air, *_ = envelope.environment
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
        lambda scene, _: scene.replace(contact_time=None),
        lambda envelope: envelope.shift(launch_error=envelope.launch_error),
        "twice what the strike changes while the foot moves on",
    ),
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
        "armature", lambda scene: bool(scene.leg.workspace.model.armature.any()), _without_rotors
    ),
    Effect(
        "stance",
        lambda scene: scene.leg.constraints is not None and bool(scene.leg.constraints.supports),
        lambda scene, _: scene.replace(leg=scene.leg.with_supports()),
    ),
    Effect(
        "drag",
        _has_air(lambda air: air.drag is not None),
        lambda scene, _: _with_air(scene, drag=None),
        lambda envelope: envelope.shift(envelope.drag),
        "the largest of the flight, all the time",
    ),
    Effect(
        "drag crisis",
        _has_air(lambda air: air.drag is not None),
        _with_constant_drag,
        lambda envelope: envelope.shift(envelope.drag_crisis),
        "the largest change from a constant coefficient",
        through=("drag",),
    ),
    Effect(
        "lift",
        _has_air(lambda air: air.lift is not None),
        lambda scene, _: _with_air(scene, lift=None),
        lambda envelope: envelope.shift(envelope.lift),
        "the largest of the flight, all the time",
    ),
    Effect(
        "spin decay",
        _has_air(lambda air: air.torque is not None),
        lambda scene, _: _with_air(scene, torque=None),
        _spin_decay_bound,
        "the fastest decay, times what spin changes",
        through=("drag", "lift"),
    ),
    Effect(
        "wind",
        _has_air(lambda air: callable(air.wind) or bool(air.wind.any())),
        lambda scene, _: _with_air(scene, wind=(0.0, 0.0, 0.0)),
        lambda envelope: envelope.shift(envelope.by_wind),
        "the largest change of drag and lift, all the time",
        through=("drag", "lift"),
    ),
    Effect(
        "buoyancy",
        _has_air(lambda air: air.buoyancy),
        lambda scene, _: _with_air(scene, buoyancy=False),
        lambda envelope: envelope.shift(envelope.buoyancy),
        "its acceleration, all the time",
    ),
)
"""Every effect that can be neglected by itself. Those without a bound cost no time."""
