"""All items of the paper, in its order."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
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
        flights: those of the figure by name, to be looked at in space.
    """

    name: str
    items: Callable[[], list[Item]]
    sensitivity: Callable[[], list[Item]] | None = None
    draw: Callable[[Figure], None] | None = None
    flights: Callable[[], Mapping[str, Flight]] | None = None


SECTIONS = (
    Section("Fig. 1", fig_1.items, draw=fig_1.draw),
    Section("Table 2", table_2.items),
    Section("Fig. 8", fig_8.items, fig_8.sensitivity, fig_8.draw, fig_8.flights),
    Section("Fig. 9", fig_9.items, fig_9.sensitivity, fig_9.draw),
    Section("Fig. 10/11", fig_10.items, fig_10.sensitivity, fig_10.draw, fig_10.flights),
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
    found = [section for section in SECTIONS if _matches(section, only)]
    if not found:
        names = ", ".join(section.name for section in SECTIONS)
        raise InvalidInput(f"item {only!r} is not in the paper: choose one of {names}")
    return found


_NAME = re.compile(r"(fig|table)(?:ures?|s)?\.?\s*(\d+)(?:\s*[-/]\s*(\d+))?", re.IGNORECASE)


def _matches(section: Section, name: str) -> bool:
    """Return whether a name means a section: `fig 10` and `figure 11` mean `Fig. 10/11`."""
    ours, theirs = _NAME.fullmatch(section.name), _NAME.fullmatch(name.strip())
    if not ours or not theirs or ours[1].lower() != theirs[1].lower():
        return False
    first, last = int(ours[2]), int(ours[3] or ours[2])
    return first <= int(theirs[2]) and int(theirs[3] or theirs[2]) <= last
