"""One kick, drawn and moving: leg, ball, flight, ground, and impulses as arrows to one scale."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import meshcat.transformations as tf
import numpy as np
import pinocchio as pin
from meshcat.animation import Animation

from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.planning.backswing import Backswing
from kickdyn.planning.swing import Swing
from kickdyn.robot.ground_clearance import find_depths, shape_of
from kickdyn.robot.leg import Leg
from kickdyn.robot.model_validation import frame_id
from kickdyn.view.camera import BOTTOM, LEFT, RIGHT, TOP, UP, Camera, camera_for, set_camera
from kickdyn.view.document import draw_label
from kickdyn.view.leg_figure import draw_leg, joint_poses
from kickdyn.view.marks import (
    ARROW,
    CURVE,
    draw_arrow,
    draw_axes,
    draw_ball,
    draw_curve,
    draw_disc,
    draw_distances,
    draw_ground,
    draw_tee,
)
from kickdyn.view.playback import RATE, Pace, ball_pose, kick_pace, leg_configuration
from kickdyn.view.wall_and_goal import Box, draw_box

SKY_COLOURS = {"top_color": [0.60, 0.78, 0.93], "bottom_color": [0.96, 0.98, 1.0]}
LIGHT_INTENSITIES = {
    "AmbientLight": 0.6,
    "FillLight": 0.7,  # from afar: of the same strength everywhere
    "PointLightNegativeX": 0.1,
    "PointLightPositiveX": 0.1,
}
SUN_DIRECTION = np.array([-0.3, -0.5, 0.81])
"""Unit vector from the scene to the light."""

LEAST_TEE_HEIGHT = 5e-3
"""Height above the ground from which on a resting ball is drawn on a tee [m]."""

CURVE_RADIUS = 0.0017
"""Radius of a flight's curve over its distance from the camera: 3 or 4 pixels on a screen."""

CURVE_POINTS = 150
"""Points of a flight's curve."""

JOINT_ARROW = 0xF28C00
"""Colour of the arrows of joint impulses."""

LEAST_JOINT_IMPULSE = 0.05
"""Least impulse of a joint that gets an arrow, over the largest impulse of the kick."""


@dataclass(frozen=True, eq=False)
class Arrow:
    """An impulse that is drawn.

    Attributes:
        node: where it is drawn in the viewer.
        start: shape `(3,)` [m, world frame].
        impulse: not zero, shape `(3,)` [N s, world frame].
        colour: 0xRRGGBB.
    """

    node: str
    start: Array
    impulse: Array
    colour: int

    @property
    def size(self) -> float:
        """Norm of the impulse [N s]."""
        return float(np.linalg.norm(self.impulse))


@dataclass(frozen=True, eq=False)
class DrawnKick:
    """What a page says of a drawn kick.

    Attributes:
        pace: of the animation.
        stripe: width of a stripe of the ground, and distance between two marks on it [m].
        axis: length of the arrows that are the world's axes [m].
        text: sentences about ground and tee; empty where there is nothing to say.
    """

    pace: Pace
    stripe: float
    axis: float
    text: str


