"""Compare kickdyn at the extremes with 50 digits: python tests/extremes [--plot FILE].

It exits with 1 if an answer is wrong.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import click
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from extremes.extreme_case import Correctness, ExtremeCase
from extremes.extreme_flights import flight_cases
from extremes.extreme_impacts import impact_cases
from kickdyn.cli.commands import run
from kickdyn.core.files import check_outputs
from kickdyn.core.plot_style import check_name, save_figure, styled


@click.command("extremes", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--plot", metavar="FILE", help="Draw error against condition: .png, .svg or .pdf.")
def extremes(plot: str | None) -> None:
    """Compare kickdyn at the extremes with 50 digits; exit 1 if an answer is wrong."""
    if plot is not None:
        check_name(plot)
    check_outputs(plot)
    cases = []
    for source in (impact_cases, flight_cases):
        for case in source():
            cases.append(case)
            print(case)
    if plot is not None:
        save_figure(condition_figure(cases), plot)
    verdicts = [case.verdict for case in cases]
    counts = ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in Correctness)
    print(f"{len(cases)} cases: {counts}")
    if Correctness.WRONG in verdicts:
        sys.exit(1)


@styled()
def condition_figure(cases: Sequence[ExtremeCase]) -> Figure:
    """Return the errors of all answers against their conditions, and what a condition allows."""
    figure = Figure(figsize=(6.4, 3.8))
    axes = figure.subplots()
    worst = max(10.0, *(case.condition for case in cases))
    limit = [1e-15, 1e-15 * worst]
    axes.loglog([1, worst], limit, "-", color="0.7", label="what the condition allows")
    colours = {"right": "tab:green", "as-claimed": "tab:orange", "wrong": "tab:red"}
    for verdict, colour in colours.items():
        chosen = [case for case in cases if case.verdict == verdict]
        conditions = [case.condition for case in chosen]
        errors = [min(max(case.error, 1e-17), 1.0) for case in chosen]
        axes.loglog(conditions, errors, "o", markersize=4, color=colour, label=verdict)
    axes.set(xlabel="condition", ylabel="relative error")
    axes.legend()
    return figure


if __name__ == "__main__":
    run(extremes)
