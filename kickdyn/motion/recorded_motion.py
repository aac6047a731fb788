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

BASE = 7
"""Size of the configuration of a floating base."""

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
    pieces, model = _pieces(table, window), leg.workspace.model
    names = file_joints(leg)
    numbers = [int(model.getJointId(name)) for name in names]
    turns = [column for column, joint in enumerate(numbers) if model.nqs[joint] == 2]
    columns = [int(model.idx_vs[joint]) for joint in numbers]
    joints, root = np.array(table.joints), np.zeros((len(table.t), 0))
    joints[:, turns] = np.unwrap(joints[:, turns], axis=0)
    q = np.zeros((len(table.t), leg.nq))
    if table.root.size:
        base = model.jointPlacements[1]
        place = (table.root[:, :3] - base.translation) @ base.rotation
        turn = Rotation.from_matrix(base.rotation).inv() * Rotation.from_quat(table.root[:, 3:])
        q[:, :BASE] = root = np.hstack([place, continuous(turn.as_quat())])
    for joint, angle in zip(numbers, joints.T, strict=True):
        index, size = int(model.idx_qs[joint]), int(model.nqs[joint])
        q[:, index : index + size] = (
            np.column_stack([np.cos(angle), np.sin(angle)]) if size == 2 else angle[:, None]
        )
    frames = np.hstack([root, joints])
    smooth, v, a = _motion(frames, pieces, (window, table.rate), columns, leg.nv)
    smoothing = list[Smoothing]()
    if window > UNSMOOTHED:
        _, raw, _ = _motion(frames, pieces, (UNSMOOTHED, table.rate), columns, leg.nv)
        units = [leg.joint_unit(name) for name in names]
        labels = list(zip(names, units, strict=True))
        moved = np.split(smooth - frames, [root.shape[1]], axis=1)
        smoothing = _smoothing("position", "", moved, labels, table.t)
        changed = [(v - raw)[:, :6] if root.size else root, (v - raw)[:, columns]]
        smoothing += _smoothing("velocity", "/s", changed, labels, table.t)
    return RecordedMotion(
        leg, table.rate, np.array(table.t), q, v, a, table.contact, tuple(smoothing), warnings
    )


def _pieces(table: FrameTable, window: int) -> list[slice]:
    """Return the frames until the impact, and those after it."""
    count, split = len(table.t), len(table.t)
    if table.contact is not None:
        split = int(np.count_nonzero(table.t <= table.contact + 1e-6 / table.rate))
    pieces = [piece for piece in (slice(0, split), slice(split, count)) if piece.start < piece.stop]
    for piece in pieces:
        frames = piece.stop - piece.start
        if frames < window:
            side = "before" if piece.start == 0 else "after"
            where = f" {side} the impact" if len(pieces) > 1 else ""
            raise InvalidInput(f"there are {frames} frames{where}: a window of {window} needs more")
    return pieces


def _motion(
    frames: Array, pieces: list[slice], fit: tuple[int, float], columns: list[int], nv: int
) -> tuple[Array, Array, Array]:
    """Return smoothed frames, v and a.

    Args:
        frames: position and quaternion of a floating base, and joints, shape `(k, 7 + n)`.
        pieces: frames between which nothing is smoothed.
        fit: window, and rate [Hz].
        columns: of the joints in v.
        nv: size of v.
    """
    orders, (window, rate) = np.zeros((3, *frames.shape)), fit
    for piece in pieces:
        for order in range(3):
            orders[order, piece] = savgol_filter(
                frames[piece], window, DEGREE, order, 1.0 / rate, axis=0
            )
    v, a = np.zeros((2, len(frames), nv))
    base = frames.shape[1] - len(columns)
    v[:, columns], a[:, columns] = orders[1:, :, base:]
    if base:
        turn, turned, accelerated = orders[:, :, 3:BASE]
        rotation, omega = Rotation.from_quat(turn).inv(), _doubled(turn, turned)
        linear = rotation.apply(orders[1, :, :3])
        v[:, :6] = np.hstack([linear, omega])
        a[:, :3] = rotation.apply(orders[2, :, :3]) - np.cross(omega, linear)
        a[:, 3:6] = _doubled(turn, accelerated)
    return orders[0], v, a


def _smoothing(
    quantity: str, per: str, changes: list[Array], joints: list[tuple[str, str]], t: Array
) -> list[Smoothing]:
    """Return the largest changes of the joints, with their names and units, and of the base."""
    base, of_joints = changes
    parts = [("joints", np.abs(of_joints), joints)]
    if base.size:
        turned = np.linalg.norm(base[:, 3:], axis=1) * (2.0 if base.shape[1] == BASE else 1.0)
        parts.append(("base position", np.linalg.norm(base[:, :3], axis=1)[:, None], [("", "m")]))
        parts.append(("base rotation", turned[:, None], [("", "rad")]))
    found = []
    for part, sizes, labels in parts:
        frame, column = divmod(int(sizes.argmax()), sizes.shape[1])
        name, unit = labels[column]
        amount = float(sizes[frame, column])
        found.append(Smoothing(quantity, part, amount, unit + per, name, float(t[frame])))
    return found


def _doubled(q: Array, other: Array) -> Array:
    r"""Return :math:`2\, \mathrm{vec}(\bar q p) / |q|^2` of quaternions xyzw, shape `(k, 3)`."""
    vector = q[:, 3:] * other[:, :3] - other[:, 3:] * q[:, :3] - np.cross(q[:, :3], other[:, :3])
    return np.asarray(2.0 * vector / np.sum(q * q, axis=1, keepdims=True))
