"""What holds a leg besides its base: feet that stand, loops that are closed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.read_only import ReadOnly
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.model_validation import frame_id

CLOSED = 1e-9
"""Gap [m] up to which a loop counts as closed."""

FLAT = 1e-6
"""Share of a sole's length below which its width counts as none."""


@dataclass(frozen=True, eq=False, init=False)
class Support(ReadOnly):
    """A frame that stands on the ground and is held there while the ball is struck.

    Args:
        frame: of the robot.
        point: holds the frame's origin only (a point foot); else the whole frame (a flat foot).
        friction: Coulomb's coefficient between sole and ground, 0 or more; None: not looked at.
        sole: corners of the sole in the frame, shape `(k, 3)` [m], three or more; None: not looked
            at. The ground is level, its normal z.

    Raises:
        InvalidInput: a coefficient below 0, corners of the wrong shape, or for a point foot.
    """

    frame: str
    point: bool
    friction: float | None
    sole: Array | None

    def __init__(
        self,
        frame: str,
        *,
        point: bool = False,
        friction: float | None = None,
        sole: ArrayLike | None = None,
    ) -> None:
        if not isinstance(frame, str):
            raise InvalidInput(f"support's frame is {frame!r}: it must be a name")
        point = validation.flag(f"point of {frame}", point)
        if friction is not None:
            friction = validation.number(f"friction under {frame}", friction, at_least=0)
        corners = None
        if sole is not None:
            corners = validation.floats(f"sole of {frame}", sole, unit="m")
            if point or corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 3:
                raise InvalidInput(
                    f"sole of {frame} has shape {corners.shape}: it must be (k, 3), the corners of "
                    "a flat foot, three or more"
                )
            extent = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)
            if not extent[1] > FLAT * extent[0]:
                raise InvalidInput(
                    f"sole of {frame} is {corners.tolist()}: its corners must span an area"
                )
            corners.setflags(write=False)
        for name, value in (
            *(("frame", frame), ("point", point)),
            *(("friction", friction), ("sole", corners)),
        ):
            object.__setattr__(self, name, value)

    @property
    def size(self) -> int:
        """How many velocities it holds at 0: 3 or 6."""
        return 3 if self.point else 6


class Row(NamedTuple):
    """Where a block of constraint rows acts: its impulse is on `joint`, minus it on `other`.

    Attributes:
        at: which rows.
        joint, other: joints of the model; `other` is 0 for the ground.
        turns: from world axes to those of the joint and of the other, shape `(3, 3)`.
        frame: from the support's or first loop frame's axes to the world's, shape `(3, 3)`.
        levers: from the joint's origin to the point, in its axes, one per joint [m].
    """

    at: slice
    joint: int
    other: int
    turns: tuple[Array, Array]
    frame: Array
    levers: tuple[Array, Array]


