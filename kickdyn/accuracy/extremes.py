"""The table of extremes (`make extremes`): every answer right, as claimed, or refused."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

import click
from rich import box
from rich.console import Console
from rich.table import Table

from kickdyn.accuracy import extreme_air, extreme_flights, extreme_impacts
from kickdyn.accuracy.extremes_row import Row
from kickdyn.accuracy.gains import Gain, gains
from kickdyn.core.files import check_outputs, write_json

LONGEST = 500
"""Joints of the longest chain; the reference takes half a minute for it."""


def rows(longest: int = LONGEST, drags: Sequence[str] = extreme_air.DRAGS) -> Iterator[Row]:
    """Yield every case, chains up to `longest` joints, shots with the shipped `drags`."""
    for family, kicks in extreme_impacts.FAMILIES.items():
        chosen = extreme_impacts.sizes(longest) if family == "size" else kicks()
        for kick in chosen:
            yield extreme_impacts.judged(family, kick)
    for flights in (extreme_flights.vacuum, extreme_flights.dragged, extreme_flights.tolerances):
        yield from flights()
    yield from extreme_air.coefficients()
    yield from extreme_air.flights(drags)
    yield from extreme_impacts.refusals()
    yield from extreme_flights.refusals()
    yield from extreme_air.refusals()


@click.command("extremes", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--json", "json_file", metavar="FILE", help="Write the rows; - is stdout.")
def extremes(json_file: str | None) -> None:
    """Compare kickdyn at the extremes with 50 digits; exit 1 if an answer is wrong.

    Example: kickdyn extremes --json extremes.json
    """
    check_outputs(json_file=json_file)
    found = []
    with Console(stderr=True).status("measuring") as status:
        for row in rows():
            status.update(f"{row.family}: {row.case}")
            found.append(row)
    if json_file is not None:
        write_json(json_file, [row.as_json() for row in found])
    if json_file != "-":
        console = Console(highlight=False)
        console.print(_table(found))
        console.print(_gains(gains()))
        console.print(summary(found), soft_wrap=True)
    if any(row.verdict == "WRONG" for row in found):
        sys.exit(1)


def summary(found: list[Row]) -> str:
    """Return how many comparisons ended how, and how many arguments that are no numbers."""
    verdicts = [row.verdict for row in found if row.family != "no number"]
    others = [row.verdict for row in found if row.family == "no number"]
    counts = [
        f"{verdicts.count(name)} {name}" for name in ("right", "as claimed", "refused", "WRONG")
    ]
    said = f"{len(verdicts)} cases: {', '.join(counts)}"
    wrong = others.count("WRONG")
    return f"{said}; {others.count('refused')} of {len(others)} that are no numbers refused" + (
        f", {wrong} WRONG" if wrong else ""
    )


def _table(found: list[Row]) -> Table:
    table = Table(
        title="The answer with least digits to spare; reference: 50 digits, 20 of flights at tol",
        box=box.SIMPLE_HEAD, title_justify="left", title_style="bold",
        caption="allowed: 15 - log10(condition). as claimed: fewer, but the answer says how many.",
        caption_justify="left",
    )  # fmt: skip
    table.add_column("case", overflow="fold")
    for head in ("condition", "error", "allowed"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("of")
    table.add_column("verdict", no_wrap=True)
    family = ""
    for row in found:
        if row.refusal and row.family == "no number":
            continue
        if row.family != family:
            family = row.family
            table.add_section()
        if row.refusal:
            table.add_row(f"{row.case}: {row.refusal}", *[""] * 4, "refused")
            continue
        case, _, condition, error, _, allowed, quantity, verdict = cells(row)
        table.add_row(case, condition, error, allowed, quantity, verdict)
    refused = sum(row.verdict == "refused" and row.family == "no number" for row in found)
    table.add_section()
    table.add_row("NaN, inf, Reynolds number 0", *[""] * 4, f"{refused} refused")
    return table


def cells(row: Row) -> list[str]:
    """Return a row as text."""
    if row.refusal:
        return [row.case, *[""] * 6, f"refused: {row.refusal}"]
    return [
        row.case,
        f"{row.worst_error:.1e}",
        f"{row.condition:.1e}",
        f"{row.error:.1e}",
        f"{row.digits:.1f}",
        f"{row.allowed:.1f}",
        row.quantity,
        row.verdict + (f" ({row.claimed:.1f})" if row.verdict == "as claimed" else ""),
    ]


def _gains(found: list[Gain]) -> Table:
    table = Table(
        title="Formulas that keep digits", box=box.SIMPLE_HEAD, title_justify="left",
        title_style="bold",
    )  # fmt: skip
    for head in ("what", "the plain formula", "error", "kickdyn's", "error"):
        table.add_column(head, justify="right" if head == "error" else "left")
    for gain in found:
        table.add_row(
            gain.what, gain.plain, f"{gain.plain_error:.1e}", gain.ours, f"{gain.our_error:.1e}"
        )
    return table
