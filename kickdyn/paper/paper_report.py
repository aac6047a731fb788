"""The paper in words: a table of all items, the reason for each, and other coefficients."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.core.console import empty_table, notes, screen_width
from kickdyn.paper.item import MEANINGS, Item, Verdict

COLOURS = {
    Verdict.REPRODUCED: "green",
    Verdict.SHAPE_REPRODUCED: "cyan",
    Verdict.FITTED: "blue",
    Verdict.OURS: "blue",
    Verdict.NOT_REACHABLE: "yellow",
}


def show(items: Mapping[str, Sequence[Item]], others: Mapping[str, Sequence[Item]]) -> None:
    """Print all items by section, and those with other coefficients, as wide as the screen is."""
    width = screen_width()
    console = Console(width=width, highlight=False)
    why = list(dict.fromkeys(item.why for section in items.values() for item in section))
    console.print(table(items, why))
    print(notes(why, width) + "\n")
    for name, section in others.items():
        console.print(sensitivity(name, section))
    every = [item for group in (items, others) for part in group.values() for item in part]
    for verdict in (one for one in COLOURS if any(item.verdict == one for item in every)):
        console.print(f"[{COLOURS[verdict]}]{verdict}[/]: {MEANINGS[verdict]}")


def table(items: Mapping[str, Sequence[Item]], why: Sequence[str]) -> Table:
    """Return the table of all items; the last column is the number of the reason in `why`."""
    result = empty_table("The paper, item by item")
    result.add_column("item", min_width=12)
    for head in ("paper", "ours", "unit", "difference", "verdict", "why"):
        left = head in ("unit", "verdict")
        result.add_column(head, justify="left" if left else "right", no_wrap=True)
    for name, section in items.items():
        result.add_row(f"[bold]{name}[/]")
        for item in section:
            result.add_row(
                escape(item.item.removeprefix(f"{name} ")),
                "" if item.paper is None else f"{item.paper:g}",
                f"{item.ours:.5g}",
                item.unit,
                item.difference,
                f"[{COLOURS[item.verdict]}]{item.verdict}[/]",
                f"{1 + why.index(item.why)}",
            )
        result.add_section()
    return result


def sensitivity(name: str, items: Sequence[Item]) -> Table:
    """Return the table of a line per choice of coefficients; the colour is the verdict."""
    rows: dict[str, list[str]] = {}
    for item in items:
        rows.setdefault(item.variant, []).append(f"[{COLOURS[item.verdict]}]{item.ours:.4g}[/]")
    result = empty_table(f"{name} with other coefficients")
    result.add_column("coefficients", no_wrap=True)
    heads = [f"{item.item.removeprefix(f'{name} ')}, {item.unit}" for item in items]
    for head in dict.fromkeys(heads):
        result.add_column(head, justify="right")
    for variant, cells in rows.items():
        result.add_row(variant, *cells)
    return result
