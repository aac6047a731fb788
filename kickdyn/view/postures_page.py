"""Several postures side by side, each with its impulses, to be compared."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import meshcat.transformations as tf
import numpy as np

from kickdyn.errors import InvalidInput
from kickdyn.impact.impact_result import Impact
from kickdyn.view.ball_figure import draw_ball
from kickdyn.view.camera import camera_for
from kickdyn.view.document import static_document
from kickdyn.view.impulses import LEAST, draw_impulse, impulse_arrows, largest
from kickdyn.view.kick_scene import prepare, stripe_width
from kickdyn.view.label_places import LabelPlaces
from kickdyn.view.leg_figure import draw_leg
from kickdyn.view.marks import draw_ground
from kickdyn.view.recorder import recorder

MOST = 8
GAP = 0.25
"""Between postures, over the length of the widest."""

LONGEST = 0.45
"""Of the longest arrow, over the size of a figure."""


def postures_page(hits: Mapping[str, Impact], *, title: str) -> str:
    """Return a page with legs at their impacts next to each other, along x; nothing moves.

    All arrows are to one scale: on the ball, and through each joint.

    Args:
        hits: name to impact, 1 to 8.
        title: of the page, plain text.

    Raises:
        InvalidInput: no impact, or too many; or a leg cannot be drawn, as `kick_page` says.
    """
    if not 0 < len(hits) <= MOST:
        raise InvalidInput(f"there are {len(hits)} impacts: 1 to {MOST} stand side by side")
    viewer = recorder()
    most = max(largest(hit) for hit in hits.values())
    figures = []
    for number, hit in enumerate(hits.values()):
        leg = draw_leg(viewer[f"{number}/leg"], hit.posture.leg, hit.posture.q)
        ball, radius = hit.ball_before.position, hit.ball.radius
        figures.append(np.vstack([leg, ball - radius, ball + radius]))
    size = max(float(np.ptp(figure, axis=0).max()) for figure in figures)
    scale = LONGEST * size / most if most > 0 else 0.0
    moves, at = [], 0.0
    for figure, hit in zip(figures, hits.values(), strict=True):
        low = figure[:, 0].min()
        high = max(figure[:, 0].max(), (hit.posture.contact_point + scale * hit.impulse)[0])
        moves.append(np.array([at - low, 0.0, 0.0]))
        at += float(high - low) + GAP * size
    points = np.vstack([figure + move for figure, move in zip(figures, moves, strict=True)])
    floor, top = float(points[:, 2].min()), float(points[:, 2].max())
    heads = [(np.array([*figure[:2].mean(axis=0)[:1], 0.0, top + 0.1 * size]) + move)
             for figure, move in zip(figures, moves, strict=True)]  # fmt: skip
    aside = np.array([0.25 * size, 0.0, 0.0])  # room for labels
    tips = [hit.posture.contact_point + scale * hit.impulse + move + aside
            for hit, move in zip(hits.values(), moves, strict=True)]  # fmt: skip
    edge = [*heads, *(head + aside for head in heads), *tips]
    camera = camera_for(points, np.vstack([points, *edge]), np.array([1.0, 0.0, 0.0]))
    prepare(viewer, camera)
    places = LabelPlaces(camera)
    names = [places.label(name, 0x1D2733, head) for name, head in zip(hits, heads, strict=True)]
    for number, (hit, move) in enumerate(zip(hits.values(), moves, strict=True)):
        node = viewer[str(number)]
        node.set_transform(tf.translation_matrix(move))
        draw_ball(node["ball"], hit.ball.radius)
        node["ball"].set_transform(tf.translation_matrix(hit.ball_before.position))
        for arrow in impulse_arrows(hit, scale, LEAST * most, places, move):
            draw_impulse(node[arrow.node], arrow, scale)
        node["name"].set_object(names[number])
        node["name"].set_transform(tf.translation_matrix(heads[number] - move))
    centre = points.mean(axis=0)
    draw_ground(
        viewer["ground"],
        np.array([centre[0], centre[1], floor]),
        np.array([1.0, 0.0, 0.0]),
        stripe_width(float(np.ptp(points[:, 0]))),
        8 * float(np.ptp(points[:, 0])),
    )
    return static_document(viewer.window.commands(), title=title, panel=_panel(title, hits))


def _panel(title: str, hits: Mapping[str, Impact]) -> str:
    rows = []
    for name, hit in hits.items():
        joint, worst = hit.worst_joint
        rows.append(
            f'<tr class="long"><th>{escape(name)}</th>'
            f"<td>{float(np.linalg.norm(hit.impulse)):.4g} N s on the ball, "
            f"{float(hit.ball_after.speed):.4g} m/s<br>{worst:.4g} N s at {escape(joint)}</td></tr>"
        )
    table = "\n".join(rows)
    return f'<aside id="caption">\n<h1>{escape(title)}</h1>\n<table>\n{table}\n</table>\n</aside>'
