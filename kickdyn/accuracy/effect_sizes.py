"""What each physical effect of a scene changes at the impact, and where the ball's path ends."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kickdyn.core.plot_style import styled
from kickdyn.errors import KickdynError
from kickdyn.scene.effects import effects_of
from kickdyn.scene.flight_end import ENDS
from kickdyn.scene.simulate import simulate
from kickdyn.scene.simulation import Simulation

TOLERANCE = 0.05
"""The default tolerance of `simulate`, a line in the picture [m]."""

LEAST = 1e-9
"""Distances below it are due to the integrators [m]."""


@dataclass(frozen=True)
class EffectSize:
    """What neglecting one effect changes, everything else modelled.

    Attributes:
        effect: its name.
        end: distance that the end of the ball's path moves [m]; nan where there is no answer.
        impulse: magnitude of the change of the impulse on the ball [N s]; likewise.
        why_not: why there is none.
    """

    effect: str
    end: float
    impulse: float
    why_not: str = ""


def measure_effects(
    whole: Simulation, report: Callable[[str], None] = lambda _: None
) -> list[EffectSize]:
    """Measure every effect of a scene, the largest first.

    The scene is that of `simulate(scene, None)`; `report` is called with each effect's name.
    """
    scene, sizes = whole.scene, []
    for effect in effects_of(scene):
        report(effect.name)
        try:
            less = simulate(effect.without(scene, whole.launch), None)
        except KickdynError as error:
            sizes.append(EffectSize(effect.name, math.nan, math.nan, str(error)))
            continue
        impulse = float(np.linalg.norm(less.impact.impulse - whole.impact.impulse))
        moved, why = math.dist(less.end.position, whole.end.position), ""
        endless = [status for status in (whole.status, less.status) if status not in ENDS]
        if endless:
            moved, why = math.nan, f"no end: {endless[0]}"
        sizes.append(EffectSize(effect.name, moved, impulse, why))
    return sorted(sizes, key=lambda size: math.inf if math.isnan(size.end) else -size.end)


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
