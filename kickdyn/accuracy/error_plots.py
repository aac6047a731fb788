"""Pictures: error against time, one panel per scene; and what each effect of a scene is worth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from kickdyn.accuracy.flight_methods import Measured
from kickdyn.accuracy.impact_methods import MeasuredImpact
from kickdyn.core.plot_style import styled

if TYPE_CHECKING:
    from kickdyn.accuracy.effect_sizes import Worth

LEAST = 1e-9
"""Distances below it are what integrators miss [m]."""

LOOKS = {
    "closed form, float64": ("o", "tab:red"),
    "closed form, float32": ("v", "tab:red"),
    "closed form": ("o", "tab:red"),
    "engine": ("s", "tab:blue"),
    "stacked KKT": ("^", "tab:green"),
    "Pinocchio ADMM": ("D", "tab:purple"),
    "Pinocchio PGS": ("d", "tab:pink"),
    "compliant contact": ("P", "tab:orange"),
    "MuJoCo": ("X", "tab:gray"),
    "kd.fly": ("o", "tab:orange"),
    "kd.fly_many": ("s", "tab:red"),
    "heyoka": ("D", "tab:gray"),
    "RK45": ("v", "tab:blue"),
    "DOP853": ("^", "tab:green"),
    "LSODA": ("P", "tab:purple"),
    "Radau": ("X", "tab:brown"),
}
"""Marker and colour of each method."""


@styled()
def picture(impacts: Sequence[MeasuredImpact], flights: Sequence[Measured]) -> Figure:
    """Return error against time for every kick and flight that was measured.

    Args:
        impacts: as `measure_impact` returns them, or none.
        flights: as `measure` returns them, or none.
    """
    panels: dict[str, list[Any]] = {}
    for hit in impacts:
        panels.setdefault(f"impact, {hit.kick}", []).append(hit)
    for path in flights:
        panels.setdefault(f"flight, {path.scene}", []).append(path)
    panels = {title: rows for title, rows in panels.items() if len(rows) > 1}
    lines = -(-len(panels) // 2)
    figure = Figure(figsize=(11.5, 3.7 * lines))
    grid = figure.subplots(lines, 2, squeeze=False).ravel()
    for axes, (title, rows) in zip(grid, panels.items(), strict=True):
        _panel(axes, title, rows)
    return figure


def _panel(axes: Any, title: str, rows: list[Any]) -> None:
    front = sorted((row.seconds, row.error) for row in rows if row.pareto)
    seconds, errors = zip(*front, strict=True)
    axes.loglog(seconds, errors, "-", color="0.8", linewidth=5, zorder=0, label="Pareto front")
    for method in dict.fromkeys(row.method for row in rows):
        mine = [row for row in rows if row.method == method]
        marker, colour = LOOKS[method]
        line = "" if method == "MuJoCo" else ":"  # two settings at once
        axes.loglog(
            [row.seconds for row in mine],
            [row.error for row in mine],
            marker=marker,
            linestyle=line,
            color=colour,
            markersize=5,
            label=method,
        )
    axes.set(title=title, xlabel="time per evaluation [s]")
    unit = "relative error of the impulse" if title.startswith("impact") else "landing error [m]"
    axes.set_ylabel(unit)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))  # beside: lines are everywhere


@styled()
def worth_picture(title: str, rows: Sequence[Worth], tolerance: float) -> Figure:
    """Return how far leaving out each effect moves the end, as bars on a scale of decades.

    Args:
        title: of the scene.
        rows: as `worths` returns them.
        tolerance: drawn as a line: half of it is there for all that is left out [m].
    """
    figure = Figure(figsize=(8.0, 1.6 + 0.32 * len(rows)))
    axes: Any = figure.subplots()
    seen = [row.end for row in rows if row.end > LEAST]
    low, high = min([*seen, tolerance]) / 3.0, max([*seen, tolerance]) * 8.0
    for place, row in enumerate(rows):
        known = row.end > LEAST
        if known:
            axes.barh(place, row.end - low, left=low, color="tab:blue", height=0.65)
        text = f"{row.end:.2g}" if known else "no answer" if row.why_not else f"below {LEAST:g}"
        axes.text(1.15 * (row.end if known else low), place, text, va="center", fontsize=8)
    axes.axvline(tolerance, color="tab:red", linestyle="--", label=f"tolerance {tolerance:g} m")
    axes.set(title=title, xlabel="leaving it out moves the end by [m]", xscale="log")
    axes.set_xlim(low, high)
    axes.set_yticks(range(len(rows)), [row.effect for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    return figure
