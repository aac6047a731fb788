"""A leg alone: at a posture, or in a motion from rest to rest."""

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from meshcat.animation import Animation

from kickdyn.core.validation import Array
from kickdyn.motion.motion import Motion
from kickdyn.motion.recorded_motion import RecordedMotion
from kickdyn.robot.leg import Leg, Posture
from kickdyn.view import marks
from kickdyn.view.camera import box_corners, camera_for, set_stage, stripe_width
from kickdyn.view.caption import panel_of
from kickdyn.view.kick_scene import RATE, Pace
from kickdyn.view.leg_figure import draw_leg, joint_poses

MOTION_TIME = 5.0
"""How long a motion is shown [s]."""

MOST_JOINTS = 12
"""Number of joints up to which those at 0 are named too."""


def draw_posture(viewer: Any, posture: Posture, text: str) -> str:
    """Draw a leg at a posture, and return its numbers as HTML."""
    leg = posture.leg
    _draw(viewer, leg, [posture.q])
    values = leg.display_values(posture.q)
    rows = [
        (escape(name), f"{value:.4g} m" if unit == "m" else f"{value:.4g}°")
        for name, (value, unit) in values.items()
        if value or len(values) <= MOST_JOINTS
    ]
    x, y, z = posture.contact_point.tolist()
    rows.append((escape(leg.frame), f"{x:.3f}, {y:.3f}, {z:.3f} m"))
    return panel_of(leg.name or "leg", rows, text, warnings=posture.warnings)


def draw_motion(viewer: Any, motion: Motion | RecordedMotion, text: str) -> tuple[str, Pace]:
    """Draw a robot in its motion, and return its numbers as HTML and the pace.

    A recorded motion is shown as fast as it was.
    """
    is_recorded = isinstance(motion, RecordedMotion)
    begin, end = motion.begin, motion.end
    count = round(RATE * (end - begin if is_recorded else MOTION_TIME))
    times = np.linspace(begin, end, count + 1)
    if isinstance(motion, RecordedMotion):
        leg, hit = motion.leg, 0 if motion.contact is None else motion.contact
        postures = [motion.q[motion.frame_at(time)] for time in times.tolist()]
        rows = [("motion", f"{begin:.4g} to {end:.4g} s, {motion.rate:.4g} frames per second")]
    else:
        leg, hit = motion.robot, 0.0
        postures = [motion.q(time) for time in times.tolist()]
        rows = [
            (phase.name, f"{phase.begin:.4g} to {phase.end:.4g} s from the impact")
            for phase in motion.phases
        ]
    pace = Pace(times, int(np.abs(times - hit).argmin()), count)
    _draw(viewer, leg, postures)
    animation = Animation(default_framerate=RATE)
    for number, q in enumerate(postures):
        with animation.at_frame(viewer, number) as frame:
            for joint, pose in list(enumerate(joint_poses(leg, q)))[1:]:
                frame[f"leg/{joint}"].set_transform(pose)
    viewer.set_animation(animation, repetitions=math.inf)
    return panel_of(leg.name or "leg", rows, text, warnings=motion.warnings), pace


def _draw(viewer: Any, leg: Leg, configurations: Sequence[Array]) -> None:
    """Draw a leg at the first of some configurations, with a ground under all of them."""
    corners = draw_leg(viewer["leg"], leg, configurations[0])
    joints = np.vstack([
        [pose[:3, 3] for pose in joint_poses(leg, q)[1:]] for q in configurations[::8]
    ])  # fmt: skip
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    points = np.vstack([corners, box_corners(joints, 0.05 * size)])
    forward = np.array([1.0, 0.0, 0.0])
    set_stage(viewer, camera_for(points, points, forward), points)
    foot = np.array([*points.mean(axis=0)[:2], corners[:, 2].min()])
    stripe = stripe_width(size)
    marks.draw_ground(viewer["ground"], foot, forward, stripe, 6 * size)
    marks.draw_axes(viewer["axes"], foot + 0.5 * size * np.array([-1.0, -1.0, 0.0]), stripe)
