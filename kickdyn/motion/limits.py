r"""What a robot must keep in the motion of a kick: one class for each limit.

A limit gives rows of CasADi's symbols at a sample of the motion, each at least 0 where it is kept.
The solver takes these rows at its points, and the same rows are evaluated between them, for the
margins of a motion and for the sentences about limits that it breaks.

On a supporting foot, the wrench of the ground has the force f and the moment m about the world's
origin, and the sole is level at :math:`z = 0`. Its limits are

.. math::
    \mu f_z \ge |f_t|, \quad d_i f_z \ge n_i \cdot (-m_y, m_x), \quad
    \mu r f_z \ge |m_z - (c_x f_y - c_y f_x)|

with the edges :math:`n_i \cdot x \le d_i` of the sole, its centre c and the arm r of its friction.
They hold for the impulse of the ground in the impact too.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from kickdyn.core.mechanics import GRAVITY
from kickdyn.core.validation import Array
from kickdyn.motion.motion_file import ranges_of
from kickdyn.motion.motion_record import GroundForces, RecordedMotion, moved
from kickdyn.robot.collisions import find_self_collisions
from kickdyn.robot.ground_clearance import TOLERANCE, Spheres, find_depths
from kickdyn.robot.human_body import muscle_share
from kickdyn.robot.leg import Leg
from kickdyn.robot.standing import Foot, StandingRobot, is_floating, sole_edges

FRICTION = 0.7
"""Coefficient of friction of a support that names none: rubber on a hall's floor or short turf."""

FACETS = 8
"""Facets of the pyramid inside the friction cone: the cone's slope does not exist at its tip."""

LENGTH = 0.05
"""Length over which moments are scaled to forces [m]: about half a sole."""

LEAST_PRESSURE, LEAST_IMPULSE = 0.05, 0.005
"""Least force of the ground on the supporting foot, over the robot's weight, and its impulse in the
impact, over the ball's."""

INSIDE = 3e-3
"""Distance of the centre of pressure from the edge of the sole, at least, but in the impact [m]."""

LARGEST_TILT = math.radians(40)
"""Largest angle between the trunk and its direction in the robot that stands upright [rad]."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A moment of the motion, or the impact, in CasADi's symbols or numbers."""

    tree: Any  # its kinematics, a `SymbolicTree`; limits of joints need its q and v only
    torque: Any  # of the joints, shape `(n,)` [N m; N]
    # of the ground on the root, force, then moment about the world's origin, `(6,)` [N, N m]; in
    # the impact, its impulse [N s, N m s]
    wrench: Any
    size: float  # of a large force or impulse [N or N s]
    resting: Any = None  # torques of the joints at rest, shape `(k,)` [N m; N]


def when(time: float) -> str:
    """Return a time from the impact on in words [s]."""
    return f"{1e3 * abs(time):.0f} ms {'before' if time < 0.0 else 'after'} the impact"


class Limit(ABC):
    """A limit of the motion."""

    labels: Sequence[str]  # a name for each row, for sentences
    unit: str = ""  # of the margins: `m`, `rad` or nothing for a share of the limit
    reserve: float = 0.0  # margin that the solver keeps at its points, for the times between them
    # whether the coefficients of the splines keep it at all times, so that the solver needs no
    # rows at its points
    by_splines: bool = False

    @property
    def names(self) -> list[str]:
        """The labels with the unit, if margins are no shares of the limit."""
        return [f"{label} [{self.unit}]" if self.unit else label for label in self.labels]

    @abstractmethod
    def margins(self, sample: Sample) -> Any:
        """Return the distance from the limit, shape `(k,)`."""

    def rows(self, sample: Sample) -> tuple[Any, float, float]:
        """Return rows of the solver, shape `(k,)`, and the bounds of all of them."""
        return self.margins(sample), self.reserve, math.inf

    def breach(self, label: str, margin: float) -> str:
        """Return a sentence about a row whose margin is below 0, without the time."""
        amount = f"{-1e3 * margin:.1f} mm" if self.unit == "m" else f"{-margin:.2g} {self.unit}"
        excess = f"{-100 * margin:.1f} %" if not self.unit else amount
        return f"{label} is beyond its limit by {excess}"


