"""Bodies of a robot inside each other or a ball, and shapes that strike a ball, by coal.

`ConvexBase.convexHull` of coal 3.0.3 ends the process with a segmentation fault for flat hulls (at
a thickness of 1e-7 of the size, not yet at 1e-4), which are therefore made `THICKNESS` thick.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from kickdyn.core.mechanics import rotation_between
from kickdyn.core.validation import Array
from kickdyn.robot.ground_clearance import LARGEST_MESH, Spheres, body_frames, shapes_of, spheres_of
from kickdyn.robot.leg import Leg, Posture
from kickdyn.robot.names import listed
from kickdyn.robot.robot_file import RobotFile, Visual, read_xml
from kickdyn.robot.standing import joint_bodies, rest_configuration

TOUCHING = 5e-3
"""Depth up to which a body counts as touching the ball or another body [m].

It is a choice: shapes are simpler than real bodies, and a ball is pressed in by more than this.
"""

MEETING, ACROSS = 0.01, 0.5
"""Distance of the axes of two joints up to which they meet, as in an ankle [m], and the sine of the
least angle between them."""

BALL = ""
"""Frame of a ball, a name that no frame of a robot has."""

THICKNESS = 1e-3
"""Least thickness of a hull, as a share of its length."""


class CollisionBody(NamedTuple):
    """A convex shape of coal, its `pin.SE3` in a named frame, and its reach from its middle [m]."""

    frame: str
    shape: Any
    pose: Any
    reach: float


class Proximity(NamedTuple):
    """Depth of a body in another [m], its point there, and the normal into the other, `(3,)`."""

    depth: float
    point: Array
    normal: Array


_known: WeakKeyDictionary[Leg, dict[tuple[str, bool], list[CollisionBody]]] = WeakKeyDictionary()
"""Bodies by frame, with meshes or without: reading a mesh takes a tenth of a second."""


class BodyPairs(NamedTuple):
    """Pairs of bodies by indices, shape `(k,)`, and the `reach` of both bodies together [m]."""

    bodies: list[CollisionBody]
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    reach: Array

    def of(self, chosen: NDArray[np.bool_]) -> "BodyPairs":
        """Return some of the pairs."""
        return BodyPairs(self.bodies, self.first[chosen], self.second[chosen], self.reach[chosen])


_pairs: WeakKeyDictionary[Leg, BodyPairs] = WeakKeyDictionary()
"""Pairs of bodies that must stay apart: a motion asks for them at many times."""


def bodies_at(leg: Leg, frame: str, *, meshes: bool = True) -> list[CollisionBody]:
    """Return the convex shapes that a leg's file has at a frame, or those that are no meshes."""
    cache, key = _known.setdefault(leg, {}), (frame, meshes)
    if key not in cache:
        cache[key] = [body_of(frame, spheres) for spheres in shapes_of(leg, frame, meshes=meshes)]
    return cache[key]


def body_of(frame: str, spheres: Spheres) -> CollisionBody:
    """Return a body: a sphere, a capsule of two spheres, or the hull of points without radii."""
    import coal  # takes a tenth of a second

    points, radius = spheres.centres, float(spheres.radii[0])
    centre = points.mean(axis=0)
    reach = float(np.linalg.norm(points - centre, axis=1).max()) + radius
    if len(points) == 1:
        return CollisionBody(frame, coal.Sphere(radius), pin.SE3(np.eye(3), centre), reach)
    if len(points) == 2:
        turn = rotation_between(np.array([0.0, 0.0, 1.0]), points[1] - points[0])
        length = float(np.linalg.norm(points[1] - points[0]))
        return CollisionBody(frame, coal.Capsule(radius, length), pin.SE3(turn, centre), reach)
    corners = coal.StdVec_Vec3s()
    corners.extend(list(thickened(points) - centre))
    shape = coal.ConvexBase.convexHull(corners, True, "Qt")
    return CollisionBody(frame, shape, pin.SE3(np.eye(3), centre), reach)


def thickened(points: Array) -> Array:
    """Return points whose hull is `THICKNESS` thick, where that of the points is flatter."""
    centre = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - centre, full_matrices=False)
    reach = float(np.linalg.norm(points - centre, axis=1).max())
    for axis in axes[sizes <= THICKNESS * sizes[0]]:
        step = 0.5 * THICKNESS * reach * axis
        points = np.vstack([points - step, points + step])
    return points


def ball_proximity(body: CollisionBody, centre: Array, radius: float) -> Proximity:
    """Return depth, point and normal of a body in a ball at a place, all in the body's frame."""
    import coal

    pose = coal.Transform3s(body.pose.rotation, body.pose.translation)
    return _proximity(body.shape, pose, coal.Sphere(radius), coal.Transform3s(np.eye(3), centre))


def _proximity(shape: Any, pose: Any, other: Any, other_pose: Any) -> Proximity:
    """Return the depth of a shape of coal in another, its point there, and the normal."""
    import coal

    request, result = coal.DistanceRequest(), coal.DistanceResult()
    coal.distance(shape, pose, other, other_pose, request, result)
    return Proximity(-result.min_distance, result.getNearestPoint1(), result.normal)


