"""Several flights in one picture, to be compared."""

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
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
from kickdyn.view.kick_scene import CURVE_POINTS, CURVE_RADIUS

COLOURS = (0xE63946, 0x2456D6, 0xF4A300, 0x6A2FB5, 0x0E8F8F, 0x8C5A2B, 0xD81E9B, 0x7FE3F5)
MOST_FLIGHTS = len(COLOURS)
"""Flights of one picture."""

MOST_DOTS = 12
"""About how many measured positions of a flight are drawn."""

DOT_COLOUR = 0x111111


def draw_flights(
    viewer: Any,
    paths: Mapping[str, Flight | Course],
    title: str,
    measured: Mapping[str, Array],
) -> str:
    """Draw the curves of up to 8 flights over one lawn, and return their legend as HTML.

    Measured positions, shape `(n, 3)`, are drawn as dots beside the flight they belong to by
    name.

    Raises:
        InvalidInput: no flight, or too many.
    """
    if not 0 < len(paths) <= MOST_FLIGHTS:
        raise InvalidInput(f"there are {len(paths)} flights: one page compares 1 to {MOST_FLIGHTS}")
    curves = [
        path.sample(np.linspace(0, path.duration, CURVE_POINTS)).position for path in paths.values()
    ]
    points = np.vstack(curves)
    reference = next(iter(paths.values()))
    start = reference.launch.position
    radius = (reference.flights[0] if isinstance(reference, Course) else reference).ball.radius
    distances = np.hypot(*(points - points[0])[:, :2].T)
    length, forward = distances.max(), level_direction(points[distances.argmax()] - points[0])
    size = max(float(np.ptp(points, axis=0).max()), radius)
    foreground = box_corners(np.array([start, start + 0.3 * size * UP_AXIS]), 0.02 * size)
    camera = camera_for(foreground, box_corners(points, radius), forward)
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
        rows.append(
            (f"{colour_key(DOT_COLOUR)} measured", f"about {MOST_DOTS} positions per flight")
        )
    origin = "first sample" if measured else "launch"
    rows.append(("distances, heights", f"from the {origin}"))
    return panel_of(title, rows)


def _length(path: Flight | Course) -> str:
    """Return distance, height and time of a ball's path, as text."""
    if isinstance(path, Course):
        return f"{path.distance:.4g} m along the ground, {path.duration:.3g} s"
    return f"{path.range:.3g} m, rises {path.height:.3g} m, {path.duration:.3g} s"
