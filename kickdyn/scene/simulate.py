"""The simulation of a scene to a tolerance, its result, and the sizes of the scene's effects."""

import math
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate
from typing import Any

import numpy as np

from kickdyn.aerodynamics.drag import constant
from kickdyn.air import Air
from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, distance_in_words, warned
from kickdyn.errors import InvalidInput, KickdynError
from kickdyn.flight.flight_result import Flight, FlightStatus
from kickdyn.flight.follow import Course
from kickdyn.impact.collide import Collision
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.uncertainty import Uncertainty
from kickdyn.robot.standing import is_floating
from kickdyn.scene.launch_and_end import (
    SMALLEST_TOLERANCE,
    STATUSES_WITH_END,
    USUAL_TOLERANCE,
    collide_scene,
    collision_error,
    contact_time_error,
    end_error,
    end_of,
    end_slopes,
    fly_scene,
    path_error,
    strike_scene,
)
from kickdyn.scene.scene import Passage, Scene, Score, passage_on, score_at


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


def scenes_without(scene: Scene, launch: BallState) -> dict[str, Scene]:
    """Return, by each effect of a scene that can be neglected by itself, the scene without it."""
    leg, ball, contact, air = scene.leg, scene.ball, scene.contact, scene.air
    less, airs = dict[str, Scene](), dict[str, Air]()
    if scene.is_compliant:
        less["contact time"] = scene.as_instant()
    if contact.friction > 0.0:
        less["friction"] = scene.replace(contact=replace(contact, friction=0.0))
    if ball.inertia_factor < math.inf:
        less["ball rotation"] = scene.replace(ball=replace(ball, inertia_factor=math.inf))
    if leg.workspace.model.armature.any():
        less["armature"] = scene.with_leg(leg.without_rotors())
    if leg.supports:
        less["supports"] = scene.with_leg(leg.with_supports())
    if air is None or air.density == 0.0:
        return less
    if air.drag is not None:
        speed = max(math.dist(launch.velocity, air.wind_at(float(launch.position[2]))), 1e-9)
        reynolds = 2.0 * ball.radius * air.density / air.viscosity * speed
        spin_parameter = ball.radius * math.hypot(*launch.spin.tolist()) / speed
        airs["drag"] = replace(air, drag=None)
        airs["drag crisis"] = replace(air, drag=constant(air.drag(reynolds, spin_parameter)))
    if air.lift is not None:
        airs["lift"] = replace(air, lift=None)
    if air.drag is not None or air.lift is not None:  # through which spin and wind act
        if air.torque is not None:
            airs["spin decay"] = replace(air, torque=None)
        if callable(air.wind) or air.wind.any():
            airs["wind"] = replace(air, wind=np.zeros(3))
    if air.buoyancy:
        airs["buoyancy"] = replace(air, buoyancy=False)
    return less | {name: scene.replace(air=changed) for name, changed in airs.items()}


CONTACT_SHARE = 0.9
"""Fraction of the tolerance for a neglected contact time, or else for its integrator."""

ROUNDING = 1e-12
"""Smallest tolerance [m]: rounding alone may move an end some metres away that far."""

