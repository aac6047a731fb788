"""A scene to a tolerance: leave out what cannot matter, compute the rest no better than needed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from kickdyn import checks
from kickdyn.ball import BallState
from kickdyn.errors import InvalidInput
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course, follow
from kickdyn.flight.forces import is_ballistic
from kickdyn.flight.path import Flight
from kickdyn.impact.collide import Collision, collide
from kickdyn.impact.held import check_free
from kickdyn.impact.result import Impact
from kickdyn.impact.strike import strike_at
from kickdyn.scene.scene import Scene
from kickdyn.simulation.answer import Simulation, Verdict
from kickdyn.simulation.coarse import Way, coarse_end
from kickdyn.simulation.contact_drift import contact_drift
from kickdyn.simulation.effects import EFFECTS, Effect
from kickdyn.simulation.envelope import Envelope, Jump
from kickdyn.simulation.slopes import contact_error, end_spread

FINEST = 1e-9
"""Relative tolerance with which everything is modelled."""

MODEL_SHARE, CONTACT_SHARE, FLIGHT_SHARE = 0.5, 0.4, 0.1
"""Of the tolerance: for effects left out, for the contact's integrator, for the flight's."""

COARSEST = 1e-3
"""Relative tolerance that a contact which takes time is integrated with at least."""

STEPS = (4, 8, 16, 32, 64)
"""Of a flight in large steps, each against the one before."""


class End(NamedTuple):
    """Where the ball's way ends, and how that was found."""

    state: BallState
    path: Flight | Course | None
    method: str
    evaluations: int
    error: Callable[[], float]


def simulate(scene: Scene, tolerance: float | None = 0.05) -> Simulation:
    """Answer a scene to a tolerance.

    Every effect the scene names has a bound on how far leaving it out can move the end; the least
    are left out while their sum stays within half the tolerance. The rest is computed as exactly as
    the other half asks for.

    Args:
        scene: the kick.
        tolerance: on the position where the ball's way ends, above 0 [m]. It is meant against
            everything the scene names, not against the world: coefficients are as good as their
            sources. None models everything, at a relative tolerance of `FINEST`.

    Raises:
        NoImpact: foot and ball do not approach each other.
        InvalidInput: what the scene names cannot be computed, or a bad tolerance.
        KickdynError: an integrator gave up.
    """
    if not isinstance(scene, Scene):
        raise InvalidInput(f"scene is {scene!r}: it must be a kickdyn.Scene")
    if scene.contact_time is not None:
        check_free(scene.leg, "a contact that takes time is")
    named = [effect for effect in EFFECTS if effect.named(scene)]
    if tolerance is None:
        return _everything(scene, named)
    tolerance = checks.number("tolerance", tolerance, above=0, unit="m")
    rigid = _struck(scene)
    jump = Jump() if scene.contact_time is None else contact_drift(scene, rigid)
    around = Envelope(rigid.ball, _way(scene), jump)
    verdicts = _judged(named, around, MODEL_SHARE * tolerance)
    out = [verdict.effect for verdict in verdicts if not verdict.modelled]
    less = scene
    for effect in named:
        if effect.name in out and effect.named(less):
            less = effect.without(less, rigid.ball)
    hit: Impact | Collision = rigid
    missed = 0.0
    if less.contact_time is not None:
        hit, missed = _collided(less, rigid.ball, CONTACT_SHARE * tolerance)
    begun = around.end if less is scene and hit is rigid else None
    end = _ended(less, hit.ball, FLIGHT_SHARE * tolerance, begun)
    return _answer(scene, tolerance, hit, end, verdicts, lambda: missed + end.error())


def _everything(scene: Scene, named: list[Effect]) -> Simulation:
    hit: Impact | Collision
    hit = _struck(scene) if scene.contact_time is None else _pressed(scene, FINEST)
    end = _exact(scene, hit.ball, FINEST)
    verdicts = tuple(Verdict(effect.name, True, math.nan, "all is modelled") for effect in named)

    def numerical() -> float:
        missed = 0.0 if isinstance(hit, Impact) else contact_error(hit.ball, _way(scene), FINEST)
        return missed + end.error()

    return _answer(scene, None, hit, end, verdicts, numerical)


def _answer(
    scene: Scene,
    tolerance: float | None,
    hit: Impact | Collision,
    end: End,
    verdicts: tuple[Verdict, ...],
    numerical: Callable[[], float],
) -> Simulation:
    contact = hit.evaluations if isinstance(hit, Collision) else 0
    spread = math.nan
    if scene.spread:
        known = _struck(scene).uncertainty(**scene.spread)
        spread = end_spread(hit.ball, _way(scene), known)
    return Simulation(
        scene=scene,
        tolerance=tolerance,
        hit=hit,
        launch=hit.ball,
        end=end.state,
        path=end.path,
        verdicts=verdicts,
        method=f"{'collide' if contact else 'strike'}, {end.method}",
        evaluations=contact + end.evaluations,
        spread=spread,
        _numerical=numerical,
    )


