"""The trade of speed for accuracy, measured here and now (`kickdyn tradeoff`)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.table import Table

from kickdyn.cli.command import busy
from kickdyn.core.console import empty_table, screen_width
from kickdyn.core.files import check_outputs, write_json
from kickdyn.errors import InvalidInput

if TYPE_CHECKING:
    from kickdyn.accuracy.flight_methods import Measured
    from kickdyn.accuracy.impact_methods import MeasuredImpact

IMPACT = "Impulse of a kick, posture a of Table 2 at 10 m/s; against 50 digits; * is the front"
FLIGHT = "Landing of 6 kicks; against 20 digits; * is the Pareto front"


@click.command("tradeoff", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--impact", is_flag=True, help="Only the ways to compute an impact.")
@click.option("--flight", is_flag=True, help="Only the integrators of the flight, by tolerance.")
@click.option("--json", "json_file", metavar="FILE", help="Write the rows; - is stdout.")
@click.option(
    "--scene",
    metavar="FILE",
    help="Only what each effect of a scene is worth: a TOML file, or as view has it.",
)
@click.option(
    "--plot", metavar="FILE", help="Draw error against time, or effects: .png, .svg or .pdf."
)
def tradeoff(
    impact: bool, flight: bool, json_file: str | None, scene: str | None, plot: str | None
) -> None:
    """Measure error against cost, all methods in one run on this machine.

    Example: kickdyn tradeoff --plot tradeoff.png
    """
    # here: mpmath, scipy's integrators and matplotlib are not the other doors' business
    from kickdyn.accuracy.effect_sizes import show
    from kickdyn.accuracy.error_plots import picture
    from kickdyn.accuracy.flight_methods import measure
    from kickdyn.accuracy.impact_methods import measure_impact
    from kickdyn.sweeps.sweep_plot import check_name, save_figure

    if scene is not None:
        if impact or flight:
            raise InvalidInput(
                "--scene measures effects of a scene, --impact and --flight measure methods: name "
                "one or the other"
            )
        show(scene, json_file, plot)
        return
    both = impact == flight
    if plot is not None:
        check_name(plot)
    check_outputs(plot, json_file=json_file)
    with busy("measuring") as say:

        def told(name: str) -> None:
            say(f"measuring {name}")

        impacts = measure_impact(told) if impact or both else []
        flights = measure(told=told) if flight or both else []
    if plot is not None:
        save_figure(picture(impacts, flights), plot)
    if json_file is not None:
        listed = {
            "impact": [dataclasses.asdict(row) for row in impacts],
            "flight": [dataclasses.asdict(row) for row in flights],
        }
        write_json(json_file, listed)
        if json_file == "-":
            return
    console = Console(highlight=False, width=screen_width())
    if impacts:
        console.print(_impact_table(impacts))
    if flights:
        console.print(_flight_table(flights))


def _table(title: str, heads: Sequence[str]) -> Table:
    table = empty_table(title)
    for head in heads:
        table.add_column(head, justify="left" if head in ("method", "setting") else "right")
    return table


def _cost(row: Any, rows: Sequence[Any]) -> tuple[str, str, str]:
    """Return microseconds, how many times the fastest of its scene, and the mark of the front."""
    fastest = min(row.seconds for row in rows)
    return f"{1e6 * row.seconds:.4g}", f"{row.seconds / fastest:.3g}", "*" if row.pareto else ""


def _impact_table(rows: list[MeasuredImpact]) -> Table:
    table = _table(IMPACT, ("method", "setting", "error", "us", "times the\nfastest", ""))
    for row in rows:
        same = [other for other in rows if other.kick == row.kick]
        if row is same[0]:
            table.add_row(f"[bold]{row.kick}[/]")
        cells = (row.method, row.setting, f"{row.error:.1e}")
        table.add_row(*cells, *_cost(row, same), end_section=row is same[-1])
    return table


def _flight_table(rows: list[Measured]) -> Table:
    heads = ("method", "tolerance", "error m", "calls", "us a flight", "times the\nfastest", "")
    table = _table(FLIGHT, heads)
    for row in rows:
        same = [other for other in rows if other.scene == row.scene]
        if row is same[0]:
            table.add_row(f"[bold]{row.scene}[/]")
        tol = f"{row.tol:g}" if row.tol else ""
        cells = (row.method, tol, f"{row.error:.1e}", f"{row.evaluations:.0f}")
        table.add_row(*cells, *_cost(row, same), end_section=row is same[-1])
    return table
