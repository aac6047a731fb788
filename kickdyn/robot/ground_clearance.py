"""The bodies of a robot as convex shapes, by the shapes of its file, and how deep they are.

A shape is the convex hull of spheres, so that its depth under a plane is a minimum over centres and
has simple derivatives.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frames_by_name
from kickdyn.robot.package_files import PackageFiles
from kickdyn.robot.visuals import RobotFile, Shape, Visual, read_mesh

TOLERANCE = 2e-3
"""Depth up to which a body counts as on the ground [m]: soles are rounded and rubber gives way."""

LARGEST_MESH = 0.5
"""Distance of a frame from which on its meshes are not read [m]: those of a leg are shorter."""

CIRCLE_POINTS = 16
"""Number of points that stand for a circle or an ellipse."""

CORNERS, DIRECTIONS = 24, 400
"""Number of spheres that stand for the kicking foot at most, and of directions, evenly over the
unit sphere, in which the foot is at most a known distance larger than these."""


class Spheres(NamedTuple):
    """Spheres whose convex hull is a body: `centres`, shape `(k, 3)`, and `radii`, `(k,)` [m]."""

    centres: Array
    radii: Array

    def moved(self, pose: Array) -> "Spheres":
        """Return the spheres at a pose, shape `(4, 4)`."""
        return Spheres(self.centres @ pose[:3, :3].T + pose[:3, 3], self.radii)

    @property
    def lowest(self) -> float:
        """Height of the body's lowest point [m]."""
        return float((self.centres[:, 2] - self.radii).min())


class Depth(NamedTuple):
    """How deep a frame's body is under the ground [m], and at which of several configurations."""

    frame: str
    depth: float
    number: int


def sphere_directions() -> Array:
    """Return `DIRECTIONS`, shape `(400, 3)`."""
    number = np.arange(DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * number / DIRECTIONS, math.pi * (1.0 + math.sqrt(5.0)) * number
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])


def extreme_spheres(
    body: Spheres, count: int = CORNERS, towards: ArrayLike = (0.0, 0.0, 0.0), cosine: float = 0.0
) -> tuple[NDArray[np.int64], float]:
    """Return indices of at most `count` spheres, and how far the body reaches beyond them [m].

    Each next one is farthest outside of the hull of those before, in one of `DIRECTIONS`. Only
    directions count whose product with the unit vector `towards` is `cosine` or more.
    """
    directions = sphere_directions()
    directions = directions[directions @ np.asarray(towards) >= cosine]
    reach = body.centres @ directions.T + body.radii[:, None]
    largest, chosen = reach.max(axis=0), [int(np.argmax(reach[:, 0]))]
    while True:
        beyond = largest - reach[chosen].max(axis=0)
        worst = int(np.argmax(beyond))
        if beyond[worst] < 1e-9 or len(chosen) == count:
            return np.array(chosen), float(beyond[worst])
        chosen.append(int(np.argmax(reach[:, worst])))


def find_depths(leg: Leg, configurations: Sequence[Array], floor: float) -> list[Depth]:
    """Return the bodies that are under the ground at some configuration, the deepest first.

    A body is `shape_of` a frame. Configurations have shape `(nq,)` each; `floor` is the height of
    the ground [m, world frame].
    """
    model, data = leg.workspace.model, leg.workspace.data
    frames = body_frames(leg)
    deepest = {name: Depth(name, TOLERANCE, -1) for name in frames}
    for number, q in enumerate(configurations):
        pin.forwardKinematics(model, data, q)
        for name, frame in frames.items():
            pose = pin.updateFramePlacement(model, data, frame)
            shape = shape_of(leg, name, meshes=pose.translation[2] - floor < LARGEST_MESH)
            depth = floor - shape.moved(pose.homogeneous).lowest
            if depth > deepest[name].depth:
                deepest[name] = Depth(name, depth, number)
    under = [depth for depth in deepest.values() if depth.number >= 0]
    return sorted(under, key=lambda depth: -depth.depth)


def body_frames(leg: Leg) -> dict[str, int]:
    """Return the frames of a leg that have shapes, by name; all frames where none has any."""
    every = frames_by_name(leg.workspace.model)
    shaped = {} if leg.file is None else leg.file.visuals_by_frame | leg.file.collisions_by_frame
    return {name: every[name] for name in shaped if name in every} or every


