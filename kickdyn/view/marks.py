"""What surrounds the leg: camera and light, the ball, the ground, curves and arrows."""

import math
from functools import cache
from itertools import pairwise, product
from typing import Any, NamedTuple

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import pinocchio as pin
import trimesh
from scipy.spatial.transform import Rotation

from kickdyn.core.validation import Array
from kickdyn.view.document import FIELD_OF_VIEW, LEFT, RIGHT, UP, draw_label

TOP, BOTTOM = 0.85 * UP, 0.8 * UP

UP_AXIS = np.array([0.0, 0.0, 1.0])

SKY_COLOURS = {"top_color": [0.60, 0.78, 0.93], "bottom_color": [0.96, 0.98, 1.0]}
LIGHT_INTENSITIES = {
    "AmbientLight": 0.6,
    "FillLight": 0.7,  # from afar: of the same strength everywhere
    "PointLightNegativeX": 0.1,
    "PointLightPositiveX": 0.1,
}
CURVE_RADIUS = 0.0017
"""Radius of a flight's curve over its distance from the camera: 3 or 4 pixels on a screen."""


class Camera(NamedTuple):
    """A camera: its position, and the point at which it looks, `(3,)` [m, world frame]."""

    position: Array
    target: Array

    def curve_width(self, points: Array) -> Array:
        """Return the radii of a flight's curve at points, shape `(n, 3)` [m]."""
        return np.asarray(CURVE_RADIUS * np.linalg.norm(points - self.position, axis=-1))


def camera_for(near: Array, far: Array, forward: Array, *, behind: bool = False) -> Camera:
    """Return the camera that sees all points, and recognisable near ones, of leg and ball.

    A kick of some metres is seen from the right side; the longer the flight, the further the
    camera moves behind the leg, where perspective shortens it. With `behind` it looks along the
    flight in any case, at a wall or goal.
    """
    floor = near[:, 2].min()
    points = np.vstack([near, far])
    # From the side to behind the leg; looking down, then up at a high flight.
    turns = np.radians(np.arange(75 if behind else 15, 86, 5))
    candidates = []
    for turn, tilt in product(turns, np.radians((14, 8, 2, -4))):
        level = math.sin(turn) * forward + math.cos(turn) * np.cross(UP_AXIS, forward)
        right, into = np.cross(level, UP_AXIS), math.cos(tilt) * level - math.sin(tilt) * UP_AXIS
        axes = np.array([right, np.cross(right, into), into])  # of the camera, as rows
        position = _nearest_position(points @ axes.T)
        seen = near @ axes.T - position
        share = float(np.ptp(seen[:, 1] / seen[:, 2])) / (2 * UP)
        depth = float(np.median(seen[:, 2]))
        camera = Camera(position @ axes, (position + np.array([0.0, 0.0, depth])) @ axes)
        above = bool(camera.position[2] > floor + 0.1 * depth)
        candidates.append((above, share, camera))
        if above and share > 0.42:  # leg and ball fill as much of the picture's height
            return camera
    return max(candidates, key=lambda candidate: candidate[:2])[2]


def set_stage(viewer: Any, camera: Camera, points: Array) -> None:
    """Set sky, camera, and light that casts the shadows of points, shape `(n, 3)` [m].

    meshcat's camera turns about the origin only, so the scene moves instead of its target.
    """
    for name in ("/Grid", "/Axes"):
        viewer[name].set_property("visible", False)
    for name, colour in SKY_COLOURS.items():
        viewer["/Background"].set_property(name, colour)
    for name, brightness in LIGHT_INTENSITIES.items():
        viewer[f"/Lights/{name}/<object>"].set_property("intensity", brightness)
    reach = float(np.linalg.norm(points - camera.target, axis=1).max())
    sun = viewer["/Lights/FillLight/<object>"]
    # unit vector from the scene to the light
    sun.set_property("position", (1.8 * reach * np.array([-0.3, -0.5, 0.81])).tolist())
    sun.set_property("reach", reach)  # the page's script frames the shadows by it
    x, y, z = (camera.position - camera.target).tolist()
    size = math.hypot(x, y, z)
    viewer.set_transform(tf.translation_matrix(-camera.target))
    lens = viewer["/Cameras/default/rotated/<object>"]
    lens.set_property("fov", FIELD_OF_VIEW)
    lens.set_property("near", 0.02 * size)
    lens.set_property("far", 1e4 * size)
    lens.set_property("position", [x, z, -y])  # three.js has y up there


