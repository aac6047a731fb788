"""What strikes the ball in MuJoCo: the shapes of the robot's own foot, or a plate."""

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.mechanics import rotation_between
from kickdyn.core.validation import Array
from kickdyn.impact.impact_result import Impact
from kickdyn.motion.motion import Motion
from kickdyn.robot.collisions import TOUCHING, CollisionBody, ball_proximity, body_of, thickened
from kickdyn.robot.ground_clearance import Spheres, spheres_of
from kickdyn.robot.leg import Leg
from kickdyn.robot.names import listed
from kickdyn.robot.robot_file import RobotFile, Shape, Visual
from kickdyn.robot.standing import joint_bodies
from kickdyn.simulators.mujoco_kick import quaternion, row

HALF_PLATE = 0.05
"""Half the width of the plate at the contact point [m]."""

TOUCHABLE = 0.1
"""Time before the planned impact from which on a plate can touch the ball [s]. It is wider than a
foot and may be inside a ball beside which the robot stands."""

FAR = 0.01
"""Distance from the ball [m] from which on shapes for contacts do not stand for the foot."""

INCLINED = math.radians(5.0)
"""Angle between the normals of the foot's shapes and of the planned impact that is named [rad]."""


class FootKind(StrEnum):
    """What strikes the ball: the shapes of the foot, or a plate at the contact point."""

    SHAPES = "shapes"
    PLATE = "plate"


class StrikingFoot(NamedTuple):
    """What strikes the ball, as MJCF.

    Attributes:
        kind: shapes or plate.
        geoms: by name, for the body of the joint that carries the contact frame.
        assets: their meshes.
        touchable: time before the planned impact from which on it can touch the ball [s].
        warnings: a line for everything that is not as it was asked for.
    """

    kind: FootKind
    geoms: dict[str, str]
    assets: str
    touchable: float
    warnings: tuple[str, ...] = ()


class _Part(NamedTuple):
    """A convex shape of the foot, in the axes of the joint, and its geom and mesh in MJCF."""

    body: CollisionBody
    name: str
    geom: str
    mesh: str


def plate(impact: Impact, warnings: tuple[str, ...] = ()) -> StrikingFoot:
    """Return a plate at the contact point, across the normal of the contact."""
    point, normal = _planned(impact)
    face = rotation_between(np.array([0.0, 0.0, 1.0]), normal)
    geom = (
        f'<geom name="plate" type="box" size="{HALF_PLATE} {HALF_PLATE} 0.005" '
        f'quat="{quaternion(face)}" pos="{row(point - 0.005 * normal)}"/>'
    )
    return StrikingFoot(FootKind.PLATE, {"plate": geom}, "", TOUCHABLE, warnings)


def find_foot(motion: Motion, impact: Impact, place: Array) -> StrikingFoot:
    """Return the shapes that strike a ball displaced by `place`, `(2,)` [m, world], or a plate."""
    robot, radius = motion.robot, impact.ball.radius
    parts, lines = _choose(robot, impact)
    if not parts:
        return plate(impact, (f"{lines[0]}: a plate at the contact point strikes the ball",))
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, motion.q(motion.begin))
    centre = impact.ball_before.position + np.append(place, 0.0)
    centre = data.oMi[robot.contact_joint].actInv(centre)
    depths = [ball_proximity(part.body, centre, radius).depth for part in parts]
    if max(depths) > TOUCHING:
        name = parts[int(np.argmax(depths))].body.frame
        line = f"the shape of {name} begins {1e3 * max(depths):.0f} mm inside the ball"
        return plate(impact, (f"{line}: a plate at the contact point strikes the ball",))
    geoms, assets = {part.name: part.geom for part in parts}, "".join(part.mesh for part in parts)
    touchable = TOUCHABLE if max(depths) > 0.0 else -motion.begin
    return StrikingFoot(FootKind.SHAPES, geoms, assets, touchable, tuple(lines))