class TorqueLimit(Limit):
    """The torques of the joints, as shares of their limits."""

    reserve = 0.01

    def __init__(self, names: Sequence[str], limit: Array) -> None:
        self.labels, self._limit = [f"torque of {name}" for name in names], limit

    def margins(self, sample: Sample) -> Any:
        return 1.0 - ca.fabs(sample.torque) / ca.DM(self._limit)

    def rows(self, sample: Sample) -> tuple[Any, float, float]:
        return sample.torque / ca.DM(self._limit), self.reserve - 1.0, 1.0 - self.reserve


class RestingTorqueLimit(TorqueLimit):
    """The torques of joints at rest while others move; `numbers` are among all joints at rest."""

    def __init__(self, names: Sequence[str], limit: Array, numbers: Sequence[int]) -> None:
        super().__init__(names, limit)
        self._numbers = list(numbers)

    def margins(self, sample: Sample) -> Any:
        return super().margins(replace(sample, torque=sample.resting[self._numbers]))

    def rows(self, sample: Sample) -> tuple[Any, float, float]:
        return super().rows(replace(sample, torque=sample.resting[self._numbers]))


class MuscleTorqueLimit(TorqueLimit):
    """The torques of muscles, whose limits fall with the speed."""

    def __init__(self, names: Sequence[str], limit: Array, speed_limit: Array) -> None:
        super().__init__(names, limit)
        self._speed_limit = speed_limit

    def margins(self, sample: Sample) -> Any:
        torque, speed = sample.torque / ca.DM(self._limit), sample.tree.v / ca.DM(self._speed_limit)
        positive, negative = (muscle_share(ca.fmax(x, 0.0)) for x in (speed, -speed))
        return ca.fmin(positive - torque, negative + torque)

    def rows(self, sample: Sample) -> tuple[Any, float, float]:
        return self.margins(sample), self.reserve, math.inf


class SpeedLimit(Limit):
    """The speeds of the joints, as shares of their limits."""

    reserve, by_splines = 0.001, True

    def __init__(self, names: Sequence[str], limit: Array) -> None:
        self.labels, self.limit = [f"speed of {name}" for name in names], limit

    def margins(self, sample: Sample) -> Any:
        return 1.0 - ca.fabs(sample.tree.v) / ca.DM(self.limit)


class RangeLimit(Limit):
    """The ranges of the joints [rad; m for prismatic joints]; the reserve is a share of a range."""

    reserve, by_splines, unit = 0.002, True, "rad"

    def __init__(self, names: Sequence[str], lower: Array, upper: Array) -> None:
        self.labels = [f"range of {name}" for name in names]
        self.lower, self.upper = lower, upper

    def margins(self, sample: Sample) -> Any:
        q = sample.tree.q
        return ca.fmin(q - ca.DM(self.lower), ca.DM(self.upper) - q)


class Pressure(Limit):
    """The ground presses the supporting foot: its force, over the weight."""

    labels = ("the ground's force on the supporting foot",)

    def __init__(self, least: float) -> None:
        self._least = least

    def margins(self, sample: Sample) -> Any:
        return sample.wrench[2] / sample.size - self._least


class GroundLimit(Limit):
    """A limit of the ground's wrench: moments or forces that are at least 0.

    Margins are these over the normal force, so the solver's rows are not.
    """

    @abstractmethod
    def excess(self, sample: Sample) -> Any:
        """Return the margins times the normal force, shape `(k,)`."""

    def margins(self, sample: Sample) -> Any:
        return self.excess(sample) / sample.wrench[2]

    def rows(self, sample: Sample) -> tuple[Any, float, float]:
        scale = sample.size * (LENGTH if self.unit == "m" else 1.0)
        return (self.excess(sample) - self.reserve * sample.wrench[2]) / scale, 0.0, math.inf


class Friction(GroundLimit):
    """The force across the ground is in a pyramid inside the friction cone, over the normal one."""

    labels = ("friction under the supporting foot",) * FACETS

    def __init__(self, coefficient: float) -> None:
        self._slope = coefficient * math.cos(math.pi / FACETS)

    def excess(self, sample: Sample) -> Any:
        turns = 2 * np.pi * np.arange(FACETS) / FACETS
        directions = ca.DM(np.column_stack([np.cos(turns), np.sin(turns)]))
        return self._slope * sample.wrench[2] - directions @ sample.wrench[:2]