class Constraints:
    """The supports and loops of a leg, looked up in its model.

    Attributes:
        supports: as given.
        loops: pairs of frames whose origins coincide.
        size: rows, 6 for a flat foot, 3 for a point foot or a loop.
        names: what each support and loop is called in messages.
    """

    def __init__(
        self,
        model: Any,
        contact_joint: int,
        supports: tuple[Support, ...],
        loops: tuple[tuple[str, str], ...],
    ) -> None:
        self.supports, self.loops = supports, loops
        named = [frozenset((s.frame,)) for s in supports] + [frozenset(loop) for loop in loops]
        for ends in named:
            if named.count(ends) > 1:
                raise InvalidInput(f"{' - '.join(sorted(ends))} is held twice: once will do")
        self._supported = [_place(model, support.frame) for support in supports]
        self._looped = [(_place(model, a), _place(model, b)) for a, b in loops]
        for support, place in zip(supports, self._supported, strict=True):
            _check_stance(model, support.frame, place.joint, contact_joint)
        for (a, b), (one, two) in zip(loops, self._looped, strict=True):
            if one.joint == two.joint:
                raise InvalidInput(f"loop {a} - {b} joins a body to itself: name two bodies")
        self.size = sum(support.size for support in supports) + 3 * len(loops)
        self.names = [s.frame for s in supports] + [f"{a} - {b}" for a, b in loops]

    def rows(self, model: Any, data: Any, q: Array) -> tuple[Array, list[Row]]:
        """Return A with A v = 0, shape `(size, nv)` [world axes], and where its impulses act.

        Kinematics must have run at `q`. Rows of a support are the velocity of its frame, linear
        then angular; of a loop, that of its second frame's origin relative to the first's.
        """
        matrix, blocks, start = np.empty((self.size, model.nv)), [], 0
        for support, place in zip(self.supports, self._supported, strict=True):
            at = slice(start, start + support.size)
            local, rotation, _ = _motion(model, data, q, place)
            for row in range(0, support.size, 3):  # linear, then angular
                matrix[start + row : start + row + 3] = rotation.dot(local[row : row + 3])
            turn, lever = place.turn.dot(rotation.T), place.lever
            blocks.append(Row(at, place.joint, 0, (turn, turn), rotation, (lever, lever)))
            start = at.stop
        for one, two in self._looped:
            at = slice(start, start + 3)
            first, rotation_1, from_ = _motion(model, data, q, one)
            second, rotation_2, to = _motion(model, data, q, two)
            # across a gap, both move as their bodies do at the second origin
            carried = rotation_1 @ first[:3] - pin.skew(to - from_) @ (rotation_1 @ first[3:])
            matrix[at] = rotation_2 @ second[:3] - carried
            turns = (two.turn @ rotation_2.T, one.turn @ rotation_1.T)
            levers = (two.lever, one.lever)
            blocks.append(Row(at, two.joint, one.joint, turns, rotation_1, levers))
            start = at.stop
        return matrix, blocks

    def gaps(self, model: Any, data: Any) -> Array:
        """Return from the first to the second origin of each loop, shape `(loops, 3)` [m]."""
        places = [
            [pin.updateFramePlacement(model, data, end.frame).translation.copy() for end in pair]
            for pair in self._looped
        ]
        return np.array([second - first for first, second in places]).reshape(-1, 3)

    def between(self, model: Any) -> Array:
        """Return 1 for the velocities of joints between the ends of a loop, 0 for others."""
        own = np.zeros(model.nv)
        for ends in self._looped:
            one, two = (set(model.supports[end.joint]) for end in ends)
            for joint in one ^ two:
                own[model.idx_vs[joint] : model.idx_vs[joint] + model.nvs[joint]] = 1.0
        return own

    def check_closed(self, model: Any, data: Any, where: object) -> None:
        """Raise `InvalidInput` if a loop is open, with its gap."""
        if not self.loops:
            return
        for (a, b), gap in zip(self.loops, self.gaps(model, data), strict=True):
            width = float(np.linalg.norm(gap))
            if not width <= CLOSED:
                raise InvalidInput(
                    f"loop {a} - {b} is open by {width:.6g} m in {where!r}: at most {CLOSED:g} m "
                    "(Leg.closed(q) closes it)"
                )


class _Place(NamedTuple):
    """A frame, and how it sits on its joint."""

    frame: int
    joint: int
    turn: Array
    lever: Array


def _place(model: Any, name: str) -> _Place:
    frame = frame_id(model, name)
    found = model.frames[frame]
    place = found.placement
    return _Place(frame, int(found.parentJoint), place.rotation.copy(), place.translation.copy())


def _motion(model: Any, data: Any, q: Array, place: _Place) -> tuple[Array, Array, Array]:
    """Return a frame's Jacobian in its own axes, the turn from those to the world's, its origin."""
    placement = pin.updateFramePlacement(model, data, place.frame)
    rotation, origin = placement.rotation.copy(), placement.translation.copy()
    local = pin.computeFrameJacobian(model, data, q, place.frame, pin.LOCAL).reshape(6, model.nv)
    return local, rotation, origin


def _check_stance(model: Any, name: str, joint: int, contact_joint: int) -> None:
    if joint == 0:
        raise InvalidInput(f"support {name} is fixed to the base: it stands already")
    # a floating base is on every path, and no limb
    base = 1 if model.joints[1].shortname() == "JointModelFreeFlyer" else 0
    below = joint != base and joint in list(model.supports[contact_joint])
    above = contact_joint != base and contact_joint in list(model.supports[joint])
    if joint == contact_joint or below or above:
        raise InvalidInput(
            f"support {name} is on the kicking limb, which moves "
            f"{model.names[contact_joint]}: hold a frame of another limb"
        )