def _judged(named: list[Effect], envelope: Envelope, share: float) -> tuple[Verdict, ...]:
    """Return a verdict on each effect, the least bounds first to be left out."""
    bounds = {effect.name: effect.bound(envelope) for effect in named if effect.bound is not None}
    within = {effect.name: [o for o in effect.within if o in bounds] for effect in named}

    def goes_along(name: str, out: list[str]) -> bool:
        return bool(within[name]) and all(outer in out for outer in within[name])

    out: list[str] = []
    for name in sorted(bounds, key=lambda name: bounds[name]):
        going = [*out, name]
        worth = math.fsum(bounds[other] for other in going if not goes_along(other, going))
        if worth <= share:
            out = going
    free = [name for name in bounds if goes_along(name, out)]
    out += [name for name in free if name not in out]
    verdicts = []
    for effect in named:
        if effect.bound is None:
            verdicts.append(Verdict(effect.name, True, math.nan, "costs no time"))
        elif effect.name in out:
            size = 0.0 if effect.name in free else bounds[effect.name]
            verdicts.append(Verdict(effect.name, False, size, effect.argument))
        else:
            why = "no room for it in the tolerance"
            if bounds[effect.name] == math.inf:
                why = "not bounded here"
            verdicts.append(Verdict(effect.name, True, bounds[effect.name], why))
    return tuple(verdicts)


def _way(scene: Scene) -> Way:
    return Way(scene.ball, scene.air, scene.ground, scene.plane)


def _struck(scene: Scene) -> Impact:
    return strike_at(
        scene.posture,
        scene.v,
        scene.ball,
        scene.touch,
        scene.law,
        ball_velocity=scene.ball_velocity,
        ball_spin=scene.ball_spin,
    )


def _pressed(scene: Scene, tol: float) -> Collision:
    return collide(
        scene.leg,
        scene.q,
        scene.v,
        scene.ball,
        scene.touch,
        contact_time=scene.contact_time,
        ball_velocity=scene.ball_velocity,
        ball_spin=scene.ball_spin,
        tol=tol,
    )


def _collided(scene: Scene, launch: BallState, share: float) -> tuple[Collision, float]:
    """Return the contact that takes time, as exact as need be, and its error at the end [m].

    The tolerance follows from how the end depends on the launch of the instant.
    """
    missed = contact_error(launch, _way(scene), 1.0)
    while True:
        tol = min(max(share / max(missed, 1e-300), FINEST), COARSEST)
        hit = _pressed(scene, tol)
        there = contact_error(hit.ball, _way(scene), 1.0)
        if tol * there <= share or tol == FINEST:
            return hit, tol * there
        missed = 2.0 * there


def _ended(scene: Scene, launch: BallState, share: float, last: BallState | None) -> End:
    """Return where the ball's way ends, in as few steps as the share of the tolerance lets.

    Where it ends in the fewest steps may be known already.
    """
    air = scene.air
    surface = None if scene.ground is None else scene.ground.surface
    refuses = air is not None and any(
        getattr(model, "refuses", False) for model in (air.drag, air.lift)
    )
    if refuses or (surface is None and is_ballistic(air, launch.spin)):
        return _exact(scene, launch, FINEST)
    way = _way(scene)
    calls = 0
    for steps in STEPS if last is None else STEPS[1:]:
        state, more = coarse_end(launch, way, steps)
        calls += more
        if state is None:
            break
        if last is not None:
            missed = float(np.linalg.norm(state.position - last.position))
            if missed <= share:
                method = f"{steps} Runge-Kutta steps a flight"
                return End(state, None, method, calls, partial(float, missed))
        last = state
    exact = _exact(scene, launch, FINEST)
    return exact._replace(evaluations=exact.evaluations + calls)


def _exact(scene: Scene, launch: BallState, tol: float) -> End:
    surface = None if scene.ground is None else scene.ground.surface
    run: Callable[..., Flight | Course] = partial(
        fly if surface is None else follow,
        launch,
        scene.ball,
        scene.air,
        scene.ground,
        plane=scene.plane,
    )
    path = run(tol=tol)
    if isinstance(path, Flight):
        return End(path.landing, path, path.method, path.evaluations, lambda: path.error)

    def again() -> float:
        finer = run(tol=1e-2 * tol)
        assert isinstance(finer, Course)
        return 2.0 * float(np.linalg.norm(finer.rest.position - path.rest.position))

    calls = sum(flight.evaluations for flight in path.flights)
    return End(path.rest, path, f"followed, tol {tol:g}", calls, again)
