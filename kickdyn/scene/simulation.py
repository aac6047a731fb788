"""The result of a simulation: where the ball ends, its error, and what was neglected."""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

from kickdyn.ball import BallState
from kickdyn.core.representation import Printed
from kickdyn.flight.flight_result import Flight, FlightStatus
from kickdyn.flight.follow import Course
from kickdyn.impact.collide import Collision
from kickdyn.impact.impact_result import Impact
from kickdyn.restitution import describe_restitution, range_warnings
from kickdyn.robot.standing import is_floating
from kickdyn.scene.effects import EffectSize, EffectVerdict
from kickdyn.scene.pitch import Passage, Score, passage_on, score_at
from kickdyn.scene.scene import Scene

_PHRASES: dict[str, str] = {
    FlightStatus.LANDED: "landed at",
    FlightStatus.AT_PLANE: "reached the plane at",
    FlightStatus.AT_REST: "came to rest at",
}
"""By status, how the path of the ball ends."""


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Printed):
    """The result of a scene. `print` shows its error budget as a table.

    Attributes:
        scene: the scene, as it was given.
        tolerance: tolerance on the position of the end [m]; None where everything is modelled,
            except for what the `verdicts` neglect.
        impact: the impact, of an instant or of a finite contact time.
        launch: the ball as it leaves the foot.
        end: the ball at the end of its path: on the ground, at the height of the launch, at the
            plane, or at rest on a ground with a surface. Its time counts from the launch.
        status: how the path ends: `landed`, `at-plane` or `at-rest`. Any other status, as of
            `Flight` and `Course`, says why it has no end; `end` is then the last state.
        path: the flight or the course, without the neglected effects.
        verdicts: the decision on each effect of the scene, with its size and its reason.
        model_error: distance by which the neglected effects move the end [m]: of the contact time
            an estimate, of all others measured.
        method: how the end was computed.
        evaluations: number of evaluations of the accelerations in contact and flight, without
            those for derivatives of the end and for `numerical_error`.
        end_deviation: standard deviation of the end that follows from the `uncertainty` of the
            scene, to first order, velocity and spin varying together [m]; nan where the scene has
            none, inf where the path has no end.
    """

    scene: Scene
    tolerance: float | None
    impact: Impact | Collision
    launch: BallState
    end: BallState
    status: str
    path: Flight | Course
    verdicts: tuple[EffectVerdict, ...]
    model_error: float
    method: str
    evaluations: int
    end_deviation: float
    _numerical: Callable[[], float] = field(repr=False)
    _measure: Callable[[Scene], Sequence[EffectSize]] = field(repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes, with the estimate in place of the function that makes it."""
        return {**self.__dict__, "_numerical": partial(float, self.numerical_error)}

    @cached_property
    def numerical_error(self) -> float:
        """Estimate of the numerical error of the end [m]; inf where there is no estimate."""
        return self._numerical()

    @cached_property
    def effect_sizes(self) -> Mapping[str, float]:
        """By effect: how far the end moves if only this effect is neglected [m].

        It is computed when it is first read, as exactly as the integrators can: it takes about
        three simulations with `tolerance=None` for a compliant contact, and milliseconds for an
        instantaneous one. nan where the path has no end with or without the effect, or cannot be
        computed.
        """
        sizes = {size.effect: size.end for size in self._measure(self.scene)}
        return {verdict.effect: sizes.get(verdict.effect, math.nan) for verdict in self.verdicts}

    @property
    def error(self) -> float:
        """Error of the end, the sum of `model_error` and `numerical_error` [m].

        It is at most `tolerance`, unless the integrators cannot reach that; then
        `within_tolerance` is False.
        """
        return self.model_error + self.numerical_error

    @property
    def within_tolerance(self) -> bool:
        """Whether the error is within the tolerance; without one, whether the error is finite."""
        return self.error <= (sys.float_info.max if self.tolerance is None else self.tolerance)

    @property
    def end_text(self) -> str:
        """Status and position of the end, as text."""
        x, y, z = self.end.position.round(3) + 0.0  # no -0
        words = _PHRASES.get(self.status, f"NO END ({self.status}), computed as far as")
        return f"{words} ({x:.3f}, {y:.3f}, {z:.3f}) m"

    @cached_property
    def passage(self) -> Passage | None:
        """How the ball passes the scene's wall.

        None where there is no wall, or where the ball comes down before it.
        """
        scene, path = self.scene, self.path
        if scene.wall is None:
            return None
        flight = path.flights[0] if isinstance(path, Course) else path
        return passage_on(flight, scene.wall, scene.ahead, scene.ball.radius, self.start_height)

    @cached_property
    def score(self) -> Score | None:
        """How the ball meets the goal; None where the scene's plane is no goal line."""
        scene, plane = self.scene, self.scene.plane
        if plane is None or not plane.is_goal_line:
            return None
        x, y, _ = self.end.position - plane.point
        left = float(plane.normal[1] * x - plane.normal[0] * y)
        up = float(self.end.position[2] - self.launch.position[2]) + self.start_height
        arrives = self.status == FlightStatus.AT_PLANE
        return score_at(left, up, scene.ball.radius, arrives=arrives)

    def pitch_numbers(self) -> dict[str, Any]:
        """Return `passage` and `score` as dictionaries for JSON, `wall` and `goal_mouth`."""
        passage, score = self.passage, self.score
        return {
            "wall": passage and {"above": passage.above, "beside": passage.beside},
            "goal_mouth": score and score._asdict(),
        }

    @property
    def start_height(self) -> float:
        """Height of the ball's lower edge over the ground at the launch [m]; 0 without a ground."""
        ground = self.scene.ground
        if ground is None:
            return 0.0
        return float(self.launch.position[2]) - self.scene.ball.radius - ground.height

    @property
    def pitch_text(self) -> str:
        """Sentences on how the ball passes the wall and meets the goal; empty without both."""
        said = []
        if self.scene.wall is not None:
            said.append(str(self.passage or "The ball lands before it reaches the wall."))
            if self.passage is not None and not self.passage.is_clear:
                said.append("The flight goes on as if the wall were not there.")
        if self.score is not None:
            said.append(str(self.score))
        return " ".join(said)

    @property
    def frame_text(self) -> str:
        """A sentence on the frame of the positions and on the height of the ground."""
        origin = "in the world frame" if is_floating(self.scene.leg) else "from the base of the leg"
        ground = self.scene.ground
        where = "" if ground is None else f"; the ground is at z = {ground.height:.3f} m"
        return f"Positions are of the ball's centre, {origin}: x forward, y left, z up{where}."

    @property
    def modelled(self) -> tuple[str, ...]:
        """Names of the effects that were modelled."""
        return tuple(v.effect for v in self.verdicts if v.modelled)

    @property
    def neglected(self) -> tuple[str, ...]:
        """Names of the effects of the scene that were not modelled."""
        return tuple(v.effect for v in self.verdicts if not v.modelled)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the leg, and of coefficients of contact and air outside their ranges."""
        impact = self.impact
        return (
            *self.scene.leg.warnings,
            *range_warnings(impact.contact.restitution, impact.approach_speed),
            *self.path.warnings,
        )

    @property
    def summary(self) -> str:
        """The end, its error, the wall, the goal, notes and warnings, one line each."""
        error = f"error {self.error:.2g} m" if math.isfinite(self.error) else "error unknown"
        if self.tolerance is not None:
            met = "within" if self.within_tolerance else "NOT WITHIN"
            error += f", {met} the tolerance of {self.tolerance:g} m"
        elif self.neglected:
            left_out = [f"{v.effect} ({v.why})" for v in self.verdicts if not v.modelled]
            error += f"; all effects are modelled except {', '.join(left_out)}"
        else:
            error += "; all effects are modelled"
        impact = self.impact
        given, speed = impact.contact.restitution, impact.approach_speed
        lines = [
            f"{self.end_text} after {self.end.time:.3f} s; {error}",
            describe_restitution(given, impact.restitution, speed),
            self.pitch_text,
            self.frame_text,
        ]
        if not math.isnan(self.end_deviation):
            lines.append(
                f"The uncertainties of the scene give the end a standard deviation of "
                f"{_size(self.end_deviation)} m."
            )
        lines += [f"note: {note}" for note in self.scene.notes]
        lines += [f"warning: {warning}" for warning in self.warnings]
        return "\n".join(filter(None, lines))

    def __str__(self) -> str:
        """Return the summary and a table of the effects."""
        numerics = self.numerical_error
        size = "rounding"
        if numerics > 1e-12:
            size = f"{_size(numerics)} m by numerical integration"
        by_model = (
            f"{_size(self.model_error)} m by neglected effects and " if self.neglected else ""
        )
        lines = [
            self.summary,
            f"The error is {by_model}{size} ({self.method}).",
            f"{'effect':20}{'':12}{'size [m]':>9}",
        ]
        for verdict in self.verdicts:
            decision = "modelled" if verdict.modelled else "neglected"
            line = f"{verdict.effect:20}{decision:12}{_size(self.effect_sizes[verdict.effect]):>9}"
            lines.append(line)
        lines.append("size: how far the end moves if only this effect is neglected.")
        if self.tolerance is not None:
            lines.append(
                "Effects are neglected as long as all that is neglected moves the end by at most "
                "half of the tolerance."
            )
        for why in {v.why: None for v in self.verdicts if v.modelled and math.isinf(v.size)}:
            names = [v.effect for v in self.verdicts if v.why == why]
            lines.append(f"{', '.join(names)}: {why}.")
        return "\n".join(lines)


def _size(metres: float) -> str:
    """Return a length with two digits, `unknown` where it is not finite."""
    if not math.isfinite(metres):
        return "unknown"
    return f"{metres:.0f}" if metres >= 10.0 else f"{metres:.2g}"
