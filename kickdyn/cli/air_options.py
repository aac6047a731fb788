"""The options `--air` and `--drag` of command lines."""

from dataclasses import replace

import click

from kickdyn.aerodynamics.coefficient_model import constant_limits, find_model
from kickdyn.aerodynamics.drag import MODELS
from kickdyn.air import AIRS, Air
from kickdyn.cli.command import offers
from kickdyn.core import validation
from kickdyn.errors import InvalidInput


def read_drag(_: click.Context, option: click.Option, text: str | None) -> str | float | None:
    """Return the number that an option's text is, or else the text, which names a model."""
    if text is None:
        return None
    known = [*MODELS, *([option.default] if isinstance(option.default, str) else [])]
    if text in known:
        return text
    try:
        value = float(text)
    except ValueError:
        raise InvalidInput(
            f"--drag is {text!r}: it must be a number such as 0.25, or one of {', '.join(known)}"
        ) from None
    return validation.number("--drag", value, **constant_limits("drag"))


air_option = click.option(
    "--air", default="standard", show_default=True, type=click.Choice(list(AIRS)),
    help="Air at 20 degC and sea level, with density and viscosity of the paper's Table 3, or "
    "none. The coefficients of drag and lift are those of kickdyn.",
)  # fmt: skip

drag_option = click.option(
    "--drag",
    metavar="MODEL|NUMBER",
    callback=read_drag,
    shell_complete=offers(lambda _: MODELS),
    help="Drag coefficient of the ball: a number such as 0.25, or the name of a model of it "
    f"({', '.join(MODELS)}).  [default: supercritical; with --air paper, brazuca]",
)


def with_drag(air: Air | None, drag: str | float | None) -> Air | None:
    """Return the air with the drag of the option, as it is where there is none."""
    if drag is None:
        return air
    if air is None:
        raise InvalidInput(f"--drag is {drag}, but --air is none: a vacuum has no drag")
    return replace(air, drag=find_model("drag", MODELS, drag))