def draw_kick(
    viewer: Any,
    impact: Impact,
    path: Flight | Course,
    scenery: Sequence[Box] = (),
    swing: Swing | Backswing | None = None,
    *,
    lies: bool = True,
) -> DrawnKick:
    """Draw a kick, from the swing to the landing, over and over, with walls and goals as scenery.

    Without a swing from rest to rest through this impact the joints move as `leg_configuration`
    says; after a backswing alone, too. Where the ball need not lie on the ground (`lies`), the
    ground is where a robot stands, or as low as ball and leg come.
    """
    leg, ball, before = impact.posture.leg, impact.ball, impact.ball_before
    backswing = swing.backswing if isinstance(swing, Swing) else swing
    pace = kick_pace(impact, path.duration, None if backswing is None else backswing.duration)
    moved = [_configuration(impact, swing, time) for time in pace.times]
    curve = path.sample(np.linspace(0.0, path.duration, CURVE_POINTS)).position
    forward = _forward(impact, curve)
    bottom = _bottom(impact, path)
    floor = bottom if lies else _ground_height(impact, moved, bottom)
    lift = float(before.position[2]) - ball.radius - floor

    joints = np.array([pose[:3, 3] for pose in joint_poses(leg, impact.posture.q)[1:]])
    near = box_corners(np.vstack([joints, impact.ball_after.position]), ball.radius)
    figure = draw_leg(viewer["leg"], leg, impact.posture.q)
    far = [box_corners(curve, ball.radius), figure, *(box.corners() for box in scenery)]
    if swing is not None:
        far.append(box_corners(_swing_points(impact, swing, pace), ball.radius))
    size = float(np.linalg.norm(np.ptp(near, axis=0)))
    most = largest_impulse(impact)
    scale = max(3.2 * ball.radius, 0.45 * size) / most if most > 0 else 0.0
    arrows = impulse_arrows(impact, LEAST_JOINT_IMPULSE * most)
    tips = np.array([arrow.start + scale * arrow.impulse for arrow in arrows]).reshape(-1, 3)
    foot = np.array([*before.position[:2], floor])
    axis = stripe_width(1.8 * size)
    far.append(foot[None])
    camera = camera_for(near, np.vstack(far), forward, marks=tips, behind=bool(scenery))
    figure = np.vstack([near, figure, tips])
    level = (curve[-1] - foot) * (1.0, 1.0, 0.0)
    line = foot + np.linspace(0.0, 1.0, CURVE_POINTS)[:, None] * level
    origin = _free_place(camera, figure, np.vstack([curve, line]), foot, axis)
    width = CURVE_RADIUS * camera.distance(curve)

    set_stage(viewer, camera, np.vstack([near, *far]))
    draw_ball(viewer["ball"], ball.radius, before.position)
    stands = lift > LEAST_TEE_HEIGHT and not lies and not before.velocity.any()
    if stands:
        draw_tee(viewer["tee"], foot + np.array([0.0, 0.0, lift]), lift, ball.radius)
    draw_curve(viewer["curve"], curve, width, np.cross(forward, (0.0, 0.0, 1.0)))
    for arrow in arrows:
        draw_impulse(viewer[arrow.node], arrow, scale)
    for number, box in enumerate(scenery):
        draw_box(viewer[f"scenery/{number}"], box)
    reach = float(np.linalg.norm(curve[-1] - foot)) + 8 * size
    length = float(np.hypot(*(curve[-1] - foot)[:2]))
    stripe = stripe_width(length + size)
    draw_ground(viewer["ground"], foot, forward, stripe, reach)
    draw_axes(viewer["axes"], origin, axis)
    draw_distances(viewer["distances"], foot, forward, stripe, length, camera)
    draw_disc(viewer["landing"], max(0.4 * ball.radius, 6 * float(width[-1])), CURVE)
    viewer["landing"].set_transform(tf.translation_matrix([*curve[-1, :2], floor]))
    far_end = path.distance if isinstance(path, Course) else path.range
    draw_label(viewer["end"], f"{far_end:.3g} m", f"#{CURVE:06x}", curve[-1])
    animation = _animation(viewer, impact, path, pace, moved, arrows)
    viewer.set_animation(animation, repetitions=math.inf)
    text = describe_buried(leg, moved, pace, floor)
    if stands:
        text += f" The ball is on a tee, {lift:.2g} m above the ground."
    elif lift < -LEAST_TEE_HEIGHT:
        text += f" The ball is {-lift:.2g} m in the ground on which the robot stands."
    return DrawnKick(pace, stripe, axis, text.strip())


def joint_impulses_in_world(impact: Impact) -> list[tuple[str, Array, Array]]:
    """Return name, origin [m] and impulse [N s] of each joint, by parent on child, world frame."""
    leg = impact.posture.leg
    poses = joint_poses(leg, impact.posture.q)[1:]
    return [
        (name, pose[:3, 3], pose[:3, :3] @ impulse[:3])
        for name, pose, impulse in zip(leg.joint_names, poses, impact.joint_impulses, strict=True)
    ]


def largest_impulse(impact: Impact) -> float:
    """Return the largest impulse of a kick, on the ball or through a joint [N s]."""
    impulses = [impact.impulse, *(impulse for _, _, impulse in joint_impulses_in_world(impact))]
    return max(float(np.linalg.norm(impulse)) for impulse in impulses)


