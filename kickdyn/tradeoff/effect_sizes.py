"""A plot of what each physical effect of a scene changes where the ball's path ends."""

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from kickdyn.core.plot_style import styled
from kickdyn.scene.effects import EffectSize

TOLERANCE = 0.05
"""The default tolerance of `simulate`, a line in the picture [m]."""

LEAST = 1e-9
"""Distances below it are due to the integrators [m]."""


@styled()
def effect_figure(title: str, sizes: Sequence[EffectSize], tolerance: float = TOLERANCE) -> Figure:
    """Return how far neglecting each effect moves the end, as bars on a logarithmic scale.

    A line is drawn at the tolerance [m]: half of it is there for all neglected effects.
    """
    figure = Figure(figsize=(8.0, 1.6 + 0.32 * len(sizes)))
    axes: Any = figure.subplots()
    seen = [size.end for size in sizes if size.end > LEAST]
    low, high = min([*seen, tolerance]) / 3.0, max([*seen, tolerance]) * 8.0
    for place, size in enumerate(sizes):
        known = size.end > LEAST
        if known:
            axes.barh(place, size.end - low, left=low, color="tab:blue", height=0.65)
        text = f"{size.end:.2g}" if known else "no answer" if size.why_not else f"below {LEAST:g}"
        axes.text(1.15 * (size.end if known else low), place, text, va="center", fontsize=8)
    axes.axvline(tolerance, color="tab:red", linestyle="--", label=f"tolerance {tolerance:g} m")
    axes.set(title=title, xlabel="neglecting it moves the end by [m]", xscale="log")
    axes.set_xlim(low, high)
    axes.set_yticks(range(len(sizes)), [size.effect for size in sizes])
    axes.set_ylim(len(sizes) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    return figure
