"""The bodies of a robot as convex shapes, by the shapes of its file, and how deep they are.

A shape is the convex hull of spheres, so that its depth under a plane is a minimum over centres and
has simple derivatives.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from kickdyn.core import validation
from kickdyn.core.validation import Array, ArrayLike
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frames_by_name
from kickdyn.robot.robot_file import PackageFiles, RobotFile, Shape, Visual, read_mesh

TOLERANCE = 2e-3
"""Depth up to which a body counts as on the ground [m]: soles are rounded and rubber gives way."""

LARGEST_MESH = 0.5
"""Distance of a frame from which on its meshes are not read [m]: a leg's are shorter."""

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
    def points(self) -> Array:
        """Centres, and points of the surfaces in `DIRECTIONS`, shape `(n, 3)` [m]."""
        round_ones = self.radii > 0.0
        reach = self.radii[round_ones, None, None] * sphere_directions()
        return np.vstack([self.centres, (self.centres[round_ones, None] + reach).reshape(-1, 3)])

    @property
    def lowest(self) -> float:
        """Height of the body's lowest point [m]."""
        return float((self.centres[:, 2] - self.radii).min())


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

    Each next one is farthest outside of the hull of those before, in one of `DIRECTIONS` whose
    product with the unit vector `towards` is `cosine` or more.
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


def find_depths(leg: Leg, q: Array, floor: float) -> dict[str, float]:
    """Return the depths of bodies under the height `floor` [m], by frame, the deepest first."""
    model, data, depths = leg.workspace.model, leg.workspace.data, dict[str, float]()
    pin.forwardKinematics(model, data, q)
    for name, frame in body_frames(leg).items():
        pose = pin.updateFramePlacement(model, data, frame)
        shape = shape_of(leg, name, meshes=pose.translation[2] - floor < LARGEST_MESH)
        depths[name] = floor - shape.moved(pose.homogeneous).lowest
    under = {name: depth for name, depth in depths.items() if depth > TOLERANCE}
    return dict(sorted(under.items(), key=lambda item: -item[1]))


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

    They are what the file draws, and, if that cannot be read or is nothing, its shapes for
    contacts. Without `meshes`, those that are meshes are left out.
    """
    return _read(leg, frame, meshes=meshes)[0]


def find_unread(leg: Leg, frame: str) -> str:
    """Return why a shape that the file of a leg draws at a frame cannot be read, or nothing."""
    return _read(leg, frame, meshes=True)[1]


def _read(leg: Leg, frame: str, *, meshes: bool) -> tuple[list[Spheres], str]:
    file = leg.file
    if file is None:
        return [], ""

    def spanned(visuals: list[Visual]) -> list[Spheres | str]:
        return [spheres_of(file, item) for item in visuals if meshes or item.shape != Shape.MESH]

    drawn = file.visuals_by_frame.get(frame, [])
    shapes = spanned(drawn)
    unread = next((reason for reason in shapes if isinstance(reason, str)), "")
    if unread or not drawn:
        shapes += spanned(file.collisions_by_frame.get(frame, []))
    return [shape for shape in shapes if not isinstance(shape, str)], unread


_known: WeakKeyDictionary[Visual, Spheres | str] = WeakKeyDictionary()
"""What `spheres_of` returned before: reading a mesh takes a tenth of a second."""


def spheres_of(file: RobotFile, visual: Visual) -> Spheres | str:
    """Return spheres that span a visual, in its frame's axes, or why it cannot be read."""
    if visual not in _known:
        try:
            _known[visual] = _spanned(file, visual).moved(visual.pose)
        except InvalidInput as error:
            _known[visual] = str(error)
    return _known[visual]


def _spanned(file: RobotFile, visual: Visual) -> Spheres:
    """Return spheres that span a shape, in its own axes; raise `InvalidInput`."""
    if visual.shape == Shape.MESH:
        points = visual.vertices
        if points is None:
            files = PackageFiles(file.folder, file.package_dirs)
            surfaces = read_mesh(files, visual.mesh, visual.size)
            points = np.vstack([surface.vertices for surface in surfaces])
        if np.ptp(points, axis=0).max() < 1e-4:
            raise InvalidInput("it is smaller than 0.1 mm")
        with suppress(QhullError, ValueError):  # flat
            points = points[ConvexHull(points).vertices]
        return Spheres(points, np.zeros(len(points)))
    size = [validation.number("size of a visual", x, above=0, unit="m") for x in visual.size]
    if visual.shape == Shape.SPHERE:
        return Spheres(np.zeros((1, 3)), np.array(size))
    if visual.shape == Shape.CAPSULE:
        ends = np.array([[0.0, 0.0, -size[0] / 2], [0.0, 0.0, size[0] / 2]])
        return Spheres(ends, np.full(2, size[1]))
    if visual.shape == Shape.BOX:
        signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        return Spheres(signs * size, np.zeros(8))
    if visual.shape == Shape.CYLINDER:
        length, radius = size
        circles, scale = [(1.0, -0.5), (1.0, 0.5)], [radius, radius, length]
    else:
        levels = np.linspace(-np.pi / 2, np.pi / 2, CIRCLE_POINTS // 2 + 1)
        circles, scale = list(zip(np.cos(levels), np.sin(levels), strict=True)), size
    turns = np.linspace(0.0, 2 * np.pi, CIRCLE_POINTS, endpoint=False)
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    points = np.vstack([np.insert(radius * ring, 2, z, axis=1) for radius, z in circles])
    return Spheres(points * scale, np.zeros(len(points)))
