"""The option `--ball` of command lines."""

import math

import click

from kickdyn.ball import Ball
from kickdyn.errors import InvalidInput


def read_ball(_: click.Context, __: click.Option, text: str) -> Ball:
    """Return the ball of an option: `size-5`, `paper`, `obstacle`, or mass [kg] and radius [m]."""
    # each command refuses `obstacle` and says why
    named = {"size-5": Ball(), "paper": Ball.paper(), "obstacle": Ball(mass=math.inf)}
    if text in named:
        return named[text]
    try:
        mass, radius = map(float, text.split(":"))
    except ValueError:
        raise InvalidInput(f"ball is {text!r}: it must be size-5, paper or MASS:RADIUS") from None
    return Ball(mass=mass, radius=radius)
