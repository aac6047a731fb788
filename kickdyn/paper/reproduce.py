"""All items of the paper, in its order, and the tables that compare them."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from kickdyn.core.representation import empty_table, notes, screen_width
from kickdyn.errors import InvalidInput
from kickdyn.paper import fig_1, fig_8, fig_9, fig_10, fig_15, table_2, tables_4_5
from kickdyn.paper.assumptions import ALTERNATIVES, DEFAULT, Coefficients
from kickdyn.paper.item import MEANINGS, Finding, Item, judged

COLOURS = dict.fromkeys(Finding, "blue") | {
    Finding.REPRODUCED: "green",
    Finding.SHAPE_REPRODUCED: "cyan",
    Finding.DEPENDS: "magenta",
    Finding.NOT_REACHABLE: "yellow",
}


@dataclass(frozen=True)
class Section:
    """One table or figure.

    Attributes:
        name: as the paper numbers it.
        keys: names of its tables and figures, such as `fig10`.
        items: with the coefficients of `DEFAULT`.
        varying: those that may change with a choice of coefficients; None if none matters.
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


def show(items: Mapping[str, Sequence[Item]]) -> None:
    """Print all items by section, as wide as the screen is."""
    width = screen_width()
    console = Console(width=width, highlight=False)
    every = [item for section in items.values() for item in section]
    why = list(dict.fromkeys(text for item in every for text in (item.why, *item.notes)))
    console.print(table(items, why))
    print(notes(why, width) + "\n")
    for verdict in COLOURS:
        count = sum(item.verdict == verdict for item in every)
        if count:
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
