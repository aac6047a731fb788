"""How much of a flight lies outside what its coefficients are meant for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kickdyn.aerodynamics.coefficient_model import CoefficientModel
from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.core.validation import Array

if TYPE_CHECKING:
    from kickdyn.flight.flight_result import Flight


ROUNDING = 1e-9
"""Spin over speed below which a ball does not spin: a planned kick leaves what rounding leaves."""


def outside(path: Flight) -> list[tuple[CoefficientModel, float]]:
    """Return each coefficient model with the share of the flight outside its range."""
    if path.air is None or path.evaluations == 0:
        return []
    states = path.sample(np.linspace(0.0, path.duration, 101))
    found = left_by(states.position[:, 2], states.velocity, states.spin, path.ball, path.air)
    return [(model, float(left.mean())) for model, left in found]


def left_by(
    height: Array, velocity: Array, spin: Array, ball: Ball, air: Air
) -> list[tuple[CoefficientModel, NDArray[np.bool_]]]:
    """Return each model of drag and lift, and which of many states lie outside its range.

    Those of the torque are not judged: nobody measured it for soccer balls at any speed.
    """
    wind: Array = np.asarray(air.wind if not callable(air.wind) else 0.0)
    if callable(air.wind):
        wind = np.array([air.wind_at(z) for z in height.tolist()])
    through = velocity - wind
    square = np.maximum(np.einsum("ij,ij->i", through, through), 1e-300)
    along = np.einsum("ij,ij->i", through, spin)
    whole = np.einsum("ij,ij->i", spin, spin)
    across = np.sqrt(np.maximum(whole - along * along / square, 0.0))
    speed = np.sqrt(square)
    reynolds = 2 * ball.radius * air.density / air.viscosity * speed
    spin_parameter = ball.radius * across / speed
    spins = ball.radius * np.sqrt(whole) > ROUNDING * speed
    return [
        (model, (spins | (model is air.drag)) & model.is_outside(reynolds, spin_parameter))
        for model in (air.drag, air.lift)
        if isinstance(model, CoefficientModel)
    ]


def said(model: CoefficientModel, share: float) -> str:
    """Return a line that says so."""
    return (
        f"{model.kind} {model.name}: {100 * share:.0f} % of the flight is outside Re "
        f"{model.reynolds[0]:.2g} to {model.reynolds[1]:.2g} and spin parameter "
        f"{model.spin[0]:g} to {model.spin[1]:g}"
    )
