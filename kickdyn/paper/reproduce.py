"""All items of the paper, in its order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from kickdyn.errors import InvalidInput
from kickdyn.paper import fig_1, fig_8, fig_9, fig_10, fig_15, table_2, tables_4_5
from kickdyn.paper.item import Item


@dataclass(frozen=True)
class Section:
    """One table or figure.

    Attributes:
        name: as the paper numbers it.
        items: with the default coefficients.
        sensitivity: the same with others; None where no coefficient matters.
        draw: onto an empty figure; None where the paper has a table.
    """

    name: str
    items: Callable[[], list[Item]]
    sensitivity: Callable[[], list[Item]] | None = None
    draw: Callable[[Figure], None] | None = None


SECTIONS = (
    Section("Fig. 1", fig_1.items, draw=fig_1.draw),
    Section("Table 2", table_2.items),
    Section("Fig. 8", fig_8.items, fig_8.sensitivity, fig_8.draw),
    Section("Fig. 9", fig_9.items, fig_9.sensitivity, fig_9.draw),
    Section("Fig. 10/11", fig_10.items, fig_10.sensitivity, fig_10.draw),
    Section("Fig. 13-15", fig_15.items, fig_15.sensitivity, fig_15.draw),
    Section("Tables 4-5", tables_4_5.items, tables_4_5.sensitivity),
)


def chosen(only: str | None) -> Sequence[Section]:
    """Return the sections that match a name such as `table 2`; all where it is None.

    Raises:
        InvalidInput: none matches.
    """
    if only is None:
        return SECTIONS
    word = _plain(only)
    exact = [section for section in SECTIONS if word in _names(section)]
    if not exact:
        names = ", ".join(section.name for section in SECTIONS)
        raise InvalidInput(f"item {only!r} is not in the paper: choose one of {names}")
    return exact


def _plain(name: str) -> str:
    return (
        name.lower()
        .replace("figure", "fig")
        .replace("tables", "table")
        .translate(str.maketrans("", "", " .s"))
    )


def _names(section: Section) -> set[str]:
    """Return what a section answers to: `fig 10/11` is also `fig 10` and `fig 11`."""
    kind, _, numbers = section.name.partition(" ")
    first, _, last = numbers.replace("/", "-").partition("-")
    every = range(int(first), int(last or first) + 1)
    return {_plain(section.name), *(_plain(f"{kind} {number}") for number in every)}
