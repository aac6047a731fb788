"""The picture of the trade: error against time, one panel per scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from kickdyn.accuracy.flight import Measured
from kickdyn.accuracy.impact import MeasuredImpact

STYLES = {
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
    figure = Figure(figsize=(9.0, 3.7 * lines), layout="constrained")
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
        marker, colour = STYLES[method]
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
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6.5)
