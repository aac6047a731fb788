"""The objectives of a kick: functions of posture and joint velocity to be least, or most."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import pinocchio as pin

from kickdyn.air import Air
from kickdyn.contact import Contact
from kickdyn.core.validation import Array
from kickdyn.errors import NoImpact
from kickdyn.impact.leg_response import joint_impulses
from kickdyn.impact.strike import strike
from kickdyn.planning.impact_target import ImpactTarget
from kickdyn.planning.launch import Launch
from kickdyn.planning.scatter import checked_spread, landing_slopes, launch_covariances
from kickdyn.robot.leg import Posture


class KickObjective(StrEnum):
    r"""What a kick makes least, or most where the name says so.

    With speed limits :math:`v_{max}`, inertia matrix :math:`M`, foot Jacobian :math:`J` and the
    linear impulses :math:`p_i` that the joints transmit:
    """

    JOINT_SPEED = "joint-speed"
    r""":math:`\frac1n \sum_i (v_i / v_{max,i})^2`."""
    JOINT_IMPULSE = "joint-impulse"
    r""":math:`\max_i |p_i|` [N s]."""
    KINETIC_ENERGY = "kinetic-energy"
    r""":math:`\frac12 v^T M v` [J], which the swing must build up."""
    FOOT_SPEED = "foot-speed"
    r""":math:`|J v|` [m/s]: the posture that makes the most impulse of it."""
    MOST_JOINT_IMPULSE = "most-joint-impulse"
    SCATTER = "scatter"
    """Root mean square error of the landing [m], for errors of given spread."""

    @property
    def unit(self) -> str:
        """Unit of the value; `joint-speed` has none."""
        return {
            "joint-impulse": "N s",
            "most-joint-impulse": "N s",
            "kinetic-energy": "J",
            "foot-speed": "m/s",
            "scatter": "m",
        }.get(self.value, "")


@dataclass(frozen=True)
class Cost:
    """A function of posture and joint velocity, to be least.

    Attributes:
        value: the function.
        slope: its derivatives by q and by v, shape `(nv,)` each; None leaves them to differences.
        by_velocity: whether it depends on the joint velocity.
        sign: -1 for what shall be most.
    """

    value: Callable[[Posture, Array], float]
    slope: Callable[[Posture, Array], tuple[Array, Array]] | None = None
    by_velocity: bool = True
    sign: float = 1.0

    def __call__(self, posture: Posture, v: Array) -> float:
        """Return the value."""
        return self.value(posture, v)


def make_cost(objective: KickObjective, velocity_scale: Array, impulse: Array) -> Cost:
    """Return the cost of an objective other than `scatter`.

    Args:
        objective: by name.
        velocity_scale: limits that `joint-speed` counts in, inf for joints that do not count, shape
            `(nv,)` [rad/s].
        impulse: on the ball, shape `(3,)` [N s].
    """
    if objective == KickObjective.JOINT_SPEED:
        return _joint_speed(velocity_scale)
    if objective == KickObjective.KINETIC_ENERGY:
        return _kinetic_energy()
    if objective == KickObjective.FOOT_SPEED:
        return Cost(lambda posture, v: float(np.linalg.norm(posture.jacobian @ v)))
    cost = _joint_impulse(impulse)
    return replace(cost, sign=-1.0) if objective == KickObjective.MOST_JOINT_IMPULSE else cost


def scatter_cost(
    target: ImpactTarget, launch: Launch, air: Air | None, spread: Mapping[str, float]
) -> Cost:
    """Return the root mean square error of the landing [m], for standard deviations by source."""
    sizes = checked_spread(spread)
    _, slopes = landing_slopes(launch.state, target.ball, air)  # the launch stays
    contact = target.contact
    plain = Contact(contact.normal, contact.restitution, contact.friction)

    def radius(posture: Posture, v: Array) -> float:
        try:
            impact = strike(posture, v, target.ball, plain)
        except NoImpact:  # far from feasible
            return 1e6
        covariances = launch_covariances(impact, slopes, sizes)
        return math.sqrt(sum(float(np.trace(part)) for part in covariances.values()))

    return Cost(radius)


def _joint_speed(scale: Array) -> Cost:
    """Return the mean square of the joint speeds over their limits."""
    n = int(np.isfinite(scale).sum())

    def slope(posture: Posture, v: Array) -> tuple[Array, Array]:
        return np.zeros_like(v), 2 * v / scale**2 / n

    return Cost(lambda posture, v: float(np.sum((v / scale) ** 2)) / n, slope)


def _kinetic_energy() -> Cost:
    """Return the leg's kinetic energy [J]."""

    def slope(posture: Posture, v: Array) -> tuple[Array, Array]:
        space, still = posture.leg.workspace, np.zeros_like(v)
        # at rest and with the acceleration v, less gravity: the derivative of M v by q
        derivatives = pin.computeRNEADerivatives(space.model, space.data, posture.q, still, v)
        return 0.5 * v @ np.reshape(derivatives[0], (len(v), -1)), posture.inertia @ v

    return Cost(lambda posture, v: 0.5 * float(v @ posture.inertia @ v), slope)


def _joint_impulse(impulse: Array) -> Cost:
    """Return the largest linear impulse in a joint [N s], smoothed; it has no derivatives."""

    def largest(posture: Posture, v: Array) -> float:
        jump, of_constraints = posture.respond(-impulse @ posture.jacobian)
        transmitted, _ = joint_impulses(posture, jump, -impulse, of_constraints)
        sizes = np.linalg.norm(transmitted[:, :3], axis=1)
        top = float(sizes.max())
        # the norm of power 12 is the largest within 10 % for six joints
        return top * math.pow(float(np.sum((sizes / top) ** 12)), 1 / 12)

    return Cost(largest, by_velocity=False)
