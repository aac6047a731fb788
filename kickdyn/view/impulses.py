"""The impulses of a kick as arrows, all to one scale: on the ball, and through every joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import meshcat.transformations as tf
import numpy as np

from kickdyn.core.validation import Array
from kickdyn.impact.impact_result import Impact
from kickdyn.view.label import Label
from kickdyn.view.label_places import LabelPlaces
from kickdyn.view.leg_figure import joint_places
from kickdyn.view.marks import ARROW, draw_arrow

JOINT = 0xF28C00

LEAST = 0.05
"""Joints that transmit less, over the largest impulse of the kick, get no arrow."""


@dataclass(frozen=True, eq=False)
class Arrow:
    """An impulse that is drawn.

    Attributes:
        node: where it is drawn in the viewer.
        start: shape `(3,)` [m, world frame].
        impulse: shape `(3,)` [N s, world frame].
        colour: 0xRRGGBB.
        label: None where there is no room beside those of larger impulses.
    """

    node: str
    start: Array
    impulse: Array
    colour: int
    label: Label | None


def joint_pushes(hit: Impact) -> list[tuple[str, Array, Array]]:
    """Return name, origin [m] and impulse [N s] of every joint, by parent on child, world frame."""
    leg = hit.posture.leg
    return [
        (name, place[:3, 3], place[:3, :3] @ impulse[:3])
        for name, place, impulse in zip(
            leg.joint_names,
            joint_places(leg, hit.posture.q)[1:],
            hit.joint_impulses,
            strict=True,
        )
    ]


def largest(hit: Impact) -> float:
    """Return the largest impulse of a kick, on the ball or through a joint [N s]."""
    pushes = [hit.impulse, *(push for _, _, push in joint_pushes(hit))]
    return max(float(np.linalg.norm(push)) for push in pushes)


def arrow_tips(hit: Impact, scale: float, least: float) -> Array:
    """Return where the arrows of a kick end, shape `(n, 3)` [m]; `impulse_arrows` says of what."""
    return np.array([start + scale * push for _, start, push, _ in _drawn(hit, least)])


def impulse_arrows(
    hit: Impact,
    scale: float,
    least: float,
    places: LabelPlaces,
    moved: Array | None = None,
) -> list[Arrow]:
    """Return the arrows of a kick: the ball's first, then the joints', largest first.

    Args:
        hit: the impact.
        scale: length of an arrow, over its impulse [m per N s].
        least: impulse that a joint must transmit for an arrow [N s].
        places: of the labels.
        moved: how far all is moved in the picture, shape `(3,)` [m]; not at all if not named.
    """
    found, shift = _drawn(hit, least), np.zeros(3) if moved is None else moved
    for _, start, push, _ in found:
        places.keep_clear(start + shift, start + scale * push + shift)
    arrows = []
    for node, start, push, colour in found:
        text = f"{float(np.linalg.norm(push)):.3g} N s"
        label = places.label(text, colour, start + scale * push + shift)
        arrows.append(Arrow(node, start, push, colour, label))
    return arrows


def _drawn(hit: Impact, least: float) -> list[tuple[str, Array, Array, int]]:
    """Return node, start [m], impulse [N s] and colour of each arrow, in order."""
    found = [("arrow", hit.posture.contact_point, hit.impulse, ARROW)]
    joints = [
        (f"joint_arrows/{number}", start, push, JOINT)
        for number, (_, start, push) in enumerate(joint_pushes(hit), start=1)
        if np.linalg.norm(push) > least
    ]
    found += sorted(joints, key=lambda one: -float(np.linalg.norm(one[2])))
    return [one for one in found if one[2].any()]


def draw_impulse(viewer: Any, arrow: Arrow, scale: float) -> None:
    """Draw an arrow and its label; `viewer` is its own node, at its start.

    Args:
        viewer: node to draw into.
        arrow: what to draw.
        scale: metres per N s.
    """
    size = float(np.linalg.norm(arrow.impulse))
    draw_arrow(viewer, arrow.start, arrow.impulse / size, scale * size, arrow.colour)
    if arrow.label is not None:
        viewer["label"].set_object(arrow.label)
        viewer["label"].set_transform(tf.translation_matrix(scale * arrow.impulse))
