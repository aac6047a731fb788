"""All cases at the extremes, their tables and their picture, and the command that prints them."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

import click
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

from extremes.extreme_case import NOT_FINITE, Correctness, ExtremeCase
from extremes.extreme_flights import DRAGS, flight_cases, flight_refusals
from extremes.extreme_impacts import LONGEST, impact_cases, impact_refusals
from extremes.gains import Gain, gains
from kickdyn.cli.command import busy
from kickdyn.core.console import empty_table
from kickdyn.core.files import check_outputs, write_json
from kickdyn.core.plot_style import check_name, save_figure, styled


@click.command("extremes", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--json", "json_file", metavar="FILE", help="Write the cases; - is stdout.")
@click.option(
    "--verdicts", metavar="FILE", help="Write the verdict of each case, which tests read."
)
@click.option("--plot", metavar="FILE", help="Draw error against condition: .png, .svg or .pdf.")
def extremes(json_file: str | None, verdicts: str | None, plot: str | None) -> None:
    """Compare kickdyn at the extremes with 50 digits; exit 1 if an answer is wrong.

    Example: python tests/extremes --json extremes.json
    """
    if plot is not None:
        check_name(plot)
    check_outputs(plot, verdicts, json_file=json_file)
    found = []
    with busy("measuring") as report:
        for case in extreme_cases():
            report(f"{case.family}: {case.case}")
            found.append(case)
    if plot is not None:
        save_figure(condition_figure(found), plot)
    if verdicts is not None:
        write_json(verdicts, [[case.family, case.case, case.verdict] for case in found])
    if json_file is not None:
        write_json(json_file, [case.as_json() for case in found])
    if json_file != "-":
        console = Console(highlight=False)
        console.print(case_table(found))
        console.print(gain_table(gains()))
        console.print(summary(found), soft_wrap=True)
    if any(case.verdict == Correctness.WRONG for case in found):
        sys.exit(1)


def extreme_cases(longest: int = LONGEST, drags: Sequence[str] = DRAGS) -> Iterator[ExtremeCase]:
    """Yield every case: chains up to `longest` joints, vertical shots with the shipped `drags`."""
    yield from impact_cases(longest)
    yield from flight_cases(drags)
    yield from impact_refusals()
    yield from flight_refusals()


def summary(cases: Sequence[ExtremeCase]) -> str:
    """Return how many comparisons ended how, and how many arguments that are not finite."""
    finite = [case.verdict for case in cases if case.family != NOT_FINITE]
    others = [case.verdict for case in cases if case.family == NOT_FINITE]
    counts = ", ".join(f"{finite.count(verdict)} {verdict}" for verdict in Correctness)
    refused, wrong = others.count(Correctness.REFUSED), others.count(Correctness.WRONG)
    text = f"{len(finite)} cases: {counts}; not finite: {refused} of {len(others)} refused"
    return text + (f", {wrong} wrong" if wrong else "")


@styled()
def condition_figure(found: Sequence[ExtremeCase]) -> Figure:
    """Return the errors of all answers against their conditions, and what a condition allows."""
    figure = Figure(figsize=(6.4, 3.8))
    axes = figure.subplots()
    worst = max(10.0, *(row.condition for row in found))
    axes.loglog(
        [1, worst], [1e-15, 1e-15 * worst], "-", color="0.7", label="what the condition allows"
    )
    for verdict, colour in (
        (Correctness.RIGHT, "tab:green"),
        (Correctness.AS_CLAIMED, "tab:orange"),
        (Correctness.WRONG, "tab:red"),
    ):
        mine = [row for row in found if row.verdict == verdict]
        errors = [min(max(row.error, 1e-17), 1.0) for row in mine]
        axes.loglog(
            [row.condition for row in mine], errors, "o", markersize=4, color=colour, label=verdict
        )
    axes.set(xlabel="condition", ylabel="relative error")
    axes.legend()
    return figure


def cells(case: ExtremeCase) -> list[str]:
    """Return a case as text: name, worst error, condition, error, digits, allowed, of, verdict."""
    if case.refusal:
        return [case.case, *[""] * 6, f"refused: {case.refusal}"]
    claim = f" ({case.claimed:.1f})" if case.verdict == Correctness.AS_CLAIMED else ""
    return [
        case.case,
        f"{case.worst_error:.1e}",
        f"{case.condition:.1e}",
        f"{case.error:.1e}",
        f"{case.digits:.1f}",
        f"{case.allowed:.1f}",
        case.quantity,
        case.verdict + claim,
    ]


def case_table(cases: Sequence[ExtremeCase]) -> Table:
    """Return the table of all cases; those that are not finite are counted."""
    table = empty_table(
        "The answer with least digits to spare; reference: 50 digits, 20 of flights at tol"
    )
    table.caption_justify = "left"
    table.caption = "allowed: 15 - log10(condition). as-claimed: fewer, and the answer says so."
    table.add_column("case", overflow="fold")
    for head in ("condition", "error", "allowed"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("of")
    table.add_column("verdict", no_wrap=True)
    family = ""
    for case in cases:
        if case.family == NOT_FINITE and case.refusal:
            continue
        if case.family != family:
            family = case.family
            table.add_section()
        if case.refusal:
            table.add_row(f"{case.case}: {case.refusal}", *[""] * 4, "refused")
            continue
        name, _, condition, error, _, allowed, quantity, verdict = cells(case)
        table.add_row(name, condition, error, allowed, quantity, verdict)
    refused = sum(
        case.verdict == Correctness.REFUSED for case in cases if case.family == NOT_FINITE
    )
    table.add_section()
    table.add_row("NaN, inf, Reynolds number 0", *[""] * 4, f"{refused} refused")
    return table


def gain_table(found: Sequence[Gain]) -> Table:
    """Return the table of formulas that keep digits."""
    table = empty_table("Formulas that keep digits")
    for head in ("what", "the plain formula", "error", "kickdyn's", "error"):
        table.add_column(head, justify="right" if head == "error" else "left")
    for gain in found:
        errors = f"{gain.plain_error:.1e}", f"{gain.our_error:.1e}"
        table.add_row(gain.what, gain.plain, errors[0], gain.ours, errors[1])
    return table
