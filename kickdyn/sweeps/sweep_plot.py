"""The plot of a sweep: ball speed over the joints, and against the largest joint impulse."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from kickdyn.core.plot_style import styled
from kickdyn.sweeps.queries import SpeedMap, Summary
from kickdyn.sweeps.sweep_report import ReportLine

_LABEL = "ball speed / foot speed"


@styled()
def sweep_figure(summary: Summary, lines: Sequence[ReportLine] = ()) -> Figure:
    """Draw a sweep.

    Args:
        summary: the summary of the sweep; postures that count for it are drawn.
        lines: postures to mark, as in the report.

    Returns:
        A figure: the ratio of ball speed to foot speed over the three joints with most values, by
        pairs (the best over the others), or over the one joint there is; and last that ratio
        against the largest joint impulse, with the postures that no other beats in both.
    """
    foot_speed = float(summary.attributes["foot_speed_m_s"])
    maps = summary.maps
    rows = 2 if len(maps) > 1 else 1
    figure = Figure(figsize=(11, 4.6 * rows))
    panels = figure.subplots(rows, 2).ravel()
    ratios = np.concatenate([speeds.best.ravel() for speeds in maps.values()]) / foot_speed
    span = (np.fmin.reduce(ratios), np.fmax.reduce(ratios))
    for speeds, panel in zip(maps.values(), panels, strict=False):
        _draw_map(figure, panel, speeds, summary, span)
    _draw_front(figure, panels[-1], summary, lines)
    figure.suptitle(_title(summary))
    return figure


def _title(summary: Summary) -> str:
    """Return leg, kick, condition and, of an unfinished sweep, the share that is computed."""
    about = summary.attributes
    title = (
        f"{_plain(about['leg'])}: foot {about['foot_speed_m_s']:g} m/s at "
        f"{about['attack_deg']:g}°, restitution {about['restitution']:g}, "
        f"friction {about['friction']:g}, ball {about['ball_mass_kg']:g} kg"
    )
    if summary.where is not None:
        title += f"\nwhere {_plain(summary.where)}"
    share = summary.postures / sum(summary.counts.values())
    return title if share == 1.0 else f"{title}\nunfinished: {share:.0%} of the postures"


def _draw_map(
    figure: Figure, axes: Any, speeds: SpeedMap, summary: Summary, span: tuple[float, float]
) -> None:
    """Draw the best ratio over one joint as a line, over two as a map."""
    reduced = [
        _plain(name)
        for name, values in summary.axes.items()
        if name not in speeds.values and len(values) > 1
    ]
    if reduced:
        axes.set_title(f"best over {', '.join(reduced)}")
    labels = [f"{_plain(name)} [{summary.units[name]}]" for name in speeds.values]
    best = speeds.best / float(summary.attributes["foot_speed_m_s"])
    values = list(speeds.values.values())
    if len(labels) == 1:
        axes.plot(values[0], best, ".-")
        axes.set(xlabel=labels[0], ylabel=_LABEL)
        return
    mesh = axes.pcolormesh(*values, best.T, shading="nearest", vmin=span[0], vmax=span[1])
    figure.colorbar(mesh, ax=axes, label=_LABEL)
    axes.set(xlabel=labels[0], ylabel=labels[1])


def _draw_front(figure: Figure, axes: Any, summary: Summary, lines: Sequence[ReportLine]) -> None:
    """Draw ratio against joint impulse: a sample, the front, and the postures of the report."""
    foot_speed = float(summary.attributes["foot_speed_m_s"])
    load, speed, use = summary.sample.T
    dots = axes.scatter(load, speed / foot_speed, c=100 * use, s=7, cmap="cividis")
    figure.colorbar(dots, ax=axes, label="joint speeds needed, % of their limits")
    speed, load, _ = summary.front[::-1].T
    axes.step(load, speed / foot_speed, where="post", color="tab:red", lw=1.2, label="Pareto front")
    for line in lines:
        x, y = line.values["worst_joint_impulse"], line.values["speed_ratio"]
        if np.isfinite(x):
            axes.plot(x, y, "o", markerfacecolor="none", color="tab:red", markersize=8)
            axes.annotate(  # at the side where no posture is better
                line.label, (x, y), xytext=(-6, 2), textcoords="offset points", ha="right",
                color="tab:red", path_effects=[withStroke(linewidth=3, foreground="white")],
            )  # fmt: skip
    if len(load):
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    axes.set(xlabel="largest joint impulse [N s]", ylabel=_LABEL)
    axes.set_title("ball speed against joint impulse", loc="left")
    axes.margins(0.2, 0.1)


def _plain(name: str) -> str:
    """Return a text without formulas: matplotlib reads them between dollars."""
    return name.replace("$", r"\$")
