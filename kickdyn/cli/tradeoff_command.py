"""The command `kickdyn tradeoff`: error against cost, or the change by each effect of a scene."""

import dataclasses
import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import click
import numpy as np
from matplotlib.figure import Figure

from kickdyn.cli.command import Command, busy, print_wrapped
from kickdyn.cli.option_groups import PlotOptions, takes
from kickdyn.core.files import finite
from kickdyn.core.plot_style import styled
from kickdyn.scene.effects import EffectSize
from kickdyn.scene.simulate import measure_effects, simulate
from kickdyn.scene.toml_reader import load_scene

TOLERANCE = 0.05
"""The default tolerance of `simulate`, a line in the picture [m]."""

LEAST_EFFECT = 1e-9
"""Shorter distances are due to the integrators [m]."""


@click.command("tradeoff", Command)
@click.option(
    "--scene",
    metavar="SCENE",
    help="Measure the effects of a scene: a TOML file, or a name as for `kickdyn view`.",
)
@takes(output=PlotOptions)
def tradeoff(scene: str | None, output: PlotOptions) -> None:
    """Measure error and time of the functions for impacts and flights, one by one and in batches.

    With --scene, measure what each effect of a scene changes at the impulse and at the end. The
    plot shows error against time, or the effects.

    Example: kickdyn tradeoff --plot tradeoff.png
    """
    output.check(inputs=[scene])
    if scene is None:
        _compare_functions(output)
    else:
        _measure_scene(scene, output)


def _compare_functions(output: PlotOptions) -> None:
    """Measure the functions; write and print the results."""
    from kickdyn.cli.function_costs import cost_figure, measure_functions  # imports numba

    with busy("measuring") as show:
        rows = measure_functions(show)
    output.save_plot(partial(cost_figure, rows))
    units = {"seconds": "s", "seconds_alike": "s", "rounding": "1", "model": "1"}
    numbers = "rounding", "model", "seconds_alike"
    functions = [
        dataclasses.asdict(row) | {name: finite(getattr(row, name)) for name in numbers}
        for row in rows
    ]
    output.write_json({"units": units, "functions": functions})
    if output.prints:
        lines = [f"{'function':28}{'time [us]':>12}{'rounding':>12}{'model':>12}"]
        for row in rows:
            rounding, model = ("" if math.isnan(error) else f"{error:.1e}"
                               for error in (row.rounding, row.model))  # fmt: skip
            name = row.function + (" (per row)" if row.is_batch else "")
            lines.append(f"{name:28}{1e6 * row.seconds:12.3g}{rounding:>12}{model:>12}".rstrip())
        lines += [
            "",
            "rounding: relative error by rounding and integration; model: by neglecting the time "
            "of the contact, 10 ms; pin.impulseDynamics also neglects friction. Of strikes in "
            "batches a third each sticks, slips and misses; flights have all lengths.",
        ]
        print_wrapped("\n".join(lines))
    output.name_written(output.plot)


def _measure_scene(scene: str, output: PlotOptions) -> None:
    """Measure the effects of a scene; write and print the results."""
    loaded = load_scene(scene)
    with busy("measuring") as show:
        exact = simulate(loaded, None)
        sizes = measure_effects(exact, show)
    sizes.sort(key=lambda size: math.inf if math.isnan(size.end) else -size.end)
    output.save_plot(partial(effect_figure, loaded.name, sizes))
    output.write_json(
        {
            "scene": loaded.name,
            "status": exact.status,
            "end": exact.end.position.tolist(),
            "impulse": exact.impact.impulse.tolist(),
            "units": {"end": "m", "impulse": "N s"},
            "effects": [
                dataclasses.asdict(size)
                | {"end": finite(size.end), "impulse": finite(size.impulse)}
                for size in sizes
            ],
        }
    )
    if output.prints:
        impulse = float(np.linalg.norm(exact.impact.impulse))
        lines = [
            f"{loaded.name}: impulse {impulse:.4g} N s, {exact.end_text}. If one effect is "
            "neglected:",
            f"\n{'effect':14}{'end moves by [m]':>18}{'impulse changes by [N s]':>26}",
        ]
        for size in sizes:
            end, impulse_change = (
                "" if math.isnan(value) else f"{value:.3g}" for value in (size.end, size.impulse)
            )
            lines.append(f"{size.effect:14}{end:>18}{impulse_change:>26}  {size.why_not}".rstrip())
        print_wrapped("\n".join([*lines, "", *(f"warning: {line}" for line in exact.warnings)]))
    output.name_written(output.plot)


@styled()
def effect_figure(title: str, sizes: Sequence[EffectSize], tolerance: float = TOLERANCE) -> Figure:
    """Return the displacement of the end by neglecting each effect, as logarithmic bars.

    A line is drawn at the tolerance [m]: half of it is there for all neglected effects.
    """
    figure = Figure(figsize=(8.0, 1.6 + 0.32 * len(sizes)))
    axes: Any = figure.subplots()
    seen = [size.end for size in sizes if size.end > LEAST_EFFECT]
    low, high = min([*seen, tolerance]) / 3.0, max([*seen, tolerance]) * 8.0
    for place, size in enumerate(sizes):
        measured = size.end > LEAST_EFFECT
        if measured:
            axes.barh(place, size.end - low, left=low, color="tab:blue", height=0.65)
        text = "no answer" if size.why_not else f"below {LEAST_EFFECT:g}"
        text = f"{size.end:.2g}" if measured else text
        axes.text(1.15 * (size.end if measured else low), place, text, va="center", fontsize=8)
    axes.axvline(tolerance, color="tab:red", linestyle="--", label=f"tolerance {tolerance:g} m")
    axes.set(title=title, xlabel="neglecting it moves the end by [m]", xscale="log")
    axes.set_xlim(low, high)
    axes.set_yticks(range(len(sizes)), [size.effect for size in sizes])
    axes.set_ylim(len(sizes) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    return figure
