"""Several flights in one picture, to be compared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

import meshcat.transformations as tf
import numpy as np

from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.view.ball_figure import draw_ball
from kickdyn.view.camera import camera_for
from kickdyn.view.document import static_document
from kickdyn.view.kick_scene import POINTS, THIN, around, prepare, stripe_width
from kickdyn.view.marks import draw_curve, draw_ground
from kickdyn.view.recorder import recorder

COLOURS = (0xE63946, 0x2456D6, 0xF4A300, 0x6A2FB5, 0x0E8F8F, 0x8C5A2B, 0xD81E9B, 0x333333)


def flights_page(paths: Mapping[str, Flight], *, title: str) -> str:
    """Return a page with the curves of several flights over one lawn, and a legend.

    Args:
        paths: name to flight, at most as many as there are colours (8), all along much the same
            direction.
        title: of the page, plain text.

    Raises:
        InvalidInput: no flight, or too many.
    """
    if not 0 < len(paths) <= len(COLOURS):
        raise InvalidInput(f"there are {len(paths)} flights: 1 to {len(COLOURS)} can be told apart")
    viewer = recorder()
    curves = {
        name: path.sample(np.linspace(0.0, path.duration, POINTS)).position
        for name, path in paths.items()
    }
    every = np.vstack(list(curves.values()))
    first = next(iter(paths.values()))
    radius = first.ball.radius
    forward = every[np.argmax(np.hypot(*(every - every[0])[:, :2].T))] - every[0]
    forward[2] = 0.0
    length = math.hypot(*forward)
    forward = forward / length if length else np.array([1.0, 0.0, 0.0])
    floor = float(every[:, 2].min()) - radius
    size = max(float(np.ptp(every, axis=0).max()), radius)
    start = first.launch.position
    camera = camera_for(around(start[None], 0.2 * size), around(every, radius), forward)
    prepare(viewer, camera)
    sideways = np.cross(forward, (0.0, 0.0, 1.0))
    for colour, (name, curve) in zip(COLOURS, curves.items(), strict=False):
        width = 1.5 * THIN * camera.distance(curve)
        draw_curve(viewer[f"curve/{name.encode().hex()}"], curve, width, sideways, colour)
    draw_ball(viewer["ball"], max(radius, 0.012 * size))
    viewer["ball"].set_transform(tf.translation_matrix(start))
    stripe = stripe_width(size)
    draw_ground(viewer["ground"], np.array([*start[:2], floor]), forward, stripe, 3 * size)
    return static_document(
        viewer.window.commands(), title=title, panel=_legend(title, paths, stripe)
    )


def _legend(title: str, paths: Mapping[str, Flight], stripe: float) -> str:
    rows = "\n".join(
        '<tr class="long">'
        f'<th><span class="key" style="background:#{colour:06x}"></span> {escape(name)}</th>'
        f"<td>{path.range:.4g} m, {path.height:.4g} m high, {path.duration:.3g} s</td></tr>"
        for colour, (name, path) in zip(COLOURS, paths.items(), strict=False)
    )
    return (
        f'<aside id="caption">\n<h1>{escape(title)}</h1>\n<table>\n{rows}\n'
        f"<tr><th>stripes</th><td>{stripe:g} m</td></tr>\n</table>\n</aside>"
    )
