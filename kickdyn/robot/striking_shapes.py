"""Shapes of a foot that strike a ball: those of its file for contacts, or those that are drawn."""

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.robot.collisions import TOUCHING, CollisionBody, ball_proximity, body_of
from kickdyn.robot.ground_clearance import Spheres, spheres_of
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.names import listed
from kickdyn.robot.robot_file import RobotFile, Visual
from kickdyn.robot.standing import joint_bodies

FAR = 0.01
"""Distance from the ball [m] from which on shapes for contacts do not stand for the foot."""

INCLINED = math.radians(5.0)
"""Angle between the normals of the foot's shapes and of the planned impact that is named [rad]."""


class FootKind(StrEnum):
    """What strikes the ball: the shapes of the foot, or a plate at the contact point."""

    SHAPES = "shapes"
    PLATE = "plate"


class StrikingShape(NamedTuple):
    """A convex shape of the foot, all in the axes of the joint that carries the contact frame.

    Attributes:
        body: the shape of coal.
        visual: of the file.
        pose: of the visual, shape `(4, 4)`.
        spheres: whose hull it is.
    """

    body: CollisionBody
    visual: Visual
    pose: Array
    spheres: Spheres


def contact_in_joint(posture: Posture, normal: Array) -> tuple[Array, Array]:
    """Return a posture's contact point [m] and a normal in the contact joint's axes, `(3,)` each.

    The normal is given in world axes.
    """
    return posture.contact_lever, posture.rotation_world_joint.T @ normal


def striking_shapes(
    robot: Leg, point: Array, normal: Array, radius: float
) -> tuple[list[StrikingShape], list[str]]:
    """Return the shapes of a foot that strike a ball, and a line for each doubt about them.

    `point` and `normal` of the planned contact are those of `contact_in_joint`; `radius` is the
    ball's [m].
    """
    file = robot.file
    if file is None:
        return [], [f"{robot.name} has no shapes"]
    shapes, lines = _read(robot, file, file.collisions_by_frame)
    gap, doubts = _meet(shapes, point, normal, radius)
    if gap > FAR:
        drawn, unread = _read(robot, file, file.visuals_by_frame)
        nearer, others = _meet(drawn, point, normal, radius)
        if nearer < gap:
            what = f"shapes for contacts {1e3 * gap:.0f} mm from the ball at the planned impact"
            what = what if shapes else "no shapes for contacts"
            line = f"the foot of {robot.name} has {what}: those that are drawn strike the ball"
            return drawn, [*lines, line, *unread, *others]
        if not shapes:
            return [], [*lines, *unread, f"the foot of {robot.name} has no shapes"]
    return shapes, lines + doubts


def _meet(
    shapes: list[StrikingShape], point: Array, normal: Array, radius: float
) -> tuple[float, list[str]]:
    """Return how far shapes are from the ball at the planned impact [m], and what is doubtful."""
    if not shapes:
        return math.inf, []
    meets = [ball_proximity(shape.body, point + radius * normal, radius) for shape in shapes]
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
    robot: Leg, file: RobotFile, visuals: dict[str, list[Visual]]
) -> tuple[list[StrikingShape], list[str]]:
    """Return the shapes at the foot, and a line if some of them cannot be read."""
    frames, shapes, unread = robot.workspace.model.frames, list[StrikingShape](), dict[str, str]()
    for name, number in joint_bodies(robot, robot.contact_joint).items():
        pose = frames[number].placement.homogeneous
        for visual in visuals.get(name, []):
            spheres = spheres_of(file, visual)
            if isinstance(spheres, str):
                unread[name] = spheres
            else:
                moved = spheres.moved(pose)
                shape = StrikingShape(body_of(name, moved), visual, pose @ visual.pose, moved)
                shapes.append(shape)
    reason, others = next(iter(unread.values()), ""), ": others are used" if shapes else ""
    line = f"the shape of {listed([*unread], 5)} is not known ({reason}){others}"
    return shapes, [line] if unread else []
