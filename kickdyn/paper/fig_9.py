"""Fig. 9: one foot motion, three contact heights: launch, spin and flight in the plane."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.impact.laws import normal_impulse
from kickdyn.paper.assumptions import (
    BALL,
    DEFAULT,
    LIFT_WITHOUT_CRISIS,
    Coefficients,
    direction,
    launch_from_contact,
    with_others,
)
from kickdyn.paper.item import FITTED, Item, near, shape

NAME = "Fig. 9"
FOOT_SPEED = 1.2
CASES = ((12.82, 37.9, 28.62, 40.0), (12.81, 54.2, 28.67, 45.0), (12.80, 69.8, 28.70, 50.0))
"""Printed ball speed [m/s], spin [rad/s], launch [deg]; and the contact height [deg], which is not
printed: the round number that the printed spin gives back within 0.05 deg."""


def flights(choice: Coefficients) -> list[Flight]:
    """Return the three flights from the printed launches, with the spin of Eqs. (15)-(21)."""
    return [
        fly(launch_from_contact(speed, direction(launch), direction(contact))[0], BALL, air)
        for air in (choice.air(),)
        for speed, _, launch, contact in CASES
    ]


def items() -> list[Item]:
    """Return the spins, the speeds' bound, and the flights."""
    result = []
    for number, (speed, spin, launch, contact) in enumerate(CASES, 1):
        state, sticking = launch_from_contact(speed, direction(launch), direction(contact))
        ours = float(np.linalg.norm(state.spin))
        held = "sticks" if sticking else "slips"
        result.append(
            Item(
                f"{NAME} case {number} spin",
                spin,
                ours,
                "rad/s",
                near(ours, spin, FITTED, "fitted"),
                f"contact at {contact:g} deg {held}: the round number that fits, as the paper "
                "prints no height",
                "Eqs. (15)-(21), from the printed launch",
            )
        )
    bound = normal_impulse(FOOT_SPEED, 1.0, np.inf, BALL.mass) / BALL.mass
    for number, (speed, *_) in enumerate(CASES, 1):
        result.append(
            Item(
                f"{NAME} case {number} ball speed",
                speed,
                bound,
                "m/s",
                "reproduced" if speed <= bound else "not reachable",
                f"a foot at {FOOT_SPEED} m/s gives at most (1 + e) v = {bound:.3g} m/s, at e = 1",
                "Eq. (10), the leg endlessly heavy",
            )
        )
    return result + _flown(DEFAULT)


def sensitivity() -> list[Item]:
    """Return the flights for every other choice of coefficients."""
    return with_others(_flown)


def _flown(choice: Coefficients) -> list[Item]:
    paths = flights(choice)
    ranges, heights = [path.range for path in paths], [path.height for path in paths]
    ordered = ranges == sorted(ranges) and heights == sorted(heights)
    air = choice.air()
    state = paths[-1].launch
    reynolds = 2 * BALL.radius * air.density * float(state.speed) / air.viscosity
    spin_parameter = BALL.radius * float(np.linalg.norm(state.spin)) / float(state.speed)
    lift = air.lift(reynolds, spin_parameter) if air.lift else 0.0
    farthest, highest = 1 + int(np.argmax(ranges)), 1 + int(np.argmax(heights))
    why = (
        f"case {farthest} flies farthest, case {highest} highest; in the paper case 3, to about "
        f"10 m and 2 m; C_L = {lift:.2g} at Re {reynolds:.2g}"
    )
    if not ordered:
        why += f", with {LIFT_WITHOUT_CRISIS.name}, which has no crisis, case 3 is first"
    result = []
    for number, path in enumerate(paths, 1):
        for what, ours in (("distance", path.range), ("apex", path.height)):
            result.append(
                Item(
                    f"{NAME} case {number} {what}",
                    None,
                    ours,
                    "m",
                    shape(ordered),
                    why,
                    f"Eqs. (12)-(13), (22)-(23), {choice.name}; from the printed launch",
                )
            )
    return result


def draw(figure: Figure) -> None:
    """Draw the three flights, with the default lift and with one that has no crisis."""
    for axes, choice in zip(
        figure.subplots(2, 1, sharex=True),
        (DEFAULT, LIFT_WITHOUT_CRISIS),
        strict=True,
    ):
        for number, path in enumerate(flights(choice), 1):
            position = path.sample(np.linspace(0, path.duration, 200)).position
            axes.plot(position[:, 0], position[:, 2], label=f"case {number}")
        axes.set(ylabel="Y [m]", ylim=(0, 2.5), xlim=(0, 14), title=choice.name)
        axes.legend()
    axes.set_xlabel("X [m]")
