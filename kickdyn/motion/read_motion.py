"""`read_motion`: a motion from a file, checked against the robot that is to perform it."""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from kickdyn.core import validation
from kickdyn.core.files import FileName, check_file, checked_ending, read_text
from kickdyn.core.validation import Array
from kickdyn.errors import FaultyFile, InvalidInput
from kickdyn.motion.motion_file import configurations, file_joints, ranges_of
from kickdyn.motion.motion_record import LEAST_FRAMES, WINDOW, RecordedMotion, record
from kickdyn.robot.leg import Leg
from kickdyn.robot.names import MAX_FAULTY, listed
from kickdyn.robot.standing import is_floating

LARGEST = 500_000_000
"""Size of the largest file of a motion that is read [bytes]."""

BASE_COLUMNS = 7
"""Columns of the floating base in a CSV file: its position and its quaternion."""


class MotionTable(NamedTuple):
    """What a file has of a motion of k frames; None or empty is what it has not."""

    source: str  # name of the file
    # positions of the joints, shape `(k, n)`; of a CSV file, with the base before them
    joints: Array
    root: Array | None = None  # position and quaternion of the base, shape `(k, 7)`
    quaternion: str = ""  # order of the quaternions in `root`
    names: tuple[str, ...] = ()  # of the joints, or of the columns of a CSV file
    rate: float | None = None  # of the frames [Hz]
    t: Array | None = None  # times, shape `(k,)` [s, impact at 0]
    bodies: Array | None = None  # positions of bodies in the world, shape `(k, m, 3)` [m]

    def fault(self, text: str) -> FaultyFile:
        """Return the error of a fault of the file."""
        return FaultyFile(self.source, [text])


def _read_csv(file: FileName, source: str) -> MotionTable:
    text = read_text(file, source, LARGEST, FaultyFile)
    if not text.strip():
        raise FaultyFile(source, ["is empty"])
    head, _, _ = text.lstrip().partition("\n")
    names = tuple(word.strip().strip('"') for word in head.split(","))
    try:
        has_header = not np.array(names, dtype=float).size
    except ValueError:
        has_header = True
    try:
        if "\n" not in text.strip():
            raise ValueError("a motion has several rows")
        table = np.loadtxt(StringIO(text), delimiter=",", ndmin=2, skiprows=int(has_header))
    except ValueError as error:
        raise FaultyFile(source, [f"is no table of numbers: {error}"]) from None
    if has_header and len(names) != table.shape[1]:
        counts = f"{len(names)} names in its first line and {table.shape[1]} columns"
        raise FaultyFile(source, [f"has {counts}: each column needs a name"])
    return MotionTable(source, _finite(table, source, ""), names=names if has_header else ())


def _read_npz(file: FileName, source: str) -> MotionTable:
    check_file(file, source, LARGEST, FaultyFile)
    try:
        # NumPy leaves a damaged file open that it has opened itself
        with Path(file).open("rb") as opened, np.load(opened, allow_pickle=False) as read:
            arrays = {name: read[name] for name in (*_SHAPES, "fps", "joint_names")
                      if name in read.files and read[name].size}  # fmt: skip
    except Exception as error:  # NumPy and zipfile raise many kinds for damaged bytes
        raise FaultyFile(source, [f"is no NPZ file of arrays: {error}"]) from None
    if "joint_pos" not in arrays:
        raise FaultyFile(source, ["has no joint_pos, the positions of the joints"])
    names = tuple(map(str, np.ravel(arrays.pop("joint_names", ()))))
    fps = np.ravel(arrays.pop("fps", ()))
    k = len(arrays["joint_pos"])
    for name, shape in _SHAPES.items():
        array = arrays.get(name, np.zeros(0))
        fits = array.ndim == len(shape) and array.dtype.kind in "fiu" and len(array) == k
        if name in arrays and not (fits and shape[-1] in (None, array.shape[-1])):
            raise FaultyFile(source, [f"has {name} of shape {array.shape} for {k} frames"])
        arrays[name] = _finite(np.asarray(array, float), source, name)
    root, quaternion, bodies = None, "", None
    if arrays["root_pos"].size and arrays["root_quat_xyzw"].size:
        root, quaternion = np.hstack([arrays["root_pos"], arrays["root_quat_xyzw"]]), "xyzw"
    elif arrays["body_pos_w"].size and arrays["body_quat_w"].size:
        bodies, quaternion = arrays["body_pos_w"], "wxyz"
        root = np.hstack([bodies[:, 0], arrays["body_quat_w"][:, 0]])
    rate = float(fps[0]) if fps.size == 1 and fps.dtype.kind in "fiu" else None
    t = arrays["time"] if arrays["time"].size else None
    return MotionTable(source, arrays["joint_pos"], root, quaternion, names, rate, t, bodies)


