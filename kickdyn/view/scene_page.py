"""A scene file as a page, and its numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kickdyn.errors import InvalidInput
from kickdyn.impact.impact_result import Impact
from kickdyn.scene.simulation import Simulation
from kickdyn.view.impulses import joint_pushes
from kickdyn.view.kick_page import kick_page
from kickdyn.view.wall_and_goal import Box, plane_boxes

BEYOND = 10.0
"""How far ahead a plane is drawn that the ball does not reach, over the length of its way."""


def scene_page(answer: Simulation) -> str:
    """Return the page of a scene that was simulated as an instant.

    Args:
        answer: with its path, as of `simulate_as_instant`.

    Raises:
        InvalidInput: the leg cannot be drawn, as `kick_page` says.
    """
    hit, path, scene = answer.impact, answer.path, answer.scene
    if not isinstance(hit, Impact) or path is None:
        raise InvalidInput("the scene's impact takes time, or its way is not known: ask for both")
    floor = min(hit.ball_before.position[2], answer.end.position[2]) - scene.ball.radius
    boxes = [] if scene.plane is None else plane_boxes(scene.plane, answer.end.position, floor)
    caption = scene.name + _instant(answer)
    if boxes and not _in_sight(answer, boxes):
        boxes, caption = [], caption + ", its plane out of the picture"
    return kick_page(hit, scene.ball, path, caption=caption, scenery=boxes)


def _instant(answer: Simulation) -> str:
    """Return what the picture leaves out, where the contact takes time in truth."""
    if not answer.left_out:
        return ""
    moved = answer.model_error
    off = f"{moved:.2g} m off" if math.isfinite(moved) else "nobody knows how far off"
    return f", its contact shown as an instant: it ends {off}"


def _in_sight(answer: Simulation, boxes: list[Box]) -> bool:
    """Return whether what stands there leaves a kick to see: it is ahead, and not far beyond."""
    start, end = answer.impact.ball_after.position[:2], answer.end.position[:2]
    ahead = np.mean([box.centre for box in boxes], axis=0)[:2] - start
    way = end - start
    reached = answer.status == "at-plane"
    return reached or 0.0 < float(ahead @ way) < BEYOND * float(way @ way)


def numbers(answer: Simulation) -> dict[str, Any]:
    """Return what the page says, all digits; SI units, joint angles in degrees as given."""
    hit, leg = answer.impact, answer.scene.leg
    assert isinstance(hit, Impact)
    return {
        "scene": answer.scene.name,
        "leg": leg.name,
        "frame": leg.frame,
        "angles": {
            name: round(value, 9) + 0.0
            for name, (value, _) in leg.display_values(answer.scene.q).items()
        },
        "impulse": hit.impulse.tolist(),
        "joint_impulses": {name: push.tolist() for name, _, push in joint_pushes(hit)},
        "foot_speed": float(np.linalg.norm(hit.foot_velocity)),
        "ball_velocity": hit.ball_after.velocity.tolist(),
        "ball_spin": hit.ball_after.spin.tolist(),
        "launch_angle": float(hit.ball_after.elevation),
        "end": answer.end.position.tolist(),
        "time": float(answer.end.time),
        "error": _finite(answer.error),
        "warnings": list(answer.warnings),
        "left_out": {v.effect: _finite(v.bound) for v in answer.verdicts if not v.modelled},
    }


def _finite(size: float) -> float | None:
    return size if math.isfinite(size) else None