def shape_of(leg: Leg, frame: str, *, meshes: bool = True) -> Spheres:
    """Return the body at a frame, in the frame's axes: a point where its file has no shape."""
    return joined(shapes_of(leg, frame, meshes=meshes))


def joined(shapes: Sequence[Spheres]) -> Spheres:
    """Return the convex hull of shapes; a point at the origin without any."""
    if not shapes:
        return Spheres(np.zeros((1, 3)), np.zeros(1))
    return Spheres(*(np.concatenate(arrays) for arrays in zip(*shapes, strict=True)))


def shapes_of(leg: Leg, frame: str, *, meshes: bool = True) -> list[Spheres]:
    """Return the convex shapes at a frame; none where the file has no readable shape.

    They are what the file draws; where a mesh of that cannot be read, or nothing is drawn, also
    what the file has for contacts. Without `meshes`, those that are meshes are left out.
    """
    if leg.file is None:
        return []
    drawn, shapes = leg.file.visuals_by_frame.get(frame, []), []
    wanted = list(drawn)
    if not drawn or find_unread(leg, frame, meshes=meshes):
        wanted += leg.file.collisions_by_frame.get(frame, [])
    for visual in wanted:
        if meshes or visual.shape != Shape.MESH:
            shape = _spheres(leg.file, visual)
            shapes += [] if isinstance(shape, str) else [shape]
    return shapes


def find_unread(leg: Leg, frame: str, *, meshes: bool = True) -> str:
    """Return why a shape that the file of a leg draws at a frame cannot be read, or nothing."""
    if leg.file is None:
        return ""
    drawn = leg.file.visuals_by_frame.get(frame, [])
    shapes = [_spheres(leg.file, item) for item in drawn if meshes or item.shape != Shape.MESH]
    return next((reason for reason in shapes if isinstance(reason, str)), "")


_known: WeakKeyDictionary[Visual, Spheres | str] = WeakKeyDictionary()
"""What `_spheres` returned before: reading a mesh takes a tenth of a second."""


def _spheres(file: RobotFile, visual: Visual) -> Spheres | str:
    """Return spheres that span a visual, in its frame's axes, or why it cannot be read."""
    if visual not in _known:
        try:
            _known[visual] = _spanned(file, visual).moved(visual.pose)
        except InvalidInput as error:
            _known[visual] = str(error)
    return _known[visual]


def _spanned(file: RobotFile, visual: Visual) -> Spheres:
    """Return spheres that span a shape, in its own axes; raise `InvalidInput`."""
    if visual.vertices is not None:
        return Spheres(corners := _hull(visual.vertices), np.zeros(len(corners)))
    if visual.shape == Shape.MESH:
        files = PackageFiles(file.folder, file.package_dirs)
        surfaces = read_mesh(files, visual.mesh, visual.size)
        points = np.vstack([surface.vertices for surface in surfaces])
        return Spheres(corners := _hull(points), np.zeros(len(corners)))
    size = [validation.number("size of a visual", x, above=0, unit="m") for x in visual.size]
    if visual.shape == Shape.SPHERE:
        return Spheres(np.zeros((1, 3)), np.array(size))
    if visual.shape == Shape.CAPSULE:
        ends = np.array([[0.0, 0.0, -size[0] / 2], [0.0, 0.0, size[0] / 2]])
        return Spheres(ends, np.full(2, size[1]))
    if visual.shape == Shape.BOX:
        signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        return Spheres(signs * size, np.zeros(8))
    turns = np.linspace(0.0, 2 * np.pi, CIRCLE_POINTS, endpoint=False)
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    if visual.shape == Shape.CYLINDER:
        length, radius = size
        rings = [
            np.column_stack([radius * ring, np.full(CIRCLE_POINTS, z)])
            for z in (-length / 2, length / 2)
        ]
        return Spheres(np.vstack(rings), np.zeros(2 * CIRCLE_POINTS))
    levels = np.linspace(-np.pi / 2, np.pi / 2, CIRCLE_POINTS // 2 + 1)
    ball = [np.column_stack([np.cos(a) * ring, np.full(CIRCLE_POINTS, np.sin(a))]) for a in levels]
    return Spheres(np.vstack(ball) * size, np.zeros(CIRCLE_POINTS * len(levels)))


def _hull(points: Array) -> Array:
    """Return the corners of the convex hull of points, shape `(k, 3)`."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # flat
        return points