_SHAPES: dict[str, tuple[int | None, ...]] = {
    "joint_pos": (None, None), "time": (None,), "root_pos": (None, 3), "root_quat_xyzw": (None, 4),
    "body_pos_w": (None, None, 3), "body_quat_w": (None, None, 4),
}  # fmt: skip
"""Arrays of numbers in an NPZ file, with their shapes; None is any size."""


def _finite(table: Array, source: str, name: str) -> Array:
    """Return a table; raise `FaultyFile` with row and column of an entry that is not finite."""
    faulty = np.argwhere(~np.isfinite(table))
    if len(faulty):
        row, *columns = (faulty[0] + 1).tolist()
        column = f", column {columns[-1]}" if columns else ""
        of_name = f" of {name}" if name else ""
        value = table[tuple(faulty[0])]
        fault = f"has {value} in row {row}{column}{of_name}: every number must be finite"
        raise FaultyFile(source, [fault])
    return table


READERS: dict[str, Callable[[FileName, str], MotionTable]] = {
    ".csv": _read_csv,
    ".npz": _read_npz,
}
"""Readers of the formats, by the ending of the file."""


BREADTH_FIRST, OF_MODEL = "breadth-first", "model"
"""Orders of joints with a name: that of Isaac Lab, and that of the model, depth first."""

UNIT = 1e-3
"""Largest error of the length of a quaternion: files have rounded digits."""

UPRIGHT, LYING = math.cos(math.radians(45)), math.cos(math.radians(60))
"""Cosines of the tilt of a base up to which it is upright, and from which on it lies."""

APART = 0.01
"""Distance of a joint from the nearest body of a file up to which they agree [m]."""

OUTSIDE = 0.05
"""Least excess of a joint's range that makes the order of the joints doubtful [rad]."""

TOO_FAST, MANY = 1.5, 0.1
"""Speed over its limit from which on the rate is doubtful, in this share of the frames."""

ROUNDED = 1e-6
"""Excess of a joint's range that rounding in a file explains [rad; m]."""


@validation.check_arguments
def read_motion(
    file: FileName,
    robot: Leg,
    *,
    rate: float | None = None,
    joints: Sequence[str] | str | None = None,
    contact: float | None = None,
    window: int = WINDOW,
    quaternion: str = "xyzw",
) -> RecordedMotion:
    """Read a motion that was recorded, retargeted to a robot or planned.

    A `.csv` file has a row for each frame: position of the floating base [m, world frame], its
    quaternion, and the joints in the order of the model; for a leg on a fixed base, the joints
    alone. Its first line may have names. An `.npz` file has `joint_pos`, `fps` and the base as
    `root_pos` and `root_quat_xyzw` (`Motion.save`), or as `body_pos_w` and `body_quat_w` (wxyz),
    whose first body is the base (BeyondMimic); it may have `joint_names`.

    Args:
        file: its name.
        robot: that moves, with all joints of the file.
        rate: of the frames [Hz]; None is that of an `.npz` file.
        joints: names of the joints in the order of the file; or `breadth-first`, the order of Isaac
            Lab; or `model`. None is the order of the names in the file, or else of the model.
        contact: time of an impact [s, the first frame is at 0 if the file has no times], across
            which nothing is smoothed; v at a frame at this time is just before it. With None, it is
            at 0 in a file with times before and after that.
        window: number of frames, odd, through which polynomials of degree 4 are fitted for
            velocities and accelerations; 5 is without smoothing.
        quaternion: order of the base's quaternions in a `.csv` file, `xyzw` or `wxyz`.

    Returns:
        The motion, with warnings of joints outside their ranges and of a doubtful rate.

    Raises:
        InvalidInput: a file that cannot be read, is of another robot, or has too few frames, angles
            in degrees, or another order of joints or quaternions than is said.
    """
    validation.check_type(str, os.PathLike, file=file)
    if quaternion not in ("xyzw", "wxyz"):
        raise InvalidInput(f"quaternion is {quaternion!r}: it must be xyzw or wxyz")
    names = file_joints(robot)
    ending = checked_ending(file, READERS, "a motion is read from")
    table = _with_root(READERS[ending](file, str(file)), robot, len(names))
    if len(table.joints) < LEAST_FRAMES:
        raise table.fault(f"has {len(table.joints)} frames: a motion needs at least {LEAST_FRAMES}")
    if rate is None and table.rate is None:
        raise InvalidInput("rate is None: the file does not have it, so give the frames' rate [Hz]")
    rate = table.rate if rate is None else rate
    rate = validation.number("rate", rate, above=0, at_most=1e5, unit="Hz")
    t = np.arange(len(table.joints)) / rate if table.t is None else table.t
    if not np.allclose(np.diff(t), 1.0 / rate, rtol=0.01):
        raise table.fault(
            f"has times that are {np.median(np.diff(t)):.4g} s apart in the median: at {rate:g} Hz "
            f"all must be {1.0 / rate:.4g} s apart"
        )
    if table.rate is not None and not math.isclose(rate, table.rate, rel_tol=0.01):
        raise table.fault(f"has frames at {table.rate:g} Hz, and rate is {rate:g} Hz: leave it out")
    if contact is not None:
        begin, end = float(t[0]), float(t[-1])
        contact = validation.number("contact", contact, at_least=begin, at_most=end, unit="s")
    elif t[0] < 0.0 < t[-1]:
        contact = 0.0
    order = _order(robot, joints, table)
    ordered = table.joints[:, [order.index(name) for name in names]]
    other = breadth_first(robot)
    breadthwise = table.joints[:, [other.index(name) for name in names]]
    root = _unit_root(table, quaternion)
    _check_angles(robot, table, ordered)
    if joints is None and not table.names:
        _check_order(robot, table, ordered, breadthwise)
    q = configurations(robot, root, ordered)
    if table.bodies is not None:
        _check_bodies(robot, table, q, configurations(robot, root, breadthwise))
    motion = record(robot, rate, t, q, contact, window, _range_warnings(robot, ordered, t))
    doubt = _rate_doubt(motion)
    return replace(motion, warnings=(doubt, *motion.warnings)) if doubt else motion


