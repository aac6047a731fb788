"""The impulses of a kick as arrows, all to one scale: on the ball, and through every joint."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.impact.impact_result import Impact
from kickdyn.view.document import draw_label
from kickdyn.view.leg_figure import joint_poses
from kickdyn.view.marks import ARROW, draw_arrow

JOINT = 0xF28C00

LEAST = 0.05
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
        Arrow(f"joint_arrows/{number}", start, impulse, JOINT)
        for number, (_, start, impulse) in enumerate(joint_impulses_in_world(impact), start=1)
    ]
    joints = sorted((a for a in joints if a.size > least), key=lambda arrow: -arrow.size)
    return [ball, *joints] if ball.size > 0.0 else joints


def draw_impulse(viewer: Any, arrow: Arrow, scale: float) -> None:
    """Draw an arrow, `scale` metres long per N s, with its size at its tip."""
    vector = scale * arrow.impulse
    draw_arrow(viewer, arrow.start, vector, arrow.colour)
    draw_label(viewer["label"], f"{arrow.size:.3g} N s", f"#{arrow.colour:06x}", vector)
