"""The option of command lines that says how much of the speed of approach an impact returns."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

from kickdyn.cli.command import offers
from kickdyn.restitution import MODELS, Restitution, read_restitution


def _read(_: click.Context, __: click.Option, text: str) -> Restitution:
    """Return a number, a table over the speed of approach, or a model's name."""
    return read_restitution(text)


Command = TypeVar("Command", bound=Callable[..., Any])

restitution_option: Callable[[Command], Command] = click.option(
    "--restitution", default="0.8", show_default=True, callback=_read,
    metavar="E|NAME|SPEED:E,...", shell_complete=offers(lambda _: MODELS),
    help="Coefficient of restitution e, from 0 to 1; a table of e over the approach speed, such as "
    f"5:0.8,20:0.65 [m/s:e]; or a model ({', '.join(MODELS)}).",
)  # fmt: skip
"""Gives a command the argument `restitution`."""
