"""The limits that a recorded motion breaks, by the limits that planned motions keep."""

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.motion.limits import (
    LEAST_PRESSURE,
    Friction,
    Limit,
    Pressure,
    PressureCentre,
    RangeLimit,
    Sample,
    SpeedLimit,
    TorqueLimit,
    Twist,
    with_unit,
)
from kickdyn.motion.motion_file import ranges_of
from kickdyn.motion.recorded_motion import GroundForces, RecordedMotion, moved
from kickdyn.robot.collisions import find_self_collisions
from kickdyn.robot.ground_clearance import TOLERANCE, find_depths
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import Foot, is_floating

ROUNDED = 1e-6
"""Margin below 0 that rounding in a file explains."""


FLOATS = "the sole of the foot that stands is above the ground"


class BrokenLimit(NamedTuple):
    """A limit that a motion breaks.

    Attributes:
        name: of the limit.
        frames: number of frames in which it is broken.
        time: at which it is broken most [s].
        amount: by how much then, in `unit`.
        unit: `m`, `rad`, or `1` for a share of the limit.
        sentence: all this in words.
    """

    name: str
    frames: int
    time: float
    amount: float
    unit: str
    sentence: str


class _Margins:
    """Margins of a motion over its frames, and the limits with their names."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.values: dict[str, Array] = {}
        self.limits: dict[str, tuple[Limit | None, str]] = {}

    def add(self, limit: Limit, row: int, sample: Sample) -> None:
        """Add the margins of a limit in a frame."""
        numbers = np.asarray(ca.DM(limit.margins(sample))).ravel().tolist()
        for label, value in zip(limit.labels, numbers, strict=True):
            self.put(label, with_unit(label, limit), row, value, limit)

    def put(self, label: str, name: str, row: int, value: float, limit: Limit | None) -> None:
        """Add a margin, of which the least of a name counts."""
        values = self.values.setdefault(name, np.full(self.count, np.nan))
        self.limits[name] = limit, label
        values[row] = np.fmin(values[row], value)

    def broken(self, t: Array) -> Iterator[BrokenLimit]:
        """Yield the limits that are broken."""
        for name, values in self.values.items():
            limit, label = self.limits[name]
            frames = int((values < -ROUNDED).sum())
            if not frames:
                continue
            worst = int(np.nanargmin(values))
            amount, unit = -float(values[worst]), "m" if limit is None else limit.unit or "1"
            said = f"{label} by {1e3 * amount:.1f} mm" if limit is None else ""
            said = said or (limit.breach(label, -amount) if limit else "")
            yield BrokenLimit(
                label, frames, float(t[worst]), amount, unit,
                f"{said}, at {t[worst]:.4g} s, and in {frames} of {self.count} frames",
            )  # fmt: skip


def margins_of(
    motion: RecordedMotion, robot: Leg, forces: GroundForces, ground: float, friction: float
) -> tuple[dict[str, Array], tuple[BrokenLimit, ...]]:
    """Return margins over the frames by name, nan where none apply, and the limits that are broken.

    Joints keep `TorqueLimit`, `SpeedLimit` and `RangeLimit`; the ground `Pressure`, `Friction`,
    `PressureCentre` and `Twist`, on the hull of all soles that stand; bodies are not under the
    ground (`find_depths`) nor inside each other (`find_self_collisions`).

    Args:
        motion: with q, v and a.
        robot: that moves.
        forces: of the motion.
        ground: height of the ground [m].
        friction: Coulomb's coefficient of the ground.
    """
    names = robot.single_joints
    columns = [robot.velocity_index(name) for name in names]
    effort, speed = (
        np.where(limit > 0.0, limit, math.inf)[columns]
        for limit in (robot.effort_limit, robot.velocity_limit)
    )
    ranges = ranges_of(robot, names).T
    of_joints = [
        TorqueLimit(names, effort), SpeedLimit(names, speed), RangeLimit(names, *ranges),
    ]  # fmt: skip
    weight = GRAVITY * pin.computeTotalMass(robot.workspace.model)
    margins = _Margins(len(motion.t))
    for row, (q, v) in enumerate(zip(motion.q, motion.v, strict=True)):
        values = robot.joint_values(q)
        tree = SimpleNamespace(q=ca.DM(list(values.values())), v=ca.DM(v[columns]))
        torque = ca.DM(forces.torque[row, columns])
        sample, stands = Sample(tree, torque, None, weight), forces.stands[row].any()
        for limit in of_joints if stands or not is_floating(robot) else of_joints[1:]:
            margins.add(limit, row, sample)
        if stands:
            _add_ground(margins, row, forces, (weight, friction, ground))
        for frame, depth in find_depths(robot, q, ground).items():
            label = f"{frame} is under the ground"
            margins.put(label, f"{label} [m]", row, -depth, None)
        for (first, second), depth in find_self_collisions(robot, q).items():
            label = f"{first} is inside {second}"
            margins.put(label, f"{label} [m]", row, -depth, None)
    return margins.values, tuple(margins.broken(motion.t))


def _add_ground(
    margins: _Margins, row: int, forces: GroundForces, given: tuple[float, float, float]
) -> None:
    """Add the margins of the ground's wrench on the feet that stand in a frame.

    `given` are the robot's weight [N], the coefficient of friction and the ground's height [m].
    """
    weight, friction, ground = given
    corners = np.vstack([
        sole[row] for sole, stands in zip(forces.soles, forces.stands[row], strict=True) if stands
    ])  # fmt: skip
    if (height := float(corners[:, 2].min()) - ground) > TOLERANCE:
        margins.put(FLOATS, f"{FLOATS} [m]", row, -height, None)
    wrench = moved(forces.wrench[row], float(corners[:, 2].mean()))
    sample = Sample(None, None, ca.DM(wrench), weight)
    pressure, feet = Pressure(0.0), Foot("", None, corners[:, :2])
    margins.add(pressure, row, sample)
    if wrench[2] > LEAST_PRESSURE * weight:  # the other limits are divided by it
        for limit in (Friction(friction), PressureCentre(feet), Twist(feet, friction)):
            margins.add(limit, row, sample)
