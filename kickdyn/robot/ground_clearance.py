"""How deep a robot's bodies would be under the ground, by the shapes of its file."""

from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.robot.leg import Leg
from kickdyn.robot.mesh_file import read_mesh
from kickdyn.robot.package_files import PackageFiles
from kickdyn.robot.visuals import RobotFile, Shape, Visual

TOLERANCE = 2e-3
"""Depth up to which a body counts as on the ground [m]: soles are rounded and rubber gives way."""

NEAR = 0.5
"""Height of a frame above which its meshes are not read [m]: those of a leg's links are shorter."""

ROUND = 16
"""Points that stand for a circle or an ellipse."""


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


def find_depths(leg: Leg, configurations: Sequence[Array], floor: float) -> list[Depth]:
    """Return the bodies that are under the ground at some configuration, the deepest first.

    A body is what the file of the leg draws at a frame, or has there for contacts where a mesh is
    missing (`shape_of`); of a leg without such shapes, frames are points.

    Args:
        leg: the leg.
        configurations: each of shape `(nq,)`.
        floor: height of the ground [m, world frame].
    """
    model, data = leg.workspace.model, leg.workspace.data
    frames = body_frames(leg)
    worst = dict.fromkeys(frames, (TOLERANCE, -1))
    for number, q in enumerate(configurations):
        pin.forwardKinematics(model, data, q)
        for name, frame in frames.items():
            pose = pin.updateFramePlacement(model, data, frame)
            shape = shape_of(leg, name, meshes=pose.translation[2] - floor < NEAR)
            heights = shape.centres @ pose.rotation[2] - shape.radii
            depth = floor - float(heights.min()) - float(pose.translation[2])
            if depth > worst[name][0]:
                worst[name] = depth, number
    found = [Depth(name, *deep) for name, deep in worst.items() if deep[1] >= 0]
    return sorted(found, key=lambda one: -one.depth)


def body_frames(leg: Leg) -> dict[str, int]:
    """Return the frames of a leg that have shapes, by name; all frames where none has any."""
    model = leg.workspace.model
    numbered = list(enumerate(model.frames))[1:]
    every = {frame.name: number for number, frame in numbered}
    # a joint may have the name of a link
    every |= {f.name: n for n, f in numbered if f.type == pin.FrameType.BODY}
    shaped = {} if leg.file is None else _visuals(leg.file) | _collisions(leg.file)
    return {name: every[name] for name in shaped if name in every} or every


def shape_of(leg: Leg, frame: str, *, meshes: bool = True) -> Spheres:
    """Return the body at a frame, in the frame's axes: a point where its file has no shape.

    It is what the file draws; where a mesh of that cannot be read, or nothing is drawn, also what
    the file has for contacts.
    """
    known = shapes_of(leg, frame, meshes=meshes)
    if not known:
        return POINT
    return Spheres(*(np.concatenate(parts) for parts in zip(*known, strict=True)))


def shapes_of(leg: Leg, frame: str, *, meshes: bool = True) -> list[Spheres]:
    """Return the shapes of `shape_of`, each convex; none where the file has no readable shape."""
    if leg.file is None:
        return []
    drawn = _visuals(leg.file).get(frame, [])
    found = [_spheres(leg.file, one) for one in drawn if meshes or one.shape != Shape.MESH]
    if not drawn or any(isinstance(one, str) for one in found):
        hidden = _collisions(leg.file).get(frame, [])
        found += [_spheres(leg.file, one) for one in hidden if meshes or one.shape != Shape.MESH]
    return [one for one in found if not isinstance(one, str)]


def find_unread(leg: Leg, frame: str) -> str:
    """Return why a shape that the file of a leg draws at a frame cannot be read, or nothing."""
    if (file := leg.file) is None:
        return ""
    drawn = _visuals(file).get(frame, [])
    reasons = [found for one in drawn if isinstance(found := _spheres(file, one), str)]
    return reasons[0] if reasons else ""


POINT = Spheres(np.zeros((1, 3)), np.zeros(1))
"""A body that is a point at the origin."""


_known: WeakKeyDictionary[Visual, Spheres | str] = WeakKeyDictionary()
"""What `_spheres` returned before: reading a mesh takes a tenth of a second."""


def _visuals(file: RobotFile) -> dict[str, list[Visual]]:
    """Return the visuals of a file by frame; none where they cannot be read."""
    try:
        return file.visuals_by_frame
    except InvalidInput:  # a page of the leg says why
        return {}


def _collisions(file: RobotFile) -> dict[str, list[Visual]]:
    """Return the shapes for contacts of a file by frame; none where they cannot be read."""
    try:
        return file.collisions_by_frame
    except InvalidInput:
        return {}


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
        finder = PackageFiles(file.folder, file.package_dirs)
        points = np.vstack([part.vertices for part in read_mesh(finder, visual.mesh, visual.size)])
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
    turns = np.linspace(0.0, 2 * np.pi, ROUND, endpoint=False)
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    if visual.shape == Shape.CYLINDER:
        length, radius = size
        rings = [
            np.column_stack([radius * ring, np.full(ROUND, z)]) for z in (-length / 2, length / 2)
        ]
        return Spheres(np.vstack(rings), np.zeros(2 * ROUND))
    levels = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1)
    ball = [np.column_stack([np.cos(a) * ring, np.full(ROUND, np.sin(a))]) for a in levels]
    return Spheres(np.vstack(ball) * size, np.zeros(ROUND * len(levels)))


def _hull(points: Array) -> Array:
    """Return the corners of the convex hull of points, shape `(k, 3)`."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # flat
        return points
