"""Files of a motion, sampled at a constant rate, in the formats that other programs read.

CSV as of motions retargeted to G1 (LAFAN1), NumPy's NPZ, `trajectory_msgs/JointTrajectory` of
ROS 2 in YAML, and keyframes of MuJoCo.
"""

import json
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from kickdyn.core.files import FileName, checked_ending, replacing
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.robot.mjcf_file import MjcfFile
from kickdyn.robot.mjcf_model import mujoco_state
from kickdyn.robot.standing import is_floating


class MotionSamples(NamedTuple):
    """A motion at times of a constant rate.

    Attributes:
        leg: that moves, in its own coordinates.
        rate: of the samples [Hz].
        t: times, shape `(k,)` [s, impact at 0]. One of them is 0, just before the impact.
        q: configurations, shape `(k, nq)`.
        v: velocities, shape `(k, nv)`.
        torque: of the joints, shape `(k, nv)` [N m; N].
        ground_wrench: of the ground on the robot, shape `(k, 6)` [N, N m about the world's origin].
    """

    leg: Leg
    rate: float
    t: Array
    q: Array
    v: Array
    torque: Array
    ground_wrench: Array

    @property
    def joints(self) -> list[str]:
        """Names of the joints in a file, see `file_joints`."""
        return file_joints(self.leg)

    @property
    def joint_positions(self) -> Array:
        """Positions of `joints`, shape `(k, n)` [rad; m for prismatic joints]."""
        return positions_of(self.leg, self.q)

    @property
    def root(self) -> Array:
        """Position [m] and quaternion xyzw of the floating base in the world, shape `(k, 7)`.

        Neighbouring quaternions have the same sign. Of a leg on a fixed base the shape is `(k, 0)`.
        """
        if not is_floating(self.leg):
            return np.zeros((len(self.t), 0))
        return moved_poses(self.leg.model.jointPlacements[1], self.q[:, :7])


def moved_poses(frame: Any, poses: Array) -> Array:
    """Return poses in a `pin.SE3` as poses outside of it, with neighbouring signs the same.

    Poses have positions [m] and quaternions xyzw, shape `(k, 7)`.
    """
    outside = np.array([pin.SE3ToXYZQUAT(frame * pin.XYZQUATToSE3(pose)) for pose in poses])
    flipped = np.sum(outside[1:, 3:] * outside[:-1, 3:], axis=1) < 0.0
    outside[1:, 3:] *= np.where(np.cumsum(flipped) % 2, -1.0, 1.0)[:, None]
    return outside


def configurations(leg: Leg, root: Array, joints: Array) -> Array:
    """Return configurations, shape `(k, nq)`, from `root` and `joint_positions` of samples."""
    model = leg.workspace.model
    steps = np.hstack([np.zeros((len(joints), 6 * is_floating(leg))), joints])
    q = np.array([pin.integrate(model, pin.neutral(model), step) for step in steps])
    if root.size:
        q[:, :7] = moved_poses(model.jointPlacements[1].inverse(), root)
    return q


def positions_of(leg: Leg, q: Array) -> Array:
    """Return the positions of `file_joints` in configurations over time, shape `(k, n)` [rad; m].

    Angles of continuous joints are unwrapped.
    """
    names, model = file_joints(leg), leg.model
    values = [leg.joint_values(row) for row in q]
    positions = np.array([[value[name] for name in names] for value in values])
    continuous = [model.nqs[model.getJointId(name)] == 2 for name in names]
    positions[:, continuous] = np.unwrap(positions[:, continuous], axis=0)
    return positions


def file_joints(leg: Leg) -> list[str]:
    """Return the joints of a leg without a floating base, in the order of the model.

    Raises:
        InvalidInput: a joint of several degrees of freedom, which the formats do not have.
    """
    names = list(leg.joint_names[is_floating(leg) :])
    several = [name for name in names if name not in leg.single_joints]
    if several:
        raise InvalidInput(
            f"joint {several[0]!r} has several degrees of freedom: files of motions have "
            "joints of one"
        )
    return names


