"""The impulses of a kick as arrows, all to one scale: on the ball, and through every joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import meshcat.transformations as tf
import numpy as np

from kickdyn.checks import Array
from kickdyn.impact.result import Impact
from kickdyn.view.camera import Camera
from kickdyn.view.label import Label
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
        label: None where it would cover that of a larger impulse.
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


def impulse_arrows(hit: Impact, scale: float, least: float, camera: Camera) -> list[Arrow]:
    """Return the arrows of a kick: the ball's first, then the joints', largest first.

    Args:
        hit: the impact.
        scale: length of an arrow, over its impulse [m per N s].
        least: impulse that a joint must transmit for an arrow [N s].
        camera: the labels shall not cover each other as it sees them.
    """
    found = [("arrow", hit.posture.contact_point, hit.impulse, ARROW)]
    joints = [
        (f"joint_arrows/{number}", start, push, JOINT)
        for number, (_, start, push) in enumerate(joint_pushes(hit), start=1)
        if np.linalg.norm(push) > least
    ]
    found += sorted(joints, key=lambda one: -float(np.linalg.norm(one[2])))
    labelled: list[Array] = []
    arrows = []
    for node, start, push, colour in found:
        size = float(np.linalg.norm(push))
        if size == 0.0:
            continue
        label = Label(f"{size:.3g} N s", colour)
        at = camera.across(start + scale * push)
        clear = all((abs(at - other) > label.size).any() for other in labelled)
        arrows.append(Arrow(node, start, push, colour, label if clear else None))
        if clear:
            labelled.append(at)
    return arrows


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