class PressureCentre(GroundLimit):
    """The centre of pressure is inside the sole, by a distance from its edges [m]."""

    unit, reserve = "m", 0.004

    def __init__(self, standing: StandingRobot | Foot, inside: float = 0.0) -> None:
        self._normals, offsets = sole_edges(standing)
        self._offsets = offsets - inside
        self.labels = ["the centre of pressure under the supporting foot"] * len(self._offsets)

    def excess(self, sample: Sample) -> Any:
        force, moment = sample.wrench[:3], sample.wrench[3:]
        centre = ca.vertcat(-moment[1], moment[0])
        return ca.DM(self._offsets) * force[2] - ca.DM(self._normals) @ centre


class Twist(GroundLimit):
    """Friction supplies the moment about the vertical: the remaining arm [m].

    The arm of an even pressure is about half the mean distance of the sole's corners from its
    centre.
    """

    unit, reserve = "m", 0.0015
    labels = ("the moment about the vertical under the supporting foot",) * 2

    def __init__(self, standing: StandingRobot | Foot, coefficient: float) -> None:
        self._centre = standing.sole.mean(axis=0)
        distances = np.linalg.norm(standing.sole - self._centre, axis=1)
        self._arm = 0.5 * coefficient * float(distances.mean())

    def excess(self, sample: Sample) -> Any:
        force, (x, y) = sample.wrench[:3], self._centre
        moment = sample.wrench[5] - (x * force[1] - y * force[0])
        return self._arm * force[2] + ca.vertcat(-moment, moment)


def ground_limits(foot: StandingRobot | Foot, friction: float, inside: float = 0.0) -> list[Limit]:
    """Return the limits of the ground's wrench on a foot, but for its pressure.

    The centre of pressure is inside the sole by a distance [m].
    """
    return [Friction(friction), PressureCentre(foot, inside), Twist(foot, friction)]


class Impulse(Limit):
    """The same limit of the ground, for its impulse in the impact."""

    def __init__(self, limit: Limit) -> None:
        self.limit, self.unit = limit, limit.unit
        self.labels = [f"{label} in the impact" for label in limit.labels]

    def margins(self, sample: Sample) -> Any:
        return self.limit.margins(sample)

    def rows(self, sample: Sample) -> tuple[Any, float, float]:
        rows, _, upper = self.limit.rows(sample)
        return rows, 0.0, upper


class SphereDistance(Limit):
    """Coordinates of the spheres of the kicking foot less their radii and the one of an edge [m].

    The spheres are in the axes of the foot's joint; `side` is 1 if the foot is beyond the edge, or
    -1.
    """

    unit = "m"
    label: str  # of all rows
    axis: int  # number of the coordinate in the world

    def __init__(self, joint: int, spheres: Spheres, edge: float = 0.0, side: float = 1.0) -> None:
        self.labels = [self.label] * len(spheres.radii)
        self._joint, self._spheres, self._edge, self._side = joint, spheres, edge, side

    def margins(self, sample: Sample) -> Any:
        points = [sample.tree.point(self._joint, centre) for centre in self._spheres.centres]
        beyond = ca.vertcat(*(point[self.axis] for point in points)) - self._edge
        return self._side * beyond - ca.DM(self._spheres.radii)


class Clearance(SphereDistance):
    """The kicking foot is above the ground: heights of its spheres [m]."""

    label, axis, reserve = "the height of the kicking foot above the ground", 2, 0.004


class Apart(SphereDistance):
    """The kicking foot stays beside the supporting one: distances from the sole's inner edge [m].

    The edge is at a y [m], and the kicking foot to the left of it, with the side 1, or the right.
    """

    label, axis, reserve = "the distance of the kicking foot from the supporting foot", 1, 0.01


class Tilt(Limit):
    """The trunk's tilt: its cosine less the largest one's."""

    labels = ("the tilt of the trunk",)

    def __init__(self, joint: int, axis: Array) -> None:
        self._joint, self._axis = joint, axis

    def margins(self, sample: Sample) -> Any:
        return (sample.tree.rotation(self._joint) @ ca.DM(self._axis))[2] - math.cos(LARGEST_TILT)


ROUNDED = 1e-6
"""Margin below 0 that rounding in a file explains."""

FLOATS = "the sole of the foot that stands is above the ground"


