"""What fits on the screen: its width, and tables and text laid out for it."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

WIDE = 200
"""Characters of a table, where there is no screen."""

PROSE = 80
"""Characters of a line of text at most, whatever the screen."""


def screen_width() -> int:
    """Return how many characters a line of the screen has; `WIDE` where there is none."""
    screen = Console()
    return screen.width if screen.is_terminal else WIDE


def fits(table: Table, width: int) -> bool:
    """Return whether a table has room in so many characters, none of its cells broken."""
    wide = Console(width=WIDE)
    return Measurement.get(wide, wide.options, table).maximum <= width


def empty_table(title: str) -> Table:
    """Return a table without columns yet, under its title if it has one, its columns close."""
    return Table(
        title=title or None,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )


def wrapped(line: str, width: int, indent: int = 0) -> str:
    """Return a line on as many as it takes, those after the first indented; no word is broken."""
    return fill(
        line,
        width,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def notes(said: Sequence[str], width: int) -> str:
    """Return numbered notes, each on lines of its own; a word that is longer is not broken."""
    return "\n".join(
        fill(each, min(PROSE, width), initial_indent=f"{number:3}  ", subsequent_indent=" " * 5,
             break_long_words=False, break_on_hyphens=False)
        for number, each in enumerate(said, 1)
    )  # fmt: skip