def ranges_of(leg: Leg, names: Iterable[str]) -> Array:
    """Return lower and upper limits of joints, infinite if continuous, `(n, 2)` [rad; m]."""
    turning = {
        str(name)
        for name, size in zip(leg.joint_names, leg.workspace.model.nqs[1:], strict=True)
        if size == 2
    }
    endless = -math.inf, math.inf
    return np.array([endless if name in turning else leg.joint_range(name) for name in names])


def write_motion(samples: MotionSamples, file: FileName) -> None:
    """Write a motion in the format of the file's ending, one of `WRITERS`."""
    writer = check_motion_name(file)
    with replacing(file) as draft:
        writer(samples, draft)


def check_motion_name(file: FileName) -> Callable[[MotionSamples, Path], None]:
    """Return the writer for the ending of a file; raise `InvalidInput` if there is none."""
    return WRITERS[checked_ending(file, WRITERS, "a motion is written as")]


def _write_csv(samples: MotionSamples, file: Path) -> None:
    np.savetxt(file, np.hstack([samples.root, samples.joint_positions]), delimiter=",", fmt="%.17g")


def _write_npz(samples: MotionSamples, file: Path) -> None:
    root, base = samples.root, 6 * is_floating(samples.leg)
    arrays: dict[str, Any] = {
        "fps": samples.rate,
        "time": samples.t,
        "joint_names": np.array(samples.joints),
        "joint_pos": samples.joint_positions,
        "joint_vel": samples.v[:, base:],
        "joint_torque": samples.torque[:, base:],
        "root_pos": root[:, :3],
        "root_quat_xyzw": root[:, 3:],
        "ground_wrench": samples.ground_wrench,
    }
    with file.open("wb") as out:
        np.savez(out, **arrays)


def _write_yaml(samples: MotionSamples, file: Path) -> None:
    base = 6 * is_floating(samples.leg)
    rows = zip(samples.joint_positions, samples.v[:, base:], samples.torque[:, base:], strict=True)
    lines = [
        "header: {stamp: {sec: 0, nanosec: 0}, frame_id: ''}",
        f"joint_names: {json.dumps(samples.joints)}",  # JSON is YAML
        "points:",
    ]
    for time, (positions, velocities, efforts) in zip(samples.t - samples.t[0], rows, strict=True):
        seconds, nanoseconds = divmod(round(1e9 * time), 10**9)
        lines += [
            f"- positions: {_yaml_list(positions)}",
            f"  velocities: {_yaml_list(velocities)}",
            "  accelerations: []",
            f"  effort: {_yaml_list(efforts)}",
            f"  time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}",
        ]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _yaml_list(values: Iterable[float]) -> str:
    """Return numbers as a list in YAML 1.1, which takes 1e-05 without a point for text."""
    texts = (repr(float(value)) for value in values)
    return f"[{', '.join(text if '.' in text else text.replace('e', '.0e') for text in texts)}]"


def _write_keyframes(samples: MotionSamples, file: Path) -> None:
    lines = ["<mujoco>", "  <keyframe>"]
    model, robot_file = samples.leg.model, samples.leg.file
    compiled = robot_file.compile() if isinstance(robot_file, MjcfFile) else None
    for number, (time, q, v) in enumerate(zip(samples.t, samples.q, samples.v, strict=True)):
        qpos, qvel = mujoco_state(model, q, v, compiled)
        name = quoteattr(f"kick {number}")
        state = f'qpos="{_row(qpos)}" qvel="{_row(qvel)}"'
        lines.append(f'    <key name={name} time="{float(time)!r}" {state}/>')
    lines += ["  </keyframe>", "</mujoco>"]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _row(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


WRITERS: dict[str, Callable[[MotionSamples, Path], None]] = {
    ".csv": _write_csv,
    ".npz": _write_npz,
    ".yaml": _write_yaml,
    ".xml": _write_keyframes,
}
"""Writers of the formats, by the ending of the file."""