def _planned(impact: Impact) -> tuple[Array, Array]:
    """Return contact point and normal of the planned impact in the joint's axes, `(3,)` each."""
    posture = impact.posture
    return posture.contact_lever, posture.rotation_world_joint.T @ impact.contact.normal


def _choose(robot: Leg, impact: Impact) -> tuple[list[_Part], list[str]]:
    """Return the shapes that strike the ball, and a line for each doubt about them."""
    file = robot.file
    if file is None:
        return [], [f"{robot.name} has no shapes"]
    parts, lines = _read(robot, file, file.collisions_by_frame)
    gap, doubts = _meet(parts, impact)
    if gap > FAR:
        drawn, unread = _read(robot, file, file.visuals_by_frame)
        nearer, others = _meet(drawn, impact)
        if nearer < gap:
            what = f"shapes for contacts {1e3 * gap:.0f} mm from the ball at the planned impact"
            what = what if parts else "no shapes for contacts"
            line = f"the foot of {robot.name} has {what}: those that are drawn strike the ball"
            return drawn, [*lines, line, *unread, *others]
        if not parts:
            return [], [*lines, *unread, f"the foot of {robot.name} has no shapes"]
    return parts, lines + doubts


def _meet(parts: list[_Part], impact: Impact) -> tuple[float, list[str]]:
    """Return how far shapes are from the ball at the planned impact [m], and what is doubtful."""
    if not parts:
        return math.inf, []
    (point, normal), radius = _planned(impact), impact.ball.radius
    meets = [ball_proximity(part.body, point + radius * normal, radius) for part in parts]
    nearest = max(meets, key=lambda one: one.depth)
    gap, angle = -nearest.depth, math.acos(np.clip(nearest.normal @ normal, -1.0, 1.0))
    if abs(gap) <= TOUCHING and angle <= INCLINED:
        return gap, []
    where = "from the ball" if gap > 0.0 else "inside the ball"
    return gap, [
        f"at the planned impact, the foot is {1e3 * abs(gap):.0f} mm {where}, with a normal "
        f"{math.degrees(angle):.0f} deg off the planned one: the contact point is not on its shapes"
    ]


def _read(
    robot: Leg, file: RobotFile, shapes: dict[str, list[Visual]]
) -> tuple[list[_Part], list[str]]:
    """Return the shapes at the foot, and a line if some of them cannot be read."""
    frames, parts, unread = robot.workspace.model.frames, list[_Part](), dict[str, str]()
    for name, number in joint_bodies(robot, robot.contact_joint).items():
        pose = frames[number].placement.homogeneous
        for visual in shapes.get(name, []):
            spheres = spheres_of(file, visual)
            if isinstance(spheres, str):
                unread[name] = spheres
            else:
                moved = spheres.moved(pose)
                elements = _elements(len(parts), visual, pose @ visual.pose, moved)
                parts.append(_Part(body_of(name, moved), *elements))
    reason, others = next(iter(unread.values()), ""), ": others are used" if parts else ""
    line = f"the shape of {listed([*unread], 5)} is not known ({reason}){others}"
    return parts, [line] if unread else []


def _elements(number: int, visual: Visual, pose: Array, spheres: Spheres) -> tuple[str, str, str]:
    """Return name, geom and mesh of a shape; `spheres` are at the pose, shape `(4, 4)`."""
    shape, size, name = visual.shape, visual.size, f"striking {number}"
    if shape == Shape.MESH:
        points = row(thickened(spheres.centres).ravel())
        mesh = f'<mesh name="{name}" vertex="{points}" inertia="shell"/>'
        return name, f'<geom name="{name}" type="mesh" mesh="{name}"/>', mesh
    if shape == Shape.BOX:
        size = tuple(0.5 * edge for edge in size)
    elif shape in (Shape.CYLINDER, Shape.CAPSULE):
        size = size[1], 0.5 * size[0]
    place = f'pos="{row(pose[:3, 3])}" quat="{quaternion(pose[:3, :3])}"'
    return name, f'<geom name="{name}" type="{shape}" size="{row(size)}" {place}/>', ""
