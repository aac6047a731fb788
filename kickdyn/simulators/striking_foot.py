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
from kickdyn.robot.collisions import TOUCHING, Body, ball_proximity, body_of, thickened
from kickdyn.robot.ground_clearance import Spheres, spheres_of
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frames_by_name
from kickdyn.robot.names import listed
from kickdyn.robot.visuals import RobotFile, Shape, Visual
from kickdyn.simulators.mujoco_kick import quaternion, row

HALF_PLATE = 0.05
"""Half the width of the plate at the contact point [m]."""

TOUCHABLE = 0.1
"""Time before the planned impact from which on a plate can touch the ball [s], or shapes that begin
in it. A plate is wider than a foot and may be inside a ball beside which the robot stands."""

FAR = 0.01
"""Distance from the ball at the planned impact from which on shapes for contacts do not stand for
the foot [m]: some files have four points under the sole."""

INCLINED = math.radians(5.0)
"""Angle between the normals of the foot's shapes and of the planned impact that is named [rad]."""

LEAST_SIZE = 1e-4
"""Size under which a mesh is no body [m]."""


class Foot(StrEnum):
    """What strikes the ball: the shapes of the foot, or a plate at the contact point."""

    SHAPES = "shapes"
    PLATE = "plate"


class StrikingFoot(NamedTuple):
    """What strikes the ball, as elements of MJCF.

    Attributes:
        kind: shapes or plate.
        geoms: in the body of the joint that carries the contact frame.
        names: of these geoms.
        assets: meshes of them.
        touchable: time before the planned impact from which on it can touch the ball [s].
        warnings: a line for everything that is not as it was asked for.
    """

    kind: Foot
    geoms: str
    names: tuple[str, ...]
    assets: str
    touchable: float
    warnings: tuple[str, ...] = ()


class _Part(NamedTuple):
    """A convex shape of the foot, its spheres and its body in the axes of the joint."""

    visual: Visual
    pose: Array
    spheres: Spheres
    body: Body


def plate(impact: Impact, warnings: tuple[str, ...] = ()) -> StrikingFoot:
    """Return a plate at the contact point, across the normal of the contact."""
    posture = impact.posture
    normal = posture.rotation_world_joint.T @ impact.contact.normal
    face = rotation_between(np.array([0.0, 0.0, 1.0]), normal)
    geom = (
        f'<geom name="plate" type="box" size="{HALF_PLATE} {HALF_PLATE} 0.005" '
        f'quat="{quaternion(face)}" pos="{row(posture.contact_lever - 0.005 * normal)}"/>'
    )
    return StrikingFoot(Foot.PLATE, geom, ("plate",), "", TOUCHABLE, warnings)


def find_foot(motion: Motion, impact: Impact, place: Array) -> StrikingFoot:
    """Return the shapes of the foot that carries the contact frame; a plate where it has none.

    They are what the robot's file has for contacts, of all bodies that are fixed to the joint that
    carries the frame; what it draws where it has nothing for contacts, or nothing near the ball at
    the planned impact. Where the foot would begin its stroke inside the ball, it is a plate.

    Args:
        motion: of the robot.
        impact: that is planned.
        place: displacement of the ball along x and y, shape `(2,)` [m, world frame].
    """
    parts, lines = _choose(motion.robot, impact)
    if not parts:
        lines.append("a plate at the contact point strikes the ball")
        return plate(impact, (": ".join(lines),))
    ball, centre = impact.ball, impact.ball_before.position + np.append(place, 0.0)

    def depths(t: float) -> dict[str, float]:
        """Return the depths of the bodies in the ball at a time [m]."""
        centre_at_t = centre + t * impact.ball_before.velocity
        model = motion.robot.model
        data = model.createData()
        pin.forwardKinematics(model, data, motion.q(t))
        local = data.oMi[motion.robot.contact_joint].actInv(centre_at_t)
        return {
            part.body.frame: ball_proximity(part.body, local, ball.radius).depth for part in parts
        }

    begin, late = depths(motion.begin), depths(max(motion.begin, -TOUCHABLE))
    for frame, depth in late.items():
        if depth > TOUCHING:
            lines.append(
                f"the shape of {frame} is {1e3 * depth:.0f} mm inside the ball {TOUCHABLE:g} s "
                "before the impact: a plate at the contact point strikes the ball instead"
            )
            return plate(impact, tuple(lines))
    for frame, depth in begin.items():
        if depth > TOUCHING:
            lines.append(
                f"the shape of {frame} begins {1e3 * depth:.0f} mm inside the ball: it can touch "
                f"the ball only from {TOUCHABLE:g} s before the impact on"
            )
    inside = max(begin.values()) > 0.0
    geoms, assets = zip(
        *(_elements(number, part) for number, part in enumerate(parts)), strict=True
    )
    return StrikingFoot(
        Foot.SHAPES, "".join(geoms), tuple(_name(number) for number in range(len(parts))),
        "".join(assets), TOUCHABLE if inside else -motion.begin, tuple(lines),
    )  # fmt: skip


