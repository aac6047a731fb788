"""A kick at the instant of the impact, whose parts move with its inputs.

A page of a kick is drawn anew for each kick, with its animation. A class or a tuning needs the next
kick within a few milliseconds: leg, ball, arrows, flight and ground of a `StillKick` move, and the
rest of the scene stays in the browser.
"""

from typing import Any, NamedTuple

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np

from kickdyn.air import Air
from kickdyn.core.validation import Array
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.fly import fly
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.leg import Posture
from kickdyn.view import marks
from kickdyn.view.camera import (
    UP_AXIS,
    box_corners,
    camera_for,
    level_direction,
    set_stage,
    stripe_width,
)
from kickdyn.view.caption import kick_panel
from kickdyn.view.document import recording_viewer
from kickdyn.view.kick_scene import (
    CURVE_RADIUS,
    LEAST_JOINT_IMPULSE,
    corners_around,
    draw_impulses,
    impulse_arrows,
    label_end,
    largest_impulse,
)
from kickdyn.view.leg_figure import draw_leg, joint_poses
from kickdyn.view.page import Page

CURVE_POINTS = 60

ELLIPSOID = 0x8E44AD
"""Colour of the impulse ellipsoid."""

LONGEST_SHARE = 1.6
"""Length of the longest flight that the camera shows, over the first one's."""

ELLIPSOID_SHARE = 0.35
"""Largest radius of the first impulse ellipsoid over the size of leg and ball."""


class Moves(NamedTuple):
    """What changes in a scene: packed commands of meshcat, and HTML of all labels and the panel."""

    commands: list[bytes]
    labels: str
    panel: str


class StillKick:
    """A drawn kick, and the moves that make another kick of the same leg of it.

    Attributes:
        leg: the leg that is drawn.
        page: the first kick.
        arrow_nodes: nodes of the arrows that are drawn now.
    """

    def __init__(
        self, impact: Impact, path: Flight | Course | None = None, caption: str = ""
    ) -> None:
        leg, ball = impact.posture.leg, impact.ball
        self.leg, viewer = leg, recording_viewer()
        path = _flown(impact, path)
        corners = draw_leg(viewer["leg"], leg, impact.posture.q)
        foreground, most = corners_around(impact), largest_impulse(impact)
        self._size = float(np.linalg.norm(np.ptp(foreground, axis=0)))
        self._scale = 0.45 * self._size / most if most > 0 else 0.0
        radii = impulse_ellipsoid(impact.posture)[0]
        self._per_root = ELLIPSOID_SHARE * self._size / max(float(radii.max()), 1e-9)
        curve = _curve(path)
        self._forward = level_direction(curve[-1] - curve[0])
        longer = curve[0] + LONGEST_SHARE * (curve - curve[0])  # so that other flights are seen
        far = np.vstack([corners, box_corners(longer, ball.radius)])
        self._camera = camera_for(foreground, far, self._forward)
        set_stage(viewer, self._camera, np.vstack([foreground, curve]))
        foot = self._ground(impact)
        length = float(np.hypot(*(curve[-1] - foot)[:2]))
        stripe = stripe_width(length + self._size)
        marks.draw_ground(
            viewer["ground"], foot, self._forward, stripe, 3 * length + 8 * self._size
        )
        marks.draw_ball(viewer["ball"], ball.radius, impact.ball_before.position)
        look = shapes.MeshBasicMaterial(
            color=ELLIPSOID, opacity=0.3, transparent=True, depthTest=False
        )
        viewer["ellipsoid"].set_object(shapes.Sphere(1.0), look)
        self.arrow_nodes: set[str] = set()
        self.page = Page(viewer, leg.name or "leg", self._draw(viewer, impact, path, caption))

    def moves(
        self, impact: Impact, path: Flight | Course | None = None, caption: str = ""
    ) -> Moves:
        """Return the changes of the scene for another kick of the same leg."""
        viewer = recording_viewer()
        panel = self._draw(viewer, impact, _flown(impact, path), caption)
        return Moves(viewer.window.commands, "\n".join(viewer.window.labels), panel)

    def _ground(self, impact: Impact) -> Array:
        """Return the point of the ground under the ball: as low as ball and leg come."""
        centre = impact.ball_before.position
        bottom = float(centre[2]) - impact.ball.radius
        depths = find_depths(impact.posture.leg, impact.posture.q, bottom).values()
        return np.array([*centre[:2], bottom - max(depths, default=0.0)])

    def _draw(self, viewer: Any, impact: Impact, path: Flight | Course, caption: str) -> str:
        """Draw all that moves, and return the panel."""
        for joint, pose in enumerate(joint_poses(impact.posture.leg, impact.posture.q)):
            viewer[f"leg/{joint}"].set_transform(pose)
        viewer["ball"].set_transform(tf.translation_matrix(impact.ball_before.position))
        viewer["ground"].set_transform(marks.level_pose(self._ground(impact), self._forward))
        radii, axes = impulse_ellipsoid(impact.posture)
        pose = np.eye(4)
        pose[:3, :3] = axes * np.maximum(self._per_root * radii, 1e-3 * self._size)
        pose[:3, 3] = impact.posture.contact_point
        viewer["ellipsoid"].set_transform(pose)
        curve = _curve(path)
        width = CURVE_RADIUS * self._camera.distance(curve)
        marks.draw_curve(viewer["curve"], curve, width, np.cross(self._forward, UP_AXIS))
        arrows = impulse_arrows(impact, LEAST_JOINT_IMPULSE * largest_impulse(impact))
        draw_impulses(viewer, arrows, self._scale)
        for node in self.arrow_nodes - {arrow.node for arrow in arrows}:
            viewer[node].delete()
        self.arrow_nodes = {arrow.node for arrow in arrows}
        label_end(viewer, path, curve)
        return kick_panel(impact, path, caption)


def impulse_ellipsoid(posture: Posture) -> tuple[Array, Array]:
    r"""Return the impulses on the foot that take the same kinetic energy, as an ellipsoid.

    An impulse $p$ takes the energy $\tfrac12 p^T J M^{-1} J^T p$. Along an eigenvector of the
    Delassus matrix $J M^{-1} J^T$ with the effective mass $m_i$, the radius is $\sqrt{m_i}$: the
    ellipsoid is long where the leg is heavy.

    Returns:
        Radii, shape `(3,)` [kg^1/2], 0 along a direction in which the foot cannot move; and the
        axes as columns, shape `(3, 3)` [world frame].
    """
    inverse_masses, axes = np.linalg.eigh(posture.delassus())
    moves = inverse_masses > 1e-9 * inverse_masses.max()
    radii = np.where(moves, 1.0 / np.sqrt(np.where(moves, inverse_masses, 1.0)), 0.0)
    return radii, axes


def _curve(path: Flight | Course) -> Array:
    return np.asarray(path.sample(np.linspace(0.0, path.duration, CURVE_POINTS)).position)


def _flown(impact: Impact, path: Flight | Course | None) -> Flight | Course:
    return fly(impact.ball_after, impact.ball, Air()) if path is None else path
