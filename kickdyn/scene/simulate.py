"""A scene to a tolerance: neglect what cannot matter, compute the rest no better than needed."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from kickdyn.core import validation
from kickdyn.core.gravity import GRAVITY
from kickdyn.errors import KickdynError
from kickdyn.impact.collide import Collision, collide
from kickdyn.impact.impact_result import Impact
from kickdyn.scene.contact_drift import contact_drift, strike_scene
from kickdyn.scene.effects import (
    Effect,
    EffectSize,
    EffectVerdict,
    effects_of,
    judge_effects,
    without_neglected,
)
from kickdyn.scene.envelope import EXACT, Envelope
from kickdyn.scene.flight_end import (
    CONTACT_SAFETY,
    ENDS,
    FINEST,
    FlightEnd,
    approximate_end,
    end_slopes,
    exact_end,
)
from kickdyn.scene.scene import Scene
from kickdyn.scene.simulation import Simulation

MODEL_SHARE, CONTACT_SHARE, FLIGHT_SHARE = 0.5, 0.4, 0.1
"""Of the tolerance: for neglected effects, for the contact's integrator, for the flight's."""


@validation.check_arguments
def simulate(scene: Scene, tolerance: float | None = 0.05) -> Simulation:
    r"""Find where the ball of a scene ends, to a tolerance.

    Every effect of the scene, such as drag or wind, has a bound :math:`b_i` on how far neglecting
    it can move the end. The effects with the smallest bounds are neglected, as long as the sum of
    their bounds is at most half the tolerance. The rest is computed as exactly as the other half
    requires, by the estimates of the integrators.

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
    effects = effects_of(scene)
    if tolerance is None:
        return _simulate_everything(scene, effects)
    tolerance = validation.number("tolerance", tolerance, above=0, unit="m")

    instant = strike_scene(scene)
    launch_error = contact_drift(scene, instant) if scene.is_compliant else EXACT
    envelope = Envelope(instant.ball_after, scene.environment, launch_error)
    verdicts = judge_effects(effects, envelope, MODEL_SHARE * tolerance)
    contact = _ComputedContact(instant, 0.0, envelope.evaluations)
    if scene.is_compliant and verdicts[0].modelled:  # the first effect: contact time
        speed = float(instant.ball_after.speed)
        contact = _collide_to(scene, speed, CONTACT_SHARE * tolerance)
        evaluations = envelope.evaluations + contact.evaluations
        envelope = Envelope(contact.impact.ball_after, scene.environment)  # of another launch
        verdicts = (verdicts[0], *judge_effects(effects[1:], envelope, MODEL_SHARE * tolerance))
        contact = contact._replace(evaluations=evaluations + envelope.evaluations)
    launch = contact.impact.ball_after
    reduced = without_neglected(scene, verdicts, launch)
    # the envelope has integrated the whole scene in four steps, which need not be repeated
    four_steps = envelope.end if reduced is scene else None
    end = approximate_end(launch, reduced.environment, FLIGHT_SHARE * tolerance, four_steps)
    return _result(scene, tolerance, contact, end, verdicts, lambda: contact.error + end.error())


def simulate_as_instant(scene: Scene) -> Simulation:
    """Model everything a scene names, except for the time that its contact takes.

    Only an instantaneous impact has joint impulses. The bound on the effect of the contact time is
    measured: how far the end lies from that of the whole scene; inf if that cannot be computed.
    """
    answer = simulate(scene.as_instant(), None)
    if not scene.is_compliant:
        return answer
    moved, evaluations = math.inf, answer.evaluations
    try:
        whole = simulate(scene, None)
    except KickdynError as error:
        why = f"which cannot be computed: {error}"
    else:
        why = f"with it: {whole.end_text}"
        moved = math.dist(answer.end.position, whole.end.position) + whole.numerical_error
        evaluations += whole.evaluations
    others = (verdict._replace(why="modelled, as all others") for verdict in answer.verdicts)
    verdicts = (EffectVerdict("contact time", False, moved, why), *others)
    return replace(answer, scene=scene, verdicts=verdicts, evaluations=evaluations)


