"""The picture of a moving ball's meetings: when to meet it, and how exact that must be."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kickdyn.core.plot_style import styled
from kickdyn.core.validation import Array
from kickdyn.planning.goal import Goal
from kickdyn.planning.meeting import LandingSlopes, error_that_matters

COLOURS = "tab:blue", "tab:orange"
"""Of speed use and of tolerances."""


@styled()
def meeting_figure(plan: Any) -> Figure:
    """Draw speed use and the tolerance of timing by meetings, and errors that miss by 10 cm.

    Args:
        plan: a `KickPlan` of a ball that moves.
    """
    kicks = [meeting for meeting in plan.meetings if meeting.impact is not None]
    times = [meeting.time for meeting in kicks]
    slopes = [meeting.landing_slopes for meeting in kicks]
    exact = [math.nan if slope is None else 1e3 * slope.tolerances[0] for slope in slopes]
    slope, goal = plan.meeting.landing_slopes, plan.goal
    figure = Figure(figsize=(9.0, 4.0))
    left, right = figure.subplots(1, 2)
    left.axvline(plan.meeting.time, color="0.6", linewidth=1, linestyle=":")
    left.set_xlabel("time of the meeting [s], dotted: planned")
    drawn = [
        (left, [100 * meeting.speed_use for meeting in kicks], COLOURS[0], "speed, % of its limit")
    ]
    if slope is not None:
        label = "foot late for 10 cm at the target [ms]"
        drawn.append((left.twinx(), exact, COLOURS[1], label))
    for axes, values, colour, label in drawn:
        axes.plot(times, values, "o-", color=colour)
        axes.set_ylabel(label, color=colour)
        axes.set_ylim(0.0, 1.1 * max([0.1, *(value for value in values if math.isfinite(value))]))
        axes.grid(visible=axes is left)
    if slope is None or not isinstance(goal, Goal):  # of a trap, a pass or half a kick
        right.remove()
        return figure
    turn = np.linspace(0.0, 2.0 * math.pi, 100)
    right.plot(10 * np.cos(turn), 10 * np.sin(turn), color="0.6")
    for number, (name, derivative, size) in enumerate(
        _errors(plan.meeting.ball.velocity, goal.ahead, slope)
    ):
        end = 100 * size * np.array([-(goal.left @ derivative), derivative[2]])
        right.plot([0.0, end[0]], [0.0, end[1]], "-o", linewidth=6.0 - 1.5 * number, label=name)
    right.set_aspect("equal", adjustable="datalim")
    right.set_xlabel("to the right of the target [cm]")
    right.set_ylabel("above it [cm]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _errors(
    velocity: Array, to_target: Array, slopes: LandingSlopes
) -> Iterator[tuple[str, Array, float]]:
    """Yield errors that move the landing by 10 cm: name, slope and size.

    The ball's `velocity` is ahead, or of a ball at rest, the direction to the target.
    """
    ahead = velocity / np.linalg.norm(velocity) if velocity.any() else to_target
    left = np.array([-ahead[1], ahead[0], 0.0])
    for derivative, factor, text in (
        (slopes.time, 1e3, "foot {:.2g} ms late"),
        (slopes.place @ ahead, 1e3, "ball {:.2g} mm ahead of where it was seen"),
        (slopes.place @ left, 1e3, "ball {:.2g} mm to the left of there"),
        (slopes.velocity @ ahead, 1e3, "ball {:.3g} mm/s faster than seen"),
    ):
        size = error_that_matters(derivative)
        if math.isfinite(size):
            yield text.format(factor * size), derivative, size
