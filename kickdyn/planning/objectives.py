"""What a kick can make least, by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from kickdyn.air import Air
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import NoImpact
from kickdyn.impact.joint_impulses import joint_impulses
from kickdyn.impact.strike import strike
from kickdyn.planning.equations import Equations, Objective
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.launch import Launch
from kickdyn.planning.scatter import checked_spread, landing_slopes, of_launch
from kickdyn.robot.leg import Posture

SMOOTH = 12
"""Power of the norm that stands for the largest of several, within 10 % for six joints' worth."""


def _joint_speed(search: Equations, impact_target: ImpactTarget) -> Objective:
    def mean(posture: Posture, v: Array) -> float:
        return float(np.mean((v[search.vs] / search.speed) ** 2))

    def slope(posture: Posture, v: Array) -> tuple[Array, Array]:
        return np.zeros_like(v), search.whole(2 * v[search.vs] / search.speed**2 / search.n)

    return Objective(mean, slope)


def _effort(search: Equations, impact_target: ImpactTarget) -> Objective:
    def slope(posture: Posture, v: Array) -> tuple[Array, Array]:
        space = posture.leg.workspace
        momentum_q = pin.computeRNEADerivatives(space.model, space.data, posture.q, space.still, v)
        by_q = np.reshape(momentum_q[0], (len(v), -1))  # without gravity and speed: of M v
        return 0.5 * v @ by_q, posture.inertia @ v

    return Objective(lambda posture, v: 0.5 * float(v @ posture.inertia @ v), slope)


def _foot_speed(search: Equations, impact_target: ImpactTarget) -> Objective:
    return Objective(lambda posture, v: float(np.linalg.norm(posture.jacobian @ v)))


def _most_joint_impulse(search: Equations, impact_target: ImpactTarget) -> Objective:
    return replace(_joint_impulse(search, impact_target), sign=-1.0)


def _joint_impulse(search: Equations, impact_target: ImpactTarget) -> Objective:
    def worst(posture: Posture, v: Array) -> float:
        jump, held = posture.respond(-impact_target.impulse.dot(posture.jacobian))
        through, _ = joint_impulses(posture, jump, -impact_target.impulse, held)
        sizes = np.linalg.norm(through[:, :3], axis=1)
        top = float(sizes.max())
        return top * math.pow(float(np.sum((sizes / top) ** SMOOTH)), 1 / SMOOTH)

    # Pinocchio has no derivatives of what joints transmit
    return Objective(worst, by_velocity=False)


def least_scatter(
    impact_target: ImpactTarget, launch: Launch, air: Air | None, spread: Mapping[str, float]
) -> Objective:
    """Return the root mean square error of the landing, for standard deviations by source."""
    sizes = checked_spread(spread)
    _, slopes = landing_slopes(launch.state, impact_target.ball, air)  # the launch stays

    def radius(posture: Posture, v: Array) -> float:
        plain = Contact(
            impact_target.contact.normal,
            impact_target.contact.restitution,
            impact_target.contact.friction,
        )
        try:
            hit = strike(posture, v, impact_target.ball, plain)
        except NoImpact:  # far from feasible
            return NEVER
        parts = of_launch(hit, slopes, sizes)
        return math.sqrt(sum(float(np.trace(part)) for part in parts.values()))

    return Objective(radius)


NEVER = 1e6
"""Scatter of a foot that does not meet the ball [m]."""

OBJECTIVES: dict[str, Callable[[Equations, ImpactTarget], Objective]] = {
    "joint speed": _joint_speed,
    "joint impulse": _joint_impulse,
    "effort": _effort,
    "foot speed": _foot_speed,
    "most joint impulse": _most_joint_impulse,
}
"""What can be made least, or most where the name says so; `scatter` besides."""

UNITS = {"joint impulse": "N s", "most joint impulse": "N s", "effort": "J", "foot speed": "m/s",
         "scatter": "m"}  # fmt: skip
"""Of their values; `joint speed` has none."""

SAID = {"effort": "effort (kinetic energy)"}
"""What is shown of those whose name alone may mean another thing."""
