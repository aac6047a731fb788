r"""Bodies apart from each other, and out of the ball before the impact, in a motion.

Two bodies that are near each other at a time have the points a and b there, nearest to each other
or deepest, and the normal n from a to b. With all three fixed in the axes of the joints that carry
them, the condition

.. math:: n \cdot (b(q) - a(q)) \ge d

is a row of the next solution; likewise :math:`|c - a(q)| \ge r` for the centre c of the ball, which
lies where the foot touches it in the impact. It is exact where the bodies are as they were, so each
solution takes the points of the one before.
"""

from collections.abc import Collection, Sequence
from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kickdyn.core.validation import Array
from kickdyn.robot.collisions import TOUCHING, Placed, Proximity, body_pairs
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frames_by_name

WITHIN = 0.08
"""Distance of bodies up to which they have conditions [m]: farther away, those of one motion say
little about another."""

RESERVE, BALL_RESERVE = 2e-3, -2.5e-3
"""Distance that bodies keep from each other and from the ball, which the foot touches [m]."""

SAME_POINT = 1e-3
"""Distance up to which points of a body are the same [m]."""

ALLOWED = TOUCHING - 5e-4
"""Depth up to which bodies count as touching on the grid of times on which they are checked [m]."""


class Gap(NamedTuple):
    """Two bodies near each other: names of their frames, and how the first one is placed."""

    frames: tuple[str, str]
    place: Proximity


class Conditions(NamedTuple):
    """Conditions that bodies of two joints are apart."""

    joints: tuple[int, int]  # that carry the bodies; the second one is -1 for the ball
    times: Array  # of the conditions, ascending, shape `(k,)` [s, impact at 0]
    # the point a and the normal in the axes of the first joint, and the point b in the second
    # one's, shape `(9, k)` [m]; for the ball, only the first three count
    parameters: Array
    multipliers: Array = np.zeros(0)  # of a solution that kept them, shape `(k,)`

    @property
    def is_of_ball(self) -> bool:
        """Whether the second body is the ball."""
        return self.joints[1] < 0


