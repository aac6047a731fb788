"""One kick, drawn and moving: leg, ball, impulses, flight and ground."""

import math
from collections.abc import Sequence
from itertools import product
from typing import Any

import meshcat.transformations as tf
import numpy as np
from meshcat.animation import Animation

from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.planning.backswing import Backswing
from kickdyn.planning.swing import Swing
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.view.camera import Camera, camera_for, set_camera
from kickdyn.view.impulses import LEAST, Arrow, draw_impulse, impulse_arrows, largest_impulse
from kickdyn.view.leg_figure import draw_leg, joint_poses
from kickdyn.view.marks import CURVE, SHADOW, draw_ball, draw_curve, draw_disc, draw_ground
from kickdyn.view.playback import GROWING, RATE, Pace, ball_pose, kick_pace, leg_configuration
from kickdyn.view.wall_and_goal import Box, draw_box

SKY = {"top_color": [0.60, 0.78, 0.93], "bottom_color": [0.96, 0.98, 1.0]}
LIGHTS = {
    "AmbientLight": 0.55,
    "FillLight": 0.6,  # from afar: of the same strength everywhere
    "PointLightNegativeX": 0.1,
    "PointLightPositiveX": 0.1,
}
THIN = 0.0017  # radius of the curve over its distance from the camera: 3 or 4 pixels on a screen
POINTS = 150  # of a flight's curve


def draw_kick(
    viewer: Any,
    impact: Impact,
    path: Flight | Course,
    scenery: Sequence[Box] = (),
    swing: Swing | Backswing | None = None,
) -> tuple[Pace, float]:
    """Draw a kick, from the swing to the landing, over and over, with walls and goals as scenery.

    Without a swing from rest to rest through this impact the joints move as `leg_configuration`
    says; after a backswing alone, too.

    Returns:
        The pace of the animation, and the width of a stripe of the ground [m].
    """
    leg, ball, before = impact.posture.leg, impact.ball, impact.ball_before
    backswing = swing.backswing if isinstance(swing, Swing) else swing
    pace = kick_pace(impact, path.duration, None if backswing is None else backswing.duration)
    curve = path.sample(np.linspace(0.0, path.duration, POINTS)).position
    forward = _forward(impact, curve)
    floor = _floor(impact, path)

    joints = np.array([pose[:3, 3] for pose in joint_poses(leg, impact.posture.q)[1:]])
    near = box_corners(np.vstack([joints, impact.ball_after.position]), ball.radius)
    figure = draw_leg(viewer["leg"], leg, impact.posture.q)
    far = [box_corners(curve, ball.radius), figure, *(box.corners() for box in scenery)]
    if swing is not None:
        far.append(box_corners(_swing_points(impact, swing, pace), ball.radius))
    size = float(np.linalg.norm(np.ptp(near, axis=0)))
    most = largest_impulse(impact)
    scale = max(3.2 * ball.radius, 0.45 * size) / most if most > 0 else 0.0
    arrows = impulse_arrows(impact, LEAST * most)
    tips = np.array([arrow.start + scale * arrow.impulse for arrow in arrows]).reshape(-1, 3)
    camera = camera_for(near, np.vstack(far), forward, marks=tips, behind=bool(scenery))
    width = THIN * camera.distance(curve)

    set_stage(viewer, camera)
    draw_ball(viewer["ball"], ball.radius, before.position)
    draw_disc(viewer["shadow"], 0.8 * ball.radius, SHADOW, opacity=0.35)
    draw_curve(viewer["curve"], curve, width, np.cross(forward, (0.0, 0.0, 1.0)))
    for arrow in arrows:
        draw_impulse(viewer[arrow.node], arrow, scale)
    for number, box in enumerate(scenery):
        draw_box(viewer[f"scenery/{number}"], box)
    foot = np.array([*before.position[:2], floor])
    reach = float(np.linalg.norm(curve[-1] - foot)) + 8 * size
    stripe = stripe_width(float(np.hypot(*(curve[-1] - curve[0])[:2])) + size)
    draw_ground(viewer["ground"], foot, forward, stripe, reach)
    draw_disc(viewer["landing"], max(0.4 * ball.radius, 6 * float(width[-1])), CURVE)
    viewer["landing"].set_transform(tf.translation_matrix([*curve[-1, :2], floor]))
    animation = _animation(viewer, impact, path, pace, floor, swing, arrows)
    viewer.set_animation(animation, repetitions=math.inf)
    return pace, stripe


def describe_buried(
    impact: Impact, path: Flight | Course, pace: Pace, swing: Swing | Backswing | None = None
) -> str:
    """Return which bodies the animation of a kick shows under the ground, as a sentence, or none.

    The deepest one with its depth and time; the ground is the lawn that `draw_kick` draws.
    """
    leg = impact.posture.leg
    shown = [_configuration(impact, swing, time) for time in pace.times]
    found = find_depths(leg, shown, _floor(impact, path))
    if not found:
        return ""
    worst, time = found[0], float(pace.times[found[0].number])
    when = f"{abs(1e3 * time):.0f} ms {'before' if time < 0.0 else 'after'} the impact"
    others = f"; also {', '.join(one.frame for one in found[1:])}" if found[1:] else ""
    return (
        f"Under the ground in this picture: {worst.frame} by {worst.depth:.3f} m, {when}{others}."
    )


def _floor(impact: Impact, path: Flight | Course) -> float:
    """Return the height of the lawn, under the ball where it starts or ends [m]."""
    end = path.sample(path.duration).position
    return float(min(impact.ball_before.position[2], end[2])) - impact.ball.radius


def set_stage(viewer: Any, camera: Camera) -> None:
    """Set sky, light and camera."""
    for name in ("/Grid", "/Axes"):
        viewer[name].set_property("visible", False)
    for name, colour in SKY.items():
        viewer["/Background"].set_property(name, colour)
    for name, brightness in LIGHTS.items():
        viewer[f"/Lights/{name}/<object>"].set_property("intensity", brightness)
    viewer["/Lights/FillLight/<object>"].set_property("position", [-2.0, -4.0, 4.0])
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
    floor: float,
    swing: Swing | Backswing | None,
    arrows: Sequence[Arrow],
) -> Animation:
    """Return the motion of leg, ball and shadow, and of the arrows that grow at the impact."""
    animation = Animation(default_framerate=RATE)
    leg = impact.posture.leg
    for picture, time in enumerate(pace.times):
        # All tracks end together, so that they stay together when they repeat.
        for at in (picture, pace.end) if picture == len(pace.times) - 1 else (picture,):
            with animation.at_frame(viewer, at) as frame:
                pose = ball_pose(impact.ball_before, path, time)
                frame["ball"].set_transform(pose)
                frame["shadow"].set_property("position", "vector3", [*pose[:2, 3], floor])
                q = _configuration(impact, swing, time)
                for joint, pose in list(enumerate(joint_poses(leg, q)))[1:]:
                    frame[f"leg/{joint}"].set_transform(pose)
    grown = pace.impact + GROWING
    for at, scale in ((0, 1e-3), (pace.impact, 1e-3), (grown, 1.0), (pace.end, 1.0)):
        with animation.at_frame(viewer, at) as frame:
            for arrow in arrows:
                frame[arrow.node].set_property("scale", "vector3", [scale] * 3)
    return animation
