"""The figure of a leg: shapes fixed to its joints, from its URDF, or sticks between the joints."""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import pinocchio as pin

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.robot.urdf_file import UrdfFile
from kickdyn.view.marks import UPRIGHT, cylinder_pose
from kickdyn.view.mesh_file import read_mesh

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
    """Return the visuals of the leg's URDF; sticks between the joints if there are none.

    Raises:
        InvalidInput: a visual cannot be read, or names a mesh outside the URDF's folder.
    """
    parts = list(_visuals(leg, leg.urdf)) if leg.urdf else []
    return parts or list(_sticks(leg))


def _visuals(leg: Leg, urdf: UrdfFile) -> Iterator[Part]:
    """Yield the visuals of a URDF, from the text that was checked."""
    import yourdfpy  # takes half a second; `from_model` legs do without

    try:
        robot = yourdfpy.URDF.load(
            io.BytesIO(urdf.text.encode()), build_scene_graph=False, load_meshes=False
        ).robot
    except Exception as error:  # yourdfpy has no error of its own for a bad file
        raise InvalidInput(f"{urdf.source}: its visuals cannot be read ({error})") from None
    visuals = [(link.name, visual) for link in robot.links for visual in link.visuals]
    materials = [visual.material for _, visual in visuals if visual.material]
    colours = {m.name: _rgba(m.color.rgba) for m in [*materials, *robot.materials] if m.color}
    frames = leg.workspace.model.frames
    bodies = {frame.name: frame for frame in frames if frame.type == pin.FrameType.BODY}
    for link, visual in visuals:
        body = bodies[link]
        pose = body.placement.homogeneous
        if visual.origin is not None:
            pose = pose @ visual.origin
        material = visual.material
        painted = colours.get(material.name) if material else None
        if material and material.color:
            painted = _rgba(material.color.rgba)
        has_texture = material is not None and material.texture is not None
        for shape, turn, own in _shapes(visual.geometry, urdf):
            rgba = own if has_texture and own else painted or own or PLAIN
            yield Part(int(body.parentJoint), pose @ turn, shape, rgba)


def _shapes(geometry: Any, urdf: UrdfFile) -> Iterator[tuple[Any, Array, Rgba | None]]:
    """Yield the shapes of a geometry: each with its pose and the colour that its mesh gives it."""
    if geometry.box:
        yield shapes.Box(_sizes(*geometry.box.size.tolist())), np.eye(4), None
    elif geometry.sphere:
        yield shapes.Sphere(*_sizes(geometry.sphere.radius)), np.eye(4), None
    elif geometry.cylinder:
        sizes = _sizes(geometry.cylinder.length, geometry.cylinder.radius)
        yield shapes.Cylinder(*sizes), UPRIGHT, None
    else:
        for mesh in read_mesh(geometry.mesh.filename, urdf.folder, geometry.mesh.scale):
            triangles = shapes.TriangularMeshGeometry(mesh.vertices, mesh.faces)
            yield triangles, np.eye(4), None if mesh.rgba is None else _rgba(mesh.rgba)


def _sizes(*sizes: float) -> list[float]:
    """Return the sizes of a shape [m]; raise `InvalidInput`."""
    return [validation.number("size of a visual", x, above=0, at_most=1e6, unit="m") for x in sizes]


def _rgba(values: Array) -> Rgba:
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
            high = np.full(3, shape.radius)
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
