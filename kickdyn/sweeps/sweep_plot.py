"""The picture of a sweep: ball speed over the joints, and what the joints pay for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from kickdyn.core.files import replacing
from kickdyn.core.plot_style import styled
from kickdyn.errors import InvalidInput
from kickdyn.sweeps.block import Space
from kickdyn.sweeps.expression import Expression
from kickdyn.sweeps.front import Front
from kickdyn.sweeps.marginal import Marginal
from kickdyn.sweeps.top import Top, lot

if TYPE_CHECKING:
    from kickdyn.sweeps.opened import Reduction, Sweep
    from kickdyn.sweeps.summary import Line

ENDINGS = (".png", ".svg", ".pdf")

PIXELS = 200
"""Values per joint that a heat map shows; neighbours go together, and the best of them counts."""

DOTS = 4000
"""Postures in the cloud; of more, so many by lot."""

RATIO, WORST, USE = "speed_ratio", "worst_joint_impulse", "speed_use"
_LABEL = "ball speed / foot speed"


def check_name(path: str | PathLike[str]) -> None:
    """Raise `InvalidInput` unless the name ends as a picture's does."""
    if Path(path).suffix.lower() not in ENDINGS:
        raise InvalidInput(f"{path} has no known ending: plots are written as {', '.join(ENDINGS)}")


def sweep_figure(sweep: Sweep, lines: Sequence[Line] = ()) -> Figure:
    """Draw a sweep, in one pass over it, without holding it in memory.

    Args:
        sweep: its postures that the leg can kick from and that fulfil its conditions are drawn.
        lines: postures to mark, as in the printed table.

    Returns:
        A figure: the ball/foot speed ratio over the three joints with most values, by pairs (the
        best over the others), or over the one joint there is; and last that ratio against the
        worst joint impulse, with the postures that no other beats in both.
    """
    picture = Picture(sweep.space)
    sweep.reduce(*picture.parts)
    share = sweep.postures / sweep.space.size
    return picture.figure(title(sweep.data.attrs, sweep.conditions, share), lines)


class Picture:
    """What is drawn of a sweep, seen block by block.

    Args:
        space: the joints.

    Attributes:
        parts: what is to see the blocks.
    """

    def __init__(self, space: Space) -> None:
        ratio, load = (Expression(of, space.units, "number") for of in (RATIO, WORST))
        most = sorted(space.axes, key=lambda name: -len(space.axes[name]))
        self._units = space.units
        self._varied = [name for name in space.axes if len(space.axes[name]) > 1]
        shown = [name for name in self._varied if name in most[:3]] or most[:1]
        pairs: list[tuple[str, ...]] = [*combinations(shown, 2)] or [(shown[0],)]
        self._maps = [Marginal(space, pair, ratio, PIXELS) for pair in pairs]
        self._front = Front(ratio, load)
        self._cloud = Top(DOTS, lot(), (WORST, RATIO, USE))
        self.parts: tuple[Reduction, ...] = (*self._maps, self._front, self._cloud)

    @styled()
    def figure(self, heading: str, lines: Sequence[Line] = ()) -> Figure:
        """Draw what was seen."""
        maps = self._maps
        rows = 2 if len(maps) > 1 else 1
        figure = Figure(figsize=(11, 4.6 * rows))
        panels = figure.subplots(rows, 2).ravel()
        top = max((each.best.max() for each in maps), default=0.0)
        low = min((each.best.min(where=each.count > 0, initial=top) for each in maps), default=0.0)
        for each, panel in zip(maps, panels, strict=False):
            others = [name for name in self._varied if name not in each.joints]
            _map(figure, panel, each, self._units, others, (low, top))
        _price(figure, panels[-1], self._cloud, self._front, lines)
        figure.suptitle(heading)
        return figure


def save_figure(figure: Figure, path: str | PathLike[str]) -> None:
    """Write a figure as PNG, SVG or PDF, by its ending; raise `InvalidInput` if that fails."""
    check_name(path)
    with replacing(path) as draft, styled():  # labels of ticks are made here
        figure.savefig(draft, dpi=150)


def title(about: Mapping[str, Any], conditions: Sequence[Expression], share: float = 1.0) -> str:
    """Return what a sweep is of, by the attributes of its dataset and the share that is done."""
    said = (
        f"{_plain(about['leg'])}: foot {about['foot_speed_m_s']:g} m/s at "
        f"{about['attack_deg']:g}°, e = {about['restitution']:g}, "
        f"μ = {about['friction']:g}, ball {about['ball_mass_kg']:g} kg"
    )
    if conditions:
        said += f"\nwhere {_plain(' and '.join(each.text for each in conditions))}"
    if share < 1.0:
        said += f"\nunfinished: {share:.0%} of the postures"
    return said


def _map(
    figure: Figure,
    axes: Any,
    marginal: Marginal,
    units: Mapping[str, str],
    others: list[str],
    span: tuple[float, float],
) -> None:
    if others:
        axes.set_title(f"best over {', '.join(map(_plain, others))}")
    labels = [f"{_plain(name)} [{units[name]}]" for name in marginal.joints]
    values, best = list(marginal.coordinates().values()), marginal.best_values()
    if len(labels) == 1:
        axes.plot(values[0], best, ".-")
        axes.set(xlabel=labels[0], ylabel=_LABEL)
        return
    mesh = axes.pcolormesh(*values, best.T, shading="nearest", vmin=span[0], vmax=span[1])
    figure.colorbar(mesh, ax=axes, label=_LABEL)
    axes.set(xlabel=labels[0], ylabel=labels[1])


def _plain(name: str) -> str:
    return name.replace("$", r"\$")  # matplotlib reads formulas between dollars


def _price(figure: Figure, axes: Any, cloud: Top, front: Front, lines: Sequence[Line]) -> None:
    load, ratio, use = cloud.rows.T
    dots = axes.scatter(load, ratio, c=100 * use, s=7, cmap="cividis")
    figure.colorbar(dots, ax=axes, label="joint speeds needed, % of their limits")
    best = front.points[::-1]
    axes.step(best[:, 1], best[:, 0], where="post", color="tab:red", lw=1.2, label="front")
    for line in lines:
        x, y = line.numbers[WORST], line.numbers[RATIO]
        if np.isfinite(x):
            axes.plot(x, y, "o", markerfacecolor="none", color="tab:red", markersize=8)
            axes.annotate(  # at the side where no posture is better
                line.label,
                (x, y),
                xytext=(-6, 2),
                textcoords="offset points",
                ha="right",
                color="tab:red",
                path_effects=[withStroke(linewidth=3, foreground="white")],
            )
    if len(best):
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    axes.set(xlabel="worst joint impulse [N s]", ylabel=_LABEL)
    axes.set_title("what the joints pay")
    axes.margins(0.2, 0.1)