_PHRASES = {"landed": "landed at", "at-plane": "reached the plane at", "at-rest": "came to rest at"}
"""By status, how the path of the ball ends."""


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(ReprMixin):
    """The result of a scene. `print` shows its error and how far each effect moves its end.

    Effects are `small` if they are among the `negligible` ones, which are modelled all the same.

    Attributes:
        scene: the scene, as it was given.
        tolerance: tolerance on the position of the end [m]; None if everything is as exact as
            the integrators can compute it.
        impact: the impact, of an instant or of a finite contact time.
        path: the flight or the course of the ball, with all effects of the scene.
        launch_spread: covariances of the launch that follow from the `uncertainty` of the scene;
            None if it has none.
        model_error: estimate of the distance by which a neglected contact time moves the end [m];
            0 where nothing is neglected, inf where it is not known.
        note: what is known about a neglected contact time.
        seconds: processor time that `simulate` took [s].
    """

    scene: Scene
    tolerance: float | None
    impact: Impact | Collision
    path: Flight | Course
    launch_spread: Uncertainty | None
    model_error: float = 0.0
    note: str = ""
    seconds: float = 0.0

    @property
    def launch(self) -> BallState:
        """The ball as it leaves the foot."""
        return self.impact.ball_after

    @property
    def end(self) -> BallState:
        """The ball at the end of its path, its time counted from the launch."""
        return end_of(self.path)

    @property
    def status(self) -> str:
        """How the path ends: `landed`, `at-plane` or `at-rest`, or why it has no end."""
        return self.path.status

    @cached_property
    def numerical_error(self) -> float:
        """Estimate of the numerical error of the end [m]; inf where there is no estimate."""
        scene, path, impact = self.scene, self.path, self.impact
        if path.status not in STATUSES_WITH_END:
            return math.inf
        error = path_error(scene, path)
        if isinstance(impact, Collision):
            error += end_error(scene, path, collision_error(scene.ball, self.launch, impact.tol))
        return error

    @property
    def error(self) -> float:
        """Error of the end, the sum of `model_error` and `numerical_error` [m]."""
        return self.model_error + self.numerical_error

    @property
    def within_tolerance(self) -> bool:
        """Whether the error is within the tolerance; without one, whether the error is finite."""
        return math.isfinite(self.error) and self.error <= (self.tolerance or math.inf)

    @cached_property
    def end_deviation(self) -> float:
        """Standard deviation of the end that follows from the scene's `uncertainty` [m].

        It is of first order, velocity and spin of the launch varying together; nan where the scene
        has no uncertainty, inf where the path has no end.
        """
        if self.launch_spread is None:
            return math.nan
        return end_slopes(self.scene, self.path).deviation(self.launch_spread)

    @property
    def neglected(self) -> tuple[str, ...]:
        """Effects of the scene that were not modelled: at most the contact time."""
        is_instant = isinstance(self.impact, Impact)
        return ("contact time",) if self.scene.is_compliant and is_instant else ()

    @property
    def modelled(self) -> tuple[str, ...]:
        """Effects of the scene that were modelled."""
        return tuple(name for name in self._scenes_without if name not in self.neglected)

    @cached_property
    def _scenes_without(self) -> dict[str, Scene]:
        return scenes_without(self.scene, self.launch)

    @cached_property
    def effects(self) -> tuple[EffectSize, ...]:
        """What neglecting each effect changes, in the order of `scenes_without`.

        It is computed when it is first read: flights and, for the effects on the launch, impacts,
        as in this answer, with its tolerances. A contact time that is neglected has the size of the
        `model_error`.
        """
        sizes = list[EffectSize]()
        for name, less in self._scenes_without.items():
            if name in self.neglected:
                sizes.append(EffectSize(name, self.model_error, math.nan, "", self.seconds))
                continue
            began = time.process_time()
            sizes.append(replace(_measure(name, less, self), seconds=time.process_time() - began))
        return tuple(sizes)

    @property
    def effect_sizes(self) -> Mapping[str, float]:
        """By effect: how far the end moves if only this effect is neglected [m].

        nan where the path has no end with or without the effect, or cannot be computed.
        """
        return {size.effect: size.end for size in self.effects}

    @property
    def negligible(self) -> tuple[str, ...]:
        """Names of the effects that do not matter at the tolerance.

        These are the effects with the smallest sizes; their sizes add up to at most half of the
        tolerance. All but the contact time are modelled all the same, because that takes no time.
        """
        sizes = {name: size for name, size in self.effect_sizes.items() if math.isfinite(size)}
        names = sorted(sizes, key=sizes.__getitem__)
        totals = accumulate(sizes[name] for name in names)
        return tuple(names[: sum(total <= 0.5 * (self.tolerance or 0.0) for total in totals)])

    @property
    def method(self) -> str:
        """How impact and path were computed."""
        function, path = "collide" if isinstance(self.impact, Collision) else "strike", self.path
        if isinstance(path, Flight):
            return f"impact: kd.{function}; path: {path.method}"
        tol = path.flights[0].tol
        return f"impact: kd.{function}; path: flights and rolling, relative tolerance {tol:g}"

    @property
    def evaluations(self) -> int:
        """Number of evaluations of the accelerations in impact and path."""
        path, phases = self.path, list[Any]()
        phases += [*path.flights, *path.ground_phases] if isinstance(path, Course) else [path]
        phases += [self.impact] if isinstance(self.impact, Collision) else []
        return sum(phase.evaluations for phase in phases)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of leg, impact and path."""
        lines = (*self.scene.leg.warnings, *self.impact.warnings, *self.path.warnings)
        return tuple(dict.fromkeys(lines))

    @property
    def start_height(self) -> float:
        """Height of the ball's lower edge over the ground at the launch [m]; 0 without a ground."""
        ground = self.scene.ground
        if ground is None:
            return 0.0
        return float(self.launch.position[2]) - self.scene.ball.radius - ground.height

    @cached_property
    def passage(self) -> Passage | None:
        """How the ball passes the scene's wall; None without one, or if it lands before it."""
        scene, path = self.scene, self.path
        if scene.wall is None:
            return None
        flight = path.flights[0] if isinstance(path, Course) else path
        return passage_on(flight, scene.wall, scene.ahead, scene.ball.radius, self.start_height)

    @cached_property
    def score(self) -> Score | None:
        """How the ball meets the goal; None if the scene's plane is no goal line."""
        scene, plane = self.scene, self.scene.plane
        if plane is None or not plane.is_goal_line:
            return None
        x, y, _ = self.end.position - plane.point
        left = float(plane.normal[1] * x - plane.normal[0] * y)
        up = float(self.end.position[2] - self.launch.position[2]) + self.start_height
        return score_at(left, up, scene.ball.radius, arrives=self.status == FlightStatus.AT_PLANE)

    @property
    def pitch_text(self) -> str:
        """Sentences on how the ball passes the wall and meets the goal; empty without both."""
        sentences = []
        if self.scene.wall is not None:
            sentences.append(str(self.passage or "The ball lands before it reaches the wall."))
            if self.passage is not None and not self.passage.is_clear:
                sentences.append("The flight goes on as if the wall were not there.")
        if self.score is not None:
            sentences.append(str(self.score))
        return " ".join(sentences)

    @property
    def end_text(self) -> str:
        """Status and position of the end, as text."""
        x, y, z = self.end.position.round(3) + 0.0  # no -0
        words = _PHRASES.get(self.status, f"NO END ({self.status}), computed as far as")
        return f"{words} ({x:.3f}, {y:.3f}, {z:.3f}) m"

    @property
    def summary(self) -> str:
        """Sentences on the end, its error, the wall and the goal."""
        error = distance_in_words(self.error) if math.isfinite(self.error) else "unknown"
        note = f" (neglecting the contact time, {self.note})" if self.neglected else ""
        text = f"The ball {self.end_text} after {self.end.time:.3f} s; the error is {error}{note}."
        return f"{text} {self.pitch_text}".rstrip()

    def _rows(self) -> Iterable[Row]:
        scene, impact, verdicts = self.scene, self.impact, dict.fromkeys(self.negligible, ", small")
        yield "status", self.status, ""
        yield "end", self.end.position, "m"
        yield "time", float(self.end.time), "s"
        yield "error", self.error, "m"
        for effect in self.neglected:
            verdicts[effect] = ", neglected"
            yield "error by the contact time", self.model_error, "m"
        if self.tolerance is not None:
            yield "tolerance", self.tolerance, "m"
            yield "within tolerance", self.within_tolerance, ""
        if not math.isnan(self.end_deviation):
            yield "standard deviation of the end", self.end_deviation, "m"
        if not isinstance(impact.contact.restitution, float):
            yield "restitution", impact.restitution, ""
        if self.pitch_text:
            yield "wall and goal", self.pitch_text, ""
        yield "method", self.method, ""
        yield "origin", "of the world" if is_floating(scene.leg) else "base of the leg", ""
        if scene.ground is not None:
            yield "height of the ground", scene.ground.height, "m"
        for size in self.effects:
            text = f"m away{verdicts.get(size.effect, '')}"
            text += f", impulse {size.impulse:.3g} N s off" if size.impulse > 0.0 else ""
            text += f", {size.why_not}" if size.why_not else ""
            yield f"the end without {size.effect}", size.end, text
        yield from warned(self.warnings)


