"""Options of command lines in groups: a dataclass each for the ball, the air, the contact, files.

A field of a group is an option. A `command` has the options of groups, and receives the filled
groups; their methods make the library's objects of what was typed.
"""

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import wraps
from typing import Any

import click

from kickdyn.aerodynamics.coefficient_model import constant_limits, find_model
from kickdyn.aerodynamics.drag import MODELS as DRAG_MODELS
from kickdyn.air import AIRS, Air
from kickdyn.ball import Ball
from kickdyn.cli.commands import Command, check_page_name, print_wrapped, warn
from kickdyn.contact import Contact
from kickdyn.core import validation
from kickdyn.core.files import check_outputs, write_json
from kickdyn.errors import InvalidInput, printable
from kickdyn.restitution import MODELS as RESTITUTION_MODELS
from kickdyn.restitution import read_restitution

NAMED_BALLS = {"size-5": Ball, "paper": Ball.paper}


def option(*names: str, **settings: Any) -> Any:
    """Return a field of a group: the arguments of its `click.option`; `TYPES` may add a type."""
    shown = {"show_default": "default" in settings}
    return field(metadata={"names": names, "settings": shown | settings})


def command(name: str) -> Callable[[Callable[..., None]], click.Command]:
    """Return a decorator that makes a command of a function whose annotations are groups."""

    def make(function: Callable[..., None]) -> click.Command:
        annotated = function.__annotations__.items()
        groups: dict[str, Any] = {key: kind for key, kind in annotated if is_dataclass(kind)}

        @wraps(function)
        def with_groups(**values: Any) -> None:
            filled = {
                key: group(**{entry.name: values.pop(entry.name) for entry in fields(group)})
                for key, group in groups.items()
            }
            function(**values, **filled)

        for group in reversed(groups.values()):
            for entry in reversed(fields(group)):
                names, settings = entry.metadata["names"], entry.metadata["settings"]
                settings = TYPES.get(entry.type, {}) | settings
                click.option(*names, entry.name, **settings)(with_groups)
        return click.command(name, Command)(with_groups)

    return make


class Numbers(click.ParamType):  # type: ignore[type-arg]
    """Finite numbers in one word, such as `X,Y,Z` or `DISTANCE:HEIGHT`."""

    def __init__(self, form: str) -> None:
        self.name = form
        self._separator = ":" if ":" in form else ","

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return the form."""
        return self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the numbers as a tuple."""
        count, numbers = self.name.count(self._separator) + 1, tuple[float, ...]()
        with suppress(ValueError):
            numbers = tuple(map(float, value.split(self._separator)))
        if len(numbers) == count and not all(map(math.isfinite, numbers)):
            self.fail(f"{value!r}: every number of {self.name} must be finite.", param, ctx)
        if len(numbers) != count:
            example = self._separator.join(["0.1", "0.2", "0.3"][:count])
            self.fail(f"{value!r} is not {self.name}, such as {example}.", param, ctx)
        return numbers


Vector = tuple[float, float, float] | None
"""The value of an option `X,Y,Z`; None if it is not given."""

TYPES: dict[Any, dict[str, Any]] = {
    Vector: {"type": Numbers("X,Y,Z")}, float | None: {"type": float}, bool: {"is_flag": True},
}  # fmt: skip
"""Settings of options by the annotations of their fields."""


@dataclass(frozen=True)
class FootOptions:
    """The velocity of the foot: `speed` [m/s] and its direction above the horizontal [deg]."""

    speed: float = option("--speed", default=1.0, help="Foot speed [m/s].")
    attack: float = option(
        "--attack", default=30.0,
        help="Direction of the foot and of the contact normal above the horizontal [deg].",
    )  # fmt: skip

    @property
    def angle(self) -> float:
        """Direction above the horizontal [rad]."""
        angle = validation.number("attack", self.attack, at_least=-90, at_most=90, unit="deg")
        return math.radians(angle)


DEFAULT_BALL = "size-5"


@dataclass(frozen=True)
class BallOptions:
    """The ball: mass [kg], radius [m] and perhaps pressure [Pa], or a name."""

    ball: str = option(
        "--ball", default=DEFAULT_BALL, metavar="MASS:RADIUS[:PRESSURE]|size-5|paper",
        help="Mass [kg], radius [m] and gauge pressure [Pa], or a name.",
    )  # fmt: skip

    def load(self) -> Ball:
        """Return the ball; raise `InvalidInput` if it is no name nor two or three numbers."""
        if self.ball in NAMED_BALLS:
            return NAMED_BALLS[self.ball]()
        try:
            mass, radius, *pressure = map(float, self.ball.split(":"))
            if len(pressure) > 1:
                raise ValueError
        except ValueError:
            raise InvalidInput(
                f"--ball is {self.ball!r}: it must be size-5, paper, or MASS:RADIUS such as "
                "0.45:0.11 [kg:m], with the pressure 0.45:0.11:80e3 [Pa]"
            ) from None
        return Ball(
            validation.number("ball mass", mass, at_least=1e-3, at_most=1e3, unit="kg"),
            validation.number("ball radius", radius, at_least=1e-3, at_most=1, unit="m"),
            pressure=pressure[0] if pressure else None,
        )


