"""The physical effects of a scene: which it has, the scene without one, and which may be neglected.

A new effect is an `Effect` in `EFFECTS`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import Ball, BallState
from kickdyn.core.validation import Array
from kickdyn.errors import KickdynError
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.forces import acceleration_function
from kickdyn.scene.launch_and_end import PathEnd, end_normal, fly_scene
from kickdyn.scene.scene import Scene

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)
"""Gauss's rule, by which accelerations along a flight are integrated."""


@dataclass(frozen=True)
class Effect:
    """One physical effect that a scene can have.

    Attributes:
        name: of the effect.
        is_in: whether a scene has it.
        without: returns the scene without it, given the launch.
        in_flight: whether it changes the flight only, not the launch.
    """

    name: str
    is_in: Callable[[Scene], bool]
    without: Callable[[Scene, BallState], Scene]
    in_flight: bool = False


class EffectVerdict(NamedTuple):
    """Whether one effect of the scene is modelled.

    Attributes:
        effect: name of the effect.
        modelled: whether the effect is modelled; otherwise it is neglected.
        size: how far neglecting it moves the end, to first order [m]; inf where that is not known,
            nan where it was not needed.
        why: reason for the decision.
    """

    effect: str
    modelled: bool
    size: float
    why: str


@dataclass(frozen=True)
class EffectSize:
    """What neglecting one effect changes, everything else modelled.

    Attributes:
        effect: name of the effect.
        end: distance that the end of the ball's path moves [m]; nan where there is no answer.
        impulse: magnitude of the change of the impulse on the ball [N s]; likewise.
        why_not: why there is no answer.
    """

    effect: str
    end: float
    impulse: float
    why_not: str = ""


def effects_of(scene: Scene) -> list[Effect]:
    """Return the effects that a scene has."""
    return [effect for effect in EFFECTS if effect.is_in(scene)]


class Reduction(NamedTuple):
    """The path of a scene without the effects of the flight that do not matter.

    Attributes:
        end: of the path.
        error: distance of this end from the end with all effects [m].
        verdicts: on each effect of the scene but the contact time.
        evaluations: of the acceleration, in all flights.
    """

    end: PathEnd
    error: float
    verdicts: tuple[EffectVerdict, ...]
    evaluations: int


def neglect_effects(scene: Scene, full: PathEnd, allowed: float) -> Reduction:
    """Neglect the effects of the flight with the smallest sizes, as far as an error is allowed [m].

    Their sizes add up to at most what is allowed. The flight without them is then compared with the
    flight that has all effects; if the ends are farther apart, the largest of the neglected effects
    is modelled again.
    """
    launch, evaluations = full.path.launch, full.evaluations
    in_flight = [effect for effect in effects_of(scene) if effect.in_flight]
    obstacle, sizes = "", dict.fromkeys([effect.name for effect in in_flight], math.inf)
    if not full.has_end:
        obstacle = "modelled, as the path has no end"
    elif not isinstance(full.path, Flight):
        obstacle = "modelled, as small differences grow after a bounce"
    elif in_flight:
        sizes = first_order_sizes(scene, in_flight, full.path)
        evaluations += len(NODES) * (1 + len(sizes))
    smallest = sorted(in_flight, key=lambda effect: sizes[effect.name])
    sums = accumulate(sizes[effect.name] for effect in smallest)
    neglected = smallest[: sum(total <= allowed for total in sums)]
    while neglected:
        reduced = scene
        for effect in neglected:
            reduced = effect.without(reduced, launch)
        with suppress(KickdynError):  # as where it leaves the range of a coefficient
            end = fly_scene(reduced, launch)
            evaluations += end.evaluations
            error = math.dist(end.state.position, full.state.position)
            if end.path.status == full.path.status and error <= allowed:
                verdicts = _verdicts(scene, reduced, neglected, sizes, obstacle)
                return Reduction(end, error, verdicts, evaluations)
        neglected.pop()
    return Reduction(full, 0.0, _verdicts(scene, scene, [], sizes, obstacle), evaluations)


