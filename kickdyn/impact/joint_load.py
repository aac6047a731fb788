"""What an impact asks of each joint: carried by its structure, along its axis, and the peak."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from kickdyn import checks
from kickdyn.checks import Array
from kickdyn.errors import InvalidInput
from kickdyn.impact.hertz import BRIEFEST
from kickdyn.impact.result import Impact


@dataclass(frozen=True, eq=False)
class JointLoad:
    """Of one joint; impulses by the parent on the child, about its origin and in its axes.

    Attributes:
        joint: its name.
        structure: what bearings and links carry, linear then angular, shape `(6,)` [N s, N m s].
        axis: what acts along the joint's freedom, shape `(6,)` [N s, N m s]: nothing in a joint
            that gives way, but for the inertia of its rotor.
        peak_force: of the linear part of both [N]; None without a contact time.
        peak_moment: of the angular part of both [N m]; None without a contact time.
        ratio: peak force over the limit given; None without one.
    """

    joint: str
    structure: Array
    axis: Array
    peak_force: float | None
    peak_moment: float | None
    ratio: float | None


def joint_loads(
    hit: Impact,
    contact_time: float | None = None,
    force_limits: Mapping[str, float] | None = None,
) -> dict[str, JointLoad]:
    """Return the load of every joint by name, in the model's order.

    Args:
        hit: any strike.
        contact_time: how long foot and ball touch [s]; with it, peaks are estimated as those of a
            half-sine pulse, pi/2 times impulse over time. That takes all joints to feel the pulse
            at once, as rigid bodies do, and the contact's force to rise and fall like a spring's.
        force_limits: joint name to the largest force it bears [N], above 0.

    Raises:
        InvalidInput: a contact time below 1e-9 s, a limit that is not above 0, limits without a
            contact time, or no such joint.
    """
    checks.made_of(Impact, hit=hit)
    leg, sharpness = hit.posture.leg, None
    limits = checks.mapping("force limits", force_limits)
    if contact_time is not None:
        time = checks.number("contact time", contact_time, at_least=BRIEFEST, unit="s")
        sharpness = math.pi / 2 / time
    elif limits:
        raise InvalidInput("force limits need a contact time: without one there is no force")
    for name, limit in limits.items():
        if name not in leg.joint_names:
            known = ", ".join(leg.joint_names)
            raise InvalidInput(f"joint {name!r} is unknown: {leg.name} has {known}")
        limits[name] = checks.number(f"force limit of {name}", limit, above=0, unit="N")
    space, loads = leg.workspace, {}
    pin.forwardKinematics(space.model, space.data, hit.posture.q)  # a freedom may depend on q
    for number, (name, impulse) in enumerate(
        zip(leg.joint_names, hit.joint_impulses, strict=True), start=1
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
