"""Representation of results in a terminal and in Jupyter, equality by value, read-only arrays.

Tables and text are laid out for the width of the terminal.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from html import escape
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from rich.table import Table

T = TypeVar("T")

Row = tuple[str, object, str]
"""A line of a representation: name, value, unit."""

SHOWN_WARNINGS = 3
"""Number of warnings that are shown; the others are counted."""

ROUNDING = 1e-12
"""Share of a vector's largest entry below which an entry is shown as 0."""


def freeze_arrays(value: object) -> None:
    """Make arrays read-only: a value, or what mappings and tuples of any depth hold."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, Mapping):
        for item in value.values():
            freeze_arrays(item)
    elif isinstance(value, tuple):
        for item in value:
            freeze_arrays(item)


class stored(cached_property[T]):  # noqa: N801  # as cached_property
    """A `cached_property` without the lock of Python 3.11, which takes as long as a small sum."""

    if not TYPE_CHECKING:

        def __get__(self, instance, owner=None):
            if instance is None:
                return self
            value = instance.__dict__[self.attrname] = self.func(instance)
            return value


class ReadOnlyArrays:
    """Keeps the arrays of a pickled or copied object read-only, which numpy forgets."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        freeze_arrays(state)
        self.__dict__.update(state)


class ReprMixin(ReadOnlyArrays):
    """Represents an object by its `_rows`, numbers rounded to 4 digits."""

    def _rows(self) -> Iterable[Row]:
        """Return the rows that are shown; a subclass defines them."""
        raise NotImplementedError

    def __repr__(self) -> str:
        rows = [(name, f"{format_value(x)} {unit}".rstrip()) for name, x, unit in self._rows()]
        width = max(len(name) for name, _ in rows)
        return "\n".join([type(self).__name__, *(f"  {n:{width}}  {v}" for n, v in rows)])

    def _repr_html_(self) -> str:
        rows = "".join(
            f'<tr><th style="text-align:left">{escape(name)}</th>'
            f'<td style="text-align:left">{escape(format_value(value))}</td>'
            f'<td style="text-align:left">{escape(unit)}</td></tr>'
            for name, value, unit in self._rows()
        )
        title = f"<caption><b>{escape(type(self).__name__)}</b></caption>"
        return f"<table>{title}{rows}</table>"


def warned(lines: Sequence[str]) -> Iterable[Row]:
    """Return a row for each of the first few lines of warning, and one that counts the others."""
    for line in lines[:SHOWN_WARNINGS]:
        yield "warning", line, ""
    if len(lines) > SHOWN_WARNINGS:
        more = f"and {len(lines) - SHOWN_WARNINGS} more: see `warnings` (of a command: --json)"
        yield "warning", more, ""


class Printed(ReadOnlyArrays):
    """Represents an object by its `str`, which is a table already."""

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"


class ValueEquality(ReadOnlyArrays):
    """Compares and hashes a frozen dataclass, declared with `eq=False`, by the values it has."""

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            return NotImplemented
        return self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def _values(self) -> tuple[Any, ...]:
        values = (getattr(self, field.name) for field in fields(self))  # type: ignore[arg-type]
        return tuple(
            (value.shape, *value.ravel().tolist()) if isinstance(value, np.ndarray) else value
            for value in values
        )


def distance_in_words(distance: float) -> str:
    """Return a distance [m] for people: to 2 digits, without powers of ten."""
    if distance < 1e-6:
        return "less than a micrometre"
    return f"{1e3 * distance:.2g} mm" if distance < 1e-3 else f"{distance:.2g} m"


def format_value(value: object) -> str:
    """Return a value as text: 4 digits, vectors in brackets, their rounding as 0."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return f"{float(value) + 0.0:.4g}"  # no -0
    if isinstance(value, np.ndarray):
        least = ROUNDING * float(np.abs(value).max(initial=0.0))
        entries = (0.0 if abs(entry) < least else entry for entry in value.tolist())
        return f"({', '.join(format_value(entry) for entry in entries)})"
    return str(value)


PIPE_WIDTH = 200
"""Characters of a line of a table if the output is no terminal."""

PROSE = 80
"""Most characters of a line of text, however wide the terminal."""


def screen_width() -> int:
    """Return the number of characters in a line of the terminal; `PIPE_WIDTH` if there is none."""
    from rich.console import Console  # takes a tenth of a second to import

    screen = Console()
    return screen.width if screen.is_terminal else PIPE_WIDTH


def empty_table(title: str) -> "Table":
    """Return a table without columns yet, its columns close together."""
    from rich import box
    from rich.table import Table

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
