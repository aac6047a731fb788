"""The figure of a leg: parts that stand still on its joints, so joints are all that moves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import pinocchio as pin

from kickdyn.core.validation import Array
from kickdyn.robot.leg import Leg
from kickdyn.view.cylinder_pose import along
from kickdyn.view.urdf_visuals import PLAIN, urdf_visuals

KNOB = (0.25, 0.27, 0.31, 1.0)


@dataclass(frozen=True, eq=False)
class Part:
    """A shape fixed to a joint.

    Attributes:
        joint: its index in the model; 0 is the world.
        place: of the shape in the joint's frame, shape `(4, 4)` [m].
        shape: a meshcat geometry.
        rgba: colour, 0 to 1.
    """

    joint: int
    place: Array
    shape: Any
    rgba: tuple[float, ...]


def leg_parts(leg: Leg) -> list[Part]:
    """Return the visuals of the leg's URDF; sticks between the joints if there are none.

    Raises:
        InvalidInput: a visual cannot be read, or names a mesh outside the URDF's folder.
    """
    model = leg.workspace.model
    bodies = {f.name: f for f in model.frames if f.type == pin.FrameType.BODY}
    visuals = urdf_visuals(leg.urdf) if leg.urdf else []
    parts = [
        Part(
            int(bodies[visual.link].parentJoint),
            bodies[visual.link].placement.homogeneous @ visual.place,
            visual.shape,
            visual.rgba,
        )
        for visual in visuals
    ]
    return parts or list(_sticks(leg))


def joint_places(leg: Leg, q: Array) -> list[Array]:
    """Return the placement of every joint, the world first, each `(4, 4)` [m, world frame]."""
    model, data = leg.workspace.model, leg.workspace.data
    pin.forwardKinematics(model, data, q)
    return [np.eye(4)] + [data.oMi[joint].homogeneous for joint in range(1, model.njoints)]


def draw_leg(viewer: Any, leg: Leg, q: Array) -> Array:
    """Draw a leg at a configuration; joint number i is the node `viewer[str(i)]`.

    Returns:
        Corners of boxes that hold its parts, shape `(n, 3)` [m, world frame].

    Raises:
        InvalidInput: as `leg_parts`.
    """
    places, corners = joint_places(leg, q), []
    for number, part in enumerate(leg_parts(leg)):
        node = viewer[f"{part.joint}/{number}"]  # numbers: a name could hold a slash
        node.set_object(part.shape, _material(part))
        node.set_transform(part.place)
        place = places[part.joint] @ part.place
        corners.append(_corners(part.shape) @ place[:3, :3].T + place[:3, 3])
    for joint, place in enumerate(places):
        viewer[str(joint)].set_transform(place)
    return np.vstack(corners)


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
    red, green, blue = (round(255 * level) for level in part.rgba[:3])
    return shapes.MeshLambertMaterial(
        color=(red << 16) + (green << 8) + blue,
        opacity=part.rgba[3],
        # three.js shades a mesh without normals of its own in smears; in facets it is honest
        flatShading=isinstance(part.shape, shapes.TriangularMeshGeometry),
    )


def _sticks(leg: Leg) -> Iterator[Part]:
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
            yield Part(parent, along(np.zeros(3), end), stick, PLAIN)
    yield Part(
        leg.contact_joint, tf.translation_matrix(ends[-1][1]), shapes.Sphere(0.06 * longest), PLAIN
    )
