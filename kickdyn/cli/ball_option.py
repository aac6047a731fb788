"""The option `--ball` of command lines."""

import click

from kickdyn.ball import Ball
from kickdyn.cli.command import offers
from kickdyn.errors import InvalidInput

_NAMED = {"size-5": Ball, "paper": Ball.paper}


def _read(_: click.Context, __: click.Option, text: str) -> Ball:
    """Return the ball of a name, or of mass [kg] and radius [m]."""
    if text in _NAMED:
        return _NAMED[text]()
    try:
        mass, radius = map(float, text.split(":"))
    except ValueError:
        raise InvalidInput(
            f"--ball is {text!r}: it must be size-5, paper, or MASS:RADIUS such as 0.45:0.11 [kg:m]"
        ) from None
    return Ball(mass=mass, radius=radius)


ball_option = click.option(
    "--ball", default="size-5", callback=_read, metavar="MASS:RADIUS|size-5|paper",
    show_default=True, help="Mass [kg] and radius [m], or a name.",
    shell_complete=offers(lambda _: _NAMED),
)  # fmt: skip
"""Gives a command the argument `ball`."""
