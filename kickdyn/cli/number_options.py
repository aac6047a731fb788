"""Options of command lines that take several numbers."""

import math
from collections.abc import Callable

import click

from kickdyn.errors import InvalidInput


def _numbers(separator: str, count: int) -> Callable[..., list[float] | None]:
    """Return a callback of click that reads so many numbers."""

    def read(_: click.Context, option: click.Option, text: str | None) -> list[float] | None:
        """Return the numbers of an option's text; None where it is not given."""
        if text is None:
            return None
        try:
            values = [float(part) for part in text.split(separator)]
        except ValueError:
            values = []
        if len(values) != count or not all(map(math.isfinite, values)):
            example = separator.join(["0.1", "0.2", "0.3"][:count])
            raise InvalidInput(
                f"{option.opts[0]} is {text!r}: it must be {option.metavar}, such as {example}"
            )
        return values

    return read


PAIR, TRIPLE = _numbers(":", 2), _numbers(",", 3)
"""Callbacks of options such as `--over DISTANCE:HEIGHT` and `--spin X,Y,Z`."""

offset_option = click.option(
    "--offset", callback=TRIPLE, metavar="X,Y,Z",
    help="Contact point relative to --frame, in its axes [m].",
)  # fmt: skip
"""Gives a command the argument `offset`."""