class BrokenLimit(NamedTuple):
    """A limit that a recorded motion breaks.

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


def margins_of(
    motion: RecordedMotion, robot: Leg, forces: GroundForces, ground: float, friction: float
) -> tuple[dict[str, Array], tuple[BrokenLimit, ...]]:
    """Return margins over the frames by name, nan where none apply, and the limits that are broken.

    Joints keep `TorqueLimit`, `SpeedLimit` and `RangeLimit`; the ground `Pressure`, `Friction`,
    `PressureCentre` and `Twist`, on the hull of all soles that stand; bodies are not under the
    ground, at a height [m] (`find_depths`), nor inside each other (`find_self_collisions`).
    """
    names = robot.single_joints
    columns = [robot.velocity_index(name) for name in names]
    effort, speed = (
        np.where(limit > 0.0, limit, math.inf)[columns]
        for limit in (robot.effort_limit, robot.velocity_limit)
    )
    of_joints = [
        TorqueLimit(names, effort), SpeedLimit(names, speed),
        RangeLimit(names, *ranges_of(robot, names).T),
    ]  # fmt: skip
    weight = GRAVITY * pin.computeTotalMass(robot.workspace.model)
    count, values = len(motion.t), dict[str, Array]()
    kinds: dict[str, tuple[Limit | None, str]] = {}

    def put(row: int, margin: float, label: str, limit: Limit | None, name: str) -> None:
        least = values.setdefault(name, np.full(count, np.nan))
        least[row] = np.fmin(least[row], margin)
        kinds[name] = limit, label

    for row, (q, v) in enumerate(zip(motion.q, motion.v, strict=True)):
        tree = SimpleNamespace(q=ca.DM(list(robot.joint_values(q).values())), v=ca.DM(v[columns]))
        sample = Sample(tree, ca.DM(forces.torque[row, columns]), None, weight)
        kept, overlaps = [(limit, sample) for limit in of_joints], dict[str, float]()
        if forces.stands[row].any():
            of_ground, overlaps = _ground_limits(row, forces, weight, friction, ground)
            kept += of_ground
        elif is_floating(robot):
            del kept[0]  # torques are those of no ground
        for limit, at in kept:
            numbers = np.asarray(ca.DM(limit.margins(at))).ravel().tolist()
            for label, name, value in zip(limit.labels, limit.names, numbers, strict=True):
                put(row, value, label, limit, name)
        for frame, depth in find_depths(robot, q, ground).items():
            overlaps[f"{frame} is under the ground"] = depth
        for (first, second), depth in find_self_collisions(robot, q).items():
            overlaps[f"{first} is inside {second}"] = depth
        for label, depth in overlaps.items():
            put(row, -depth, label, None, f"{label} [m]")
    broken = (_broken(*kinds[name], margins, motion.t) for name, margins in values.items())
    return values, tuple(limit for limit in broken if limit)


def _broken(limit: Limit | None, label: str, margins: Array, t: Array) -> BrokenLimit | None:
    """Return a limit that is broken, by margins over the frames."""
    frames, worst = int((margins < -ROUNDED).sum()), int(np.nanargmin(margins))
    if not frames:
        return None
    amount, unit = -float(margins[worst]), "m" if limit is None else limit.unit or "1"
    said = f"{label} by {1e3 * amount:.1f} mm" if limit is None else limit.breach(label, -amount)
    where = f"at {t[worst]:.4g} s, and in {frames} of {len(t)} frames"
    return BrokenLimit(label, frames, float(t[worst]), amount, unit, f"{said}, {where}")


def _ground_limits(
    row: int, forces: GroundForces, weight: float, friction: float, ground: float
) -> tuple[list[tuple[Limit, Sample]], dict[str, float]]:
    """Return limits of the ground's wrench in a frame, and the height of soles that float [m]."""
    corners = np.vstack([
        sole[row] for sole, stands in zip(forces.soles, forces.stands[row], strict=True) if stands
    ])  # fmt: skip
    height = float(corners[:, 2].min()) - ground
    wrench = moved(forces.wrench[row], float(corners[:, 2].mean()))
    limits, feet = list[Limit]([Pressure(0.0)]), Foot("", None, corners[:, :2])
    if wrench[2] > LEAST_PRESSURE * weight:  # the other limits are divided by it
        limits += ground_limits(feet, friction)
    sample = Sample(None, None, ca.DM(wrench), weight)
    return [(limit, sample) for limit in limits], {FLOATS: height} if height > TOLERANCE else {}