@validation.check_arguments
def simulate(scene: Scene, tolerance: float | None = 0.05) -> Simulation:
    r"""Find where the ball of a scene ends, to a tolerance.

    The contact time is neglected if it moves the end by less than 0.9 of the tolerance, as
    estimated by strikes of an instantaneous contact where the foot is meanwhile; otherwise the
    contact is integrated to a relative tolerance of 1e-6, or 1e-9 if that does not suffice. All
    other effects are always modelled, and the flight is integrated to 1e-9.

    Args:
        scene: the scene of the kick.
        tolerance: largest error of the position where the path of the ball ends, 1e-12 or more [m],
            beside that of the scene's own numbers. None models everything, with a relative
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
    began = time.process_time()
    if tolerance is not None:
        tolerance = validation.number("tolerance", tolerance, above=0, unit="m")
        if tolerance < ROUNDING:
            raise InvalidInput(
                f"tolerance is {tolerance:g} m, below rounding: it must be {ROUNDING:g} m or more, "
                "or None for everything as exact as possible"
            )

    def answer(
        impact: Impact | Collision, path: Flight | Course | None = None, model_error: float = 0.0
    ) -> Simulation:
        path, sources = path or fly_scene(scene, impact.ball_after), scene.uncertainty
        spread = strike_scene(scene).uncertainty(**sources) if sources else None
        seconds = time.process_time() - began
        return Simulation(scene, tolerance, impact, path, spread, model_error, seconds=seconds)

    if not scene.is_compliant:
        return answer(strike_scene(scene))
    if tolerance is None:
        return answer(collide_scene(scene, SMALLEST_TOLERANCE))
    instant = strike_scene(scene)
    allowed, launch_error = CONTACT_SHARE * tolerance, contact_time_error(scene, instant)
    if launch_error.velocity < math.inf:
        with suppress(KickdynError):  # as where only this launch leaves the range of a coefficient
            path = fly_scene(scene, instant.ball_after)
            size = end_error(scene, path, launch_error)
            # where the path ends at once, the launch with contact time may well fly
            if size <= allowed and path.duration > 0.0:
                return answer(instant, path, size)
    for tol in (USUAL_TOLERANCE, SMALLEST_TOLERANCE):
        found = answer(collide_scene(scene, tol))
        error = end_error(scene, found.path, collision_error(scene.ball, found.launch, tol))
        if not allowed < error < math.inf:
            break
    return found


def simulate_as_instant(scene: Scene) -> Simulation:
    """Return a scene with an instantaneous contact, simulated exactly.

    Only such an impact has joint impulses. `model_error` is the measured distance to the end
    with the contact time; inf if that cannot be computed.
    """
    if not scene.is_compliant:
        return simulate(scene, None)
    answer, size = simulate(scene.as_instant(), None), math.inf
    try:
        compliant = simulate(scene, None)
        note = f"with it: {compliant.end_text}"
        size = math.dist(answer.end.position, compliant.end.position) + compliant.numerical_error
    except KickdynError as error:
        note = f"which cannot be computed: {error}"
    return replace(answer, scene=scene, model_error=size, note=note)


def _measure(effect: str, less: Scene, full: Simulation) -> EffectSize:
    impact, impulse = full.impact, 0.0
    try:
        if less.air is full.scene.air:  # else the effect is one of the flight only
            if isinstance(impact, Collision) and less.is_compliant:
                impact = collide_scene(less, impact.tol)
            else:
                impact = strike_scene(less)
            impulse = math.dist(impact.impulse, full.impact.impulse)
        path = fly_scene(less, impact.ball_after)
    except KickdynError as error:
        return EffectSize(effect, math.nan, math.nan, str(error))
    for status in (full.status, path.status):
        if status not in STATUSES_WITH_END:
            return EffectSize(effect, math.nan, impulse, f"no end: {status}")
    return EffectSize(effect, math.dist(end_of(path).position, full.end.position), impulse)