def measure_effects(
    whole: Simulation, report: Callable[[str], None] = lambda _: None
) -> list[EffectSize]:
    """Measure every effect of a scene, in the order of `EFFECTS`.

    The scene is that of `simulate(scene, None)`; `report` is called with each effect's name.
    """
    scene, sizes = whole.scene, []
    for effect in effects_of(scene):
        report(effect.name)
        less, impulse = effect.without(scene, whole.launch), 0.0
        try:
            if less.air is scene.air:
                other = simulate(less, None)
                end, status = other.end, other.status
                impulse = math.dist(other.impact.impulse, whole.impact.impulse)
            else:  # the launch is the same
                end, status, *_ = exact_end(whole.launch, less.environment, FINEST)
        except KickdynError as error:
            sizes.append(EffectSize(effect.name, math.nan, math.nan, str(error)))
            continue
        moved, why = math.dist(end.position, whole.end.position), ""
        endless = [each for each in (whole.status, status) if each not in ENDS]
        if endless:
            moved, why = math.nan, f"no end: {endless[0]}"
        sizes.append(EffectSize(effect.name, moved, impulse, why))
    return sizes


def _effect_sizes(scene: Scene) -> list[EffectSize]:
    """Return the size of each effect of a scene, none where the whole cannot be computed."""
    try:
        return measure_effects(simulate(scene, None))
    except KickdynError:
        return []


class _ComputedContact(NamedTuple):
    """A contact, what its integrator misses at the end [m], and the evaluations spent so far."""

    impact: Impact | Collision
    error: float
    evaluations: int


def _simulate_everything(scene: Scene, effects: Sequence[Effect]) -> Simulation:
    """Return the simulation with every effect modelled, as exactly as the integrators can."""
    impact = _collide(scene, FINEST) if scene.is_compliant else strike_scene(scene)
    launch, environment = impact.ball_after, scene.environment
    end = exact_end(launch, environment, FINEST)

    def numerical_error() -> float:
        """Return the error of the numbers at the end [m]."""
        if isinstance(impact, Impact) or not end.ended:
            return end.error()
        slopes = end_slopes(launch, environment)
        return slopes.contact_error(launch, scene.ball.radius, FINEST) + end.error()

    verdicts = [EffectVerdict(each.name, True, math.nan, "all is modelled") for each in effects]
    evaluations = impact.evaluations if isinstance(impact, Collision) else 0
    contact = _ComputedContact(impact, 0.0, evaluations)
    return _result(scene, None, contact, end, verdicts, numerical_error)


def _result(
    scene: Scene,
    tolerance: float | None,
    contact: _ComputedContact,
    end: FlightEnd,
    verdicts: Sequence[EffectVerdict],
    numerical_error: Callable[[], float],
) -> Simulation:
    """Return the simulation's result, with the deviation of the end where uncertainty is given."""
    impact, evaluations = contact.impact, contact.evaluations + end.evaluations
    deviation = math.nan
    if scene.uncertainty:
        slopes = end_slopes(impact.ball_after, scene.environment)
        deviation = slopes.deviation(strike_scene(scene).uncertainty(**scene.uncertainty))
        evaluations += slopes.evaluations
    return Simulation(
        scene=scene,
        tolerance=tolerance,
        impact=impact,
        launch=impact.ball_after,
        end=end.state,
        status=end.status,
        path=end.path,
        verdicts=tuple(verdicts),
        method=f"impact: kd.{'strike' if isinstance(impact, Impact) else 'collide'}; "
        f"path: {end.method}",
        evaluations=evaluations,
        end_deviation=deviation,
        _numerical=numerical_error if end.ended else lambda: math.inf,
        _measure=_effect_sizes,
    )


def _collide(scene: Scene, tol: float) -> Collision:
    """Return the impact that takes time, at a relative tolerance."""
    return collide(
        scene.posture,
        scene.v,
        scene.ball,
        scene.contact,
        contact_time=scene.contact_time,
        stiffness=scene.stiffness,  # type: ignore[arg-type]
        dissipation=scene.dissipation,
        ball_velocity=scene.ball_velocity,
        ball_spin=scene.ball_spin,
        tol=tol,
    )


def _collide_to(scene: Scene, speed: float, accuracy: float) -> _ComputedContact:
    """Return the contact that takes time, as exact as the accuracy of the end [m] requires.

    Its tolerance follows from how the end depends on the launch, at first from the longest parabola
    with the speed of an instant's launch [m/s].
    """
    radius, evaluations = scene.ball.radius, 0
    tol = 0.5 * accuracy / (CONTACT_SAFETY * (2.0 * speed**2 / GRAVITY + radius))
    while True:
        tol = min(max(tol, FINEST), 1e-3)
        impact = _collide(scene, tol)
        slopes = end_slopes(impact.ball_after, scene.environment)
        error = slopes.contact_error(impact.ball_after, radius, tol)
        evaluations += slopes.evaluations + impact.evaluations
        if error <= accuracy or tol == FINEST:
            return _ComputedContact(impact, error, evaluations)
        tol *= 0.5 * accuracy / error
