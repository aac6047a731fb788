"""A robot's kicking chain, and a robot that stands on one foot as one on a fixed base: that foot.

With the foot as its root, the robot is a tree on a fixed base, and what is made for those
(`kicking_chain`, `plan_kick`) applies to it.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from kickdyn.core.mechanics import rotation_between
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.constraints import Support
from kickdyn.robot.ground_clearance import (
    Spheres,
    body_frames,
    find_unread,
    joined,
    shape_of,
    shapes_of,
)
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.model_validation import frame_id
from kickdyn.robot.names import listed
from kickdyn.robot.surgery import (
    angle_model,
    coordinate_indices,
    has_floating_base,
    reduce_model,
    reroot_model,
)

UNLIMITED = 100.0
"""Speed that counts as the limit where no joint has one [rad/s]: faster than any that kicks."""

SOLE_THICKNESS = 2e-3
"""Height above the lowest point of a foot up to which its shapes count as its sole [m]."""

NARROW = 0.02
"""Width of a sole below which the foot may stand on another face of its shapes [m]."""

MOST_TILT = np.radians(30.0)
"""Largest angle of a sole to the ground while all joints are at 0 [rad]."""


@dataclass(frozen=True, eq=False)
class KickingChain:
    """The joints between a fixed base and the contact frame, and where the whole robot has them.

    An impact on the chain and its motion are those of the whole robot with other joints at
    rest. `leg` is the chain with these locked; `qs` and `vs` are its indices in the robot's q
    and v.
    """

    leg: Leg
    qs: NDArray[np.int64]
    vs: NDArray[np.int64]

    def robot_state(self, robot: Leg, q: Array, v: Array) -> tuple[Array, Array]:
        """Return q and v of the robot from the chain's, all other joints at rest."""
        configuration, velocity = rest_configuration(robot), np.zeros(robot.nv)
        configuration[self.qs], velocity[self.vs] = q, v
        return configuration, velocity


def assumed_speed_limit(leg: Leg) -> Array:
    """Return the limits of the joints' speeds, shape `(nv,)` [rad/s; m/s for prismatic joints].

    A joint without a limit, or with 0, has the largest limit of the joints of its unit; inf if none
    of them has one.
    """
    limit = np.where(leg.velocity_limit > 0.0, leg.velocity_limit, np.inf)
    units = {name: leg.joint_unit(name) for name in leg.single_joints}
    for unit in {*units.values()}:
        columns = [leg.velocity_index(name) for name in units if units[name] == unit]
        known = limit[columns][np.isfinite(limit[columns])]
        limit[columns] = np.where(
            np.isfinite(limit[columns]), limit[columns], known.max(initial=0.0) or np.inf
        )
    return limit


def rest_configuration(robot: Leg, others: Mapping[str, float] | None = None) -> Array:
    """Return q with every joint at the value of its range that is nearest to 0, shape `(nq,)`.

    Joints of several degrees of freedom are at 0, mimic joints where their drivers put them.
    `others` are values of joints that are elsewhere [rad; m for prismatic joints].
    """
    following = {mimic.joint for mimic in robot.mimics}
    ranges = {name: robot.joint_range(name) for name in robot.single_joints}
    nearest = {name: min(max(low, 0.0), high) for name, (low, high) in ranges.items()}
    nearest.update(others or {})
    return robot.configuration({
        name: value for name, value in nearest.items() if value and name not in following
    })  # fmt: skip


