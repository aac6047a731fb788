"""A scene to a tolerance: neglect what cannot matter, compute the rest as exactly as needed."""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from kickdyn.core import validation
from kickdyn.core.mechanics import GRAVITY
from kickdyn.errors import KickdynError
from kickdyn.flight.flight_result import FlightStatus
from kickdyn.impact.collide import Collision
from kickdyn.impact.impact_result import Impact
from kickdyn.scene.effects import (
    EffectSize,
    EffectVerdict,
    Reduction,
    effects_of,
    neglect_effects,
)
from kickdyn.scene.launch_and_end import (
    COLLIDE_SAFETY,
    SMALLEST_TOLERANCE,
    STATUSES_WITH_END,
    PathEnd,
    collide_scene,
    collision_error,
    contact_time_error,
    end_slopes,
    fly_scene,
    strike_scene,
)
from kickdyn.scene.scene import Scene
from kickdyn.scene.simulation import Simulation

MODEL_SHARE, CONTACT_SHARE = 0.5, 0.4
"""Fractions of the tolerance for neglected effects and for the integrator of the contact; the rest
is far more than the integrator of the flight needs."""

LARGEST_TOLERANCE = 1e-3
"""Largest relative tolerance of the integrator of the contact."""


@validation.check_arguments
def simulate(scene: Scene, tolerance: float | None = 0.05) -> Simulation:
    r"""Find where the ball of a scene ends, to a tolerance.

    The contact time is neglected if it moves the end by less than half the tolerance, as estimated
    by strikes of an instantaneous contact where the foot is meanwhile. Of the effects of the
    flight, such as drag or wind, those with the smallest sizes are neglected as long as all that is
    neglected stays within that half; the flight without them is compared with the flight that has
    all effects. The rest is computed as exactly as the other half requires, by the estimates of the
    integrators.

    Args:
        scene: the scene of the kick.
        tolerance: largest error of the position where the path of the ball ends, above 0 [m]. It
            counts everything that the scene names, but not how well the scene describes the world:
            coefficients are as good as their sources. None models everything, with a relative
            tolerance of 1e-9 of the integrators. A tolerance that they cannot reach is computed in
            the same manner, and `within_tolerance` of the result is False.

    Raises:
        NoImpact: foot and ball do not approach each other.
        InvalidInput: the tolerance is invalid, or what the scene names cannot be computed.
        KickdynError: an integrator gave up.

    Example:
        >>> import kickdyn as kd
        >>> simulation = kd.simulate(kd.load_scene("free_kick"), tolerance=0.1)
        >>> simulation.end.position.round(1).tolist(), simulation.within_tolerance
        ([16.5, 8.4, 0.1], True)
    """
    if tolerance is None:
        return _simulate_everything(scene)
    tolerance = validation.number("tolerance", tolerance, above=0, unit="m")
    launched = _launch(scene, tolerance)
    allowed = MODEL_SHARE * tolerance - launched.model_error
    return _result(scene, tolerance, launched, neglect_effects(scene, launched.path, allowed))


def simulate_as_instant(scene: Scene) -> Simulation:
    """Model everything a scene names, except for the time that its contact takes.

    Only an instantaneous impact has joint impulses. The effect of the contact time is measured: how
    far the end lies from that of the scene with it; inf if that cannot be computed.
    """
    answer = simulate(scene.as_instant(), None)
    if not scene.is_compliant:
        return answer
    size, evaluations = math.inf, answer.evaluations
    try:
        compliant = simulate(scene, None)
    except KickdynError as error:
        why = f"which cannot be computed: {error}"
    else:
        why = f"with it: {compliant.end_text}"
        size = math.dist(answer.end.position, compliant.end.position) + compliant.numerical_error
        evaluations += compliant.evaluations
    unchanged = (verdict._replace(why="modelled, as all others") for verdict in answer.verdicts)
    verdicts = (EffectVerdict("contact time", False, size, why), *unchanged)
    return replace(
        answer, scene=scene, verdicts=verdicts, model_error=size, evaluations=evaluations
    )


def measure_effects(
    full: Simulation, report: Callable[[str], None] = lambda _: None
) -> list[EffectSize]:
    """Measure every effect of a scene, in the order of `EFFECTS`, with it and without.

    The scene is that of `simulate(scene, None)`; `report` is called with each effect's name.
    """
    scene, sizes = full.scene, []
    for effect in effects_of(scene):
        report(effect.name)
        less, impulse = effect.without(scene, full.launch), 0.0
        try:
            if effect.in_flight:
                end = fly_scene(less, full.launch)
                position, status = end.state.position, end.path.status
            else:
                other = simulate(less, None)
                position, status = other.end.position, FlightStatus(other.status)
                impulse = math.dist(other.impact.impulse, full.impact.impulse)
        except KickdynError as error:
            sizes.append(EffectSize(effect.name, math.nan, math.nan, str(error)))
            continue
        endless = [name for name in (full.status, status) if name not in STATUSES_WITH_END]
        if endless:
            sizes.append(EffectSize(effect.name, math.nan, impulse, f"no end: {endless[0]}"))
        else:
            moved = math.dist(position, full.end.position)
            sizes.append(EffectSize(effect.name, moved, impulse))
    return sizes


