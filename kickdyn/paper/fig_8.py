"""Fig. 8: 30 m/s at 30 deg in the vacuum, with drag, with back spin, with top spin."""

from kickdyn.ball import BallState
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.paper.assumptions import BALL, DEFAULT, Coefficients, direction, warnings_of
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
    of_vacuum = Item(f"{NAME} vacuum range", None, vacuum.range, "m", verdict, why, source)
    return [of_vacuum, *varying(DEFAULT)]


def varying(choice: Coefficients) -> list[Item]:
    """Return range and apex of the curves in air with a choice of coefficients."""
    paths = flights(choice)
    highest = paths["back spin"].height == max(path.height for path in paths.values())
    lowest = paths["top spin"].height == min(path.height for path in paths.values())
    shortest = paths["top spin"].range == min(path.range for path in paths.values())
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
