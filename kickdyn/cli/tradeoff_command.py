"""The command `kickdyn tradeoff`: error against cost of methods, or what each effect changes."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.cli.command import Command, busy, check_files, offers
from kickdyn.cli.scene_argument import scene_names
from kickdyn.core.console import empty_table, screen_width
from kickdyn.core.files import finite, write_json
from kickdyn.core.plot_style import check_name, save_figure
from kickdyn.errors import InvalidInput
from kickdyn.scene.effects import EffectSize
from kickdyn.scene.simulate import measure_effects, simulate
from kickdyn.scene.simulation import Simulation
from kickdyn.scene.toml_reader import load_scene
from kickdyn.tradeoff.effect_sizes import effect_figure
from kickdyn.tradeoff.measurement import Measurement, front_figure

TITLES = {
    "impact": "Impulse in posture a of Table 2 at 10 m/s; reference of 50 digits; *: Pareto front",
    "flight": "Landing points of 6 kicks, error in m; reference of 20 digits; *: Pareto front",
}


@click.command("tradeoff", Command)
@click.option("--impact", is_flag=True, help="Measure only methods for the impact.")
@click.option("--flight", is_flag=True, help="Measure only integrators of the flight.")
@click.option("--json", "json_file", metavar="FILE", help="Write the rows as JSON; - is stdout.")
@click.option("--scene", metavar="SCENE", shell_complete=offers(scene_names, files=True),
              help="Measure what each effect of a scene changes: a TOML file, or the name of a "
              "scene, as for `kickdyn view`.")  # fmt: skip
@click.option("--plot", metavar="FILE",
              help="Plot error against time, or the effects: .png, .svg or .pdf.")  # fmt: skip
def tradeoff(
    impact: bool, flight: bool, json_file: str | None, scene: str | None, plot: str | None
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
    check_files(plot, json_file=json_file, inputs=[scene])
    if scene is not None:
        _compare_effects(scene, json_file, plot)
    else:
        both = impact == flight
        _compare_methods(impact or both, flight or both, json_file, plot)


def _compare_methods(impact: bool, flight: bool, json_file: str | None, plot: str | None) -> None:
    """Measure the methods, and write and print what was asked for."""
    from kickdyn.tradeoff.flight_methods import measure_flights
    from kickdyn.tradeoff.impact_methods import measure_impacts

    with busy("measuring") as show:

        def report(name: str) -> None:
            """Show which method is measured."""
            show(f"measuring {name}")

        rows = {
            "impact": measure_impacts(report) if impact else [],
            "flight": measure_flights(report=report) if flight else [],
        }
    if plot is not None:
        save_figure(front_figure(rows["impact"], rows["flight"]), plot)
    if json_file is not None:
        write_json(json_file, {k: [dataclasses.asdict(row) for row in v] for k, v in rows.items()})
    if json_file != "-":
        console = Console(highlight=False, width=screen_width())
        for kind in rows:
            if rows[kind]:
                console.print(_method_table(TITLES[kind], rows[kind]))


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


def _compare_effects(file: str, json_file: str | None, plot: str | None) -> None:
    """Measure the effects of a scene, and write and print what was asked for."""
    scene = load_scene(file)
    whole = simulate(scene, None)
    with busy("measuring") as show:
        sizes = measure_effects(whole, lambda name: show(f"measuring {name}"))
    sizes.sort(key=lambda size: math.inf if math.isnan(size.end) else -size.end)
    if plot is not None:
        save_figure(effect_figure(scene.name, sizes), plot)
    if json_file is not None:
        write_json(json_file, _document(whole, sizes))
        if json_file == "-":
            return
    console = Console(highlight=False, width=screen_width())
    impulse = float(np.linalg.norm(whole.impact.impulse))
    console.print(
        f"{scene.name}: impulse {impulse:.4g} N s, {whole.end_text}. If one effect is neglected:",
        markup=False,
    )
    console.print(_effect_table(sizes))
    for note in scene.notes:
        console.print(f"note: {note}", markup=False)


def _document(whole: Simulation, sizes: Sequence[EffectSize]) -> dict[str, Any]:
    """Return what JSON can hold: nan is null."""
    effects = [dataclasses.asdict(size) for size in sizes]
    for effect in effects:
        effect |= {name: finite(effect[name]) for name in ("end", "impulse")}
    return {
        "scene": whole.scene.name,
        "status": whole.status,
        "end": whole.end.position.tolist(),
        "impulse": whole.impact.impulse.tolist(),
        "units": {"end": "m", "impulse": "N s"},
        "effects": effects,
    }


def _effect_table(sizes: Sequence[EffectSize]) -> Table:
    """Return a table of effects."""
    table = empty_table("")
    table.add_column("effect")
    for head in ("end moves by \\[m]", "impulse changes by \\[N s]"):
        table.add_column(head, justify="right")
    table.add_column("")
    for size in sizes:
        cells = ("" if math.isnan(value) else f"{value:.3g}" for value in (size.end, size.impulse))
        table.add_row(size.effect, *cells, escape(size.why_not))
    return table
