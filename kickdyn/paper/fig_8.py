"""Fig. 8: 30 m/s at 30 deg in the vacuum, with drag, with back spin, with top spin."""

import numpy as np
from matplotlib.figure import Figure

from kickdyn.ball import BallState
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.paper.assumptions import (
    BALL,
    DEFAULT,
    Coefficients,
    direction,
    show_warnings,
    warnings_of,
)
from kickdyn.paper.item import Item, shape

NAME = "Fig. 8"
SPEED, ELEVATION_DEG, SPIN = 30.0, 30.0, 180.0


def flights(choice: Coefficients = DEFAULT) -> dict[str, Flight]:
    """Return the four flights, in the paper's order."""
    velocity = SPEED * direction(ELEVATION_DEG)
    kicks = {
        "vacuum": (0.0, None),
        "drag": (0.0, choice.air(lift=False)),
        "back spin": (-SPIN, choice.air()),
        "top spin": (SPIN, choice.air()),
    }
    return {
        name: fly(BallState(velocity=velocity, spin=(0.0, spin, 0.0)), BALL, air)
        for name, (spin, air) in kicks.items()
    }


def items() -> list[Item]:
    """Return range and apex of every curve."""
    vacuum = flights()["vacuum"]
    why = "closed form; the paper's text prints no range"
    verdict, source = shape(vacuum.range > 0), "Eqs. (24)-(25)"
    first = Item(f"{NAME} vacuum range", None, vacuum.range, "m", verdict, why, source)
    return [first, *varying(DEFAULT)]


def varying(choice: Coefficients) -> list[Item]:
    """Return range and apex of the curves in air with a choice of coefficients."""
    paths = flights(choice)
    heights = {name: path.height for name, path in paths.items()}
    ranges = {name: path.range for name, path in paths.items()}
    highest = heights["back spin"] == max(heights.values())
    lowest = heights["top spin"] == min(heights.values())
    shortest = ranges["top spin"] == min(ranges.values())
    order = (
        f"back spin {'flies' if highest else 'does not fly'} highest, "
        f"top spin {'lowest' if lowest else 'not lowest'} and "
        f"{'shortest' if shortest else 'not shortest'}"
    )
    source = f"Eqs. (12)-(13), (22)-(23), {choice.name}"
    verdict = shape(highest and lowest and shortest)
    return [
        Item(
            f"{NAME} {name} {what}", None, ours, "m", verdict, order, source,
            notes=warnings_of(path),
        )
        for name, path in paths.items()
        if name != "vacuum"
        for what, ours in (("range", path.range), ("apex", path.height))
    ]  # fmt: skip


def draw(figure: Figure) -> None:
    """Draw the four curves."""
    axes, paths = figure.subplots(), flights()
    for (name, path), style in zip(paths.items(), ("-", "--", "-.", ":"), strict=True):
        position = path.sample(np.linspace(0, path.duration, 200)).position
        axes.plot(position[:, 0], position[:, 2], style, label=name)
    axes.set(xlabel="X [m]", ylabel="Y [m]", xlim=(0, 80), ylim=(0, None))
    axes.legend()
    show_warnings(figure, *paths.values())
