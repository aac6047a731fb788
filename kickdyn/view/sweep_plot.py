"""The picture of a sweep: ball speed over the joints, and what the joints pay for it."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from kickdyn.errors import InvalidInput
from kickdyn.files import replacing
from kickdyn.sweep.kick import STATUSES
from kickdyn.sweep.summary import Line

ENDINGS = (".png", ".svg", ".pdf")


def check_name(path: str | PathLike[str]) -> None:
    """Raise `InvalidInput` unless the name ends as a picture's does."""
    if Path(path).suffix.lower() not in ENDINGS:
        raise InvalidInput(f"{path} has no known ending: plots are written as {', '.join(ENDINGS)}")


def sweep_figure(data: xr.Dataset, lines: Sequence[Line]) -> Figure:
    """Draw a sweep.

    Args:
        data: as `kickdyn.sweep.run.sweep` returns it.
        lines: postures to mark, as in the printed table.

    Returns:
        A figure: on the left, the ball/foot speed ratio over the two joints with most values
        (the best over the others); on the right, that ratio against the worst joint impulse.
    """
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    possible = data.where(data.status == STATUSES.index("ok"))
    _map(figure, left, possible, data)
    _price(figure, right, possible, lines)
    figure.suptitle(
        f"{_plain(data.attrs['leg'])}: foot {data.attrs['foot_speed_m_s']:g} m/s at "
        f"{data.attrs['attack_deg']:g}°, e = {data.attrs['restitution']:g}, "
        f"μ = {data.attrs['friction']:g}, ball {data.attrs['ball_mass_kg']:g} kg"
    )
    return figure


def save_figure(figure: Figure, path: str | PathLike[str]) -> None:
    """Write a figure as PNG, SVG or PDF, by its ending; raise `InvalidInput` if that fails."""
    check_name(path)
    with replacing(path) as draft:
        figure.savefig(draft, dpi=150)


def _map(figure: Figure, axes: Any, possible: xr.Dataset, data: xr.Dataset) -> None:
    ratio = possible.speed_ratio
    names = sorted(ratio.dims, key=lambda name: -ratio.sizes[name])[:2]
    names = [name for name in ratio.dims if name in names]
    others = [name for name in ratio.dims if name not in names]
    best = ratio.max(others) if others else ratio
    angles = [_axis(data, str(name)) for name in names]
    if len(names) == 1:
        axes.plot(angles[0][0], best)
        axes.set(xlabel=angles[0][1], ylabel="ball speed / foot speed")
        axes.set_title("ball speed / foot speed")
        return
    mesh = axes.pcolormesh(
        angles[0][0], angles[1][0], best.transpose(*reversed(names)), shading="nearest"
    )
    figure.colorbar(mesh, ax=axes, label="ball speed / foot speed")
    axes.set(xlabel=angles[0][1], ylabel=angles[1][1])
    over = f", best over {', '.join(_plain(str(name)) for name in others)}" if others else ""
    axes.set_title(f"ball speed / foot speed{over}")


def _axis(data: xr.Dataset, name: str) -> tuple[Any, str]:
    values = data.coords[name].values
    if data.coords[name].attrs["units"] == "rad":
        return np.degrees(values), f"{_plain(name)} [deg]"
    return values, f"{_plain(name)} [m]"


def _plain(name: str) -> str:
    return name.replace("$", r"\$")  # matplotlib reads formulas between dollars


def _price(figure: Figure, axes: Any, possible: xr.Dataset, lines: Sequence[Line]) -> None:
    cloud = axes.scatter(
        possible.worst_joint_impulse.values.ravel(),
        possible.speed_ratio.values.ravel(),
        c=100 * possible.speed_use.values.ravel(),
        s=7,
        cmap="cividis",
    )
    figure.colorbar(cloud, ax=axes, label="fastest joint, % of its speed limit")
    for line in lines:
        x, y = line.numbers["worst_joint_impulse"], line.numbers["speed_ratio"]
        if np.isfinite(x):
            axes.plot(x, y, "o", markerfacecolor="none", color="tab:red", markersize=8)
            axes.annotate(
                line.label,
                (x, y),
                xytext=(8, -3),
                textcoords="offset points",
                color="tab:red",
                bbox={"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.7},
            )
    axes.set(xlabel="worst joint impulse [N s]", ylabel="ball speed / foot speed")
    axes.set_title("what the joints pay")
    axes.margins(0.12)