class Placed:
    """The bodies of a leg at q; `frames` are numbers in the model, of the leg or a part of it."""

    def __init__(self, leg: Leg, frames: Mapping[str, int], model: Any, data: Any, q: Array):
        self._leg, self._placed = leg, dict[int, tuple[CollisionBody, Any]]()
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacements(model, data)
        self.poses = {name: data.oMf[number].copy() for name, number in frames.items()}

    def bodies_near(self, point: Array, radius: float) -> list[CollisionBody]:
        """Return the bodies that may be inside a sphere; no mesh that is farther away is read."""
        bodies = []
        for frame, pose in self.poses.items():
            meshes = bool(np.linalg.norm(pose.translation - point) < LARGEST_MESH + radius)
            bodies += [
                body
                for body in bodies_at(self._leg, frame, meshes=meshes)
                if np.linalg.norm(pose.act(body.pose.translation) - point) < body.reach + radius
            ]
        return bodies

    def least_distances(self, pairs: BodyPairs) -> Array:
        """Return lower bounds of the distances of pairs, shape `(k,)` [m]."""
        places = [self.poses[body.frame].act(body.pose.translation) for body in pairs.bodies]
        centres = np.array(places).reshape(-1, 3)
        apart = np.linalg.norm(centres[pairs.first] - centres[pairs.second], axis=1)
        return np.asarray(apart - pairs.reach)

    def near(self, pairs: BodyPairs) -> list[tuple[CollisionBody, CollisionBody]]:
        """Return the pairs that may be inside each other."""
        chosen = np.flatnonzero(self.least_distances(pairs) < 0.0)
        return [(pairs.bodies[pairs.first[k]], pairs.bodies[pairs.second[k]]) for k in chosen]

    def place_ball(self, centre: Array, radius: float) -> CollisionBody:
        """Return a ball as a body of the frame `BALL`, which moves there [m, world frame]."""
        self.poses[BALL] = pin.SE3(np.eye(3), centre)
        return body_of(BALL, Spheres(np.zeros((1, 3)), np.array([radius])))

    def _place(self, body: CollisionBody) -> Any:
        """Return a body's pose in the world, of coal: it is asked for with many other bodies."""
        if id(body) not in self._placed:
            import coal

            pose = self.poses[body.frame] * body.pose
            self._placed[id(body)] = body, coal.Transform3s(pose.rotation, pose.translation)
        return self._placed[id(body)][1]

    def proximity(self, body: CollisionBody, other: CollisionBody) -> Proximity:
        """Return depth, point and normal of a body in another [m, world frame]."""
        return _proximity(body.shape, self._place(body), other.shape, self._place(other))

    def find_overlaps(
        self, pairs: Iterable[tuple[CollisionBody, CollisionBody]]
    ) -> dict[tuple[str, str], float]:
        """Return the depths of bodies inside each other [m], by frames, the deepest first."""
        depths: dict[tuple[str, str], float] = {}
        for body, other in pairs:
            frames, depth = (body.frame, other.frame), self.proximity(body, other).depth
            if depth > max(TOUCHING, depths.get(frames, 0.0)):
                depths[frames] = depth
        return dict(sorted(depths.items(), key=lambda item: -item[1]))


def find_ball_overlaps(posture: Posture, centre: Array, radius: float) -> dict[str, float]:
    """Return the depths of bodies inside a ball [m], by frame, the deepest first."""
    leg = posture.leg
    placed = Placed(leg, body_frames(leg), leg.workspace.model, leg.workspace.data, posture.q)
    ball = placed.place_ball(centre, radius)
    overlaps = placed.find_overlaps((body, ball) for body in placed.bodies_near(centre, radius))
    return {frame: depth for (frame, _), depth in overlaps.items()}


def find_self_collisions(leg: Leg, q: Array) -> dict[tuple[str, str], float]:
    """Return the depths of `body_pairs` inside each other [m], by frames, the deepest first."""
    space = leg.workspace
    placed = Placed(leg, body_frames(leg), space.model, space.data, q)
    return placed.find_overlaps(placed.near(body_pairs(leg)))


def body_pairs(leg: Leg) -> BodyPairs:
    """Return the pairs of a leg's bodies that must not be inside each other.

    Bodies of one joint or of a joint and its carrier do not count, nor pairs of `find_forks`, pairs
    that the SRDF beside the URDF disables, or pairs that touch where all joints are at rest.
    """
    if leg not in _pairs:
        space, frames = leg.workspace, body_frames(leg)
        model = space.model
        bodies = [body for frame in frames for body in bodies_at(leg, frame)]
        joints = np.array([model.frames[frames[body.frame]].parentJoint for body in bodies], int)
        carriers = np.array([_carrier(model, joint) for joint in range(model.njoints)])[joints]
        counts = (joints[:, None] < joints) & (joints[:, None] != carriers)
        first, second = np.nonzero(counts)
        reach = np.array([body.reach for body in bodies])
        pairs = BodyPairs(bodies, first, second, reach[first] + reach[second])
        placed = Placed(leg, frames, model, space.data, rest_configuration(leg))
        touching = placed.find_overlaps(placed.near(pairs))
        allowed = disabled_pairs(leg) | {*map(frozenset, touching)} | find_forks(leg)
        named = [
            frozenset((bodies[i].frame, bodies[j].frame))
            for i, j in zip(first, second, strict=True)
        ]
        _pairs[leg] = pairs.of(np.array([names not in allowed for names in named], bool))
    return _pairs[leg]