def _with_root(table: MotionTable, robot: Leg, count: int) -> MotionTable:
    """Return a table whose base and joints are apart and are as many as those of a robot."""
    floats, columns = is_floating(robot), table.joints.shape[1]
    from_csv = table.root is None and table.rate is None
    base = BASE_COLUMNS if floats else 0
    if floats and table.root is None and columns == base + count:
        root, joints = np.split(table.joints, [base], axis=1)
        return table._replace(joints=joints, root=root, names=table.names[base:])
    if columns == count and (table.root is not None) == floats:
        return table
    parts = f"{base} for its floating base (position, quaternion) and {count} for its joints"
    robots = f"{robot.name or 'the leg'} on a {'floating' if floats else 'fixed'} base"
    if floats and columns == count:
        fault = f"has {count} columns of joints and no base: {robots} needs {parts}"
    elif not floats and columns == count + (BASE_COLUMNS if from_csv else 0):
        fault = f"has a floating base: {robots} has {count} joints only (base='floating')"
    elif from_csv:
        need = f"{base + count}: {parts}" if floats else f"{count}, its joints"
        fault = f"has {columns} columns: {robots} needs {need}"
    else:
        fault = f"has {columns} joints: {robots} has {count}"
    raise table.fault(fault)


def _order(robot: Leg, joints: Sequence[str] | str | None, table: MotionTable) -> list[str]:
    """Return the names of the joints in the order of a file."""
    names = file_joints(robot)
    if joints is None:
        order = list(table.names or names)
    elif isinstance(joints, str):
        if joints not in (BREADTH_FIRST, OF_MODEL):
            raise InvalidInput(
                f"joints is {validation.brief(joints)}: it must be the names of the joints in the "
                f"order of the file, {BREADTH_FIRST} or {OF_MODEL}"
            )
        order = names if joints == OF_MODEL else breadth_first(robot)
    else:
        for name in joints:
            validation.check_type(str, joint=name)
        order = list(joints)
    if sorted(order) == sorted(names):
        return order
    where = "joints" if joints is not None else f"{table.source}: its names of joints"
    missing = [name for name in names if name not in order]
    others = [name for name in order if name not in names]
    faults = [f"lacks {listed(missing, MAX_FAULTY)}"] if missing else []
    faults += [f"has {listed(others, MAX_FAULTY)}, which {robot.name} has not"] if others else []
    raise InvalidInput(f"{where}: {' and '.join(faults) or 'has a joint twice'}")


def breadth_first(robot: Leg) -> list[str]:
    """Return the joints in breadth-first order, as Isaac Lab has them."""
    model = robot.workspace.model
    depths = {str(model.names[j]): len(model.supports[j]) for j in range(1, model.njoints)}
    return sorted(file_joints(robot), key=depths.__getitem__)


def _unit_root(table: MotionTable, quaternion: str) -> Array:
    """Return position and unit quaternion xyzw of the base, shape `(k, 7)`, or `(k, 0)`."""
    if table.root is None:
        return np.zeros((len(table.joints), 0))
    place, turns = table.root[:, :3], table.root[:, 3:]
    length = np.linalg.norm(turns, axis=1)
    row = int(np.abs(length - 1.0).argmax())
    if abs(length[row] - 1.0) > UNIT:
        raise table.fault(
            f"has a quaternion of length {length[row]:.4g} for the base in row {row + 1}: it must "
            "be 1 (columns 4 to 7 of a CSV file)"
        )
    orders = {"xyzw": turns, "wxyz": turns[:, [1, 2, 3, 0]]}
    used = table.quaternion or quaternion
    if not table.quaternion:
        up = {name: Rotation.from_quat(q[0]).as_matrix()[2, 2] for name, q in orders.items()}
        other = "wxyz" if used == "xyzw" else "xyzw"
        if up[used] < LYING and up[other] > UPRIGHT:
            raise table.fault(
                f"has a base that is not upright in the first frame: its quaternions seem to be "
                f"{other}, not {used}; quaternion={other!r} (--quaternion) reads them"
            )
    return np.hstack([place, orders[used] / length[:, None]])