class Surroundings:
    """Which bodies of a robot can come near each other or a ball with a radius [m].

    `leg` has the joints that move, whose configurations are given.
    """

    def __init__(self, robot: Leg, leg: Leg, radius: float) -> None:
        self._robot, self._space, self._radius = robot, leg.workspace, radius
        pairs, numbers = body_pairs(robot), frames_by_name(leg.workspace.model)
        self._frames = {body.frame: numbers[body.frame] for body in pairs.bodies}
        self._joints = {
            name: int(leg.workspace.model.frames[number].parentJoint)
            for name, number in self._frames.items()
        }
        carriers = np.array([self._joints[body.frame] for body in pairs.bodies], int)
        self._pairs = pairs.of(carriers[pairs.first] != carriers[pairs.second])

    def gaps(self, q: Array, ball: Array | None, within: float = WITHIN) -> list[Gap]:
        """Return gaps below a distance at q [m]; those with a ball, if its centre is given.

        They are the nearest ones of two frames, of which each may have dozens of shapes.
        """
        placed = Placed(self._robot, self._frames, self._space.model, self._space.data, q)
        pairs, least = self._pairs, placed.least_distances(self._pairs)
        found = [
            (least[k], pairs.bodies[pairs.first[k]], pairs.bodies[pairs.second[k]])
            for k in np.flatnonzero(least < within)
        ]
        if ball is not None:
            bodies = placed.bodies_near(ball, self._radius + within)
            found += [(-np.inf, body, placed.place_ball(ball, self._radius)) for body in bodies]
        nearest: dict[tuple[str, str], Gap | None] = {(a.frame, b.frame): None for _, a, b in found}
        for distance, body, other in sorted(found, key=lambda pair: pair[0]):
            frames = body.frame, other.frame
            previous = nearest[frames]
            if previous is None or -previous.place.depth > distance:
                place = placed.proximity(body, other)
                if previous is None or place.depth > previous.place.depth:
                    nearest[frames] = Gap(frames, place)
        return [gap for gap in nearest.values() if gap is not None and gap.place.depth > -within]

    def joints(self, gap: Gap) -> tuple[int, int]:
        """Return the joints that carry two bodies; the second one is -1 for the ball."""
        return self._joints[gap.frames[0]], self._joints.get(gap.frames[1], -1)

    def label(self, joints: tuple[int, int]) -> str:
        """Return the name of the limit that bodies of two joints are apart."""
        first, second = (str(self._space.model.names[joint]) for joint in joints)
        other = "the ball" if joints[1] < 0 else f"those of {second}"
        return f"distance of bodies of {first} from {other}"

    def only(self, frames: Collection[str], *, others: bool = False) -> "Surroundings":
        """Return the pairs of which one or both bodies are at some frames, or the other pairs."""
        at_frames = np.array([body.frame in frames for body in self._pairs.bodies], bool)
        chosen = at_frames[self._pairs.first] | at_frames[self._pairs.second]
        some = copy(self)
        some._pairs = self._pairs.of(~chosen if others else chosen)
        return some

    def conditions(
        self, gaps: Sequence[Sequence[Gap]], times: Array, q: Array, chosen: NDArray[np.bool_]
    ) -> list[Conditions]:
        """Return the conditions of bodies that come near each other, by their gaps at times [s].

        The configurations are q, shape `(k, n)`. Times that are `chosen` have conditions besides
        those at which bodies are nearest.
        """
        depths: dict[tuple[str, str], Array] = {}
        for number, close in enumerate(gaps):
            for gap in close:
                row = depths.setdefault(gap.frames, np.full(len(times), -np.inf))
                row[number] = max(row[number], gap.place.depth)
        wanted = {}
        for frames, row in depths.items():
            padded = np.pad(row, 1, constant_values=-np.inf)
            peak = np.isfinite(row) & (row >= padded[:-2]) & (row >= padded[2:])
            wanted[frames] = peak | chosen
        columns: dict[tuple[int, int], list[tuple[float, Array]]] = {}
        model, data = self._space.model, self._space.data
        for number, close in enumerate(gaps):
            placed = Placed(self._robot, {}, model, data, q[number]) if close else None
            for gap in close:
                if placed is None or not wanted[gap.frames][number]:
                    continue
                first, second = self.joints(gap)
                pose, other = data.oMi[first], data.oMi[max(second, 0)]
                depth, point, normal = gap.place
                column = np.concatenate([
                    pose.actInv(point), pose.rotation.T @ normal,
                    other.actInv(point - depth * normal),
                ])  # fmt: skip
                columns.setdefault((first, second), []).append((float(times[number]), column))
        return [
            Conditions(joints, np.array([t for t, _ in rows]), np.array([c for _, c in rows]).T)
            for joints, rows in columns.items()
        ]


def multipliers_nearby(new: Conditions, former: Conditions | None) -> Array:
    """Return multipliers of new conditions: of the most similar former one at each time, or 0."""
    if former is None:
        return np.zeros(len(new.times))
    apart = np.abs(new.times[:, None] - former.times[None])
    change = np.linalg.norm(new.parameters[:, :, None] - former.parameters[:, None], axis=0)
    nearest = np.where(apart < 1e-12, change, np.inf)
    touches = np.isfinite(nearest).any(axis=1)
    return np.where(touches, former.multipliers[nearest.argmin(axis=1)], 0.0)


def with_former(new: Sequence[Conditions], former: Sequence[Conditions]) -> list[Conditions]:
    """Return conditions with those former ones for whose joints there are none at that time.

    A solution that kept these would otherwise return to where bodies are inside each other. Former
    points that must be out of the ball stay beside new ones. Otherwise the solutions of a foot with
    corners can alternate, each with another corner inside the ball.
    """
    merged = {conditions.joints: conditions for conditions in new}
    for conditions in former:
        joints, times, parameters, _ = conditions
        latest = merged.get(joints, Conditions(joints, np.zeros(0), np.zeros((9, 0))))
        replaced = np.abs(times[:, None] - latest.times) < 1e-12
        if conditions.is_of_ball:  # a point of a body must be out of it wherever the body is
            offsets = parameters[:3, :, None] - latest.parameters[:3, None]
            replaced &= np.linalg.norm(offsets, axis=0) < SAME_POINT
        remaining = ~replaced.any(axis=1)
        every = np.concatenate([latest.times, times[remaining]])
        order = np.argsort(every, kind="stable")
        stacked = np.hstack([latest.parameters, parameters[:, remaining]])
        merged[joints] = Conditions(joints, every[order], stacked[:, order])
    return [*merged.values()]
