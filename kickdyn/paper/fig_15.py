"""Figs. 13-15: planning a launch by the paper's learning loop, and by ours."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from kickdyn.paper.assumptions import ALTERNATIVES, BALL, DEFAULT, Coefficients
from kickdyn.paper.item import Item, Verdict
from kickdyn.planning.launch import TOLERANCES, LaunchPlan, Method, plan_launch

NAME = "Fig. 13-15"
GOALS = ((30.0, 1.5, 3), (50.0, 2.0, 8), (100.0, 3.0, 25))
"""Distance [m], time [s], and after how many rounds the paper's curves settle, read off them."""


def plans(choice: Coefficients, method: Method) -> list[LaunchPlan]:
    """Return the plans for the three goals, with drag only."""
    air = choice.air(lift=False)
    return [plan_launch(distance, time, BALL, air, method) for distance, time, _ in GOALS]


def items() -> list[Item]:
    """Return rounds and errors of both methods."""
    result = _learned(DEFAULT)
    for (distance, time, _), plan in zip(GOALS, plans(DEFAULT, "newton"), strict=True):
        goal = f"{NAME} {distance:g} m, {time:g} s planner"
        met: Verdict = "ours" if plan.status == "met" else "not reachable"
        source = f"Newton on the flight's derivatives, from Eqs. (24)-(25), {DEFAULT.name}, no lift"
        why = (
            f"ours, beside the paper's loop: {plan.speed:.4f} m/s at "
            f"{math.degrees(plan.angle):.4f} deg after {plan.iterations} steps, errors "
            f"{plan.best.distance_error:.0e} m, {plan.best.time_error:.0e} s"
        )
        why += "".join(f"; {warning}" for warning in plan.flight.warnings)
        result += [
            Item(f"{goal} steps", None, plan.iterations, "1", met, why, source),
            Item(f"{goal} distance", distance, distance - plan.best.distance_error, "m",
                 met, why, source),
            Item(f"{goal} time", time, time - plan.best.time_error, "s",
                 met, why, source),
        ]  # fmt: skip
    return result


def sensitivity() -> list[Item]:
    """Return the learning loop's rounds for every other drag."""
    return [
        replace(item, variant=choice.name)
        for choice in ALTERNATIVES
        if not choice.name.startswith("lift")
        for item in _learned(choice)
        if item.item.endswith("rounds")
    ]


def _learned(choice: Coefficients) -> list[Item]:
    distance_tolerance, time_tolerance = TOLERANCES["learned"]
    found = plans(choice, "learned")
    rounds = [plan.iterations for plan in found]
    harder = rounds == sorted(rounds)
    result = []
    for (distance, time, printed), plan in zip(GOALS, found, strict=True):
        goal = f"{NAME} {distance:g} m, {time:g} s learning loop"
        met: Verdict = "shape reproduced" if plan.status == "met" and harder else "not reachable"
        first = plan.history[0]
        why = (
            f"met to {distance_tolerance:g} m and {time_tolerance:g} s, "
            f"{'more' if harder else 'not more'} rounds for farther goals; first errors "
            f"{first.distance_error:.2f} m, {first.time_error:.3f} s"
        )
        source = f"Figs. 13-14: command += error, from Eqs. (24)-(25), {choice.name}, no lift"
        result += [
            Item(f"{goal} rounds", printed, plan.iterations, "1", met, why, source),
            Item(f"{goal} distance", distance, distance - plan.best.distance_error, "m",
                 met, why, source),
            Item(f"{goal} time", time, time - plan.best.time_error, "s", met, why, source),
        ]  # fmt: skip
    return result


def draw(figure: Figure) -> None:
    """Draw the histories of the errors of distance and time, learning loop and planner."""
    rows = figure.subplots(2, len(GOALS), sharex="col")
    for column, (distance, time, _) in enumerate(GOALS):
        methods: tuple[tuple[Method, str], ...] = (("learned", "o-"), ("newton", "s--"))
        for method, style in methods:
            plan = plans(DEFAULT, method)[column]
            errors = np.array([[r.distance_error, r.time_error] for r in plan.history])
            for row in range(2):
                rows[row, column].plot(errors[:, row], style, markersize=3, label=method)
        rows[0, column].set_title(f"{distance:g} m, {time:g} s")
        rows[1, column].set_xlabel("round")
    rows[0, 0].set_ylabel("error of distance [m]")
    rows[1, 0].set_ylabel("error of time [s]")
    rows[0, 0].legend()