def _carrier(model: Any, joint: int) -> int:
    """Return the joint of the body that carries a joint; others of a joint of several have none."""
    carrier = int(model.parents[joint])
    while carrier and model.inertias[carrier].mass == 0.0:
        carrier = int(model.parents[carrier])
    return carrier


def find_forks(leg: Leg) -> set[frozenset[str]]:
    """Return the pairs of frames whose bodies are on both sides of two joints whose axes meet.

    They are forks around the place of the meeting, as of an ankle, and their hulls are not; ranges
    of the joints keep them apart. A body counts if the sphere around it includes that place.
    """
    model, data, frames = leg.workspace.model, leg.workspace.data, body_frames(leg)
    pin.computeJointJacobians(model, data, rest_configuration(leg))
    pin.updateFramePlacements(model, data)
    forks = set()
    for joint in range(1, model.njoints):
        before = int(model.parents[joint])
        if not before or model.nvs[before] != 1 or model.nvs[joint] != 1:
            continue
        axes = data.J[3:, [model.idx_vs[before], model.idx_vs[joint]]]
        origins = np.array([data.oMi[number].translation for number in (before, joint)])
        along = np.linalg.lstsq(axes * [1.0, -1.0], origins[1] - origins[0])[0]
        places = origins + along[:, None] * axes.T
        inclined = np.linalg.norm(np.cross(*axes.T)) > ACROSS
        if not inclined or np.linalg.norm(places[1] - places[0]) > MEETING:
            continue
        sides = [
            [
                name
                for name, number in frames.items()
                if int(model.frames[number].parentJoint) == side
                and _includes(bodies_at(leg, name), data.oMf[number].actInv(places[1]))
            ]
            for side in (_carrier(model, before), joint)
        ]
        forks |= {frozenset((first, second)) for first in sides[0] for second in sides[1]}
    return forks


def _includes(bodies: Sequence[CollisionBody], point: Array) -> bool:
    """Return whether a sphere around bodies of a frame includes a point, in the frame's axes."""
    places = np.array([body.pose.translation for body in bodies]).reshape(-1, 3)
    centre = places.sum(axis=0) / max(len(places), 1)
    reach = np.linalg.norm(places - centre, axis=1) + [body.reach for body in bodies]
    return bool(np.linalg.norm(point - centre) < reach.max(initial=0.0))


def disabled_pairs(leg: Leg) -> set[frozenset[str]]:
    """Return the pairs of links that the SRDF of a leg's file disables; none without one.

    It lies beside the file or in a folder `srdf` beside its folder, named as the file or the
    robot.
    """
    if leg.file is None:
        return set()
    names = {Path(leg.file.source).stem.lower(), leg.name.lower()}
    folders = leg.file.folder, leg.file.folder.parent / "srdf"
    paths = [path for folder in folders for path in sorted(folder.glob("*.srdf"))]
    srdf = next((path for path in paths if path.stem.lower() in names), None)
    pairs = () if srdf is None else read_xml(srdf, str(srdf)).iter("disable_collisions")
    return {frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in pairs}


FAR = 0.01
"""Distance from the ball [m] from which on shapes for contacts do not stand for the foot."""


FootKind = StrEnum("FootKind", {"SHAPES": "shapes", "PLATE": "plate"})
"""What strikes the ball: the shapes of the foot, or a plate at the contact point."""


class StrikingShape(NamedTuple):
    """A shape, the file's visual, its pose `(4, 4)` and spheres, in axes of the contact joint."""

    body: CollisionBody
    visual: Visual
    pose: Array
    spheres: Spheres


def contact_in_joint(posture: Posture, normal: Array) -> tuple[Array, Array]:
    """Return a contact point [m] and a normal, given in world axes, in the contact joint's axes."""
    return posture.contact_lever, posture.rotation_world_joint.T @ normal


def striking_shapes(
    robot: Leg, point: Array, normal: Array, radius: float
) -> tuple[list[StrikingShape], list[str]]:
    """Return the shapes of a foot that strike a ball, and a line for each doubt about them.

    The planned contact is from `contact_in_joint`; `radius` is the ball's [m].
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
    # There is no doubt up to this depth or distance, and up to 5 deg between the normals.
    if abs(gap) <= TOUCHING and angle <= math.radians(5.0):
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