@dataclass(frozen=True)
class ContactOptions:
    """Coefficients of the contact: `restitution` as it was typed, and `friction`."""

    restitution: str = option(
        "--restitution", default="0.8", metavar="E|NAME|SPEED:E,...",
        help="Coefficient of restitution e, from 0 to 1; a table of e over the approach speed, "
        f"such as 5:0.8,20:0.65 [m/s:e]; or a model ({', '.join(RESTITUTION_MODELS)}, which "
        "needs the PRESSURE of --ball).",
    )  # fmt: skip
    friction: float = option("--friction", default=0.4, help="Coulomb's coefficient.")


@dataclass(frozen=True)
class PointOptions(ContactOptions):
    """Coefficients of the contact, and its `offset` from the contact frame, in its axes [m]."""

    offset: Vector = option("--offset", help="Contact point relative to --frame, in its axes [m].")

    def contact(self) -> Contact:
        """Return the contact, without a normal."""
        return Contact(None, read_restitution(self.restitution), self.friction, offset=self.offset)


@dataclass(frozen=True)
class AirOptions:
    """The air by its name, and the drag of the ball: a number, or the name of a model."""

    air: str = option(
        "--air", default="standard", type=click.Choice(list(AIRS)),
        help="Air at 20 degC and sea level, with density and viscosity of the paper's Table 3, or "
        "none. The coefficients of drag and lift are kickdyn's.",
    )  # fmt: skip
    drag: str | None = option(
        "--drag", metavar="MODEL|NUMBER",
        help="Drag coefficient of the ball: a number such as 0.25, or the name of a model of it "
        f"({', '.join(DRAG_MODELS)}).  [default: supercritical; with --air paper, brazuca]",
    )  # fmt: skip

    def load(self) -> Air | None:
        """Return the air; None in a vacuum."""
        air = AIRS[self.air]
        if self.drag is None:
            return air
        drag = read_drag(self.drag)
        if air is None:
            raise InvalidInput(f"--drag is {drag}, but --air is none: a vacuum has no drag")
        return replace(air, drag=find_model("drag", DRAG_MODELS, drag))


def read_drag(text: str, *names: str) -> str | float:
    """Return a coefficient of drag, or the text if it is the name of a model or one of `names`."""
    choices = [*DRAG_MODELS, *names]
    if text in choices:
        return text
    try:
        value = float(text)
    except ValueError:
        raise InvalidInput(
            f"--drag is {text!r}: it must be a number such as 0.25, or one of {', '.join(choices)}"
        ) from None
    return validation.number("--drag", value, **constant_limits("drag"))


@dataclass(frozen=True)
class JsonOptions:
    """The file of the results as JSON; `-` is stdout, and then nothing else is printed."""

    json_file: str | None = option(
        "--json", metavar="FILE", help="Write results as JSON; - is stdout."
    )

    @property
    def prints(self) -> bool:
        """Whether the results are printed for people."""
        return self.json_file != "-"

    def check(self, *files: str | None, inputs: Iterable[str | None] = ()) -> None:
        """Refuse outputs that cannot be written or are inputs; name those that are replaced."""
        page, plot = (getattr(self, name, None) for name in ("view", "plot"))
        if page is not None:
            check_page_name(page)
        if plot is not None:
            from kickdyn.core.plot_style import check_name  # imports matplotlib

            check_name(plot)
        replaced = check_outputs(*files, page, plot, json_file=self.json_file, inputs=inputs)
        if replaced:
            will = "exists and will be" if len(replaced) == 1 else "exist and will be"
            click.echo(f"{printable(', '.join(replaced))} {will} replaced", err=True)

    def write_json(self, document: object) -> None:
        """Write the document if a file is named."""
        if self.json_file is not None:
            write_json(self.json_file, document)

    def print_rows(self, *results: Any) -> None:
        """Print rows of results, with class names if several; earlier warnings are not repeated."""
        seen = set[str]()
        for result in results if self.prints else ():
            lines = repr(result).splitlines()[len(results) == 1 :]
            print_wrapped("\n".join(line for line in lines if " ".join(line.split()) not in seen))
            seen |= {" ".join(line.split()) for line in lines if line.startswith("  warning")}

    def name_written(self, *files: object) -> None:
        """Print the names of these files and of the JSON file, all of which were written."""
        for file in (*files, self.json_file):
            if self.prints and file is not None:
                click.echo(f"wrote {file}")


@dataclass(frozen=True)
class PlotOptions(JsonOptions):
    """Where results are written: as JSON, and as a plot."""

    plot: str | None = option("--plot", metavar="FILE", help="Plot the results: .png, .svg, .pdf.")

    def save_plot(self, draw: Callable[[], Any]) -> None:
        """Write the figure that a function returns, if a file is named."""
        if self.plot is not None:
            from kickdyn.core.plot_style import save_figure

            save_figure(draw(), self.plot)


@dataclass(frozen=True)
class OutputOptions(PlotOptions):
    """Where results are written: as JSON, as a plot, and as a 3-D page or a picture of it."""

    view: str | None = option(
        "--view", metavar="FILE.html|.png", help="Write a 3-D page, or a picture of it."
    )

    def save_page(self, subject: Any, **options: Any) -> None:
        """Write the page of a subject, as `page` takes it, if a file is named; show warnings."""
        if self.view is not None:
            from kickdyn.view.page import page  # imports meshcat

            made_page = page(subject, **options)
            made_page.save(self.view)
            warn(made_page.warnings)


scene_argument: Callable[[Any], Any] = click.argument(
    "scene_file", metavar="SCENE", type=click.Path()
)
"""Gives a command the argument `scene_file`."""
