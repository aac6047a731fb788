"""The paper in words: a table of all items, the reason for each, and other coefficients."""

from collections.abc import Mapping, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.core.console import empty_table, notes, screen_width
from kickdyn.paper.item import MEANINGS, Item, Verdict

COLOURS = {
    Verdict.REPRODUCED: "green",
    Verdict.SHAPE_REPRODUCED: "cyan",
    Verdict.DEPENDS: "magenta",
    Verdict.FITTED: "blue",
    Verdict.INPUT: "blue",
    Verdict.OURS: "blue",
    Verdict.NOT_REACHABLE: "yellow",
}


def show(items: Mapping[str, Sequence[Item]], varied: Mapping[str, Sequence[Item]]) -> None:
    """Print all items by section, and those with other coefficients, as wide as the screen is."""
    width = screen_width()
    console = Console(width=width, highlight=False)
    every = [item for section in items.values() for item in section]
    why = list(dict.fromkeys(text for item in every for text in (item.why, *item.notes)))
    console.print(table(items, why))
    print(notes(why, width) + "\n")
    for name, section in varied.items():
        console.print(sensitivity(name, section))
    every += [item for section in varied.values() for item in section]
    for verdict in (kind for kind in COLOURS if any(item.verdict == kind for item in every)):
        count = sum(item.verdict == verdict for section in items.values() for item in section)
        console.print(f"[{COLOURS[verdict]}]{verdict}[/] ({count}): {MEANINGS[verdict]}")
    console.print(
        "C_D: drag coefficient; e: coefficient of restitution; Re: Reynolds number; spin "
        "parameter: surface speed of the spin over speed; X forward and Y up, as in the paper"
    )


def table(items: Mapping[str, Sequence[Item]], why: Sequence[str]) -> Table:
    """Return the table of all items; the last column numbers reason and notes as in `why`."""
    result = empty_table("Choi et al., ICRA 2005, and kickdyn, item by item")
    result.add_column("item", min_width=12)
    for head in ("paper", "kickdyn", "unit", "difference", "verdict", "notes"):
        left = head in ("unit", "verdict", "notes")
        result.add_column(head, justify="left" if left else "right", no_wrap=head != "notes")
    for name, section in items.items():
        result.add_row(f"[bold]{name}[/]")
        for item in section:
            result.add_row(
                escape(item.item.removeprefix(f"{name} ")),
                "" if item.paper is None else f"{item.paper:g}",
                f"{item.ours:.5g}",
                item.unit.removeprefix("1"),
                item.difference,
                f"[{COLOURS[item.verdict]}]{item.verdict}[/]",
                " ".join(f"{1 + why.index(text)}" for text in (item.why, *item.notes)),
            )
        result.add_section()
    return result


def sensitivity(name: str, items: Sequence[Item]) -> Table:
    """Return the table of a line per choice of coefficients; the colour is the verdict.

    Numbers that are the same for all choices, or were shown before, have no column.
    """
    columns: dict[str, dict[str, str]] = {}
    for item in items:
        unit = "" if item.unit == "1" else f" [{item.unit}]"
        column = columns.setdefault(escape(item.item.removeprefix(f"{name} ") + unit), {})
        column[item.variant] = f"[{COLOURS[item.verdict]}]{item.ours:.4g}[/]"
    result = empty_table(f"{name} with other coefficients of drag (C_D) and lift")
    result.add_column("coefficients", no_wrap=True)
    shown: list[dict[str, str]] = []
    for head, column in columns.items():
        if len(set(column.values())) > 1 and column not in shown:
            shown.append(column)
            result.add_column(head, justify="right")
    for variant in dict.fromkeys(item.variant for item in items):
        result.add_row(variant, *(column[variant] for column in shown))
    return result
