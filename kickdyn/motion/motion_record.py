r"""A motion that was recorded, retargeted or simulated elsewhere, frame by frame.

Velocities and accelerations are those of polynomials of degree 4 through neighbouring frames
(Savitzky & Golay 1964, Anal Chem 36:1627), of joints and the position of the base as they are, of
the rotation of the base from its quaternion q:

.. math:: \omega = 2\, \mathrm{vec}(\bar q \dot q) / |q|^2, \qquad
          \dot\omega = 2\, \mathrm{vec}(\bar q \ddot q) / |q|^2

in the axes of the base.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from kickdyn.core import validation
from kickdyn.core.representation import ReprMixin, Row, warned
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.motion.motion_file import MotionSamples, file_joints, moved_poses, positions_of
from kickdyn.motion.weight_shift import split_wrench
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.constraints import Support
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frame_id, frames_by_name
from kickdyn.robot.standing import is_floating, sole_corners

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
        smoothing: rows of how far it moves positions and velocities at most, where and when.
        warnings: lines about the rate and joints outside their ranges.
    """

    leg: Leg
    rate: float
    t: Array
    q: Array
    v: Array
    a: Array
    contact: float | None
    smoothing: tuple[Row, ...] = ()
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
        yield from self.smoothing
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


def as_recorded(motion: "RecordedMotion | Any") -> RecordedMotion:
    """Return a recorded motion, of a planned `Motion` `PLAN_RATE` times a second."""
    if isinstance(motion, RecordedMotion):
        return motion
    samples: MotionSamples = motion.samples(PLAN_RATE)
    return record(samples.leg, samples.rate, samples.t, samples.q, 0.0, UNSMOOTHED)


def record(
    leg: Leg,
    rate: float,
    t: Array,
    q: Array,
    contact: float | None = None,
    window: int = WINDOW,
    warnings: tuple[str, ...] = (),
) -> RecordedMotion:
    """Return the motion of frames with velocities and accelerations; see `RecordedMotion`.

    Raises:
        InvalidInput: an even window, one of less than 5 frames, or of more than there are frames
            before or after the impact.
    """
    window = validation.whole("window", window, at_least=UNSMOOTHED)
    if window % 2 == 0:
        raise InvalidInput(f"window is {window}: it must be odd, so that a frame is in its middle")
    split = len(t) if contact is None else int((t <= contact + 1e-6 / rate).sum())
    sides = slice(0, split), slice(split, len(t))
    pieces = [piece for piece in sides if piece.start < piece.stop]
    for piece, side in zip(pieces, ("before", "after"), strict=False):
        if (count := piece.stop - piece.start) < window:
            where = f" {side} the impact" if len(pieces) > 1 else ""
            raise InvalidInput(f"there are {count} frames{where}: a window of {window} needs more")
    joints, floats = positions_of(leg, q), is_floating(leg)
    root = moved_poses(pin.SE3.Identity(), q[:, :BASE]) if floats else q[:, :0]
    frames, fit = np.hstack([root, joints]), (rate, floats)
    smooth, v, a = _derivatives(frames, pieces, window, *fit)
    smoothing = list[Row]()
    if window > UNSMOOTHED:
        moved, changed = smooth - frames, v - _derivatives(frames, pieces, UNSMOOTHED, *fit)[1]
        moved[:, 3 : root.shape[1]] *= 2.0  # of a quaternion, half the angle
        smoothing += _largest("position", moved, leg, t)
        smoothing += _largest("velocity", changed, leg, t)
    t, q = np.array(t), np.array(q)
    return RecordedMotion(leg, rate, t, q, v, a, contact, tuple(smoothing), warnings)


def _derivatives(
    frames: Array, pieces: list[slice], window: int, rate: float, floats: bool
) -> tuple[Array, Array, Array]:
    """Return smoothed frames, v and a, of base (position, quaternion) and joints in columns."""
    from scipy.signal import savgol_filter  # takes half a second

    orders = np.zeros((3, *frames.shape))
    for piece in pieces:
        fit = partial(savgol_filter, frames[piece], window, DEGREE, delta=1.0 / rate, axis=0)
        orders[:, piece] = [fit(deriv=order) for order in range(3)]
    smooth, v, a = orders
    if not floats:
        return smooth, v, a
    turn, turned, accelerated = orders[:, :, 3:BASE]
    rotation, omega = Rotation.from_quat(turn).inv(), _doubled(turn, turned)
    linear = rotation.apply(v[:, :3])
    change = rotation.apply(a[:, :3]) - np.cross(omega, linear)
    v = np.hstack([linear, omega, v[:, BASE:]])
    return smooth, v, np.hstack([change, _doubled(turn, accelerated), a[:, BASE:]])


def _largest(quantity: str, changes: Array, leg: Leg, t: Array) -> Iterable[Row]:
    """Yield rows of the largest changes of joints, and of position and rotation of a base."""
    names, per = file_joints(leg), "/s" if quantity == "velocity" else ""
    base = changes.shape[1] - len(names)
    parts = {"joints": np.abs(changes[:, base:])}
    if base:
        parts["base position"] = np.linalg.norm(changes[:, :3], axis=1)[:, None]
        parts["base rotation"] = np.linalg.norm(changes[:, 3:base], axis=1)[:, None]
    for part, sizes in parts.items():
        frame, column = divmod(int(sizes.argmax()), sizes.shape[1])
        unit, joint = "m" if part == "base position" else "rad", ""
        if part == "joints":
            unit, joint = leg.joint_unit(names[column]), f" of {names[column]}"
        where = f"{unit}{per}{joint} at {t[frame]:.4g} s"
        yield f"smoothing, {quantity} of {part}", float(sizes[frame, column]), where