class _Launched(NamedTuple):
    """How the ball leaves the foot, and its path from there with all effects of the flight.

    Attributes:
        impact: the impact.
        path: from the launch to the end, with all effects.
        numerical_error: returns how far the integrator of the contact moves the end [m].
        evaluations: of the accelerations in the contact.
        verdicts: on the contact time, if the scene has one.
        model_error: how far neglecting the contact time moves the end [m].
    """

    impact: Impact | Collision
    path: PathEnd
    numerical_error: Callable[[], float] = float
    evaluations: int = 0
    verdicts: tuple[EffectVerdict, ...] = ()
    model_error: float = 0.0


def _simulate_everything(scene: Scene) -> Simulation:
    """Return the simulation with every effect modelled, as exactly as the integrators can."""
    launched = _collide(scene, SMALLEST_TOLERANCE) if scene.is_compliant else _strike(scene)
    verdicts = [
        EffectVerdict(effect.name, True, math.nan, "all is modelled")
        for effect in effects_of(scene)
    ]
    unreduced = Reduction(launched.path, 0.0, tuple(verdicts), launched.path.evaluations)
    return _result(scene, None, launched, unreduced)


def _strike(scene: Scene) -> _Launched:
    """Return the launch by an instantaneous contact."""
    impact = strike_scene(scene)
    return _Launched(impact, fly_scene(scene, impact.ball_after))


def _collide(scene: Scene, tol: float) -> _Launched:
    """Return the launch by a contact that takes time, to a relative tolerance."""
    impact = collide_scene(scene, tol)
    path = fly_scene(scene, impact.ball_after)

    def error() -> float:
        return end_slopes(scene, path).distance(collision_error(scene, impact.ball_after, tol))

    return _Launched(impact, path, error, impact.evaluations)


def _launch(scene: Scene, tolerance: float) -> _Launched:
    """Return the launch, with the contact time only where it matters at the tolerance [m]."""
    instant = strike_scene(scene)
    if not scene.is_compliant:
        return _Launched(instant, fly_scene(scene, instant.ball_after))
    error, size = contact_time_error(scene, instant), math.inf
    why = "how much the contact time changes the launch is not known before it is computed"
    if error.velocity < math.inf:
        with suppress(KickdynError):  # as where only this launch leaves the range of a coefficient
            path = fly_scene(scene, instant.ball_after)
            size = end_slopes(scene, path).distance(error)
            if size <= MODEL_SHARE * tolerance:
                verdict = EffectVerdict("contact time", False, size, "its size is small enough")
                return _Launched(instant, path, verdicts=(verdict,), model_error=size)
            why = "its size is too large for the tolerance"
    launched = _collide_to(scene, float(instant.ball_after.speed), CONTACT_SHARE * tolerance)
    return launched._replace(verdicts=(EffectVerdict("contact time", True, size, why),))


def _collide_to(scene: Scene, speed: float, accuracy: float) -> _Launched:
    """Return the launch by a contact that takes time, as exact as the end requires.

    Args:
        scene: the scene.
        speed: speed of the launch by an instantaneous contact [m/s]. The first relative tolerance
            follows from the longest parabola with it, the next ones from the derivatives of the
            end.
        accuracy: error of the end that is allowed [m].
    """
    evaluations, radius = 0, scene.ball.radius
    tol = 0.5 * accuracy / (COLLIDE_SAFETY * (2.0 * speed**2 / GRAVITY + radius))
    while True:
        tol = min(max(tol, SMALLEST_TOLERANCE), LARGEST_TOLERANCE)
        launched = _collide(scene, tol)
        error = launched.numerical_error()
        evaluations += launched.evaluations
        if error <= accuracy or tol == SMALLEST_TOLERANCE:
            return launched._replace(numerical_error=partial(float, error), evaluations=evaluations)
        tol *= 0.5 * accuracy / error


def _result(
    scene: Scene, tolerance: float | None, launched: _Launched, reduction: Reduction
) -> Simulation:
    """Return the result of a simulation, with the deviation of the end by the uncertainty."""
    impact, path, end = launched.impact, launched.path, reduction.end

    def numerical_error() -> float:
        return launched.numerical_error() + path.error() if path.has_end else math.inf

    deviation = math.nan
    if scene.uncertainty:
        deviation = end_slopes(scene, path).deviation(
            strike_scene(scene).uncertainty(**scene.uncertainty)
        )
    function = "strike" if isinstance(impact, Impact) else "collide"
    return Simulation(
        scene=scene,
        tolerance=tolerance,
        impact=impact,
        launch=impact.ball_after,
        end=end.state,
        status=end.path.status,
        path=end.path,
        verdicts=(*launched.verdicts, *reduction.verdicts),
        model_error=launched.model_error + reduction.error,
        method=f"impact: kd.{function}; path: {end.method}",
        evaluations=launched.evaluations + reduction.evaluations,
        end_deviation=deviation,
        _numerical=numerical_error,
        _measure=_effect_sizes,
    )


def _effect_sizes(scene: Scene) -> list[EffectSize]:
    """Return the size of each effect of a scene, none where the scene cannot be computed."""
    try:
        return measure_effects(simulate(scene, None))
    except KickdynError:
        return []
