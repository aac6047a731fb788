"""The option `--drag` of command lines, beside their `--air`."""

from dataclasses import replace

import click

from kickdyn.aerodynamics.coefficient_model import find_model
from kickdyn.aerodynamics.drag import MODELS
from kickdyn.air import Air
from kickdyn.errors import InvalidInput

drag_option = click.option(
    "--drag",
    metavar="MODEL|NUMBER",
    help="Drag of the ball: the name of a model, or a constant coefficient such as 0.25.  "
    "[default: supercritical; with --air paper, brazuca]",
)


def read_coefficient(text: str) -> str | float:
    """Return the number that a text is, or else the text, which names a model."""
    try:
        return float(text)
    except ValueError:
        return text


def with_drag(air: Air | None, drag: str | None) -> Air | None:
    """Return the air with the drag of the option, as it is where there is none."""
    if drag is None:
        return air
    if air is None:
        raise InvalidInput(f"--drag {drag} is named with --air none: a vacuum has no drag")
    return replace(air, drag=find_model("drag", MODELS, read_coefficient(drag)))