def kicking_chain(
    robot: Leg, *, branches: bool = False, others: Mapping[str, float] | None = None
) -> KickingChain:
    """Return the joints that move a robot's contact frame, each of one coordinate.

    With `branches`, joints that branch off are kept too: an impact at the contact frame moves
    them. `others` are values of joints that are taken out, as for `rest_configuration`. Raises
    `InvalidInput` for other joints, without `branches`, or if one mimics another or is
    mimicked.
    """
    model = robot.model
    joints = path = [int(joint) for joint in model.supports[robot.contact_joint]][1:]
    if branches:
        joints = [int(joint) for joint in model.subtrees[path[0]]]
    elif wide := [str(model.names[joint]) for joint in path if model.nqs[joint] != 1]:
        raise InvalidInput(
            f"joint {wide[0]!r} moves the contact frame of {robot.name} by more than one "
            "coordinate: every joint of the kicking chain must have one, and the base must be fixed"
        )
    names = {str(model.names[joint]) for joint in joints}
    for mimic in robot.mimics:
        if mimic.joint in names or mimic.driver in names:
            raise InvalidInput(
                f"joint {mimic.joint!r} mimics {mimic.driver!r}: kicks are planned without mimic "
                f"joints in the kicking limb; lock {mimic.driver!r}, which locks both (Leg.locked, "
                f"--lock {mimic.driver}=VALUE)"
            )
    leg = robot
    if locked := [name for name in robot.joint_names if name not in names]:
        leg = robot.with_model(reduce_model(model, locked, rest_configuration(robot, others)))
    return KickingChain(leg, *coordinate_indices(model, joints))


def foot_directions(postures: Iterable[Posture]) -> Array:
    """Return orthonormal directions, `(k, 3)`, in which a foot moves at all, by drawn postures."""
    directions, gains, _ = np.linalg.svd(np.hstack([x.jacobian for x in postures]))
    return np.asarray(directions[:, gains > 1e-9 * gains[0]].T)


def vertical_plane(directions: Array) -> Array | None:
    """Return the normal, to the left, of a vertical plane in which a foot moves; None without."""
    if len(directions) != 2:
        return None
    x, y, z = np.cross(*directions).tolist()
    side = math.copysign(math.hypot(x, y), y)  # legs face x
    return None if abs(z) > 1e-9 else np.array([x / side, y / side, 0.0])


def with_angles(robot: Leg) -> Leg:
    """Return a robot whose continuous joints have one angle in q, from -pi to pi, as plans do."""
    model = robot.workspace.model
    has_continuous = (2, 1) in zip(model.nqs, model.nvs, strict=True)
    return robot.with_model(angle_model(robot.model)) if has_continuous else robot


