"""The figure of a leg: the shapes of its file, and sticks between joints without any.

A kick as a simulator carried it out is drawn beside the planned one.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any, NamedTuple, Protocol, runtime_checkable

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np
import pinocchio as pin

from kickdyn.ball import BallState
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.planning.kick_plan import KickPlan
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frames_by_name
from kickdyn.robot.robot_file import PackageFiles, Shape, Triangles, Visual, read_mesh
from kickdyn.view import marks
from kickdyn.view.document import draw_label
from kickdyn.view.marks import UP_AXIS, UPRIGHT, box_corners, cylinder_pose

Rgba = tuple[float, ...]
MeshReader = Callable[[str, tuple[float, ...]], list[Triangles]]

BODY_COLOUR: Rgba = (0.62, 0.67, 0.73, 1.0)
JOINT_COLOUR: Rgba = (0.25, 0.27, 0.31, 1.0)
"""Colours of sticks and of bodies without a colour, and of the spheres at joints."""


BallPath = Flight | Course
"""The path of a ball through the air, or also along the ground."""

CURVE = 0xF28C00
"""Colour of the flight of a simulated ball."""

CURVE_POINTS = 150
"""Points of the curve of a flight."""

PERSON_COLOUR = 0x8A97A6
PERSON = (
    ((0.0, 0.0, 0.25), (0.0, 0.0, 1.25), 0.3),  # trunk
    ((0.0, 0.0, 1.25), (0.0, 0.0, 1.45), 0.12),  # neck
    ((0.0, 0.0, 1.68), (0.0, 0.0, 1.68), 0.25),  # head
    ((0.0, 0.38, 1.15), (0.1, 0.55, 0.0), 0.1),  # arms
    ((0.0, -0.38, 1.15), (-0.1, -0.55, 0.0), 0.1),
)
"""Cylinders and a sphere of a person above the hip: from, to, radius, over the thigh's length."""


def curve_of(path: BallPath, count: int = CURVE_POINTS) -> Array:
    """Return points of a ball's path, evenly in time, shape `(count, 3)` [m, world frame]."""
    return np.asarray(path.sample(np.linspace(0.0, path.duration, count)).position)


class BodyShape(NamedTuple):
    """A geometry of meshcat, its joint (0: the world), its pose there `(4, 4)` [m], and colour."""

    joint: int
    pose: Array
    geometry: Any
    rgba: Rgba


def joint_poses(leg: Leg, q: Array) -> list[Array]:
    """Return the pose of every joint, the world first, each `(4, 4)` [m, world frame].

    The configuration q has the shape `(nq,)` [rad; m for prismatic joints].
    """
    model, data = leg.workspace.model, leg.workspace.data
    pin.forwardKinematics(model, data, q)
    return [np.eye(4)] + [data.oMi[joint].homogeneous for joint in range(1, model.njoints)]


def move_leg(frame: Any, node: str, leg: Leg, q: Array) -> list[Array]:
    """Put a leg at a configuration, in a frame of an animation; return the poses of its joints."""
    poses = joint_poses(leg, q)
    for joint, pose in list(enumerate(poses))[1:]:
        frame[f"{node}/{joint}"].set_transform(pose)
    return poses


def draw_leg(viewer: Any, leg: Leg, q: Array) -> Array:
    """Draw a leg, joint i as `viewer[str(i)]`; return corners of its boxes, `(n, 3)` [m, world]."""
    poses, corners = joint_poses(leg, q), []
    body_shapes, warning = leg_shapes(leg)
    if warning and warning not in viewer.window.warnings:
        viewer.window.warnings.append(warning)
    for number, body_shape in enumerate(body_shapes):
        node = viewer[f"{body_shape.joint}/{number}"]  # numbers, as a name could contain a slash
        red, green, blue = (round(255 * level) for level in body_shape.rgba[:3])
        look = shapes.MeshLambertMaterial(
            color=(red << 16) + (green << 8) + blue,
            opacity=body_shape.rgba[3],
            # A mesh has no normals; three.js's own for smooth bodies would smear over edges.
            flatShading=isinstance(body_shape.geometry, shapes.TriangularMeshGeometry),
        )
        node.set_object(body_shape.geometry, look)
        node.set_transform(body_shape.pose)
        pose = poses[body_shape.joint] @ body_shape.pose
        corners.append(_corners(body_shape.geometry) @ pose[:3, :3].T + pose[:3, 3])
    for joint, pose in enumerate(poses):
        viewer[str(joint)].set_transform(pose)
    _draw_person(viewer, leg)
    return np.vstack(corners)


