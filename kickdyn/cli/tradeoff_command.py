"""The command `kickdyn tradeoff`: error against cost of methods, or what each effect changes."""

import dataclasses
import math
from collections.abc import Sequence

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from kickdyn.cli.command import Command, busy, offers
from kickdyn.cli.option_groups import JsonOptions, scene_names, takes
from kickdyn.core.console import empty_table, screen_width
from kickdyn.core.files import finite
from kickdyn.core.plot_style import check_name, save_figure
from kickdyn.errors import InvalidInput
from kickdyn.scene.effects import EffectSize
from kickdyn.scene.simulate import measure_effects, simulate
from kickdyn.scene.toml_reader import load_scene
from kickdyn.tradeoff.measurement import Measurement, effect_figure, front_figure

TITLES = {
    "impact": "Impulse in posture a of Table 2 at 10 m/s; reference of 50 digits; *: Pareto front",
    "flight": "Landing points of 6 kicks, error in m; reference of 20 digits; *: Pareto front",
}


@click.command("tradeoff", Command)
@click.option("--impact", is_flag=True, help="Measure only methods for the impact.")
@click.option("--flight", is_flag=True, help="Measure only integrators of the flight.")
@click.option("--scene", metavar="SCENE", shell_complete=offers(scene_names, files=True),
              help="Measure what each effect of a scene changes: a TOML file, or the name of a "
              "scene, as for `kickdyn view`.")  # fmt: skip
@takes(output=JsonOptions)
@click.option("--plot", metavar="FILE", type=click.Path(),
              help="Plot error against time, or the effects: .png, .svg or .pdf.")  # fmt: skip
def tradeoff(
    impact: bool, flight: bool, scene: str | None, output: JsonOptions, plot: str | None
) -> None:
    """Measure the error and the computing time of kickdyn and of other methods.

    Example: kickdyn tradeoff --plot tradeoff.png
    """
    if scene is not None and (impact or flight):
        raise InvalidInput(
            "--scene measures effects of a scene, --impact and --flight measure methods: give "
            "one or the other"
        )
    if plot is not None:
        check_name(plot)
    output.check(plot, inputs=[scene])
    if scene is not None:
        _compare_effects(scene, output, plot)
    else:
        kinds = [kind for kind, chosen in (("impact", impact), ("flight", flight)) if chosen]
        _compare_methods(kinds or ["impact", "flight"], output, plot)


def _compare_methods(kinds: Sequence[str], output: JsonOptions, plot: str | None) -> None:
    """Measure methods for `impact`, `flight` or both, and write and print the results."""
    from kickdyn.tradeoff.flight_methods import measure_flights
    from kickdyn.tradeoff.impact_methods import measure_impacts

    with busy("measuring") as show:
        rows = {
            "impact": measure_impacts(show) if "impact" in kinds else [],
            "flight": measure_flights(report=show) if "flight" in kinds else [],
        }
    if plot is not None:
        save_figure(front_figure(rows["impact"], rows["flight"]), plot)
    output.write_json({k: [dataclasses.asdict(row) for row in v] for k, v in rows.items()})
    if output.prints:
        console = Console(highlight=False, width=screen_width())
        for kind in kinds:
            console.print(_method_table(TITLES[kind], rows[kind]))
    output.name_written(plot)


def _method_table(title: str, rows: Sequence[Measurement]) -> Table:
    """Return a table of measurements, by scene."""
    table = empty_table(title)
    for head in ("method", "setting", "error", "calls", "time\n\\[us]", "times the\nfastest", ""):
        table.add_column(head, justify="left" if head in ("method", "setting") else "right")
    for row in rows:
        same = [other for other in rows if other.scene == row.scene]
        if row is same[0]:
            table.add_row(f"[bold]{row.scene}[/]")
        table.add_row(
            row.method,
            row.setting,
            f"{row.error:.1e}",
            "" if row.calls is None else f"{row.calls:.0f}",
            f"{1e6 * row.seconds:.4g}",
            f"{row.seconds / min(other.seconds for other in same):.3g}",
            "*" if row.pareto else "",
            end_section=row is same[-1],
        )
    return table


def _compare_effects(file: str, output: JsonOptions, plot: str | None) -> None:
    """Measure the effects of a scene, and write and print the results."""
    scene = load_scene(file)
    with busy("measuring") as show:
        exact = simulate(scene, None)
        sizes = measure_effects(exact, show)
    sizes.sort(key=lambda size: math.inf if math.isnan(size.end) else -size.end)
    if plot is not None:
        save_figure(effect_figure(scene.name, sizes), plot)
    output.write_json(
        {
            "scene": scene.name,
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
        console = Console(highlight=False, width=screen_width(), markup=False)
        console.print(
            f"{scene.name}: impulse {impulse:.4g} N s, {exact.end_text}. If one effect is "
            "neglected:"
        )
        console.print(_effect_table(sizes))
        for warning in exact.warnings:
            console.print(f"warning: {warning}")
    output.name_written(plot)


def _effect_table(sizes: Sequence[EffectSize]) -> Table:
    """Return a table of effects."""
    table = empty_table("")
    table.add_column("effect")
    for head in ("end moves by [m]", "impulse changes by [N s]"):
        table.add_column(head, justify="right")
    table.add_column("")
    for size in sizes:
        cells = ("" if math.isnan(value) else f"{value:.3g}" for value in (size.end, size.impulse))
        table.add_row(size.effect, *cells, size.why_not)
    return table
