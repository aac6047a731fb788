"""One kick, drawn and moving: leg, ball, impulse, flight and ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import meshcat.transformations as tf
import numpy as np
from meshcat.animation import Animation

from kickdyn.ball import Ball
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.planning.swing import Swing
from kickdyn.view import playback as motion
from kickdyn.view.ball_figure import draw_ball
from kickdyn.view.camera import Camera, camera_for, set_camera
from kickdyn.view.impulses import (
    LEAST,
    Arrow,
    arrow_tips,
    draw_impulse,
    impulse_arrows,
    largest,
)
from kickdyn.view.label_places import LabelPlaces
from kickdyn.view.leg_figure import draw_leg, joint_places
from kickdyn.view.marks import draw_curve, draw_ground, draw_landing, draw_shadow
from kickdyn.view.wall_and_goal import Box, draw_box

SKY = {"top_color": [0.60, 0.78, 0.93], "bottom_color": [0.96, 0.98, 1.0]}
LIGHTS = {
    "AmbientLight": 0.55,
    "FillLight": 0.6,  # from afar: of the same strength everywhere
    "PointLightNegativeX": 0.1,
    "PointLightPositiveX": 0.1,
}
THIN = 0.0017
"""Radius of the curve over its distance from the camera: 3 or 4 pixels on a screen."""

POINTS = 150

SELDOM = 8
"""Of so many pictures of a swing, one counts for where the camera must stand."""


@dataclass(frozen=True)
class Drawn:
    """What a reader of the picture needs to be told.

    Attributes:
        pace: when the animation shows what.
        stripe: width of a stripe of the ground [m].
    """

    pace: motion.Pace
    stripe: float


def draw_kick(
    viewer: Any,
    hit: Impact,
    ball: Ball,
    path: Flight | Course,
    scenery: Sequence[Box] = (),
    swing: Swing | None = None,
) -> Drawn:
    """Draw a kick, from the swing to the landing, over and over.

    Args:
        viewer: a `meshcat.Visualizer`.
        hit: the impact; its posture's leg is drawn.
        ball: what was struck.
        path: of the ball.
        scenery: what stands around.
        swing: of the leg to this impact and on, from rest to rest; straight on if not named.

    Raises:
        InvalidInput: the leg cannot be drawn, as `leg_figure.leg_parts` says.
    """
    whole = None if swing is None else swing.backswing.duration
    pace = motion.pace_of(hit, path.duration, whole)
    before = hit.ball_before
    curve = path.sample(np.linspace(0.0, path.duration, POINTS)).position
    forward = _forward(hit, curve)
    floor = min(before.position[2], curve[-1, 2]) - ball.radius
    joints = np.array([place[:3, 3] for place in joint_places(hit.posture.leg, hit.posture.q)[1:]])
    near = np.vstack(
        [around(joints, ball.radius), around(hit.ball_after.position[None], ball.radius)]
    )
    figure = draw_leg(viewer["leg"], hit.posture.leg, hit.posture.q)
    far = np.vstack([around(curve, ball.radius), figure, *(box.corners() for box in scenery)])
    if swing is not None:
        far = np.vstack([far, _swept(hit, pace, swing, ball.radius)])
    size = float(np.linalg.norm(np.ptp(near, axis=0)))
    most = largest(hit)
    scale = max(3.2 * ball.radius, 0.45 * size) / most if most > 0 else 0.0
    tips = arrow_tips(hit, scale, LEAST * most) if most > 0 else near[:0]
    camera = camera_for(near, far, forward, marks=tips, behind=bool(scenery))
    width = THIN * camera.distance(curve)

    prepare(viewer, camera)
    draw_ball(viewer["ball"], ball.radius)
    viewer["ball"].set_transform(tf.translation_matrix(before.position))
    draw_shadow(viewer["shadow"], ball.radius)
    draw_curve(viewer["curve"], curve, width, np.cross(forward, (0.0, 0.0, 1.0)))
    arrows = impulse_arrows(hit, scale, LEAST * most, LabelPlaces(camera))
    for arrow in arrows:
        draw_impulse(viewer[arrow.node], arrow, scale)
    foot = np.array([*before.position[:2], floor])
    reach = float(np.linalg.norm(curve[-1] - foot)) + 8 * size
    stripe = stripe_width(float(np.hypot(*(curve[-1] - curve[0])[:2])) + size)
    for number, box in enumerate(scenery):
        draw_box(viewer[f"scenery/{number}"], box)
    draw_ground(viewer["ground"], foot, forward, stripe, reach)
    end = np.array([*curve[-1, :2], floor])
    draw_landing(viewer["landing"], end, max(0.4 * ball.radius, 6 * float(width[-1])))
    film = _animation(viewer, hit, path, pace, floor, swing, arrows)
    viewer.set_animation(film, repetitions=math.inf)
    return Drawn(pace, stripe)


def prepare(viewer: Any, camera: Camera) -> None:
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


def _swept(hit: Impact, pace: motion.Pace, swing: Swing, radius: float) -> Array:
    """Return corners of boxes around all places of joints and contact point in a swing."""
    leg = hit.posture.leg
    places = []
    for time in pace.times[::SELDOM]:
        q = swing.configuration(time)
        places += [place[:3, 3] for place in joint_places(leg, q)[1:]]
        places.append(leg.posture(q).contact_point)
    return around(np.array(places), radius)


def _forward(hit: Impact, curve: Array) -> Array:
    """Return the horizontal direction of the flight; of the impulse, or x, where it has none."""
    for way in (curve[-1] - curve[0], hit.impulse):
        level = np.array([way[0], way[1], 0.0])
        length = float(np.linalg.norm(level))
        if length > 1e-3 * np.linalg.norm(way):
            return level / length
    return np.array([1.0, 0.0, 0.0])


def around(points: Array, radius: float) -> Array:
    """Return the corners of boxes around points."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray((points[:, None] + radius * corners).reshape(-1, 3))


def _animation(
    viewer: Any,
    hit: Impact,
    path: Flight | Course,
    pace: motion.Pace,
    floor: float,
    swing: Swing | None,
    arrows: Sequence[Arrow],
) -> Animation:
    film = Animation(default_framerate=motion.RATE)
    before = hit.ball_before
    for picture, time in enumerate(pace.times):
        # All tracks end together, so that they stay together when they repeat.
        for at in (picture, pace.end) if picture == len(pace.times) - 1 else (picture,):
            with film.at_frame(viewer, at) as frame:
                place = motion.ball_place(before, path, time)
                frame["ball"].set_transform(place)
                frame["shadow"].set_property("position", "vector3", [*place[:2, 3], floor])
                q = swing.configuration(time) if swing else motion.leg_configuration(hit, time)
                for joint, place in list(enumerate(joint_places(hit.posture.leg, q)))[1:]:
                    frame[f"leg/{joint}"].set_transform(place)
    grown = pace.impact + motion.GROWING
    for at, scale in ((0, 1e-3), (pace.impact, 1e-3), (grown, 1.0), (pace.end, 1.0)):
        with film.at_frame(viewer, at) as frame:
            for arrow in arrows:
                frame[arrow.node].set_property("scale", "vector3", [scale] * 3)
    return film
