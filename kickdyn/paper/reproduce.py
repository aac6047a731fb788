"""All items of the paper, in its order with its inputs last, and the tables that compare them."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.core.console import empty_table, notes, screen_width
from kickdyn.errors import InvalidInput
from kickdyn.paper import assumptions, fig_1, fig_8, fig_9, fig_10, fig_15, table_2, tables_4_5
from kickdyn.paper.assumptions import ALTERNATIVES, Coefficients
from kickdyn.paper.item import MEANINGS, Item, Verdict, judged

COLOURS = {
    Verdict.REPRODUCED: "green",
    Verdict.SHAPE_REPRODUCED: "cyan",
    Verdict.DEPENDS: "magenta",
    Verdict.FITTED: "blue",
    Verdict.INPUT: "blue",
    Verdict.OURS: "blue",
    Verdict.NOT_REACHABLE: "yellow",
}


@dataclass(frozen=True)
class Section:
    """One table or figure.

    Attributes:
        name: as the paper numbers it.
        items: with the default coefficients.
        varying: those that may change with a choice of coefficients; None where none matters.
        draw: onto an empty figure; None where there is nothing to draw.
        also: another table or figure that it answers to, such as the one that it draws.
    """

    name: str
    items: Callable[[], list[Item]]
    varying: Callable[[Coefficients], list[Item]] | None = None
    draw: Callable[[Figure], None] | None = None
    also: str = ""

    @property
    def numbers(self) -> set[tuple[str, int]]:
        """Kind and number of each table and figure in its names, such as `("fig", 7)`."""
        return _numbers(f"{self.name} {self.also}")

    def compare(self) -> tuple[list[Item], list[Item]]:
        """Return the items, judged, and those that vary with every other choice of coefficients."""
        varied = [
            replace(item, variant=choice.name)
            for choice in (ALTERNATIVES if self.varying else ())
            for item in (self.varying(choice) if self.varying else ())
        ]
        by_name: dict[str, list[Item]] = {}
        for item in varied:
            by_name.setdefault(item.item, []).append(item)
        return [judged(item, by_name.get(item.item, ())) for item in self.items()], varied


SECTIONS = (
    Section("Fig. 1", fig_1.items, draw=fig_1.draw),
    Section("Table 2", table_2.items, draw=table_2.draw, also="Fig. 7"),
    Section("Fig. 8", fig_8.items, fig_8.varying, fig_8.draw),
    Section("Fig. 9", fig_9.items, fig_9.varying, fig_9.draw),
    Section("Fig. 10/11", fig_10.items, fig_10.varying, fig_10.draw),
    Section("Fig. 13-15", fig_15.items, fig_15.varying, fig_15.draw),
    Section("Tables 4-5", tables_4_5.items, tables_4_5.varying),
    Section("Tables 1, 3, 6", assumptions.items),
)


def chosen(only: str | None) -> Sequence[Section]:
    """Return the sections that match a name such as `table 2`; all where it is None.

    `fig 10` and `figure 11` mean `Fig. 10/11`, `fig 7` means `Table 2`, which draws it.
    """
    if only is None:
        return SECTIONS
    wanted = _numbers(only)
    sections = [section for section in SECTIONS if wanted and wanted <= section.numbers]
    if not sections:
        raise InvalidInput(f"only is {only!r}: it must be one of {', '.join(item_names())}")
    return sections


def item_names() -> list[str]:
    """Return the names of all tables and figures, such as `table2`, for `chosen`."""
    every = set().union(*(section.numbers for section in SECTIONS))
    return [f"{kind}{number}" for kind, number in sorted(every)]


def _numbers(name: str) -> set[tuple[str, int]]:
    """Return what a name such as `Figs. 13-15` means; empty where it cannot be read."""
    pattern = r"\s*(fig|table)(?:ures?|s)?\.?\s*(\d{1,2}(?:\s*[-/,]\s*\d{1,2})*)\s*"
    if not re.fullmatch(f"(?:{pattern})+", name.lower()):
        return set()
    numbers = set[tuple[str, int]]()
    for kind, pieces in re.findall(pattern, name.lower()):
        for piece in re.split("[/,]", pieces):
            first, _, last = piece.partition("-")
            numbers |= {(kind, n) for n in range(int(first), int(last or first) + 1)}
    return numbers


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
