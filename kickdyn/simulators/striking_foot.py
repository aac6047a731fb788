"""What strikes the ball in MuJoCo: the shapes of the robot's own foot, or a plate."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from kickdyn.core.mechanics import rotation_between
from kickdyn.core.validation import Array
from kickdyn.impact.impact_result import Impact
from kickdyn.motion.motion import Motion
from kickdyn.robot.collisions import (
    TOUCHING,
    FootKind,
    StrikingShape,
    ball_proximity,
    contact_in_joint,
    striking_shapes,
    thickened,
)
from kickdyn.robot.robot_file import Shape
from kickdyn.simulators.mujoco_kick import quaternion, row

HALF_PLATE = 0.05
"""Half the width of the plate at the contact point [m]."""

TOUCHABLE = 0.1
"""Time before the planned impact from which on a plate can touch the ball [s]. It is wider than a
foot and may be inside a ball beside which the robot stands."""


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


def plate(impact: Impact, warnings: tuple[str, ...] = ()) -> StrikingFoot:
    """Return a plate at the contact point, across the normal of the contact."""
    point, normal = contact_in_joint(impact.posture, impact.contact.normal)
    face = rotation_between(np.array([0.0, 0.0, 1.0]), normal)
    geom = (
        f'<geom name="plate" type="box" size="{HALF_PLATE} {HALF_PLATE} 0.005" '
        f'quat="{quaternion(face)}" pos="{row(point - 0.005 * normal)}"/>'
    )
    return StrikingFoot(FootKind.PLATE, {"plate": geom}, "", TOUCHABLE, warnings)


def find_foot(motion: Motion, impact: Impact, place: Array) -> StrikingFoot:
    """Return the shapes that strike a ball displaced by `place`, `(2,)` [m, world], or a plate."""
    robot, radius = motion.robot, impact.ball.radius
    planned = contact_in_joint(impact.posture, impact.contact.normal)
    shapes, lines = striking_shapes(robot, *planned, radius)
    if not shapes:
        return plate(impact, (f"{lines[0]}: a plate at the contact point strikes the ball",))
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, motion.q(motion.begin))
    centre = impact.ball_before.position + np.append(place, 0.0)
    centre = data.oMi[robot.contact_joint].actInv(centre)
    depths = [ball_proximity(shape.body, centre, radius).depth for shape in shapes]
    if max(depths) > TOUCHING:
        name = shapes[int(np.argmax(depths))].body.frame
        line = f"the shape of {name} begins {1e3 * max(depths):.0f} mm inside the ball"
        return plate(impact, (f"{line}: a plate at the contact point strikes the ball",))
    geoms, assets = dict[str, str](), ""
    for number, shape in enumerate(shapes):
        name = f"striking {number}"
        geoms[name], mesh = _elements(name, shape)
        assets += mesh
    touchable = TOUCHABLE if max(depths) > 0.0 else -motion.begin
    return StrikingFoot(FootKind.SHAPES, geoms, assets, touchable, tuple(lines))


def _elements(name: str, striking: StrikingShape) -> tuple[str, str]:
    """Return geom and mesh of a shape."""
    shape, size, pose = striking.visual.shape, striking.visual.size, striking.pose
    if shape == Shape.MESH:
        points = row(thickened(striking.spheres.centres).ravel())
        mesh = f'<mesh name="{name}" vertex="{points}" inertia="shell"/>'
        return f'<geom name="{name}" type="mesh" mesh="{name}"/>', mesh
    if shape == Shape.BOX:
        size = tuple(0.5 * edge for edge in size)
    elif shape in (Shape.CYLINDER, Shape.CAPSULE):
        size = size[1], 0.5 * size[0]
    place = f'pos="{row(pose[:3, 3])}" quat="{quaternion(pose[:3, :3])}"'
    return f'<geom name="{name}" type="{shape}" size="{row(size)}" {place}/>', ""
