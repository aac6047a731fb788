"""The physical effects of a scene: which it has, the scene without one, and bounds of each."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.scene.envelope import EXACT, Envelope, LaunchError
from kickdyn.scene.scene import Scene

INCLUDED = "neglected with"
"""Beginning of the reason of an effect whose bound is that of the effects it acts through."""


@dataclass(frozen=True)
class Effect:
    """One physical effect that a scene can have.

    Attributes:
        name: of the effect.
        is_in: whether a scene has it.
        without: returns the scene without it, given the launch.
        change: what neglecting it changes in the flight: the acceleration [m/s2] and the launch;
            None where it is not bounded, because it costs no time to model.
        reason: why the bound holds.
        through: names of the effects that this one acts through: where all of them are neglected,
            so is this one, and their bounds hold with it and without.
    """

    name: str
    is_in: Callable[[Scene], bool]
    without: Callable[[Scene, BallState], Scene]
    change: Callable[[Envelope], tuple[float, LaunchError]] | None = None
    reason: str = ""
    through: tuple[str, ...] = ()


class EffectVerdict(NamedTuple):
    """Whether one effect of the scene is modelled.

    Attributes:
        effect: name of the effect.
        modelled: whether the effect is modelled; otherwise it is neglected.
        bound: bound on how far neglecting it can move the end [m]; inf where no bound is known, nan
            where none was needed.
        why: reason for the decision.
    """

    effect: str
    modelled: bool
    bound: float
    why: str


@dataclass(frozen=True)
class EffectSize:
    """What neglecting one effect changes, everything else modelled.

    Attributes:
        effect: its name.
        end: distance that the end of the ball's path moves [m]; nan where there is no answer.
        impulse: magnitude of the change of the impulse on the ball [N s]; likewise.
        why_not: why there is none.
    """

    effect: str
    end: float
    impulse: float
    why_not: str = ""


def effects_of(scene: Scene) -> list[Effect]:
    """Return the effects that a scene has."""
    return [effect for effect in EFFECTS if effect.is_in(scene)]


def judge_effects(
    effects: Sequence[Effect], envelope: Envelope, allowed: float
) -> tuple[EffectVerdict, ...]:
    """Neglect the effects with the least bounds while they move the end by what is allowed [m].

    The envelope is around the flight of the scene whose effects these are. Changes of acceleration
    add up, and all that is neglected moves the end by more than the sum of what each does: the
    bounds of what is neglected are in proportion to those of each alone, and add up to the whole.
    """
    changes = {effect.name: effect.change(envelope) for effect in effects if effect.change}
    bounds = {name: envelope.shift(*change) for name, change in changes.items()}
    through = {effect.name: [o for o in effect.through if o in bounds] for effect in effects}

    def is_implied(name: str, out: list[str]) -> bool:
        """Return whether an effect acts only through others that are out."""
        return bool(through[name]) and all(outer in out for outer in through[name])

    def together(out: list[str]) -> float:
        """Return how far all of these effects together can move the end [m]."""
        found = [changes[name] for name in out if not is_implied(name, out)]
        errors = [error for _, error in found if error != EXACT]
        return envelope.shift(math.fsum(a for a, _ in found), *errors)

    out: list[str] = []
    for name in sorted(bounds, key=lambda name: bounds[name]):
        if together([*out, name]) <= allowed:
            out.append(name)
    alone = math.fsum(bounds[name] for name in out if not is_implied(name, out))
    factor = together(out) / alone if alone > 0.0 else 1.0
    verdicts = []
    for effect in effects:
        name, bound = effect.name, bounds.get(effect.name, math.nan)
        if effect.change is None:
            verdicts.append(
                EffectVerdict(name, True, bound, "always modelled, which costs no time")
            )
        elif name in out:
            if is_implied(name, out):
                why = f"{INCLUDED} {' and '.join(through[name])}"
                verdicts.append(EffectVerdict(name, False, 0.0, why))
            else:
                verdicts.append(EffectVerdict(name, False, factor * bound, effect.reason))
        else:
            why = "its bound is too large for the tolerance"
            if bound == math.inf:
                why = f"no bound is known: {envelope.obstacle}"
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


def _without_rotors(scene: Scene, _: BallState) -> Scene:
    """Return a scene whose joints of one degree of freedom have no armature."""
    leg = scene.leg
    sizes = list(leg.workspace.model.nvs)[1:]
    single = [name for name, size in zip(leg.joint_names, sizes, strict=True) if size == 1]
    return scene.replace(leg=leg.with_armature(dict.fromkeys(single, 0.0)))


def _constant_drag(air: Air, ball: Ball, launch: BallState) -> Air:
    """Return air with the drag coefficient of the launch, whatever the speed and the spin."""
    assert air.drag is not None
    speed = max(math.dist(launch.velocity, air.wind_at(float(launch.position[2]))), 1e-9)
    surface_speed = ball.radius * math.hypot(*launch.spin.tolist())
    reynolds = 2.0 * ball.radius * air.density / air.viscosity * speed
    return replace(air, drag=constant(air.drag(reynolds, surface_speed / speed)))


def _of_air(
    name: str,
    acts: Callable[[Air], bool],
    change: Callable[[Air, Ball, BallState], Air],
    through: tuple[str, ...] = (),
) -> Effect:
    """Return an effect of the air, bounded by its acceleration; `change` returns air without it."""

    def without(scene: Scene, launch: BallState) -> Scene:
        """Return the scene with the changed air."""
        assert scene.air is not None
        return scene.replace(air=change(scene.air, scene.ball, launch))

    def neglected(envelope: Envelope) -> tuple[float, LaunchError]:
        """Return the change of acceleration, and the error of the launch."""
        ball, air, *_ = envelope.environment
        assert air is not None
        return envelope.difference(change(air, ball, envelope.launch)), EXACT

    def is_in(scene: Scene) -> bool:
        """Return whether the effect acts in a scene."""
        return scene.air is not None and scene.air.density > 0.0 and acts(scene.air)

    return Effect(
        name,
        is_in,
        without,
        neglected,
        "bounded by its largest acceleration on the flight",
        through,
    )


EFFECTS = (
    Effect(
        "contact time",
        lambda scene: scene.is_compliant,
        lambda scene, _: scene.as_instant(),
        lambda envelope: (0.0, envelope.launch_error),
        "bounded by how the strike changes while the foot moves on",
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
        "supports",
        lambda scene: scene.leg.constraints is not None and bool(scene.leg.constraints.supports),
        lambda scene, _: scene.replace(leg=scene.leg.with_supports()),
    ),
    _of_air("drag", lambda air: air.drag is not None, lambda air, *_: replace(air, drag=None)),
    _of_air("drag crisis", lambda air: air.drag is not None, _constant_drag, ("drag",)),
    _of_air("lift", lambda air: air.lift is not None, lambda air, *_: replace(air, lift=None)),
    replace(
        _of_air(
            "spin decay",
            lambda air: air.torque is not None,
            lambda air, *_: replace(air, torque=None),
            ("drag", "lift"),
        ),
        change=lambda envelope: (envelope.spin_decay(), EXACT),
    ),
    _of_air(
        "wind",
        lambda air: callable(air.wind) or bool(air.wind.any()),
        lambda air, *_: replace(air, wind=(0.0, 0.0, 0.0)),
        ("drag", "lift"),
    ),
    _of_air("buoyancy", lambda air: air.buoyancy, lambda air, *_: replace(air, buoyancy=False)),
)
"""Every effect that can be neglected by itself. Those without a bound cost no time."""
