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
from typing import Any

import casadi as ca
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.robot.ground_clearance import Spheres
from kickdyn.robot.human_body import muscle_share
from kickdyn.robot.standing import Foot, StandingRobot, sole_edges

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
    """A moment of the motion, or the impact, in CasADi's symbols.

    Attributes:
        tree: its kinematics, a `SymbolicTree`; limits of joints need its q and v only, which may be
            numbers.
        torque: of the joints, shape `(n,)` [N m; N].
        wrench: of the ground on the root, force, then moment about the world's origin, `(6,)`
            [N, N m]; in the impact, its impulse [N s, N m s].
        size: of a large force or impulse [N or N s].
        resting: torques of the joints at rest, shape `(k,)` [N m; N].
    """

    tree: Any
    torque: Any
    wrench: Any
    size: float
    resting: Any = None


def when(time: float) -> str:
    """Return a time from the impact on in words [s]."""
    return f"{1e3 * abs(time):.0f} ms {'before' if time < 0.0 else 'after'} the impact"


def with_unit(label: str, limit: "Limit") -> str:
    """Return the name of a margin: the label with the unit, if it is no share of the limit."""
    return f"{label} [{limit.unit}]" if limit.unit else label


class Limit(ABC):
    """A limit of the motion.

    Attributes:
        labels: a name for each row, for sentences.
        unit: of the margins: `m`, `rad` or nothing for a share of the limit.
        reserve: margin that the solver keeps at its points, for the times between them.
        by_splines: whether the coefficients of the splines keep it at all times, so that the solver
            needs no rows at its points.
    """

    labels: Sequence[str]
    unit: str = ""
    reserve: float = 0.0
    by_splines: bool = False

    @abstractmethod
    def margins(self, sample: Sample) -> Any:
        """Return the distance from the limit, shape `(k,)`."""

    def rows(self, sample: Sample) -> tuple[Any, float, float]:
        """Return rows of the solver, shape `(k,)`, and the bounds of all of them."""
        return self.margins(sample), self.reserve, math.inf

    def describe(self, label: str, margin: float, time: float) -> str:
        """Return a sentence about a row whose margin is below 0 at a time [s]."""
        return f"{self.breach(label, margin)}, {when(time)}"

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
    """The torques of joints at rest while others move, as shares of their limits.

    Args:
        names: of these joints.
        limit: of their torques [N m; N].
        numbers: of these joints among all joints at rest.
    """

    def __init__(self, names: Sequence[str], limit: Array, numbers: Sequence[int]) -> None:
        super().__init__(names, limit)
        self._numbers = list(numbers)

    def margins(self, sample: Sample) -> Any:
        return super().margins(replace(sample, torque=sample.resting[self._numbers]))

    def rows(self, sample: Sample) -> tuple[Any, float, float]:
        return super().rows(replace(sample, torque=sample.resting[self._numbers]))


class MuscleTorqueLimit(TorqueLimit):
    """The torques of joints that muscles move, whose limits fall with the speed."""

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


class Clearance(Limit):
    """A body of the kicking limb is above the ground: heights of its spheres [m]."""

    unit, reserve = "m", 0.004

    def __init__(self, name: str, joint: int, spheres: Spheres) -> None:
        self.labels = [f"the height of {name} above the ground"] * len(spheres.radii)
        self._joint, self._spheres = joint, spheres

    def margins(self, sample: Sample) -> Any:
        points = [sample.tree.point(self._joint, centre) for centre in self._spheres.centres]
        return ca.vertcat(*(point[2] for point in points)) - ca.DM(self._spheres.radii)


class Apart(Limit):
    """The kicking foot stays beside the supporting one: distances from the sole's inner edge [m].

    Args:
        name: of the kicking foot.
        joint: that carries it.
        spheres: that span it, in the joint's axes.
        edge: y of the sole's inner edge [m].
        side: 1 where the kicking foot is to the left of it, -1 to the right.
    """

    unit, reserve = "m", 0.01

    def __init__(self, name: str, joint: int, spheres: Spheres, edge: float, side: float) -> None:
        self.labels = [f"the distance of {name} from the supporting foot"] * len(spheres.radii)
        self._joint, self._spheres, self._edge, self._side = joint, spheres, edge, side

    def margins(self, sample: Sample) -> Any:
        points = [sample.tree.point(self._joint, centre) for centre in self._spheres.centres]
        beside = ca.vertcat(*(point[1] for point in points)) - self._edge
        return self._side * beside - ca.DM(self._spheres.radii)


class Tilt(Limit):
    """The trunk's tilt: its cosine less the largest one's."""

    labels = ("the tilt of the trunk",)

    def __init__(self, joint: int, axis: Array) -> None:
        self._joint, self._axis = joint, axis

    def margins(self, sample: Sample) -> Any:
        return (sample.tree.rotation(self._joint) @ ca.DM(self._axis))[2] - math.cos(LARGEST_TILT)
