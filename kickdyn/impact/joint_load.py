"""The load of each joint in an impact: on its structure, along its axis, and its peak."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from kickdyn.core import validation
from kickdyn.core.representation import ROUNDING, ReprMixin, Row, format_value
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.hertz import SHORTEST_CONTACT
from kickdyn.impact.impact_result import Impact


@dataclass(frozen=True, eq=False, repr=False)
class JointLoad(ReprMixin):
    """The load of one joint; impulses by the parent on the child, about its origin in its axes.

    Attributes:
        joint: its name.
        structure: on bearings and links, linear then angular, shape `(6,)` [N s, N m s].
        axis: along the joint's degrees of freedom, shape `(6,)` [N s, N m s]: 0 in a passive joint
            but for the inertia of its rotor.
        peak_force: of the linear part of both [N]; None without a contact time.
        peak_moment: of the angular part of both [N m]; None without a contact time.
        ratio: peak force over the force limit; None without one.
    """

    joint: str
    structure: Array
    axis: Array
    peak_force: float | None
    peak_moment: float | None
    ratio: float | None

    def __repr__(self) -> str:
        """Return the load in a line."""
        return f"JointLoad({self.joint}: {self.line()})"

    def line(self) -> str:
        """Return the sizes of the linear parts: on the structure, along the axis, and the peak."""
        structure, along = (float(np.linalg.norm(part[:3])) for part in (self.structure, self.axis))
        parts = [f"{format_value(structure)} N s"]
        if along > ROUNDING * structure:
            parts.append(f"{format_value(along)} N s along the axis")
        if self.peak_force is not None:
            parts.append(f"peak {format_value(self.peak_force)} N")
        if self.ratio is not None:
            parts.append(f"{100 * self.ratio:.3g} % of the limit")
        return ", ".join(parts)

    def _rows(self) -> Iterable[Row]:
        whole = float(np.linalg.norm(self.structure + self.axis))
        yield "joint", self.joint, ""
        for name, part in (("structure", self.structure), ("axis", self.axis)):
            clean = np.where(abs(part) > ROUNDING * whole, part, 0.0)
            yield f"{name}, linear", clean[:3], "N s"
            yield f"{name}, angular", clean[3:], "N m s"
        for name, value, unit in (
            ("peak force", self.peak_force, "N"),
            ("peak moment", self.peak_moment, "N m"),
            ("peak force over limit", self.ratio, ""),
        ):
            if value is not None:
                yield name, value if value > ROUNDING * (self.peak_force or 0.0) else 0.0, unit


class JointLoads(ReprMixin, dict[str, JointLoad]):
    """The loads of all joints by name, in the model's order: a dictionary with a table."""

    def _rows(self) -> Iterable[Row]:
        for name, load in self.items():
            yield name, load.line(), ""


def joint_loads(
    impact: Impact,
    contact_time: float | None = None,
    force_limits: Mapping[str, float] | None = None,
) -> JointLoads:
    r"""Return the load of every joint by name, in the model's order.

    Args:
        impact: of any law.
        contact_time: T [s]; with it, the peak of a half-sine pulse is estimated for each joint,
            :math:`\frac{\pi}{2} p / T`. This assumes that all joints feel the pulse at once, as
            rigid bodies do, and that the contact force rises and falls like a spring's.
        force_limits: joint name to the largest permissible force [N], above 0.

    Raises:
        InvalidInput: a contact time below 1e-9 s, a limit that is not above 0, limits without a
            contact time, or no such joint.
    """
    validation.check_type(Impact, impact=impact)
    leg, sharpness = impact.posture.leg, None
    limits = validation.mapping("force limits", force_limits)
    if contact_time is not None:
        time = validation.number("contact time", contact_time, at_least=SHORTEST_CONTACT, unit="s")
        sharpness = math.pi / 2 / time
    elif limits:
        raise InvalidInput("force limits need a contact time: without one there is no force")
    for name, limit in limits.items():
        if name not in leg.joint_names:
            known = ", ".join(leg.joint_names)
            raise InvalidInput(f"joint {name!r} is unknown: {leg.name} has {known}")
        limits[name] = validation.number(f"force limit of {name}", limit, above=0, unit="N")
    space, loads = leg.workspace, JointLoads()
    pin.forwardKinematics(space.model, space.data, impact.posture.q)  # joint axes may depend on q
    for number, (name, impulse) in enumerate(
        zip(leg.joint_names, impact.joint_impulses, strict=True), start=1
    ):
        freedom = np.array(space.data.joints[number].S).reshape(6, -1)
        axis = freedom @ np.linalg.lstsq(freedom, impulse, rcond=None)[0]
        force, moment = (
            None if sharpness is None else sharpness * float(np.linalg.norm(part))
            for part in (impulse[:3], impulse[3:])
        )
        ratio = force / limits[name] if force is not None and name in limits else None
        loads[name] = JointLoad(name, impulse - axis, axis, force, moment, ratio)
    return loads
