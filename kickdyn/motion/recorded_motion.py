r"""A motion that was recorded, retargeted or simulated elsewhere, frame by frame.

Velocities and accelerations are those of polynomials of degree 4 through neighbouring frames
(Savitzky & Golay 1964, Anal Chem 36:1627), of joints and the position of the base as they are, of
the rotation of the base from its quaternion q:

.. math:: \omega = 2\, \mathrm{vec}(\bar q \dot q) / |q|^2, \qquad
          \dot\omega = 2\, \mathrm{vec}(\bar q \ddot q) / |q|^2

in the axes of the base.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.motion.motion_file import MotionSamples, continuous, file_joints
from kickdyn.robot.leg import Leg

DEGREE = 4
"""Degree of the polynomials."""

UNSMOOTHED, WINDOW = DEGREE + 1, 7
"""Frames that determine a polynomial, and frames through which one is fitted by default."""

PLAN_RATE = 500.0
"""Rate at which planned motions are sampled [Hz]."""

LEAST_FRAMES = 10
"""Least number of frames of a motion."""


class Smoothing(NamedTuple):
    """How far smoothing moves a part of a motion at most.

    Attributes:
        quantity: `position` or `velocity`.
        part: `joints`, `base position` or `base rotation`.
        amount: largest difference from what is not smoothed, in `unit`.
        unit: of the amount.
        name: of the joint; empty for the base.
        time: when [s].
    """

    quantity: str
    part: str
    amount: float
    unit: str
    name: str
    time: float


@dataclass(frozen=True, eq=False, repr=False)
class RecordedMotion(ReprMixin):
    """A motion of a leg or a robot at a constant rate, as `read_motion` returns it.

    Attributes:
        leg: that moves, in its own coordinates.
        rate: of the frames [Hz].
        t: times, shape `(k,)` [s].
        q: configurations as the file has them, shape `(k, nq)` [rad; m for prismatic joints].
        v: velocities, shape `(k, nv)`; at the impact, just before it.
        a: accelerations, shape `(k, nv)`, likewise.
        contact: time of the impact [s], across which nothing is smoothed; None without one.
        smoothing: how far it moves positions and velocities.
        warnings: lines about the rate and joints outside their ranges.
    """

    leg: Leg
    rate: float
    t: Array
    q: Array
    v: Array
    a: Array
    contact: float | None
    smoothing: tuple[Smoothing, ...]
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        validation.protect(self.t, self.q, self.v, self.a)

    def _rows(self) -> Iterable[Row]:
        yield "frames", len(self.t), ""
        yield "rate", self.rate, "Hz"
        yield "begin", self.begin, "s"
        yield "end", self.end, "s"
        if self.contact is not None:
            yield "contact", self.contact, "s"
        for quantity, part, amount, unit, name, time in self.smoothing:
            where = f"{f'{name}, ' if name else ''}at {time:.4g} s"
            yield f"smoothing, {quantity} of {part}", f"{amount:.2g} {unit}, {where}", ""
        yield from warned(self.warnings)

    @property
    def begin(self) -> float:
        """Time of the first frame [s]."""
        return float(self.t[0])

    @property
    def end(self) -> float:
        """Time of the last frame [s]."""
        return float(self.t[-1])

    def frame_at(self, time: float) -> int:
        """Return the number of the frame that is nearest to a time [s]."""
        return int(np.abs(self.t - time).argmin())


class FrameTable(NamedTuple):
    """The frames of a motion as files have them.

    Attributes:
        rate: of the frames [Hz].
        t: times, shape `(k,)` [s].
        root: position [m] and quaternion xyzw of the floating base in the world, shape `(k, 7)`;
            `(k, 0)` on a fixed base.
        joints: positions of `file_joints`, shape `(k, n)` [rad; m for prismatic joints].
        contact: time of an impact [s]; None without one.
    """

    rate: float
    t: Array
    root: Array
    joints: Array
    contact: float | None


def as_recorded(motion: "RecordedMotion | Any") -> RecordedMotion:
    """Return a recorded motion, of a planned `Motion` `PLAN_RATE` times a second."""
    if isinstance(motion, RecordedMotion):
        return motion
    samples: MotionSamples = motion.samples(PLAN_RATE)
    table = FrameTable(samples.rate, samples.t, samples.root, samples.joint_positions, 0.0)
    return record(samples.leg, table, UNSMOOTHED)


def record(
    leg: Leg, table: FrameTable, window: int = WINDOW, warnings: tuple[str, ...] = ()
) -> RecordedMotion:
    """Return the motion of frames, with velocities and accelerations.

    Args:
        leg: that moves.
        table: its frames; unit quaternions.
        window: number of frames through which a polynomial is fitted; 5 do not smooth.
        warnings: of the motion.

    Raises:
        InvalidInput: an even window, one of less than 5 frames, or of more than there are frames
            before or after the impact.
    """
    window = validation.whole("window", window, at_least=UNSMOOTHED)
    if window % 2 == 0:
        raise InvalidInput(f"window is {window}: it must be odd, so that a frame is in its middle")
    pieces = _pieces(table, window)
    smooth, raw = (_Derivatives(leg, table, pieces, size) for size in (window, UNSMOOTHED))
    smoothing = smooth.differences(raw, table.t) if window > UNSMOOTHED else ()
    return RecordedMotion(
        leg, table.rate, np.array(table.t), raw.configurations(), smooth.velocity,
        smooth.acceleration, table.contact, smoothing, warnings,
    )  # fmt: skip


def _pieces(table: FrameTable, window: int) -> list[slice]:
    """Return the frames until the impact, and those after it."""
    count, split = len(table.t), len(table.t)
    if table.contact is not None:
        split = int(np.count_nonzero(table.t <= table.contact + 1e-6 / table.rate))
    pieces = [piece for piece in (slice(0, split), slice(split, count)) if piece.start < piece.stop]
    for piece in pieces:
        frames = piece.stop - piece.start
        if frames < window:
            side = "" if len(pieces) == 1 else " before" if piece.start == 0 else " after"
            raise InvalidInput(
                f"there are {frames} frames{side}{' the impact' if side else ''}: a window of "
                f"{window} needs as many; contact= is the time of the impact [s], from "
                f"{table.t[0]:g} to {table.t[-1]:g}"
            )
    return pieces


class _Derivatives:
    """Velocities and accelerations of frames, by polynomials through a window of these."""

    def __init__(self, leg: Leg, table: FrameTable, pieces: list[slice], window: int) -> None:
        model, k = leg.workspace.model, len(table.t)
        self._leg = leg
        names = file_joints(leg)
        numbers = [int(model.getJointId(name)) for name in names]
        self._names = names
        self._qs = [(int(model.idx_qs[j]), int(model.nqs[j])) for j in numbers]
        self._vs = [int(model.idx_vs[j]) for j in numbers]
        turns = [column for column, (_, nq) in enumerate(self._qs) if nq == 2]
        joints = np.array(table.joints)
        joints[:, turns] = np.unwrap(joints[:, turns], axis=0)
        self._angles = joints

        def differentiated(samples: Array) -> Array:
            orders = np.zeros((3, *samples.shape))
            for piece in pieces:
                for order in range(3):
                    orders[order, piece] = savgol_filter(
                        samples[piece], window, DEGREE, order, 1.0 / table.rate, axis=0
                    )
            return orders

        self.joints = differentiated(joints)
        self.velocity, self.acceleration = np.zeros((2, k, leg.nv))
        self.velocity[:, self._vs], self.acceleration[:, self._vs] = self.joints[1:]
        self.floats = table.root.shape[1] > 0
        if not self.floats:
            return
        base = model.jointPlacements[1]
        self._place = place = (table.root[:, :3] - base.translation) @ base.rotation
        turn = Rotation.from_matrix(base.rotation).inv() * Rotation.from_quat(table.root[:, 3:])
        self._quaternions = continuous(turn.as_quat())
        self.place, self.turn = differentiated(place), differentiated(self._quaternions)
        rotation = Rotation.from_quat(self.turn[0]).inv()
        linear, angular = rotation.apply(self.place[1]), _doubled(self.turn[0], self.turn[1])
        self.velocity[:, :6] = np.hstack([linear, angular])
        accelerated = rotation.apply(self.place[2]) - np.cross(angular, linear)
        self.acceleration[:, :6] = np.hstack([accelerated, _doubled(self.turn[0], self.turn[2])])

    def configurations(self) -> Array:
        """Return q, shape `(k, nq)`, of positions that are not smoothed."""
        q = np.zeros((len(self.velocity), self._leg.nq))
        if self.floats:
            q[:, :7] = np.hstack([self._place, self._quaternions])
        for column, (place, nq) in enumerate(self._qs):
            angle = self._angles[:, column]
            q[:, place] = np.cos(angle) if nq == 2 else angle
            if nq == 2:
                q[:, place + 1] = np.sin(angle)
        return q

    def differences(self, raw: "_Derivatives", t: Array) -> tuple[Smoothing, ...]:
        """Return how far these are from those that are not smoothed."""
        found = list[Smoothing]()
        units = [self._leg.joint_unit(name) for name in self._names]
        for order, quantity, per in ((0, "position", ""), (1, "velocity", "/s")):
            apart = np.abs(self.joints[order] - raw.joints[order])
            frame, column = np.unravel_index(apart.argmax(), apart.shape)
            most, unit, name = float(apart[frame, column]), units[column] + per, self._names[column]
            found.append(Smoothing(quantity, "joints", most, unit, name, float(t[frame])))
            if not self.floats:
                continue
            moved = self.place[order] - raw.place[order]
            turned = self.velocity[:, 3:6] - raw.velocity[:, 3:6]
            if order == 0:
                turned = _doubled(raw.turn[0], self.turn[0])
            for part, change, unit in (("position", moved, "m"), ("rotation", turned, "rad")):
                size = np.linalg.norm(change, axis=1)
                frame = int(size.argmax())
                found.append(Smoothing(quantity, f"base {part}", float(size[frame]), unit + per,
                                       "", float(t[frame])))  # fmt: skip
        return tuple(found)


def _doubled(q: Array, other: Array) -> Array:
    r"""Return :math:`2\, \mathrm{vec}(\bar q p) / |q|^2` of quaternions xyzw, shape `(k, 3)`."""
    vector = q[:, 3:] * other[:, :3] - other[:, 3:] * q[:, :3] - np.cross(q[:, :3], other[:, :3])
    return np.asarray(2.0 * vector / np.sum(q * q, axis=1, keepdims=True))