def _draw_person(viewer: Any, leg: Leg) -> None:
    """Draw the rest of the person of a `Leg.human` with a fixed hip, as a faint figure."""
    model = leg.workspace.model
    is_person = (leg.name or "").startswith("leg_human") and "knee" in model.names
    if not is_person or model.joints[1].nq != 1:  # a pelvis that moves
        return
    thigh = float(np.linalg.norm(model.jointPlacements[model.getJointId("knee")].translation))
    for number, (start, end, radius) in enumerate(PERSON):
        ends = thigh * np.array([start, end])
        look = shapes.MeshLambertMaterial(color=PERSON_COLOUR, opacity=0.22, transparent=True)
        node = viewer[f"0/person/{number}"]
        if start == end:
            node.set_object(shapes.Sphere(radius * thigh), look)
            node.set_transform(tf.translation_matrix(ends[0]))
        else:
            length = float(np.linalg.norm(ends[1] - ends[0]))
            node.set_object(shapes.Cylinder(length, radius * thigh), look)
            node.set_transform(cylinder_pose(ends[0], ends[1]))


def leg_shapes(leg: Leg) -> tuple[list[BodyShape], str]:
    """Return the shapes of a leg's file, sticks for bodies without any, and a warning."""
    if leg.file is None:
        return list(_sticks(leg, set())), ""
    try:
        visuals = leg.file.visuals()
    except InvalidInput as error:
        return list(_sticks(leg, set())), f"{error}: sticks are drawn instead"
    model = leg.workspace.model
    frames = {name: model.frames[number] for name, number in frames_by_name(model).items()}
    visuals = [visual for visual in visuals if visual.frame in frames]  # not of other objects
    body_shapes: list[BodyShape] = []
    faults: list[str] = []
    read = cache(partial(read_mesh, PackageFiles(leg.file.folder, leg.file.package_dirs)))
    for visual in visuals:
        frame = frames[visual.frame]
        pose = frame.placement.homogeneous @ visual.pose
        try:
            for geometry, turn, colour in list(_shapes(visual, read)):
                colours = [visual.rgba, colour, BODY_COLOUR]
                if visual.has_texture and colour is not None:
                    colours.pop(0)
                rgba = next(np.clip(c, 0.0, 1.0) for c in colours if c is not None and len(c) == 4)
                joint = int(frame.parentJoint)
                body_shapes.append(BodyShape(joint, pose @ turn, geometry, tuple(rgba.tolist())))
        except InvalidInput as error:
            faults.append(str(error))
    body_shapes += _sticks(leg, {body_shape.joint for body_shape in body_shapes})
    if not faults:
        return body_shapes, ""
    what = "is not drawn" if len(faults) == 1 else "are not drawn, the first"
    return body_shapes, f"{len(faults)} of {len(visuals)} visuals of {leg.name} {what}: {faults[0]}"


def _shapes(visual: Visual, read: MeshReader) -> Iterator[tuple[Any, Array, Array | None]]:
    """Yield the shapes of a visual: each with its pose and the colour that its mesh gives it."""
    if visual.vertices is not None:
        yield shapes.TriangularMeshGeometry(visual.vertices, visual.faces), np.eye(4), None
        return
    if visual.shape == Shape.MESH:
        for mesh in read(visual.mesh, visual.size):
            yield shapes.TriangularMeshGeometry(mesh.vertices, mesh.faces), np.eye(4), mesh.rgba
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