def level_direction(vector: Array) -> Array:
    """Return the horizontal unit vector of a direction; x where it is vertical or zero."""
    level = vector * (1.0, 1.0, 0.0)
    length = float(np.linalg.norm(level))
    steep = length <= 1e-3 * np.linalg.norm(vector)
    return np.array([1.0, 0.0, 0.0]) if steep else np.asarray(level / length)


def stripe_width(extent: float) -> float:
    """Return 1, 2 or 5 times a power of ten, about a sixth of the extent [m]."""
    sixth = extent / 6 * (1 + 1e-9)  # so that a round one stays
    power = 10.0 ** math.floor(math.log10(sixth))
    return power * max(step for step in (1, 2, 5) if step * power <= sixth)


def box_corners(points: Array, radius: float) -> Array:
    """Return the corners of boxes around points, shape `(8 n, 3)`."""
    corners = np.array(list(product((-1, 1), repeat=3)))
    return np.asarray((points[:, None] + radius * corners).reshape(-1, 3))


def _nearest_position(points: Array) -> Array:
    """Return the foremost camera position that sees all points, in the camera's axes.

    Each edge of the picture is a plane through the camera. Two of them bound each coordinate
    across the picture, and where both bounds meet the camera cannot come nearer.
    """
    x, y, z = points.T
    bounds = [
        ((x - RIGHT * z).max(), (x + LEFT * z).min(), RIGHT, LEFT),
        ((y - TOP * z).max(), (y + BOTTOM * z).min(), TOP, BOTTOM),
    ]
    depth = min((high - low) / (plus + minus) for low, high, plus, minus in bounds)
    centre = [(low + high + (plus - minus) * depth) / 2 for low, high, plus, minus in bounds]
    return np.array([*centre, depth])


CURVE, ARROW, AXIS, ARRIVAL = 0xE63946, 0x2456D6, 0x1D2733, 0x7B3FA0
GRASS = (0x86B56B, 0x7DAD63)
HEXAGON, PENTAGON = 0xF7F7F2, 0x1E2A38
SIDES = 8  # of a tube that draws a curve

SHAFT, NECK, HEAD = 0.028, 0.72, 0.084
"""Of an arrow, over its length: radius of the shaft, where the head begins, the head's radius."""

UPRIGHT: Array = tf.rotation_matrix(math.pi / 2, (1, 0, 0))
"""Turns the axis of meshcat's cylinder, y, to z, which is the axis of a URDF's cylinder."""


def cylinder_pose(start: Array, end: Array) -> Array:
    """Return the pose that lays meshcat's cylinder between two points, shape `(4, 4)`."""
    axis = np.asarray(end) - start
    turn = Rotation.align_vectors(axis, (0.0, 1.0, 0.0))[0].as_matrix()
    return np.asarray(pin.SE3(turn, start + axis / 2).homogeneous)


def level_pose(origin: Array, forward: Array) -> Array:
    """Return the pose at a point whose x is a horizontal unit vector and whose z is up."""
    axes = np.column_stack([forward, np.cross(UP_AXIS, forward), UP_AXIS])
    return np.asarray(pin.SE3(axes, origin).homogeneous)


def draw_ground(viewer: Any, centre: Array, forward: Array, stripe: float, reach: float) -> None:
    """Draw a lawn around a centre with stripes across `forward`, which fade out at `reach` [m]."""
    count = math.ceil(reach / stripe)
    edges = stripe * np.arange(-count, count + 1)
    end, far = edges[-1], 100 * edges[-1]
    # One mesh, as two faces in one plane flicker; stripes are halves, so that both sides can fade.
    sides = pairwise([-far, *edges, far]), pairwise([-far, -end, 0.0, end, far])
    pieces = np.array([(*x, *y) for x, y in product(*sides)])
    left, right, low, high = pieces.T
    x, y = np.stack([left, right, right, left], 1), np.stack([low, low, high, high], 1)
    dark = np.round(left / stripe) % 2
    shade = dark[:, None] * np.clip(1 - np.hypot(x, y) / end, 0.0, 1.0)
    light, deep = (np.array([c >> 16, c >> 8 & 255, c & 255]) / 255 for c in GRASS)
    colours = light + shade[..., None] * (deep - light)
    corners = 4 * np.arange(len(pieces))[:, None, None]
    lawn = shapes.TriangularMeshGeometry(
        np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3),
        (corners + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3),
        colours.reshape(-1, 3),
    )
    viewer.set_object(lawn, shapes.MeshBasicMaterial(vertexColors=True))
    # of what lies in the plane of the ground, so that it is seen
    offset = {"polygonOffset": True, "polygonOffsetFactor": -1.0, "polygonOffsetUnits": -4.0}
    viewer["shadow"].set_object(lawn, _Shadow(color=0, opacity=0.4, **offset))
    viewer.set_transform(level_pose(centre, forward))