def impulse_arrows(impact: Impact, least: float) -> list[Arrow]:
    """Return the ball's arrow, then the arrows of joints above `least` [N s], largest first."""
    ball = Arrow("arrow", impact.posture.contact_point, impact.impulse, ARROW)
    joints = [
        Arrow(f"joint_arrows/{number}", start, impulse, JOINT_ARROW)
        for number, (_, start, impulse) in enumerate(joint_impulses_in_world(impact), start=1)
    ]
    joints = sorted(
        (arrow for arrow in joints if arrow.size > least), key=lambda arrow: -arrow.size
    )
    return [ball, *joints] if ball.size > 0.0 else joints


def draw_impulse(viewer: Any, arrow: Arrow, scale: float) -> None:
    """Draw an arrow, `scale` metres long per N s, with its size at its tip."""
    vector = scale * arrow.impulse
    draw_arrow(viewer, arrow.start, vector, arrow.colour)
    draw_label(viewer["label"], f"{arrow.size:.3g} N s", f"#{arrow.colour:06x}", vector)


def describe_buried(leg: Leg, moved: Sequence[Array], pace: Pace, floor: float) -> str:
    """Return which bodies the animation of a kick shows under the ground, as a sentence, or none.

    The deepest one with its depth and time.

    Args:
        leg: the leg.
        moved: its configuration at each of the times of the animation.
        pace: of the animation.
        floor: height of the ground [m, world frame].
    """
    depths = find_depths(leg, moved, floor)
    if not depths:
        return ""
    worst, time = depths[0], float(pace.times[depths[0].number])
    when = f"{abs(1e3 * time):.0f} ms {'before' if time < 0.0 else 'after'} the impact"
    further = f"; also {', '.join(depth.frame for depth in depths[1:])}" if depths[1:] else ""
    return (
        f"Under the ground in this picture: {worst.frame} by {worst.depth:.3f} m, {when}{further}."
    )


def _ground_height(impact: Impact, moved: Sequence[Array], bottom: float) -> float:
    """Return the height of the ground of a kick that does not name it [m, world frame].

    A robot stands on it with its first support; else it is as low as the ball's lowest position,
    `bottom`, and the leg at its configurations during the kick.
    """
    posture = impact.posture
    leg = posture.leg
    if leg.constraints is not None and leg.constraints.supports:
        name = leg.constraints.supports[0].frame
        model, data = leg.workspace.model, leg.workspace.data
        pin.forwardKinematics(model, data, posture.q)
        placement = pin.updateFramePlacement(model, data, frame_id(model, name))
        return float(shape_of(leg, name).moved(placement.homogeneous).lowest)
    depths = find_depths(leg, moved, bottom)
    return bottom - depths[0].depth if depths else bottom


def _free_place(camera: Camera, figure: Array, lines: Array, foot: Array, size: float) -> Array:
    """Return a point on the ground where arrows of a size along the axes cover nothing.

    That is neither the figure nor points of lines, both of shape `(n, 3)` [m]. Of such points in
    the picture, it is the nearest one to the point `foot` below the ball, or rather to one in front
    of it. Without any, the arrows may cover lines, or stand at the right of that point.
    """
    into = (camera.target - camera.position) * (1.0, 1.0, 0.0)
    into *= size / np.linalg.norm(into)
    covering: list[Array] = [foot + np.cross(into, (0.0, 0.0, 1.0))]
    steps = size * np.arange(-6.0, 6.5, 0.5)
    places: list[Array] = [foot + np.array([x, y, 0.0]) for x, y in product(steps, steps)]
    taken, along = camera.slopes(figure), camera.slopes(lines)
    label = np.array([0.25 * UP, 0.0])  # at either side of an arrow
    bottom, top = taken.min(axis=0) - label, taken.max(axis=0) + label
    for place in sorted(places, key=lambda point: float(np.linalg.norm(point - foot + 2 * into))):
        ends = camera.slopes(place + 1.3 * size * np.vstack([np.zeros(3), np.eye(3)]))
        low, high = ends.min(axis=0), ends.max(axis=0)
        inside = (low > (-LEFT, -BOTTOM)).all() and (high < (RIGHT, TOP)).all()
        if inside and ((high < bottom).any() or (low > top).any()):
            if not ((low < along) & (along < high)).all(axis=1).any():
                return place
            covering.append(place)
    return covering[min(1, len(covering) - 1)]