def _sticks(leg: Leg, drawn: set[int]) -> Iterator[BodyShape]:
    """Yield spheres at joints, and cylinders to the next ones, of all bodies but the drawn ones.

    A joint whose next ones are all in the same place has none: the bodies between have no
    extent.
    """
    model = leg.workspace.model
    ends = [
        (int(model.parents[joint]), model.jointPlacements[joint].translation)
        for joint in range(1, model.njoints)
    ]
    ends.append((leg.contact_joint, leg.contact_lever))
    lengths = [float(np.linalg.norm(end)) if parent else 0.0 for parent, end in ends]
    longest = max(lengths) or 1.0
    for joint in range(1, model.njoints):
        pairs = zip(ends, lengths, strict=True)
        next_ones = [length for (parent, _), length in pairs if parent == joint]
        if joint not in drawn and (any(next_ones) or not next_ones):
            yield BodyShape(joint, np.eye(4), shapes.Sphere(0.1 * longest), JOINT_COLOUR)
    for (parent, end), length in zip(ends, lengths, strict=True):
        if parent not in drawn and length > 0:
            stick = shapes.Cylinder(length, 0.06 * longest)
            yield BodyShape(parent, cylinder_pose(np.zeros(3), end), stick, BODY_COLOUR)
    if leg.contact_joint not in drawn:
        tip = tf.translation_matrix(leg.contact_lever)
        yield BodyShape(leg.contact_joint, tip, shapes.Sphere(0.06 * longest), BODY_COLOUR)


def _corners(shape: Any) -> Array:
    middle = np.zeros(3)
    if isinstance(shape, shapes.TriangularMeshGeometry):
        low, high = np.min(shape.vertices, axis=0), np.max(shape.vertices, axis=0)
        middle, size = (low + high) / 2, high - low
    elif isinstance(shape, shapes.Cylinder):
        size = np.array([2 * shape.radiusTop, shape.height, 2 * shape.radiusTop])
    elif isinstance(shape, shapes.Sphere):
        size = 2 * np.asarray(getattr(shape, "radii", np.full(3, shape.radius)))  # of an ellipsoid
    else:
        size = np.asarray(shape.lengths)
    return np.asarray(middle + box_corners(np.zeros((1, 3)), 0.5) * size)


@runtime_checkable
class SimulatedRun(Protocol):
    """A planned motion that a simulator carried out, with the attributes of `MujocoRun`."""

    plan: KickPlan
    t: Array
    q: Array
    ball_position: Array
    ball_after: BallState
    path: BallPath | None
    summary: str


class DrawnRun(NamedTuple):
    """A simulated robot and ball at an offset [m], corners of boxes, and the ball's curve."""

    run: SimulatedRun
    offset: Array
    corners: Array
    curve: Array

    def draw_curve(self, viewer: Any, width: Array, right: Array) -> None:
        """Draw the path of the ball, with half widths of its points, `(n,)` [m]."""
        if len(self.curve):
            curve = self.curve - self.offset
            marks.draw_curve(viewer["run/curve"], curve, width, right, CURVE)

    def move(self, frame: Any, time: float) -> None:
        """Put robot and ball where they are at a time [s], in a frame of an animation."""
        run, released = self.run, float(self.run.ball_after.time)
        if run.path is None or time < released:
            columns = run.ball_position.T
            position = np.array([np.interp(time, run.t, column) for column in columns])
        else:
            position = run.path.sample(min(time - released, run.path.duration)).position
        frame["run/ball"].set_transform(tf.translation_matrix(position))
        q = run.q[np.clip(np.searchsorted(run.t, time), 0, len(run.t) - 1)]
        move_leg(frame, "run/leg", run.plan.impact.posture.leg, np.asarray(q))


def draw_run(viewer: Any, run: SimulatedRun, forward: Array, planned: Array) -> DrawnRun:
    """Draw robot and ball of a run to the right of the planned robot, which has these corners."""
    right, impact = np.cross(forward, UP_AXIS), run.plan.impact
    # distance of the two robots over the width of one, across the kick
    offset = max(1.2 * float(np.ptp(planned @ right)), 8 * impact.ball.radius) * right
    node, leg = viewer["run"], impact.posture.leg
    node.set_transform(tf.translation_matrix(offset))
    corners = draw_leg(node["leg"], leg, run.q[0])
    marks.draw_ball(node["ball"], impact.ball.radius, run.ball_position[0])
    for parent, name, boxes, colour in (
        (node, "simulated", corners, CURVE),
        (viewer["planned"], "planned", planned, marks.CURVE),
    ):
        height = boxes[:, 2].max() + 0.08 * np.ptp(boxes[:, 2])
        point = np.array([*boxes[:, :2].mean(axis=0), height])
        draw_label(parent["name"], name, point, f"#{colour:06x}")
    curve = np.zeros((0, 3)) if run.path is None else curve_of(run.path)
    return DrawnRun(run, offset, corners + offset, curve + offset)
