"""Fig. 9: one foot motion, three contact heights: launch, spin and flight in the plane."""

import math

import numpy as np

from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.impact.laws import normal_impulse
from kickdyn.paper.assumptions import (
    BALL,
    DEFAULT,
    Coefficients,
    direction,
    launch_from_force,
    warnings_of,
)
from kickdyn.paper.item import FITTED, Finding, Item, near, shape

NAME = "Fig. 9"
FOOT_SPEED = 1.2
CASES = ((12.82, 37.9, 28.62, 40.0), (12.81, 54.2, 28.67, 45.0), (12.80, 69.8, 28.70, 50.0))
"""Printed ball speed [m/s], spin [rad/s], launch [deg]; and the contact height [deg], which is not
printed: the round number that the printed spin gives back within 0.05 deg."""


def flights(choice: Coefficients) -> list[Flight]:
    """Return the three flights from the printed launches, with the spin of Eqs. (15)-(21)."""
    launches = (
        launch_from_force(BALL.mass * speed * direction(launch), direction(contact))[0]
        for speed, _, launch, contact in CASES
    )
    return [fly(launch, BALL, choice.air()) for launch in launches]


def items() -> list[Item]:
    """Return spins and launch angles, the speeds' bound, and the flights."""
    result, attack = [], float(np.mean([launch for _, _, launch, _ in CASES]))
    bound = normal_impulse(FOOT_SPEED, 1.0, np.inf, BALL.mass) / BALL.mass
    attack_reason = "one attack direction for all cases: the mean of the printed launch angles"
    slow = (
        f"a foot at {FOOT_SPEED} m/s gives the ball at most (1 + e) v = {bound:.3g} m/s, with a "
        "restitution e of 1"
    )
    for number, (speed, spin, angle, contact) in enumerate(CASES, 1):
        normal, momentum = direction(contact), BALL.mass * speed
        state, sticking = launch_from_force(momentum * direction(angle), normal)
        common, _ = launch_from_force(momentum * direction(attack), normal)
        fitted = (
            f"the contact height of {contact:g} deg is fitted, as the paper prints none; the "
            f"contact {'sticks' if sticking else 'slips'}"
        )
        up, rate = math.degrees(common.elevation), math.hypot(*state.spin)
        for what, paper, ours, unit, why, source in (
            ("spin", spin, rate, "rad/s", fitted, "Eqs. (15)-(21)"),
            ("launch angle", angle, up, "deg", attack_reason, "Eqs. (15)-(18)"),
            ("ball speed", speed, bound, "m/s", slow, "Eq. (10), the leg of infinite mass"),
        ):
            name = f"{NAME} case {number} {what}"
            verdict = near(ours, paper, FITTED, Finding.FITTED)
            result.append(Item(name, paper, ours, unit, verdict, why, source))
    return result + varying(DEFAULT)


def varying(choice: Coefficients) -> list[Item]:
    """Return distance and apex of the three flights with a choice of coefficients."""
    paths = flights(choice)
    ranges, heights = [path.range for path in paths], [path.height for path in paths]
    ordered = ranges == sorted(ranges) and heights == sorted(heights)
    farthest, highest = 1 + int(np.argmax(ranges)), 1 + int(np.argmax(heights))
    why = (
        f"case {farthest} flies farthest and case {highest} highest; in the paper case 3 does "
        "both, about 10 m far and 2 m high, read off its curves"
    )
    source = f"Eqs. (12)-(13), (22)-(23), {choice.name}; from the printed launch"
    return [
        Item(
            f"{NAME} case {number} {what}", None, ours, "m", shape(ordered), why, source,
            notes=warnings_of(path),
        )
        for number, path in enumerate(paths, 1)
        for what, ours in (("distance", path.range), ("apex", path.height))
    ]  # fmt: skip
