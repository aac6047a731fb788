"""All items of the paper, in its order with its inputs last, and the tables that compare them."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import fill

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.core.console import empty_table, notes, screen_width
from kickdyn.errors import InvalidInput
from kickdyn.paper import assumptions, fig_1, fig_8, fig_9, fig_10, fig_15, table_2, tables_4_5
from kickdyn.paper.assumptions import ALTERNATIVES, DEFAULT, Coefficients
from kickdyn.paper.item import MEANINGS, Item, Verdict, judged

COLOURS = dict.fromkeys(Verdict, "blue") | {
    Verdict.REPRODUCED: "green",
    Verdict.SHAPE_REPRODUCED: "cyan",
    Verdict.DEPENDS: "magenta",
    Verdict.NOT_REACHABLE: "yellow",
}


@dataclass(frozen=True)
class Section:
    """One table or figure.

    Attributes:
        name: as the paper numbers it.
        keys: the tables and figures that it answers to, such as `fig10`.
        items: with the coefficients of `DEFAULT`.
        varying: those that may change with a choice of coefficients; None where none matters.
    """

    name: str
    keys: tuple[str, ...]
    items: Callable[[], list[Item]]
    varying: Callable[[Coefficients], list[Item]] | None = None

    def compare(self) -> tuple[list[Item], list[Item]]:
        """Return the items, judged, and those that vary with every other choice of coefficients."""
        varied = [
            replace(item, variant=choice.name)
            for choice in ALTERNATIVES
            for item in (self.varying(choice) if self.varying else ())
        ]
        judgements = [
            judged(item, [other for other in varied if other.item == item.item], DEFAULT.name)
            for item in self.items()
        ]
        return judgements, varied


SECTIONS = (
    Section("Fig. 1", ("fig1",), fig_1.items),
    Section("Table 2", ("fig7", "table2"), table_2.items),
    Section("Fig. 8", ("fig8",), fig_8.items, fig_8.varying),
    Section("Fig. 9", ("fig9",), fig_9.items, fig_9.varying),
    Section("Fig. 10/11", ("fig10", "fig11"), fig_10.items, fig_10.varying),
    Section("Fig. 13-15", ("fig13", "fig14", "fig15"), fig_15.items, fig_15.varying),
    Section("Tables 4-5", ("table4", "table5"), tables_4_5.items, tables_4_5.varying),
    Section("Tables 1, 3, 6", ("table1", "table3", "table6"), assumptions.items),
)


def chosen(only: str | None) -> Sequence[Section]:
    """Return the section of a table or figure such as `table 2` or `Fig. 7`; all if it is None."""
    if only is None:
        return SECTIONS
    key = re.sub(r"[\s.]", "", only.lower()).replace("figure", "fig")
    sections = [section for section in SECTIONS if key in section.keys]
    if not sections:
        keys = [key for section in SECTIONS for key in section.keys]
        names = sorted(keys, key=lambda key: (key[0], len(key), key))
        raise InvalidInput(f"only is {only!r}: it must be one of {', '.join(names)}")
    return sections


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
    result = empty_table(f"{name} with other coefficients than {DEFAULT.name}")
    result.add_column("coefficients", no_wrap=True)
    shown: list[dict[str, str]] = []
    for head, column in columns.items():
        if len(set(column.values())) > 1 and column not in shown:
            shown.append(column)
            result.add_column(head, justify="right")
    for variant in dict.fromkeys(item.variant for item in items):
        result.add_row(fill(variant, width=14), *(column[variant] for column in shown))
    return result
