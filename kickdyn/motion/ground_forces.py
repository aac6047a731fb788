"""Which feet of a recorded motion stand, the wrenches of the ground on them, and the torques."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from kickdyn.core.validation import Array
from kickdyn.motion.recorded_motion import DEGREE, UNSMOOTHED, RecordedMotion
from kickdyn.motion.weight_shift import split_wrench
from kickdyn.robot.catalog import ROBOTS
from kickdyn.robot.constraints import Support
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frame_id, frames_by_name
from kickdyn.robot.standing import is_floating, sole_corners

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

    @classmethod
    def unknown(cls, count: int, nv: int) -> "GroundForces":
        """Return the forces of a motion of a robot whose feet are not known."""
        none = np.full((count, nv), np.nan), np.full((count, 6), np.nan)
        return cls((), (), np.zeros((count, 0), bool), *none)


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


def ground_forces(motion: RecordedMotion, robot: Leg) -> GroundForces:
    r"""Return the forces of a motion by inverse dynamics, :math:`M \dot v + c + g - J^T w`.

    A foot stands if its sole is within `HEIGHT` of the lowest one in the frame, and slower than
    `AT_REST`. On both feet, forces are parallel, as in `WeightShift`.

    Raises:
        InvalidInput: a foot has no flat sole.
    """
    feet, model, count = feet_of(robot), robot.model, len(motion.t)
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
