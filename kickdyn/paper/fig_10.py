"""Figs. 10-11: three kicks in space: straight, curving left, curving right."""

import math

from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.paper.assumptions import (
    BALL,
    DEFAULT,
    Coefficients,
    direction,
    launch_from_force,
    warnings_of,
)
from kickdyn.paper.item import Item, shape

NAME = "Fig. 10/11"
SPEED, ATTACK_DEG, OFFSET_DEG = 12.8, 28.7, 20.0
"""Attack of Fig. 9, as the paper prints none here; contact 20 deg below and beside the middle."""

CONTACTS = {"centre-low": 0.0, "right-low": 1.0, "left-low": -1.0}
"""Side of the contact; the normal leans to the other one: +1 to the left."""

AXES = {"centre-low": "A", "right-low": "B"}
"""The paper's names of spin axes; the axis of the left-low kick has none."""


def flights(choice: Coefficients = DEFAULT) -> dict[str, Flight]:
    """Return the three flights."""
    attack = direction(ATTACK_DEG)
    paths = {}
    for name, side in CONTACTS.items():
        normal = direction(ATTACK_DEG + OFFSET_DEG, side * OFFSET_DEG)
        launch, _ = launch_from_force(BALL.mass * SPEED * attack, normal)
        paths[name] = fly(launch, BALL, choice.air())
    return paths


def curve(path: Flight) -> float:
    """Return the distance of the landing to the left of the launch's vertical plane [m]."""
    forward = path.launch.velocity / math.hypot(*path.launch.velocity[:2])
    x, y, _ = path.landing.position - path.launch.position
    return float(forward[0] * y - forward[1] * x)


def items() -> list[Item]:
    """Return the curves to the side and the tilt of the spin axes."""
    result = varying(DEFAULT)
    source = "Eq. (21): the torque impulse r x F_f"
    for name, path in flights().items():
        _, y, z = path.launch.spin
        tilt, side = math.degrees(math.atan2(z, -y)) + 0.0, CONTACTS[name]
        why = "angle to the level axis of pure back spin; higher where the ball curves to"
        verdict = shape(abs(tilt) < 1e-9 if side == 0 else tilt * side > 0)
        axis = f" {AXES[name]}" if name in AXES else ""
        title = f"{NAME} {name} tilt of spin axis{axis}"
        result.append(Item(title, None, tilt, "deg", verdict, why, source))
    return result


def varying(choice: Coefficients) -> list[Item]:
    """Return the curve of every flight with a choice of coefficients."""
    source = f"Eqs. (13), (15)-(21) in 3-D, {choice.name}; attack of Fig. 9 assumed"
    result = []
    for name, path in flights(choice).items():
        left, side = curve(path), CONTACTS[name]
        correct = abs(left) < 1e-9 if side == 0 else left * side > 0
        course = "flies straight" if side == 0 else f"curves {'left' if side > 0 else 'right'}"
        why = (
            f"the ball {course if correct else f'does not fly as the paper says ({course})'}; "
            f"launch at {float(path.launch.speed):.4g} m/s, range {path.range:.3g} m"
        )
        title, notes = f"{NAME} {name} curve to the left", warnings_of(path)
        result.append(Item(title, None, left, "m", shape(correct), why, source, notes=notes))
    return result
