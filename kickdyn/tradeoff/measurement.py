"""Error against cost: one measurement, the Pareto front of many, and plots of error and effects."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from timeit import Timer
from typing import Any

from matplotlib.figure import Figure

from kickdyn.core.plot_style import styled
from kickdyn.scene.effects import EffectSize

BRIEFEST_TIMING = 0.02
"""Least time of a mean over repetitions [s]."""

MARKERS = "osv^DdPX*"
"""One for each of the methods of an impact, or of a flight."""

TOLERANCE = 0.05
"""The default tolerance of `simulate`, a line in the picture [m]."""

LEAST_EFFECT = 1e-9
"""Shorter distances are due to the integrators [m]."""


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
        pareto: whether no other method of the same scene is both faster and more exact.
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
        replace(row, pareto=not any(o.seconds < row.seconds and o.error < row.error for o in rows))
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


@styled()
def effect_figure(title: str, sizes: Sequence[EffectSize], tolerance: float = TOLERANCE) -> Figure:
    """Return how far neglecting each effect moves the end, as bars on a logarithmic scale.

    A line is drawn at the tolerance [m]: half of it is there for all neglected effects.
    """
    figure = Figure(figsize=(8.0, 1.6 + 0.32 * len(sizes)))
    axes: Any = figure.subplots()
    seen = [size.end for size in sizes if size.end > LEAST_EFFECT]
    low, high = min([*seen, tolerance]) / 3.0, max([*seen, tolerance]) * 8.0
    for place, size in enumerate(sizes):
        known = size.end > LEAST_EFFECT
        if known:
            axes.barh(place, size.end - low, left=low, color="tab:blue", height=0.65)
        text = "no answer" if size.why_not else f"below {LEAST_EFFECT:g}"
        text = f"{size.end:.2g}" if known else text
        axes.text(1.15 * (size.end if known else low), place, text, va="center", fontsize=8)
    axes.axvline(tolerance, color="tab:red", linestyle="--", label=f"tolerance {tolerance:g} m")
    axes.set(title=title, xlabel="neglecting it moves the end by [m]", xscale="log")
    axes.set_xlim(low, high)
    axes.set_yticks(range(len(sizes)), [size.effect for size in sizes])
    axes.set_ylim(len(sizes) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    return figure
