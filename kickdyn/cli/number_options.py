"""Options of command lines that take numbers: those of the foot, and those of several."""

import math
from collections.abc import Callable
from typing import Any, TypeVar

import click

from kickdyn.core import validation
from kickdyn.errors import InvalidInput

Command = TypeVar("Command", bound=Callable[..., Any])


def _numbers(separator: str, count: int) -> Callable[..., list[float] | None]:
    """Return a callback of click that reads so many numbers."""

    def read(_: click.Context, option: click.Option, text: str | None) -> list[float] | None:
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


def foot_options(speed: float, attack: float) -> Callable[[Command], Command]:
    """Return what gives a command the arguments `speed` [m/s] and `attack` [deg], with defaults."""

    def check(_: click.Context, option: click.Parameter, value: float) -> float:
        if option.name == "speed":
            return validation.number("speed", value, above=0, at_most=1e6, unit="m/s")
        return validation.number("attack", value, at_least=-90, at_most=90, unit="deg")

    def add(command: Command) -> Command:
        command = click.option(
            "--attack", default=attack, show_default=True, callback=check,
            help="Direction of the foot and of the contact normal above the horizontal [deg].",
        )(command)  # fmt: skip
        return click.option(
            "--speed", default=speed, show_default=True, callback=check, help="Foot speed [m/s]."
        )(command)

    return add
