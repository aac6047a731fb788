"""How much of a flight lies outside what its coefficients are meant for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kickdyn import checks
from kickdyn.aerodynamics.model import CoefficientModel

if TYPE_CHECKING:
    from kickdyn.flight.path import Flight


def outside(path: Flight) -> list[tuple[CoefficientModel, float]]:
    """Return each coefficient model with the share of the flight outside its range."""
    air = path.air
    if air is None or path.evaluations == 0:
        return []
    times = np.linspace(0.0, path.duration, 101)
    states = path.sample(times)
    wind = np.array([air.wind_at(height) for height in states.position[:, 2].tolist()])
    through = states.velocity - wind
    speed = np.maximum(checks.length(through), 1e-300)
    reynolds = 2 * path.ball.radius * air.density * speed / air.viscosity
    across = checks.length(np.cross(states.spin, through / speed[:, None]))
    spin_parameter = path.ball.radius * across / speed
    used = [air.drag, air.lift, air.torque] if path.launch.spin.any() else [air.drag]
    met = list(zip(reynolds.tolist(), spin_parameter.tolist(), strict=True))
    return [
        (model, sum(model.range_left(*pair) for pair in met) / len(met))
        for model in used
        if isinstance(model, CoefficientModel)
    ]


def said(model: CoefficientModel, share: float) -> str:
    """Return a line that says so."""
    return (
        f"{model.kind} {model.name}: {100 * share:.0f} % of the flight is outside Re "
        f"{model.reynolds[0]:.2g} to {model.reynolds[1]:.2g} and spin parameter "
        f"{model.spin[0]:g} to {model.spin[1]:g}"
    )
