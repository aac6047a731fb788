"""The load of each joint in an impact: on its structure, along its axis, and its peak."""

import math
from dataclasses import dataclass

import numpy as np

from kickdyn.core import validation
from kickdyn.core.representation import ROUNDING, Printed, format_value
from kickdyn.core.validation import Array
from kickdyn.impact.force_model import LONGEST_CONTACT, SHORTEST_CONTACT
from kickdyn.impact.impact_result import Impact
from kickdyn.impact.leg_response import axis_projectors


@dataclass(frozen=True, eq=False, repr=False)
class JointLoad(Printed):
    """The load of one joint: the impulses of its parent on its child, about its origin in its axes.

    Attributes:
        joint: name of the joint.
        structure: part of the impulse that bearings and links transmit, linear then angular, shape
            `(6,)` [N s, N m s].
        axis: part of the impulse along the degrees of freedom of the joint, shape `(6,)`
            [N s, N m s]. It is 0 in a passive joint but for the inertia of its rotor; in a stiff
            joint it is the impulse of its motor.
        peak_force: peak force of both parts together [N]; None without a contact time.
        peak_moment: peak moment of both parts together [N m]; None without a contact time.
    """

    joint: str
    structure: Array
    axis: Array
    peak_force: float | None
    peak_moment: float | None

    def __str__(self) -> str:
        """Return the linear parts in a line: on the structure, along the axis, and the peak."""
        structure, along = (np.linalg.norm(load[:3]) for load in (self.structure, self.axis))
        axis = f", {format_value(along)} N s along the axis" if along > ROUNDING * structure else ""
        peak = "" if self.peak_force is None else f", peak {format_value(self.peak_force)} N"
        return f"JointLoad({self.joint}: {format_value(float(structure))} N s{axis}{peak})"


@validation.check_arguments
def joint_loads(impact: Impact, contact_time: float | None = None) -> dict[str, JointLoad]:
    r"""Return the load of every joint by name, in the model's order.

    Args:
        impact: an impact by any law.
        contact_time: T [s], 1e-9 to 0.1. With it, the peak of a half-sine pulse is estimated for
            each joint, :math:`\frac{\pi}{2} p / T`. This assumes that all joints feel the pulse at
            once, as rigid bodies do, and that the contact force rises and falls like the force of a
            spring. None estimates no peaks.

    Raises:
        InvalidInput: no impact, or a contact time outside 1e-9 to 0.1 s.

    Example:
        >>> import kickdyn as kd
        >>> posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
        >>> contact = kd.Contact(normal=(2, 0, 1), restitution=0.8)
        >>> impact = kd.strike(posture, [6.6, -14.5, 6.6], kd.Ball(), contact)
        >>> loads = kd.joint_loads(impact, contact_time=0.01)
        >>> round(loads["knee"].peak_force)  # [N]
        389
    """
    per_time = None
    if contact_time is not None:
        time = validation.number(
            "contact time", contact_time,
            at_least=SHORTEST_CONTACT, at_most=LONGEST_CONTACT, unit="s",
        )  # fmt: skip
        per_time = math.pi / 2 / time
    leg, loads = impact.posture.leg, {}
    for name, impulse, projector in zip(
        leg.joint_names, impact.joint_impulses, axis_projectors(impact.posture), strict=True
    ):
        along = projector @ impulse
        force, moment = (
            None if per_time is None else per_time * float(np.linalg.norm(vector))
            for vector in (impulse[:3], impulse[3:])
        )
        loads[name] = JointLoad(name, impulse - along, along, force, moment)
    return loads
