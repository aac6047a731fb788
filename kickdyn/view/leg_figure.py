"""The figure of a leg: the shapes of its file, or sticks between its joints."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.robot.mesh_file import read_mesh
from kickdyn.robot.visuals import RobotFile, Shape, Visual
from kickdyn.view.marks import UPRIGHT, cylinder_pose

Rgba = tuple[float, ...]

PLAIN: Rgba = (0.62, 0.67, 0.73, 1.0)
KNOB: Rgba = (0.25, 0.27, 0.31, 1.0)


@dataclass(frozen=True, eq=False)
class Part:
    """A shape fixed to a joint.

    Attributes:
        joint: its index in the model; 0 is the world.
        pose: of the shape in the joint's frame, shape `(4, 4)` [m].
        shape: a meshcat geometry.
        rgba: colour, 0 to 1.
    """

    joint: int
    pose: Array
    shape: Any
    rgba: Rgba


def joint_poses(leg: Leg, q: Array) -> list[Array]:
    """Return the pose of every joint, the world first, each `(4, 4)` [m, world frame].

    The configuration q has the shape `(nq,)` [rad; m for prismatic joints].
    """
    model, data = leg.workspace.model, leg.workspace.data
    pin.forwardKinematics(model, data, q)
    return [np.eye(4)] + [data.oMi[joint].homogeneous for joint in range(1, model.njoints)]


def draw_leg(viewer: Any, leg: Leg, q: Array) -> Array:
    """Draw a leg at a configuration; joint number i is the node `viewer[str(i)]`.

    Returns:
        Corners of boxes around its parts, shape `(n, 3)` [m, world frame].

    Raises:
        InvalidInput: as `leg_parts`.
    """
    poses, corners = joint_poses(leg, q), []
    for number, part in enumerate(leg_parts(leg)):
        node = viewer[f"{part.joint}/{number}"]  # numbers, as a name could contain a slash
        node.set_object(part.shape, _material(part))
        node.set_transform(part.pose)
        pose = poses[part.joint] @ part.pose
        corners.append(_corners(part.shape) @ pose[:3, :3].T + pose[:3, 3])
    for joint, pose in enumerate(poses):
        viewer[str(joint)].set_transform(pose)
    return np.vstack(corners)


def leg_parts(leg: Leg) -> list[Part]:
    """Return the shapes of the leg's file; sticks between the joints if there are none.

    Raises:
        InvalidInput: a visual cannot be read, or names a mesh outside the file's folder.
    """
    return list(_visuals(leg, leg.file) if leg.file else ()) or list(_sticks(leg))


def _visuals(leg: Leg, file: RobotFile) -> Iterator[Part]:
    """Yield the parts that draw the visuals of a file."""
    frames = leg.workspace.model.frames
    by_name = {frame.name: frame for frame in frames}
    # a joint may have the name of a link
    by_name |= {frame.name: frame for frame in frames if frame.type == pin.FrameType.BODY}
    for visual in file.visuals():
        if visual.frame not in by_name:  # of an object beside the robot
            continue
        frame = by_name[visual.frame]
        pose = frame.placement.homogeneous @ visual.pose
        painted = None if visual.rgba is None else _rgba(visual.rgba)
        for shape, turn, own in _shapes(visual, file):
            rgba = own if visual.has_texture and own else painted or own or PLAIN
            yield Part(int(frame.parentJoint), pose @ turn, shape, rgba)


def _shapes(visual: Visual, file: RobotFile) -> Iterator[tuple[Any, Array, Rgba | None]]:
    """Yield the shapes of a visual: each with its pose and the colour that its mesh gives it."""
    if visual.vertices is not None:
        yield shapes.TriangularMeshGeometry(visual.vertices, visual.faces), np.eye(4), None
        return
    if visual.shape == Shape.MESH:
        for mesh in read_mesh(visual.mesh, file.folder, visual.size):
            triangles = shapes.TriangularMeshGeometry(mesh.vertices, mesh.faces)
            yield triangles, np.eye(4), None if mesh.rgba is None else _rgba(mesh.rgba)
        return
    sizes = [
        validation.number("size of a visual", x, above=0, at_most=1e6, unit="m")
        for x in visual.size
    ]
    if visual.shape == Shape.BOX:
        yield shapes.Box(sizes), np.eye(4), None
    elif visual.shape == Shape.SPHERE:
        yield shapes.Sphere(*sizes), np.eye(4), None
    elif visual.shape == Shape.ELLIPSOID:
        yield shapes.Ellipsoid(sizes), np.eye(4), None
    else:
        length, radius = sizes
        yield shapes.Cylinder(length, radius), UPRIGHT, None
        if visual.shape == Shape.CAPSULE:
            for end in (-length / 2, length / 2):
                yield shapes.Sphere(radius), tf.translation_matrix([0.0, 0.0, end]), None


def _rgba(values: ArrayLike) -> Rgba:
    """Return a colour within 0 to 1; the plain one where it is no colour."""
    if np.shape(values) != (4,) or not np.isfinite(values).all():
        return PLAIN
    return tuple(np.clip(values, 0.0, 1.0).tolist())


def _sticks(leg: Leg) -> Iterator[Part]:
    """Yield a sphere at each joint, and cylinders between them and to the contact point."""
    model = leg.workspace.model
    ends = [
        (int(model.parents[joint]), model.jointPlacements[joint].translation)
        for joint in range(1, model.njoints)
    ]
    ends.append((leg.contact_joint, leg.contact_lever))
    longest = max(float(np.linalg.norm(end)) for parent, end in ends if parent) or 1.0
    for joint in range(1, model.njoints):
        yield Part(joint, np.eye(4), shapes.Sphere(0.1 * longest), KNOB)
    for parent, end in ends:
        length = float(np.linalg.norm(end))
        if parent and length > 0:
            stick = shapes.Cylinder(length, 0.06 * longest)
            yield Part(parent, cylinder_pose(np.zeros(3), end), stick, PLAIN)
    tip = tf.translation_matrix(leg.contact_lever)
    yield Part(leg.contact_joint, tip, shapes.Sphere(0.06 * longest), PLAIN)


def _corners(shape: Any) -> Array:
    """Return the corners of the box around a shape, along its own axes, `(8, 3)` [m]."""
    if isinstance(shape, shapes.TriangularMeshGeometry):
        low, high = np.min(shape.vertices, axis=0), np.max(shape.vertices, axis=0)
    else:
        if isinstance(shape, shapes.Cylinder):
            wide = max(shape.radiusTop, shape.radiusBottom)
            high = np.array([wide, shape.height / 2, wide])
        elif isinstance(shape, shapes.Sphere):
            high = np.asarray(getattr(shape, "radii", np.full(3, shape.radius)))  # of an ellipsoid
        else:
            high = np.asarray(shape.lengths) / 2
        low = -high
    return np.array(list(product(*zip(low, high, strict=True))), dtype=float)


def _material(part: Part) -> Any:
    """Return the material of a part."""
    red, green, blue = (round(255 * level) for level in part.rgba[:3])
    return shapes.MeshLambertMaterial(
        color=(red << 16) + (green << 8) + blue,
        opacity=part.rgba[3],
        # three.js smears the light over a mesh without normals; facets show its true shape
        flatShading=isinstance(part.shape, shapes.TriangularMeshGeometry),
    )