class StandingRobot:
    r"""A robot that stands on one flat foot, and the same robot with this foot as its root.

    The ground is the plane :math:`z = 0`. The foot lies on it as it does while all joints are at 0
    and the base is upright; a foot whose sole is tilted then is turned until it is level.
    Joints between foot and base keep their names, values, velocities and limits (`reroot_model`).

    Attributes:
        robot: on a floating base, on `support`.
        support: on which it stands, with its sole.
        leg: the same bodies on a fixed base, the supporting foot, without supports.
        placement: of the supporting frame in the world, a `pin.SE3`.
        sole: corners of the sole, shape `(k, 2)` [m, world frame, x and y].
        trunk_joint: of `leg` that carries the trunk, which is the body of the floating base; empty
            where the trunk is the foot.
        trunk_axis: that is vertical while the robot stands upright, shape `(3,)` [trunk joint's
            frame].
    """

    def __init__(self, robot: Leg) -> None:
        robot = lock_idle_mimics(robot)
        support = _flat_support(robot)
        model = robot.workspace.model
        self._frame = frame_id(model, support.frame)
        self.placement, corners = _flat_on_ground(robot, support)
        self.sole = _on_ground(self.placement, corners)
        self.support = replace(support, sole=corners)
        self.robot = robot.with_supports(self.support)
        frame = model.frames[self._frame]
        root = self.placement * frame.placement.inverse()
        rooted = reroot_model(robot.model, int(frame.parentJoint), root)
        self.leg = Leg(rooted, robot.frame, contact_normal_cone=robot.contact_normal_cone)
        above = list(model.supports[int(frame.parentJoint)])[2:]
        self.trunk_joint = str(model.names[above[0]]) if above else ""
        leg_model, data = self.leg.workspace.model, self.leg.workspace.data
        pin.forwardKinematics(leg_model, data, self.leg.configuration())
        number = leg_model.getJointId(self.trunk_joint) if above else 0
        pin.forwardKinematics(model, upright := model.createData(), robot.configuration())
        foot = pin.updateFramePlacement(model, upright, self._frame)
        turn = self.placement.rotation @ foot.rotation.T  # of the robot with joints at 0
        self.trunk_axis = data.oMi[number].rotation.T @ turn[:, 2]
        names = robot.joint_names[1:]
        self._of_leg, self._of_robot = (
            coordinate_indices(tree, [tree.getJointId(name) for name in names])
            for tree in (leg_model, model)
        )

    def kicking_foot(self) -> "Foot":
        """Return the foot that kicks, as it stands beside the supporting one."""
        robot = self.robot
        model = robot.workspace.model
        placement, corners = _flat_on_ground(robot, Support(robot.frame))
        frame = model.frames[frame_id(model, robot.frame)]
        pose = placement * frame.placement.inverse()
        return Foot(robot.frame, pose, _on_ground(placement, corners))

    def robot_state(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return q and v of the robot from the leg's, the foot where it stands."""
        robot = self.robot
        configuration, velocity = robot.configuration(), np.zeros(robot.nv)
        (leg_qs, leg_vs), (robot_qs, robot_vs) = self._of_leg, self._of_robot
        configuration[robot_qs], velocity[robot_vs] = q[leg_qs], v[leg_vs]
        configuration = place_base(robot, configuration, self._frame, self.placement)
        model, data = robot.workspace.model, robot.workspace.data
        rows = pin.computeFrameJacobian(model, data, configuration, self._frame, pin.LOCAL)
        velocity[:6] = np.linalg.solve(rows[:, :6], -rows[:, 6:] @ velocity[6:])
        return configuration, velocity


@dataclass(frozen=True, eq=False)
class Foot:
    """The kicking foot on the ground: contact frame, `pin.SE3` of its joint, sole `(k, 2)` [m]."""

    frame: str
    pose: Any
    sole: Array


def sole_edges(standing: StandingRobot | Foot) -> tuple[Array, Array]:
    """Return normals, outwards, and offsets of the sole's edges, `(k, 2)` and `(k,)` [m]."""
    edges = ConvexHull(standing.sole).equations
    return edges[:, :2], -edges[:, 2]


def place_base(robot: Leg, q: Array, frame: int, placement: Any) -> Array:
    """Return q of a robot with its floating base moved so that a frame has a placement."""
    model, data = robot.workspace.model, robot.workspace.data
    placed = q.copy()
    placed[:7] = pin.neutral(model)[:7]
    pin.forwardKinematics(model, data, placed)
    seen = pin.updateFramePlacement(model, data, frame)
    root = model.jointPlacements[1]
    placed[:7] = pin.SE3ToXYZQUAT(root.inverse() * placement * seen.inverse() * root)
    return placed


def hold_support(posture: Posture, q: Array) -> Array:
    """Return q with a floating base moved so that the first support is where a posture has it."""
    leg = posture.leg
    if not leg.supports or not is_floating(leg):
        return q
    model, data = leg.workspace.model, leg.workspace.data
    frame = frame_id(model, leg.supports[0].frame)
    pin.forwardKinematics(model, data, posture.q)
    placement = pin.updateFramePlacement(model, data, frame).copy()
    return place_base(leg, q, frame, placement)


def is_floating(robot: Leg) -> bool:
    """Return whether the first joint of a robot is a floating base."""
    return has_floating_base(robot.workspace.model)


def lock_idle_mimics(robot: Leg) -> Leg:
    """Return a robot with the mimic joints of neither leg, as of hands, locked at rest."""
    limbs = {*robot.workspace.model.supports[robot.contact_joint]}
    for support in robot.supports:
        number = frame_id(robot.workspace.model, support.frame)
        limbs |= {*robot.workspace.model.supports[robot.workspace.model.frames[number].parentJoint]}
    moving = {robot.joint_names[joint - 1] for joint in limbs if joint}
    busy = {mimic.driver for mimic in robot.mimics if moving & {mimic.joint, mimic.driver}}
    idle = {mimic.driver for mimic in robot.mimics} - busy
    values = robot.joint_values(rest_configuration(robot)) if idle else {}
    return robot.locked({joint: values[joint] for joint in idle})


def _flat_support(robot: Leg) -> Support:
    supports = robot.supports
    if robot.constraints is None or robot.loops or not is_floating(robot):
        raise InvalidInput(
            f"{robot.name} does not stand: kicks are planned for robots on a fixed base, or on a "
            "floating one with one support (Leg.with_supports) and no loops"
        )
    drivers = list(dict.fromkeys(mimic.driver for mimic in robot.mimics))
    if drivers:
        raise InvalidInput(
            f"joints of {robot.name} mimic {', '.join(drivers)}: kicks from one foot are planned "
            f"without mimic joints; lock {drivers[0]!r}, which locks what mimics it (Leg.locked, "
            f"--lock {drivers[0]}=VALUE)"
        )
    if len(supports) != 1 or supports[0].point:
        named = ", ".join(f"{s.frame}{' (a point)' if s.point else ''}" for s in supports)
        raise InvalidInput(f"{robot.name} stands on {named}: kicks are planned from one flat foot")
    return supports[0]


def _flat_on_ground(robot: Leg, support: Support) -> tuple[Any, Array]:
    """Return the `pin.SE3` of a frame whose foot is flat on the ground, and its sole's corners.

    x and y are those with all joints at 0; the corners have the shape `(k, 3)` [m, support frame].
    """
    model, data = robot.workspace.model, robot.workspace.data
    frame = frame_id(model, support.frame)
    pin.forwardKinematics(model, data, robot.configuration())
    upright = pin.updateFramePlacement(model, data, frame).copy()
    rotation = upright.rotation
    corners = _sole(robot, support, frame, rotation)
    if support.sole is not None and not _is_level(corners @ rotation.T):
        offsets = corners - corners.mean(axis=0)
        face = np.linalg.svd(offsets)[2][2:]
        rotation = _levelled(rotation, np.vstack([face, -face]), np.ones(2))
    elif support.sole is None and _width(corners @ rotation.T) < NARROW:
        level = _levelled(rotation, *_faces(robot, frame))
        others = _sole(robot, support, frame, level)
        if _width(others @ level.T) >= NARROW:
            rotation, corners = level, others
        elif len(corners) < 3:  # as of a body that is a point
            bodies = joint_bodies(robot, int(model.frames[frame].parentJoint))
            reasons = [why for name in bodies if (why := find_unread(robot, name))]
            why = f" ({reasons[0]}; --package-dir names the folder of meshes)" if reasons else ""
            raise InvalidInput(
                f"the shapes of {support.frame} have no sole{why}: name its corners, "
                f"Support({support.frame!r}, sole=...), --support {support.frame}:FRICTION:CORNERS"
            )
    heights = corners @ rotation[2]
    if not _is_level(corners @ rotation.T):
        raise InvalidInput(
            f"the corners of the sole of {support.frame} are not in a plane, or are tilted by more "
            f"than {np.degrees(MOST_TILT):.0f} degrees while all joints of {robot.name} are at 0: "
            f"their heights differ by {np.ptp(heights):.3g} m, but the ground is level"
        )
    origin = np.array([*upright.translation[:2], -heights.min()])
    return pin.SE3(rotation, origin), corners


def _is_level(corners: Array) -> bool:
    size = np.ptp(corners, axis=0)
    return bool(size[2] <= SOLE_THICKNESS + 0.01 * size.max())


def _levelled(rotation: Array, normals: Array, areas: Array) -> Array:
    """Return a rotation of a foot that turns its largest face within `MOST_TILT` to the ground."""
    downward = -normals @ rotation[2]
    if not (downward >= np.cos(MOST_TILT)).any():
        return rotation
    number = int(np.argmax(np.where(downward >= np.cos(MOST_TILT), areas, -1.0)))
    return rotation_between(rotation @ normals[number], np.array([0.0, 0.0, -1.0])) @ rotation


def _faces(robot: Leg, frame: int) -> tuple[Array, Array]:
    """Return outward normals, `(k, 3)` [frame], and areas [m^2] of the faces of a foot's hull."""
    support = robot.workspace.model.frames[frame]
    shapes = joint_spheres(robot, int(support.parentJoint))
    try:
        hull = ConvexHull(shapes.moved(support.placement.inverse().homogeneous).points)
    except QhullError:  # flat, or a point
        return np.zeros((0, 3)), np.zeros(0)
    normals = hull.equations[:, :3]
    corners = hull.points[hull.simplices]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.asarray(0.5 * np.linalg.norm(sides, axis=1))
    # largest angle between facets of a hull that are one face [rad]
    along = normals @ normals.T >= np.cos(np.radians(1.0))
    return np.asarray(normals), along @ areas


def _width(corners: Array) -> float:
    turns = np.linspace(0.0, np.pi, 90, endpoint=False)
    return float(np.ptp(corners[:, :2] @ [np.cos(turns), np.sin(turns)], axis=0).min())


def _on_ground(placement: Any, corners: Array) -> Array:
    return np.asarray((corners @ placement.rotation.T + placement.translation)[:, :2])


def _sole(robot: Leg, support: Support, frame: int, rotation: Array) -> Array:
    """Return corners of the sole of a support, shape `(k, 3)` [m, support frame].

    Without corners in the support, they are the extreme points in eight directions of the shapes up
    to `SOLE_THICKNESS` above their lowest point, on one level. `rotation` is from the frame to the
    world.
    """
    if support.sole is not None:
        return support.sole
    support_frame = robot.workspace.model.frames[frame]
    shapes = joint_spheres(robot, int(support_frame.parentJoint))
    seen = shapes.moved(support_frame.placement.inverse().homogeneous).centres @ rotation.T
    bottom = seen[:, 2] - shapes.radii
    level = float(bottom.min())
    points = []
    turns = np.linspace(0.0, 2 * np.pi, 8, endpoint=False)
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    for (x, y, _), low, radius in zip(seen, bottom, shapes.radii, strict=True):
        depth = SOLE_THICKNESS - (low - level)  # how far the sphere reaches down into the sole
        if depth < 0.0:
            continue
        wide = np.sqrt(max(2 * radius * depth - depth**2, 0.0)) if depth < radius else radius
        points += [(x, y, level), *((x + wide * a, y + wide * b, level) for a, b in ring)]
    corners = np.array(points)
    corners = corners[np.unique(np.argmax(corners[:, :2] @ ring.T, axis=0))]
    return np.asarray(corners @ rotation)


def sole_corners(robot: Leg, support: Support) -> Array:
    """Return the corners of a foot's sole, `(k, 3)` [m, support frame], or raise `InvalidInput`."""
    return _flat_on_ground(robot, support)[1]


def joint_spheres(robot: Leg, joint: int) -> Spheres:
    """Return the bodies that a joint carries, in its axes; its origin where it has no shapes."""
    frames = robot.workspace.model.frames
    return joined([
        shape_of(robot, name).moved(frames[number].placement.homogeneous)
        for name, number in joint_bodies(robot, joint).items()
    ])  # fmt: skip


def joint_bodies(robot: Leg, joint: int) -> dict[str, int]:
    """Return the frames with shapes that a joint carries, by name, as `body_frames`."""
    frames = robot.workspace.model.frames
    every = body_frames(robot).items()
    return {name: number for name, number in every if int(frames[number].parentJoint) == joint}


def missing_shapes(robot: Leg, support: Support) -> list[str]:
    """Return a line for what is not known of the kicking limb's shapes, as they are drawn."""
    model = robot.workspace.model
    standing = list(model.supports[model.frames[frame_id(model, support.frame)].parentJoint])
    joints = [joint for joint in model.supports[robot.contact_joint] if joint not in standing]
    limb = [name for joint in joints for name in joint_bodies(robot, joint)]
    reasons = {name: why for name in limb if (why := find_unread(robot, name))}
    lines = []
    for has_others, instead in (
        (True, "its other shapes are used instead"),
        (False, "it is treated as a point and may reach lower than the plan says"),
    ):
        names = [name for name in reasons if bool(shapes_of(robot, name)) == has_others]
        if names:
            more = f", neither are the shapes of {listed(names[1:], 5)}" if names[1:] else ""
            lines.append(
                f"the shape of {names[0]} is not known ({reasons[names[0]]}; --package-dir names "
                f"the folder of meshes){more}: {instead}"
            )
    foot = joint_bodies(robot, robot.contact_joint)
    if not any(shapes_of(robot, name) or name in reasons for name in foot):
        lines.append(
            f"the kicking foot has no shape: {robot.frame} is treated as a point, and the foot may "
            "be lower than the plan says"
        )
    return lines
