"""Several flights in one picture, or several impacts side by side, to be compared."""

from collections.abc import Mapping
from html import escape
from types import MappingProxyType
from typing import Any

import meshcat.transformations as tf
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.view import marks
from kickdyn.view.camera import (
    UP_AXIS,
    box_corners,
    camera_for,
    level_direction,
    set_stage,
    stripe_width,
)
from kickdyn.view.caption import colour_key, panel_of
from kickdyn.view.document import draw_label
from kickdyn.view.kick_scene import (
    CURVE_POINTS,
    CURVE_RADIUS,
    LEAST_JOINT_IMPULSE,
    draw_impulse,
    impulse_arrows,
    largest_impulse,
)
from kickdyn.view.leg_figure import draw_leg

COLOURS = (0xE63946, 0x2456D6, 0xF4A300, 0x6A2FB5, 0x0E8F8F, 0x8C5A2B, 0xD81E9B, 0x7FE3F5)
MOST_SUBJECTS = len(COLOURS)
"""Flights or impacts of one picture."""

X_AXIS = np.array([1.0, 0.0, 0.0])

MOST_DOTS = 12
"""About how many measured positions of a flight are drawn."""

DOT_COLOUR = 0x111111


def draw_flights(
    viewer: Any,
    paths: Mapping[str, Flight | Course],
    title: str,
    measured: Mapping[str, Array] = MappingProxyType({}),
) -> str:
    """Draw the curves of up to 8 flights over one lawn, and return their legend as HTML.

    Measured positions, shape `(n, 3)`, are drawn as dots beside the flight they belong to by
    name.

    Raises:
        InvalidInput: no flight, or too many.
    """
    _check_count(paths)
    curves = [
        path.sample(np.linspace(0, path.duration, CURVE_POINTS)).position for path in paths.values()
    ]
    points = np.vstack(curves)
    first = next(iter(paths.values()))
    start = first.launch.position
    radius = (first.flights[0] if isinstance(first, Course) else first).ball.radius
    distances = np.hypot(*(points - points[0])[:, :2].T)
    length, forward = distances.max(), level_direction(points[distances.argmax()] - points[0])
    size = max(float(np.ptp(points, axis=0).max()), radius)
    near = box_corners(np.array([start, start + 0.3 * size * UP_AXIS]), 0.02 * size)
    camera = camera_for(near, box_corners(points, radius), forward)
    set_stage(viewer, camera, points)
    rows = []
    for number, (name, path) in enumerate(paths.items()):
        curve, colour = curves[number], COLOURS[number]
        width = 1.5 * CURVE_RADIUS * camera.distance(curve)
        marks.draw_curve(
            viewer[f"curve/{number}"], curve, width, np.cross(forward, UP_AXIS), colour
        )
        if name in measured:
            dots = measured[name][:: max(len(measured[name]) // MOST_DOTS, 1)]
            marks.draw_dots(viewer[f"dots/{number}"], dots, 0.0035 * size, DOT_COLOUR)
        rows.append((f"{colour_key(colour)} {escape(name)}", _length(path)))
    marks.draw_ball(viewer["ball"], radius, start)
    stripe = stripe_width(size)
    floor = np.array([*start[:2], points[:, 2].min() - radius])
    marks.draw_ground(viewer["ground"], floor, forward, stripe, 3 * size)
    marks.draw_distances(viewer["distances"], floor, forward, stripe, length)
    marks.draw_axes(viewer["axes"], floor, stripe / 2)
    if measured:
        rows.append((f"{colour_key(DOT_COLOUR)} measured", f"about {MOST_DOTS} positions of each"))
    origin = "first sample" if measured else "launch"
    rows.append(("distances, heights", f"from the {origin} of each"))
    return panel_of(title, rows)


def _length(path: Flight | Course) -> str:
    """Return how far, how high and how long a ball goes."""
    if isinstance(path, Course):
        return f"{path.distance:.4g} m along the ground, {path.duration:.3g} s"
    return f"{path.range:.3g} m, rises {path.height:.3g} m, {path.duration:.3g} s"


def draw_impacts(viewer: Any, impacts: Mapping[str, Impact], title: str) -> str:
    """Draw legs at their impacts side by side along x, and return their numbers as HTML.

    Nothing moves, and all arrows are to one scale: on the ball, and through each joint.

    Raises:
        InvalidInput: no impact, or too many.
    """
    _check_count(impacts)
    most = max(largest_impulse(impact) for impact in impacts.values())
    figures = []
    for number, impact in enumerate(impacts.values()):
        leg = draw_leg(viewer[f"{number}/leg"], impact.posture.leg, impact.posture.q)
        ball, radius = impact.ball_before.position, impact.ball.radius
        figures.append(np.vstack([leg, ball - radius, ball + radius]))
    size = max(float(np.ptp(figure, axis=0).max()) for figure in figures)
    scale = 0.45 * size / most if most > 0 else 0.0
    shown, left = [], 0.0
    for number, ((name, impact), figure) in enumerate(zip(impacts.items(), figures, strict=True)):
        node = viewer[str(number)]
        head = np.array([figure[:, 0].mean(), 0.0, figure[:, 2].max() + 0.1 * size])
        tip = impact.posture.contact_point + scale * impact.impulse
        points = np.vstack([figure, head, tip + 0.25 * size * X_AXIS])  # with space for labels
        shift = (left - points[:, 0].min()) * X_AXIS
        shown.append(points + shift)
        left = shown[-1][:, 0].max()
        node.set_transform(tf.translation_matrix(shift))
        marks.draw_ball(node["ball"], impact.ball.radius, impact.ball_before.position)
        draw_label(node["name"], name, head, "black")
        for arrow in impulse_arrows(impact, LEAST_JOINT_IMPULSE * most):
            draw_impulse(node[arrow.node], arrow, scale)
    points, floor = np.vstack(shown), min(float(figure[:, 2].min()) for figure in figures)
    set_stage(viewer, camera_for(points, points, X_AXIS), points)
    width = float(np.ptp(points[:, 0]))
    centre = np.array([*points.mean(axis=0)[:2], floor])
    marks.draw_ground(viewer["ground"], centre, X_AXIS, stripe_width(width), 8 * width)
    rows = []
    for name, impact in impacts.items():
        joint, worst = impact.worst_joint
        impulse, speed = np.linalg.norm(impact.impulse), float(impact.ball_after.speed)
        text = (
            f"{impulse:.4g} N s on the ball, {speed:.4g} m/s<br>{worst:.4g} N s at {escape(joint)}"
        )
        rows.append((escape(name), text))
    return panel_of(title, rows, warnings=viewer.window.warnings)


def _check_count(subjects: Mapping[str, object]) -> None:
    """Raise `InvalidInput` unless a picture can show so many."""
    if not 0 < len(subjects) <= MOST_SUBJECTS:
        raise InvalidInput(
            f"there are {len(subjects)} to show: one page compares 1 to {MOST_SUBJECTS}"
        )
