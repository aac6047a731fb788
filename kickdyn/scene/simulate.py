"""A scene to a tolerance: leave out what cannot matter, compute the rest no better than needed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.flight.forces import is_ballistic
from kickdyn.impact.collide import Collision, collide
from kickdyn.impact.constraint_impulses import check_free
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.strike import strike
from kickdyn.scene.coarse_flight import FlightEnvironment, coarse_end
from kickdyn.scene.contact_drift import contact_drift
from kickdyn.scene.effects import EFFECTS, Effect
from kickdyn.scene.end_sensitivity import contact_error, end_spread, slopes
from kickdyn.scene.envelope import Envelope, Jump, refuses
from kickdyn.scene.exact_end import End, followed
from kickdyn.scene.scene import Scene
from kickdyn.scene.simulation import Simulation, Verdict

FINEST = 1e-9
"""Relative tolerance with which everything is modelled."""

MODEL_SHARE, CONTACT_SHARE, FLIGHT_SHARE = 0.5, 0.4, 0.1
"""Of the tolerance: for effects left out, for the contact's integrator, for the flight's."""

COARSEST = 1e-3
"""Relative tolerance that a contact which takes time is integrated with at least."""

STEPS = (4, 8, 16, 32, 64)
"""Of a flight in large steps, whose error is twice what they move the end from the ones before."""


def simulate(scene: Scene, tolerance: float | None = 0.05) -> Simulation:
    """Answer a scene to a tolerance.

    Every effect the scene names has a bound on how far leaving it out can move the end; the least
    are left out while their sum stays within half the tolerance. The rest is computed as exactly as
    the other half asks for, by the integrators' own estimates.

    Args:
        scene: the kick.
        tolerance: on the position where the ball's way ends, above 0 [m]. It is meant against
            everything the scene names, not against the world: coefficients are as good as their
            sources. None models everything, at a relative tolerance of `FINEST`; a tolerance below
            what that reaches is answered the same way, and the answer says that it is not met.

    Raises:
        NoImpact: foot and ball do not approach each other.
        InvalidInput: what the scene names cannot be computed, or a bad tolerance.
        KickdynError: an integrator gave up.
    """
    validation.check_type(Scene, scene=scene)
    if scene.contact_time is not None:
        check_free(scene.leg, "a contact that takes time is")
    named = [effect for effect in EFFECTS if effect.named(scene)]
    if tolerance is None:
        return _everything(scene, named)
    tolerance = validation.number("tolerance", tolerance, above=0, unit="m")
    rigid, way = _struck(scene), _way(scene)
    hit: Impact | Collision = rigid
    missed, calls, share = 0.0, 0, MODEL_SHARE * tolerance
    jump = Jump() if scene.contact_time is None else contact_drift(scene, rigid)
    around = Envelope(rigid.ball_after, way, jump)
    verdicts = _judged(named, around, share)
    if scene.contact_time is not None and verdicts[0].modelled:
        # another launch than the instant's: what is known of the flight holds around that one
        hit, missed, calls = _collided(scene, rigid.ball_after, CONTACT_SHARE * tolerance)
        calls += around.evaluations
        around = Envelope(hit.ball_after, way)
        verdicts = (verdicts[0], *_judged(named[1:], around, share))
    out = [verdict.effect for verdict in verdicts if not verdict.modelled]
    less = scene
    for effect in named:
        if effect.name in out and effect.named(less):
            less = effect.without(less, hit.ball_after)
    end = _ended(
        less, hit.ball_after, FLIGHT_SHARE * tolerance, around.end if less is scene else None
    )
    calls += around.evaluations + end.evaluations
    return _answer(scene, tolerance, hit, end, verdicts, calls, lambda: missed + end.error())


def _everything(scene: Scene, named: list[Effect]) -> Simulation:
    hit: Impact | Collision
    hit = _struck(scene) if scene.contact_time is None else _pressed(scene, FINEST)
    way = _way(scene)
    end = followed(hit.ball_after, way, FINEST)
    verdicts = tuple(Verdict(effect.name, True, math.nan, "all is modelled") for effect in named)

    def numerical() -> float:
        if isinstance(hit, Impact) or not end.ended:
            return end.error()
        return contact_error(slopes(hit.ball_after, way), hit.ball_after, way, FINEST) + end.error()

    calls = end.evaluations + (hit.evaluations if isinstance(hit, Collision) else 0)
    return _answer(scene, None, hit, end, verdicts, calls, numerical)


def _answer(
    scene: Scene,
    tolerance: float | None,
    hit: Impact | Collision,
    end: End,
    verdicts: tuple[Verdict, ...],
    calls: int,
    numerical: Callable[[], float],
) -> Simulation:
    spread = math.nan
    if scene.spread:
        found = slopes(hit.ball_after, _way(scene))
        spread = end_spread(found, _struck(scene).uncertainty(**scene.spread))
        calls += found.evaluations
    contact = "strike" if isinstance(hit, Impact) else "collide"
    return Simulation(
        scene=scene,
        tolerance=tolerance,
        hit=hit,
        launch=hit.ball_after,
        end=end.state,
        status=end.status,
        path=end.path,
        verdicts=verdicts,
        method=f"{contact}, {end.method}",
        evaluations=calls,
        spread=spread,
        _numerical=numerical if end.ended else lambda: math.inf,
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


def _way(scene: Scene) -> FlightEnvironment:
    return FlightEnvironment(scene.ball, scene.air, scene.ground, scene.plane)


def _struck(scene: Scene) -> Impact:
    return strike(
        scene.posture,
        scene.v,
        scene.ball,
        scene.contact,
        scene.law,
        ball_velocity=scene.ball_velocity,
        ball_spin=scene.ball_spin,
    )


def _pressed(scene: Scene, tol: float) -> Collision:
    return collide(
        scene.posture,
        scene.v,
        scene.ball,
        scene.contact,
        contact_time=scene.contact_time,
        ball_velocity=scene.ball_velocity,
        ball_spin=scene.ball_spin,
        tol=tol,
    )


def _collided(scene: Scene, launch: BallState, share: float) -> tuple[Collision, float, int]:
    """Return the contact that takes time, as exact as need be, its error at the end [m], and calls.

    The tolerance follows from how the end depends on the launch of the instant.
    """
    way = _way(scene)
    found = slopes(launch, way, sure=False)
    missed, calls = contact_error(found, launch, way, 1.0), found.evaluations
    while True:
        tol = min(max(share / max(missed, 1e-300), FINEST), COARSEST)
        hit = _pressed(scene, tol)
        found = slopes(hit.ball_after, way)
        there = contact_error(found, hit.ball_after, way, 1.0)
        calls += found.evaluations + hit.evaluations
        if tol * there <= share or tol == FINEST:
            return hit, tol * there, calls
        missed = 2.0 * there


def _ended(scene: Scene, launch: BallState, share: float, last: BallState | None) -> End:
    """Return where the ball's way ends, in as few steps as the share of the tolerance lets.

    Where it ends in the fewest steps may be known already.
    """
    air, way, calls = scene.air, _way(scene), 0
    surface = None if scene.ground is None else scene.ground.surface
    if (air is not None and refuses(air)) or (surface is None and is_ballistic(air, launch.spin)):
        return followed(launch, way, FINEST)
    for steps in STEPS if last is None else STEPS[1:]:
        state, status, more = coarse_end(launch, way, steps)
        calls += more
        if state is None:
            break
        if last is not None:
            # twice: where the ball bounces, steps need not come nearer one by one
            missed = 2.0 * float(np.linalg.norm(state.position - last.position))
            if missed <= share:
                method = f"{steps} Runge-Kutta steps a flight"
                return End(state, status, None, method, calls, partial(float, missed))
        last = state
    exact = followed(launch, way, FINEST)
    return exact._replace(evaluations=exact.evaluations + calls)
