"""The trade of speed for accuracy, measured here and now (`python -m kickdyn.tradeoff`)."""

from __future__ import annotations

import dataclasses
import json
import sys

import click
from rich import box
from rich.console import Console
from rich.table import Table

from kickdyn.accuracy.flight import Measured, measure
from kickdyn.accuracy.models import show
from kickdyn.door import run
from kickdyn.errors import InvalidInput
from kickdyn.files import check_writable, replacing


@click.command("tradeoff", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--flight", is_flag=True, help="Integrators of the flight, by tolerance.")
@click.option("--json", "json_file", metavar="FILE", help="Write the rows; - is stdout.")
@click.option("--scene", metavar="FILE", help="What each effect of a scene (TOML) is worth.")
def tradeoff(flight: bool, json_file: str | None, scene: str | None) -> None:
    """Measure error against cost, all methods in one run on this machine.

    Example: python -m kickdyn.tradeoff --flight
    """
    if scene is not None:
        if flight:
            raise InvalidInput("two things to measure were named: give --flight or --scene")
        show(scene, json_file)
        return
    if not flight:
        raise InvalidInput("nothing to measure was named: give --flight or --scene")
    if json_file is not None and json_file != "-":
        check_writable(json_file)
    console = Console(stderr=True)
    with console.status("measuring") as status:
        rows = measure(told=lambda name: status.update(f"measuring {name}"))
    if json_file is not None:
        text = json.dumps([dataclasses.asdict(row) for row in rows], indent=2) + "\n"
        if json_file == "-":
            sys.stdout.write(text)
            return
        with replacing(json_file) as draft:
            draft.write_text(text, encoding="utf-8")
    Console(highlight=False, width=100).print(_table(rows))


def _table(rows: list[Measured]) -> Table:
    fastest = min(row.seconds for row in rows)
    table = Table(
        title="Landing of 12 spinning kicks; reference kd.fly at 1e-13; * is the Pareto front",
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
    )
    table.add_column("method")
    for head in ("tolerance", "error m", "calls", "us a flight", "times the fastest", ""):
        table.add_column(head, justify="right")
    for row in rows:
        table.add_row(
            row.method,
            f"{row.tol:g}",
            f"{row.error:.1e}",
            f"{row.evaluations:.0f}",
            f"{1e6 * row.seconds:.4g}",
            f"{row.seconds / fastest:.3g}",
            "*" if row.pareto else "",
        )
    return table


if __name__ == "__main__":
    run(tradeoff)
