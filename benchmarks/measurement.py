"""Error against cost: one measurement, the Pareto front of many, and the plot of both."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from timeit import Timer
from typing import Any

from matplotlib.figure import Figure

from kickdyn.core.plot_style import styled

BRIEFEST_TIMING = 0.02
"""Least time of a mean over repetitions [s]."""

MARKERS = "osv^DdPX*"
"""One for each of the methods of an impact, or of a flight."""


@dataclass(frozen=True)
class Measurement:
    """One method at one setting.

    Attributes:
        scene: what is computed.
        method: with what.
        setting: tolerance, stiffness or time step, if it has one.
        error: of an impulse, relative to 50 digits; of landings, the largest distance [m].
        seconds: of this process, per evaluation or flight.
        calls: of the acceleration, per flight; of heyoka, its steps; None of an impact.
        pareto: whether no other method of the same scene is at least as fast and as exact.
    """

    scene: str
    method: str
    setting: str
    error: float
    seconds: float
    calls: float | None = None
    pareto: bool = False


def mark_front(rows: Sequence[Measurement]) -> list[Measurement]:
    """Return the measurements of one scene, those on the Pareto front marked."""
    return [
        replace(
            row,
            pareto=not any(
                o.seconds <= row.seconds
                and o.error <= row.error
                and (o.seconds, o.error) != (row.seconds, row.error)
                for o in rows
            ),
        )
        for row in rows
    ]


def shortest_time(run: Callable[[], object]) -> float:
    """Return the shortest of three mean times of this process that a call takes [s]."""
    timer = Timer(run, timer=time.process_time)
    once = timer.timeit(1)
    number = max(1, math.ceil(BRIEFEST_TIMING / max(once, 1e-6)))
    return min(once, *(total / number for total in timer.repeat(3 - (number == 1), number)))


@styled()
def front_figure(impacts: Sequence[Measurement], flights: Sequence[Measurement]) -> Figure:
    """Return error against time, a panel for each scene that more than one method measured."""
    panels = []
    for kind, unit, rows in (
        ("impact", "relative error of the impulse", impacts),
        ("flight", "landing error [m]", flights),
    ):
        methods = list(dict.fromkeys(row.method for row in rows))
        for scene in dict.fromkeys(row.scene for row in rows):
            of_scene = [row for row in rows if row.scene == scene]
            if len(of_scene) > 1:
                panels.append((f"{kind}, {scene}", unit, of_scene, methods))
    lines = -(-len(panels) // 2)
    figure = Figure(figsize=(11.5, 3.7 * lines))
    grid = figure.subplots(lines, 2, squeeze=False).ravel()
    for axes, (title, unit, rows, methods) in zip(grid, panels, strict=True):
        _draw_panel(axes, rows, methods)
        axes.set(title=title, xlabel="time per evaluation [s]", ylabel=unit)
    return figure


def _draw_panel(axes: Any, rows: Sequence[Measurement], methods: Sequence[str]) -> None:
    """Draw the front and every method of one scene; a method looks alike in all of them."""
    front = sorted((row.seconds, row.error) for row in rows if row.pareto)
    seconds, errors = zip(*front, strict=True)
    axes.loglog(seconds, errors, "-", color="0.8", linewidth=5, zorder=0, label="Pareto front")
    for method in dict.fromkeys(row.method for row in rows):
        index = methods.index(method)
        axes.loglog(
            [row.seconds for row in rows if row.method == method],
            [row.error for row in rows if row.method == method],
            marker=MARKERS[index],
            linestyle="" if method == "MuJoCo" else ":",  # stiffness and time step vary at once
            color=f"C{index}",
            markersize=5,
            label=method,
        )
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))  # beside: lines are everywhere
