"""Width of the terminal, and tables and text laid out for it."""

from collections.abc import Sequence
from textwrap import fill

from rich import box
from rich.console import Console
from rich.table import Table

PIPE_WIDTH = 200
"""Characters of a line of a table if the output is no terminal."""

PROSE = 80
"""Most characters of a line of text, however wide the terminal."""


def screen_width() -> int:
    """Return the number of characters in a line of the terminal; `PIPE_WIDTH` if there is none."""
    screen = Console()
    return screen.width if screen.is_terminal else PIPE_WIDTH


def empty_table(title: str) -> Table:
    """Return a table without columns yet, its columns close together."""
    return Table(
        title=title or None,
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )


def wrapped(line: str, width: int, indent: int = 0, start: str = "") -> str:
    """Return a line broken between words, all lines but the first indented."""
    return fill(
        line,
        width,
        initial_indent=start,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def notes(texts: Sequence[str], width: int) -> str:
    """Return numbered notes, each on lines of its own, broken between words."""
    lines = (
        wrapped(text, min(PROSE, width), indent=5, start=f"{number:3}  ")
        for number, text in enumerate(texts, 1)
    )
    return "\n".join(lines)