def _choose(robot: Leg, impact: Impact) -> tuple[list[_Part], list[str]]:
    """Return the shapes that strike the ball, and a line for each doubt about them."""
    file = robot.file
    if file is None:
        return [], [f"{robot.name} has no shapes"]
    contacts, lines = _read(robot, file, file.contacts_by_frame)
    gap, doubts = _meet(contacts, impact)
    if gap <= FAR:
        return contacts, lines + doubts
    drawn, unread = _read(robot, file, file.visuals_by_frame)
    nearer, others = _meet(drawn, impact)
    if nearer >= gap:
        lines += [] if contacts or lines else unread or [f"the foot of {robot.name} has no shapes"]
        return contacts, lines + doubts
    what = "has no shapes for contacts"
    if contacts:
        what = f"has shapes for contacts, {1e3 * gap:.0f} mm from the ball at the planned impact"
    lines.append(f"the foot of {robot.name} {what}: those that are drawn strike the ball")
    return drawn, lines + unread + others


def _meet(parts: list[_Part], impact: Impact) -> tuple[float, list[str]]:
    """Return how far shapes are from the ball at the planned impact [m], and what is doubtful."""
    if not parts:
        return math.inf, []
    posture, radius = impact.posture, impact.ball.radius
    normal = posture.rotation_world_joint.T @ impact.contact.normal
    centre = posture.contact_lever + radius * normal
    nearest = max(
        (ball_proximity(part.body, centre, radius) for part in parts), key=lambda one: one.depth
    )
    gap, sine = -nearest.depth, float(np.linalg.norm(np.cross(nearest.normal, normal)))
    angle = math.atan2(sine, float(nearest.normal @ normal))
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
    model, parts, unread = robot.workspace.model, list[_Part](), dict[str, str]()
    for name, number in frames_by_name(model).items():
        frame = model.frames[number]
        if int(frame.parentJoint) != robot.contact_joint:
            continue
        for visual in shapes.get(name, []):
            spheres = spheres_of(file, visual)
            if isinstance(spheres, str):
                unread[name] = spheres
            elif np.ptp(spheres.centres, axis=0).max() + spheres.radii.max() < LEAST_SIZE:
                unread[name] = f"it is smaller than {1e3 * LEAST_SIZE:g} mm"
            else:
                spheres = spheres.moved(frame.placement.homogeneous)
                pose = frame.placement.homogeneous @ visual.pose
                parts.append(_Part(visual, pose, spheres, body_of(name, spheres)))
    if not unread:
        return parts, []
    reason = next(iter(unread.values()))
    instead = ": its other shapes are used" if parts else ""
    return parts, [f"the shape of {listed([*unread], 5)} is not known ({reason}){instead}"]


def _name(number: int) -> str:
    return f"striking {number}"


def _elements(number: int, part: _Part) -> tuple[str, str]:
    """Return a geom of a shape of the foot, and its asset."""
    name, shape, size = _name(number), part.visual.shape, part.visual.size
    if shape == Shape.MESH:  # its points have the pose already
        points = row(thickened(part.spheres.centres).ravel())
        return (
            f'<geom name="{name}" type="mesh" mesh="{name}"/>',
            f'<mesh name="{name}" vertex="{points}" inertia="shell"/>',
        )
    if shape == Shape.BOX:
        size = tuple(0.5 * edge for edge in size)
    elif shape in (Shape.CYLINDER, Shape.CAPSULE):
        size = size[1], 0.5 * size[0]
    return (
        f'<geom name="{name}" type="{shape}" size="{row(size)}" pos="{row(part.pose[:3, 3])}" '
        f'quat="{quaternion(part.pose[:3, :3])}"/>',
        "",
    )