def _bottom(impact: Impact, path: Flight | Course) -> float:
    """Return the height of the ball's lowest point where it starts or ends [m]."""
    end = path.sample(path.duration).position
    return float(min(impact.ball_before.position[2], end[2])) - impact.ball.radius


def set_stage(viewer: Any, camera: Camera, points: Array) -> None:
    """Set sky, camera, and light that casts the shadows of points, shape `(n, 3)` [m]."""
    for name in ("/Grid", "/Axes"):
        viewer[name].set_property("visible", False)
    for name, colour in SKY_COLOURS.items():
        viewer["/Background"].set_property(name, colour)
    for name, brightness in LIGHT_INTENSITIES.items():
        viewer[f"/Lights/{name}/<object>"].set_property("intensity", brightness)
    reach = float(np.linalg.norm(points - camera.target, axis=1).max())
    sun = viewer["/Lights/FillLight/<object>"]
    sun.set_property("position", (1.8 * reach * SUN_DIRECTION).tolist())
    sun.set_property("reach", reach)  # the page's script frames the shadows by it
    set_camera(viewer, camera)


def stripe_width(extent: float) -> float:
    """Return 1, 2 or 5 times a power of ten, about a sixth of the extent [m]."""
    sixth = extent / 6 * (1 + 1e-9)  # so that a round one stays
    power = 10.0 ** math.floor(math.log10(sixth))
    return power * max(step for step in (1, 2, 5) if step * power <= sixth)


def box_corners(points: Array, radius: float) -> Array:
    """Return the corners of boxes around points, shape `(8 n, 3)`."""
    corners = np.array(list(product((-1, 1), repeat=3)))
    return np.asarray((points[:, None] + radius * corners).reshape(-1, 3))


def _configuration(impact: Impact, swing: Swing | Backswing | None, time: float) -> Array:
    """Return q of the leg at a time from the impact [s], shape `(nq,)`."""
    if swing is None or (isinstance(swing, Backswing) and time > 0.0):
        return leg_configuration(impact, time)
    return swing.configuration(time)


def _swing_points(impact: Impact, swing: Swing | Backswing, pace: Pace) -> Array:
    """Return positions of joints and contact point during a swing, shape `(n, 3)` [m]."""
    leg = impact.posture.leg
    points = []
    for time in pace.times[::8]:  # enough to set the camera
        q = _configuration(impact, swing, time)
        points += [pose[:3, 3] for pose in joint_poses(leg, q)[1:]]
        points.append(leg.posture(q).contact_point)
    return np.array(points)


def _forward(impact: Impact, curve: Array) -> Array:
    """Return the horizontal direction of the flight; of the impulse, or x, where it has none."""
    for direction in (curve[-1] - curve[0], impact.impulse):
        level = np.array([direction[0], direction[1], 0.0])
        length = float(np.linalg.norm(level))
        if length > 1e-3 * np.linalg.norm(direction):
            return level / length
    return np.array([1.0, 0.0, 0.0])


def _animation(
    viewer: Any,
    impact: Impact,
    path: Flight | Course,
    pace: Pace,
    moved: Sequence[Array],
    arrows: Sequence[Arrow],
) -> Animation:
    """Return the motion of leg and ball, and of the arrows that appear at the impact."""
    animation = Animation(default_framerate=RATE)
    leg = impact.posture.leg
    for picture, time in enumerate(pace.times):
        # All tracks end together, so that they stay together when they repeat.
        for number in (picture, pace.end) if picture == len(pace.times) - 1 else (picture,):
            with animation.at_frame(viewer, number) as frame:
                frame["ball"].set_transform(ball_pose(impact.ball_before, path, time))
                for joint, pose in list(enumerate(joint_poses(leg, moved[picture])))[1:]:
                    frame[f"leg/{joint}"].set_transform(pose)
    hit = pace.impact
    for number, scale in ((0, 1e-3), (hit - 1, 1e-3), (hit, 1.0), (pace.end, 1.0)):
        with animation.at_frame(viewer, number) as frame:
            for arrow in arrows:
                frame[arrow.node].set_property("scale", "vector3", [scale] * 3)
    return animation