def _doubled(q: Array, other: Array) -> Array:
    r"""Return :math:`2\, \mathrm{vec}(\bar q p) / |q|^2` of quaternions xyzw, shape `(k, 3)`."""
    vector = q[:, 3:] * other[:, :3] - other[:, 3:] * q[:, :3] - np.cross(q[:, :3], other[:, :3])
    return np.asarray(2.0 * vector / np.sum(q * q, axis=1, keepdims=True))


HEIGHT, AT_REST = 0.03, 0.5
"""Height of a sole above the lowest one of its frame up to which its foot stands [m], and speed of
the middle of the sole up to which it does [m/s]: soles of retargeted motions float and slide."""


@dataclass(frozen=True, eq=False)
class GroundForces:
    """The forces of a motion; of a leg on a fixed base, without feet.

    Attributes:
        feet: on which the robot may stand, the kicking foot last.
        soles: corners of their soles in each frame, each of shape `(k, c, 3)` [m, world frame].
        stands: whether each foot stands, shape `(k, feet)`.
        torque: of the joints, shape `(k, nv)` [N m; N]; of a floating base, what feet that stand do
            not supply.
        wrench: of the ground on the robot, shape `(k, 6)` [N, N m about the world's origin].
    """

    feet: tuple[Support, ...]
    soles: tuple[Array, ...]
    stands: NDArray[np.bool_]
    torque: Array
    wrench: Array


def feet_of(robot: Leg) -> tuple[Support, ...]:
    """Return a robot's supports, or its foot of the catalogue, and its kicking foot.

    On a fixed base, or if no foot but the kicking one is known, there are none.
    """
    if not is_floating(robot):
        return ()
    names = frames_by_name(robot.workspace.model)
    stance = ROBOTS[robot.name].stance if robot.name in ROBOTS else ""
    others = robot.supports or ((Support(stance),) if stance in names else ())
    return (*others, Support(robot.frame)) if others else ()


def ground_forces(motion: RecordedMotion, robot: Leg, feet: tuple[Support, ...]) -> GroundForces:
    r"""Return the forces of a motion by inverse dynamics, :math:`M \dot v + c + g - J^T w`.

    A foot stands if its sole is within `HEIGHT` of the lowest one in the frame, and slower than
    `AT_REST`. On both feet, forces are parallel, as in `WeightShift`.

    Raises:
        InvalidInput: a foot has no flat sole.
    """
    model, count = robot.model, len(motion.t)
    data, frames = model.createData(), [frame_id(model, foot.frame) for foot in feet]
    local = [sole_corners(robot, foot) for foot in feet]
    soles = tuple(np.zeros((count, len(corners), 3)) for corners in local)
    torque, wrench = np.zeros((count, robot.nv)), np.zeros((count, 6))
    poses = []
    for row, (q, v, a) in enumerate(zip(motion.q, motion.v, motion.a, strict=True)):
        torque[row] = pin.rnea(model, data, q, v, a)
        pin.framesForwardKinematics(model, data, q)
        poses.append([data.oMf[frame].copy() for frame in frames])
        for sole, corners, pose in zip(soles, local, poses[-1], strict=True):
            sole[row] = corners @ pose.rotation.T + pose.translation
        if feet:
            wrench[row] = data.oMi[1].act(pin.Force(torque[row, :6])).vector
    stands = _stands(soles, motion)
    for row in np.flatnonzero(stands.any(axis=1)).tolist():
        on = np.flatnonzero(stands[row]).tolist()[:2]
        parts = _shared(wrench[row], [soles[foot][row].mean(axis=0) for foot in on])
        for foot, part in zip(on, parts, strict=True):
            rows = pin.computeFrameJacobian(model, data, motion.q[row], frames[foot], pin.LOCAL)
            torque[row] -= rows.T @ poses[row][foot].actInv(pin.Force(part)).vector
    return GroundForces(feet, soles, stands, torque, wrench)


def _stands(soles: Sequence[Array], motion: RecordedMotion) -> NDArray[np.bool_]:
    """Return whether the feet of soles stand, shape `(k, feet)`."""
    from scipy.signal import savgol_filter

    if not soles:
        return np.zeros((len(motion.t), 0), bool)
    heights = np.array([sole[:, :, 2].min(axis=1) for sole in soles]).T
    middles = np.array([sole.mean(axis=1) for sole in soles])
    velocities = savgol_filter(middles, UNSMOOTHED, DEGREE, 1, 1.0 / motion.rate, axis=1)
    slow = np.linalg.norm(velocities, axis=2).T < AT_REST
    return np.asarray((heights <= heights.min(axis=1)[:, None] + HEIGHT) & slow)


def _shared(wrench: Array, places: list[Array]) -> tuple[Array, ...]:
    """Return the wrenches on one or two feet, whose soles have their middles at places [m]."""
    if len(places) == 1 or wrench[2] <= 0.0:
        return (wrench, np.zeros(6))[: len(places)]
    height = float(np.mean([place[2] for place in places]))
    parts = split_wrench(moved(wrench, height), np.array(places)[:, :2])
    return tuple(moved(part, -height) for part in parts)


def moved(wrench: Array, height: float) -> Array:
    """Return a wrench about the point above the world's origin at a height [m]."""
    x, y, _ = wrench[:3]
    return np.asarray(wrench - height * np.array([0.0, 0.0, 0.0, -y, x, 0.0]))