class _Shadow(shapes.GenericMaterial):  # type: ignore[misc]
    _type = "ShadowMaterial"  # of three.js, seen only where a shadow falls


def draw_distances(viewer: Any, start: Array, forward: Array, step: float, length: float) -> None:
    """Write the distance at each stripe across `forward` up to `length` [m], ends first."""
    count = max(1, math.ceil(length / step - 0.05))
    for k in (0, count, *range(1, count)):
        text = f"{round(k * step, 9):g} m"
        draw_label(viewer[str(k)], text, np.array([k * step, 0.0, 0.0]))
    viewer.set_transform(level_pose(start, forward))


def draw_axes(viewer: Any, origin: Array, length: float) -> None:
    """Draw the directions of the world's axes at a point, shape `(3,)` [m], as arrows this long."""
    for name, axis in zip("xyz", np.eye(3), strict=True):
        draw_arrow(viewer[name], length * axis, AXIS)
        text = f"{name} ({length:g} m)" if name == "x" else name
        draw_label(viewer[f"{name}/name"], text, 1.15 * length * axis)
    viewer.set_transform(tf.translation_matrix(origin))


def draw_curve(viewer: Any, points: Array, radii: Array, side: Array, colour: int = CURVE) -> None:
    """Draw a tube, as lines are thin in WebGL, through points `(n, 3)` [m]; `side` is across it."""
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1)
    distinct = np.concatenate([[True], moves > 1e-9 * np.abs(points).max()])
    points, radii = points[distinct], radii[distinct]
    if len(points) < 2:
        return
    # Forward differences: central ones vanish where a ball that went straight up turns back.
    tangents = np.diff(points, axis=0, append=2 * points[-1:] - points[-2:-1])
    normal = np.cross(tangents, side)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    binormal = np.cross(tangents, normal)
    binormal /= np.linalg.norm(binormal, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = np.cos(angle)[:, None] * normal[:, None] + np.sin(angle)[:, None] * binormal[:, None]
    vertices = (points[:, None] + radii[:, None, None] * ring).reshape(-1, 3)
    begin = SIDES * np.arange(len(points) - 1)[:, None]
    a, b = begin + np.arange(SIDES), begin + (np.arange(SIDES) + 1) % SIDES
    faces = np.stack([a, b, b + SIDES, a, b + SIDES, a + SIDES], axis=-1).reshape(-1, 3)
    viewer.set_object(shapes.TriangularMeshGeometry(vertices, faces), overlay(colour))


def draw_arrow(viewer: Any, vector: Array, colour: int) -> None:
    """Draw an arrow from the origin of `viewer` along a vector, not zero [m], over all else."""
    length = float(np.linalg.norm(vector))
    shaft = shapes.Cylinder(NECK * length, SHAFT * length)
    head = shapes.Cylinder((1 - NECK) * length, radiusTop=0.0, radiusBottom=HEAD * length)
    for name, shape, begin, end in (("shaft", shaft, 0.0, NECK), ("head", head, NECK, 1.0)):
        viewer[name].set_object(shape, overlay(colour))
        viewer[name].set_transform(cylinder_pose(begin * vector, end * vector))


def overlay(colour: int, **looks: float) -> Any:
    """Return the material of marks that are drawn over nearer things too."""
    # Transparent things are drawn last; without a depth test nothing covers them.
    return shapes.MeshBasicMaterial(color=colour, transparent=True, depthTest=False, **looks)


def draw_ball(viewer: Any, radius: float, position: Array) -> None:
    """Draw a ball around the origin of `viewer`, which is at `position`; panels show its spin."""
    for name, colour in (("hexagons", HEXAGON), ("pentagons", PENTAGON)):
        vertices, faces = _panels()[name]
        mesh = shapes.TriangularMeshGeometry(radius * vertices, faces)
        viewer[name].set_object(mesh, shapes.MeshLambertMaterial(color=colour))
    viewer.set_transform(tf.translation_matrix(position))


@cache
def _panels() -> dict[str, tuple[Array, Array]]:
    """Return vertices and faces of a ball's panels, the dark ones at corners of an icosahedron."""
    sphere = trimesh.creation.icosphere(subdivisions=4)
    corners = trimesh.creation.icosahedron().vertices
    # angle between the middle and the edge of a dark panel of the ball, at the ball's centre [rad]
    dark = (sphere.triangles_center @ corners.T).max(axis=1) > math.cos(0.36)
    return {
        "pentagons": (sphere.vertices, sphere.faces[dark]),
        "hexagons": (sphere.vertices, sphere.faces[~dark]),
    }