def first_order_sizes(scene: Scene, effects: Sequence[Effect], flight: Flight) -> dict[str, float]:
    r"""Return by effect how far neglecting it moves the end of a flight, to first order [m].

    Without the effect the acceleration is :math:`a'` in place of :math:`a`. Along the flight, of
    duration T, which ends at a surface of normal n with the velocity v,

    .. math:: \delta = \int_0^T (T - t)\, (a' - a)\, dt, \qquad
        \text{size} = \left| \delta - v\, \frac{n \cdot \delta}{n \cdot v} \right| .

    It is inf where the ball only grazes that surface.
    """
    times = 0.5 * flight.duration * (1.0 + NODES)
    weights = 0.5 * flight.duration * WEIGHTS * (flight.duration - times)
    states = flight.sample(times)
    normal, velocity = end_normal(scene, flight), flight.landing.velocity
    closing = float(normal @ velocity)
    accelerations, sizes = _accelerations(scene, flight.launch, states), {}
    for effect in effects:
        less = effect.without(scene, flight.launch)
        moved = weights @ (_accelerations(less, flight.launch, states) - accelerations)
        sizes[effect.name] = math.inf
        if closing != 0.0:
            late = float(normal @ moved) / closing
            sizes[effect.name] = float(np.linalg.norm(moved - velocity * late))
    return sizes


def _accelerations(scene: Scene, launch: BallState, states: BallState) -> Array:
    """Return the accelerations of n states in the air of a scene, shape `(n, 3)` [m/s2].

    Where the spin does not decay, it is the spin of the launch.
    """
    assert scene.air is not None
    acceleration = acceleration_function(scene.ball, scene.air)
    decays = scene.air.torque is not None
    spins = states.spin if decays else np.tile(launch.spin, (len(NODES), 1))
    rows = np.column_stack([states.position[:, 2], states.velocity, spins])
    return np.array([acceleration(*row)[:3] for row in rows.tolist()])


def _verdicts(
    scene: Scene,
    reduced: Scene,
    neglected: Sequence[Effect],
    sizes: Mapping[str, float],
    obstacle: str,
) -> tuple[EffectVerdict, ...]:
    """Return the verdict on each effect of a scene; the reduced scene has no neglected ones."""
    verdicts = []
    for effect in effects_of(scene):
        if effect.name == "contact time":
            continue
        is_modelled = effect not in neglected and effect.is_in(reduced)
        why = "its size is small enough"
        if not effect.in_flight:
            why = "always modelled, which costs no time"
        elif is_modelled:
            why = obstacle or "its size is too large for the tolerance"
        elif effect not in neglected:
            why = "it does nothing without the effects that are neglected"
        size = sizes.get(effect.name, math.nan)
        verdicts.append(EffectVerdict(effect.name, is_modelled, size, why))
    return tuple(verdicts)


def _without_rotors(scene: Scene, _: BallState) -> Scene:
    """Return a scene whose joints of one degree of freedom have no armature."""
    leg = scene.leg
    sizes = list(leg.workspace.model.nvs)[1:]
    single = [name for name, size in zip(leg.joint_names, sizes, strict=True) if size == 1]
    return scene.with_leg(leg.with_armature(dict.fromkeys(single, 0.0)))


def _constant_drag(air: Air, ball: Ball, launch: BallState) -> Air:
    """Return air with the drag coefficient of the launch, whatever the speed and the spin."""
    if air.drag is None:
        return air
    speed = max(math.dist(launch.velocity, air.wind_at(float(launch.position[2]))), 1e-9)
    surface_speed = ball.radius * math.hypot(*launch.spin.tolist())
    reynolds = 2.0 * ball.radius * air.density / air.viscosity * speed
    return replace(air, drag=constant(air.drag(reynolds, surface_speed / speed)))


def _of_air(
    name: str, acts: Callable[[Air], bool], change: Callable[[Air, Ball, BallState], Air]
) -> Effect:
    """Return an effect of the air; `change` returns air without it."""

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
    Effect(
        "contact time",
        lambda scene: scene.is_compliant,
        lambda scene, _: scene.as_instant(),
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
