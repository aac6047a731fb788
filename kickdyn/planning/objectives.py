"""Objectives of a kick: what its posture and joint velocity make least, or most."""

import math
from enum import StrEnum
from typing import Self

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.impact.leg_response import joint_impulses
from kickdyn.planning.kick_terms import KickPoint, Objective
from kickdyn.planning.problem import Function, Kind


class JointSpeed(Objective):
    """Mean square of the joints' speeds over their limits."""

    def quantity(self, point: KickPoint) -> float:
        variables = point.variables
        return float(np.mean((point.v[variables.vs] / variables.velocity_scale) ** 2))

    def slope(self, point: KickPoint) -> Array:
        slope, n = np.zeros((1, len(point.x))), point.variables.n
        slope[0, n:-1] = 2.0 / n * point.x[n:-1]
        return slope


class KineticEnergy(Objective):
    """Kinetic energy of the leg."""

    def quantity(self, point: KickPoint) -> float:
        return 0.5 * float(point.v @ point.posture.inertia @ point.v)


class FootSpeed(Objective):
    """Speed of the contact point."""

    def quantity(self, point: KickPoint) -> float:
        return math.hypot(*point.posture.point_velocity(point.v))


class JointImpulse(Objective):
    """Largest linear impulse that a joint transmits, smoothed."""

    def quantity(self, point: KickPoint) -> float:
        posture, impulse = point.posture, point.variables.target.impulse
        jump, of_constraints = posture.respond(-impulse @ posture.jacobian)
        transmitted, _ = joint_impulses(posture, jump, -impulse, of_constraints)
        sizes = np.linalg.norm(transmitted[:, :3], axis=1)
        largest = float(sizes.max())
        # the norm of power 12 is the largest within 10 % for six joints
        return largest * math.pow(float(np.sum((sizes / largest) ** 12)), 1 / 12)


class MostJointImpulse(JointImpulse):
    """The same, as large as possible."""

    maximized = True


class LargestShare(Function[KickPoint]):
    """The share of the foot velocity that is reached, as large as possible."""

    kind = Kind.OBJECTIVE

    def value(self, point: KickPoint) -> Array:
        return np.array([-point.share])

    def slope(self, point: KickPoint) -> Array:
        slope = np.zeros((1, len(point.x)))
        slope[0, -1] = -1.0
        return slope


class KickObjective(StrEnum):
    r"""What a kick makes least, or most where the name says so: name, unit and term.

    With speed limits :math:`v_{max}`, inertia matrix :math:`M`, foot Jacobian :math:`J` and the
    linear impulses :math:`p_i` that the joints transmit:

    Attributes:
        unit: unit of the quantity, or words where it has none.
        term: class of its term; None for an objective of a motion.
    """

    unit: str
    term: type[Objective] | None

    def __new__(cls, name: str, unit: str, term: type[Objective] | None) -> Self:
        objective = str.__new__(cls, name)
        objective._value_, objective.unit, objective.term = name, unit, term
        return objective

    JOINT_SPEED = "joint-speed", "(mean square of the joint speeds over their limits)", JointSpeed
    r""":math:`\frac1n \sum_i (v_i / v_{max,i})^2`."""
    JOINT_IMPULSE = "joint-impulse", "N s", JointImpulse
    r""":math:`\max_i |p_i|` [N s]."""
    KINETIC_ENERGY = "kinetic-energy", "J", KineticEnergy
    r""":math:`\frac12 v^T M v` [J], which the swing must build up."""
    FOOT_SPEED = "foot-speed", "m/s", FootSpeed
    r"""Speed of the foot [m/s]: the posture that makes the most impulse of it."""
    MOST_JOINT_IMPULSE = "most-joint-impulse", "N s", MostJointImpulse
    TORQUE_SQUARED = "torque-squared", "s", None
    r""":math:`\int \frac1n \sum_i (\tau_i / \tau_{max,i})^2 dt` [s], of a motion."""


OBJECTIVES = {objective: objective.term for objective in KickObjective if objective.term}
"""The terms of the objectives of a posture."""