def _check_angles(robot: Leg, table: MotionTable, joints: Array) -> None:
    """Refuse angles beyond a turn, and beyond the range of their joint."""
    names = file_joints(robot)
    for name, angles, bounds in zip(names, joints.T, ranges_of(robot, names), strict=True):
        row, reach = int(np.abs(angles).argmax()), np.abs(bounds).max()
        is_angle = robot.joint_unit(name) == "rad" and reach < math.inf
        if is_angle and abs(angles[row]) > max(math.tau, reach):
            raise table.fault(
                f"has {name} at {angles[row]:.4g} in row {row + 1}, more than a turn: angles must "
                "be in radians, and seem to be in degrees"
            )


def _excess(robot: Leg, joints: Array) -> Array:
    """Return how far joints are outside their ranges, shape `(k, n)` [rad; m]."""
    lower, upper = ranges_of(robot, file_joints(robot)).T
    return np.asarray(np.maximum(lower - joints, joints - upper))


def _check_order(robot: Leg, table: MotionTable, joints: Array, breadthwise: Array) -> None:
    """Refuse joints that fit their ranges in breadth-first order only."""
    excess = _excess(robot, joints)
    row, column = np.unravel_index(excess.argmax(), excess.shape)
    most = float(excess[row, column])
    if most > OUTSIDE and _excess(robot, breadthwise).max() < 0.1 * most:
        raise table.fault(
            f"has {file_joints(robot)[column]} outside its range by {most:.2g} rad in row {row + 1}"
            " in the order of the model, but not in breadth-first order, which Isaac Lab writes: "
            f"name the order, joints={BREADTH_FIRST!r} or {OF_MODEL!r} (--joints), or all names"
        )


def _check_bodies(robot: Leg, table: MotionTable, q: Array, breadthwise: Array) -> None:
    """Refuse joints that are not where the file has bodies, at ten of its times."""
    rows = np.unique(np.linspace(0, len(q) - 1, LEAST_FRAMES).astype(int))
    space, bodies = robot.workspace, np.asarray(table.bodies)

    def farthest(q: Array) -> tuple[float, str]:
        worst = 0.0, ""
        for row in rows:
            pin.forwardKinematics(space.model, space.data, q[row])
            for joint in range(1, space.model.njoints):
                apart = np.linalg.norm(bodies[row] - space.data.oMi[joint].translation, axis=1)
                worst = max(worst, (float(apart.min()), str(space.model.names[joint])))
        return worst

    apart, name = farthest(q)
    if apart > APART:
        hint = "joints= names the order of the file, or it is of another model"
        hint = f"joints={BREADTH_FIRST!r} agrees" if farthest(breadthwise)[0] <= APART else hint
        raise table.fault(
            f"has no body nearer than {apart:.2g} m to joint {name}, where the positions of the "
            f"joints put it: {hint}"
        )


def _range_warnings(robot: Leg, joints: Array, t: Array) -> tuple[str, ...]:
    """Return a line for each joint that is outside its range, the farthest first."""
    lines = list[tuple[float, str]]()
    for name, excess in zip(file_joints(robot), _excess(robot, joints).T, strict=True):
        row, count = int(excess.argmax()), int((excess > ROUNDED).sum())
        if count:
            amount = f"{excess[row]:.2g} {robot.joint_unit(name)}"
            where = f"at {t[row]:.4g} s (frame {row}), in {count} of {len(t)} frames"
            lines.append((excess[row], f"{name} is outside its range by {amount} {where}"))
    return tuple(line for _, line in sorted(lines, reverse=True))


def _rate_doubt(motion: RecordedMotion) -> str:
    """Return a line if joints are too fast in many frames; empty if they are not."""
    limit = motion.leg.velocity_limit
    limit = np.where(limit > 0.0, limit, math.inf)
    use = (np.abs(motion.v) / limit).max(axis=1)
    fast = use > TOO_FAST
    if fast.mean() <= MANY:
        return ""
    factor = float(np.median(use[fast]))
    return (
        f"joints exceed their speed limits in {100 * fast.mean():.0f} % of the frames, by a factor "
        f"of {factor:.2g} in their median: a rate of {motion.rate / factor:.2g} Hz instead of "
        f"{motion.rate:g} Hz would fit"
    )
