"""One kick as a page that opens anywhere and needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike

from kickdyn.ball import Ball
from kickdyn.core.files import replacing
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.flight.follow import Course
from kickdyn.impact.impact_result import Impact
from kickdyn.planning.swing import Swing
from kickdyn.view.caption import caption_panel
from kickdyn.view.document import static_document
from kickdyn.view.kick_scene import draw_kick
from kickdyn.view.recorder import recorder
from kickdyn.view.wall_and_goal import Box


def kick_page(
    hit: Impact,
    ball: Ball,
    path: Flight | Course,
    *,
    caption: str = "",
    scenery: Sequence[Box] = (),
    swing: Swing | None = None,
) -> str:
    """Return a kick as HTML, animated, with its numbers.

    Args:
        hit: the impact.
        ball: what was struck.
        path: the ball's flight from there, or its course along the ground.
        caption: a line of plain text above the numbers.
        scenery: what stands around, such as a wall or a goal.
        swing: to this impact and on, from rest to rest, which meets its plan.

    Raises:
        InvalidInput: the leg cannot be drawn: a visual of its URDF cannot be read, or names a
            mesh that is missing or lies outside the URDF's folder; or the swing falls short.
    """
    if swing is not None and swing.status != "met":
        raise InvalidInput(f"the swing does not reach this impact: {swing.limit}")
    viewer = recorder()
    drawn = draw_kick(viewer, hit, ball, path, scenery, swing)
    return static_document(
        viewer.window.commands(),
        title=page_title(hit),
        panel=caption_panel(hit, path, drawn, caption),
    )


def page_title(hit: Impact) -> str:
    """Return the title of a kick's page, plain text."""
    return f"{hit.posture.leg.name or 'leg'}: ball at {float(hit.ball_after.speed):.4g} m/s"


def write_page(file: str | PathLike[str], html: str) -> None:
    """Write a page, whole or not at all.

    Raises:
        InvalidInput: the file cannot be written.
    """
    with replacing(file) as draft:
        draft.write_text(html, encoding="utf-8")
