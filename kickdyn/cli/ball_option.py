"""The option `--ball` of command lines."""

import click

from kickdyn.ball import Ball
from kickdyn.cli.command import offers
from kickdyn.core import validation
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
    return checked_ball(mass, radius, "ball mass", "ball radius")


def checked_ball(mass: float, radius: float, mass_name: str, radius_name: str) -> Ball:
    """Return a ball of 1 g to 1000 kg and 1 mm to 1 m of radius, or raise `InvalidInput`."""
    return Ball(
        validation.number(mass_name, mass, at_least=1e-3, at_most=1e3, unit="kg"),
        validation.number(radius_name, radius, at_least=1e-3, at_most=1, unit="m"),
    )


ball_option = click.option(
    "--ball", default="size-5", callback=_read, metavar="MASS:RADIUS|size-5|paper",
    show_default=True, help="Mass [kg] and radius [m], or a name.",
    shell_complete=offers(lambda _: _NAMED),
)  # fmt: skip
"""Gives a command the argument `ball`."""
