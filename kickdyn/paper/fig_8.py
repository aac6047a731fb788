"""Fig. 8: 30 m/s at 30 deg in the vacuum, with drag, with back spin, with top spin."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from kickdyn.ball import BallState
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.paper.assumptions import BALL, DEFAULT, Coefficients, direction, with_others
from kickdyn.paper.item import COMPUTED, Item, near, shape

NAME = "Fig. 8"
SPEED, ELEVATION_DEG, SPIN = 30.0, 30.0, 180.0
VACUUM_RANGE = 79.4


def flights(choice: Coefficients) -> dict[str, Flight]:
    """Return the four flights, in the paper's order."""
    velocity = SPEED * direction(ELEVATION_DEG)

    def flown(spin: float) -> BallState:
        return BallState(velocity=velocity, spin=(0.0, spin, 0.0))

    return {
        "vacuum": fly(flown(0.0), BALL),
        "drag": fly(flown(0.0), BALL, choice.air(lift=False)),
        "back spin": fly(flown(-SPIN), BALL, choice.air()),
        "top spin": fly(flown(SPIN), BALL, choice.air()),
    }


def items() -> list[Item]:
    """Return range and apex of every curve."""
    return _items(DEFAULT)


def sensitivity() -> list[Item]:
    """Return the same for every other choice of coefficients."""
    return [item for item in with_others(_items) if "vacuum" not in item.item]


def _items(choice: Coefficients) -> list[Item]:
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
    result = []
    for name, path in paths.items():
        exact = name == "vacuum"
        verdict = shape(highest and lowest and shortest)
        result.append(
            Item(
                f"{NAME} {name} range",
                VACUUM_RANGE if exact else None,
                path.range,
                "m",
                near(path.range, VACUUM_RANGE, COMPUTED) if exact else verdict,
                "closed form" if exact else order,
                "Eqs. (24)-(25)" if exact else source,
            )
        )
        if not exact:
            result.append(
                Item(f"{NAME} {name} apex", None, path.height, "m", verdict, order, source)
            )
    return result


def draw(figure: Figure) -> None:
    """Draw the four curves."""
    axes = figure.subplots()
    for (name, path), style in zip(flights(DEFAULT).items(), ("-", "--", "-.", ":"), strict=True):
        position = path.sample(np.linspace(0, path.duration, 200)).position
        axes.plot(position[:, 0], position[:, 2], style, label=name)
    axes.set(xlabel="X [m]", ylabel="Y [m]", xlim=(0, 80), ylim=(0, None))
    axes.legend()
