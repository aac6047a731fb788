"""`show`: a live view in a tab of the browser or in Jupyter.

A server in a thread of this process sends scenes to the browsers that have its page open: it is
bound to the loopback, and its address has a random part. meshcat's own server listens on all
network interfaces. Scenes arrive as server-sent events, a part of HTML that needs no package; a
command of meshcat that a browser has already is not sent again.
"""

import atexit
import base64
import json
import secrets
import sys
import threading
import webbrowser
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import meshcat.geometry as shapes
import meshcat.transformations as tf
import numpy as np

from kickdyn.air import Air
from kickdyn.core import validation
from kickdyn.core.validation import Array
from kickdyn.flight.fly import fly
from kickdyn.impact.impact_result import Impact
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.robot.leg import Posture
from kickdyn.view import marks
from kickdyn.view.caption import kick_panel
from kickdyn.view.document import html_document, recording_viewer, scene_parts
from kickdyn.view.kick_scene import (
    LEAST_JOINT_IMPULSE,
    corners_around,
    draw_impulses,
    impulse_arrows,
    label_end,
    largest_impulse,
)
from kickdyn.view.leg_figure import BallPath, curve_of, draw_leg, joint_poses
from kickdyn.view.page import FRAME_HEIGHT, Page, page

CURVE_POINTS = 60

ELLIPSOID = 0x8E44AD
"""Colour of the impulse ellipsoid."""

LONGEST_SHARE = 1.6
"""Length of the longest flight that the camera shows, over the first one's."""

ELLIPSOID_SHARE = 0.35
"""Largest radius of the first impulse ellipsoid over the size of leg and ball."""


class StillKick:
    """A kick at the instant of the impact, and the moves that make another kick of the same leg.

    A page takes too long to draw for each kick of a class or a tuning; leg, ball, arrows,
    flight and ground move within milliseconds. `page` has the first kick, `arrow_nodes` are the
    arrows drawn.
    """

    def __init__(self, impact: Impact, path: BallPath | None = None, caption: str = "") -> None:
        leg, ball = impact.posture.leg, impact.ball
        self.leg, viewer = leg, recording_viewer()
        path = _flown(impact, path)
        corners = draw_leg(viewer["leg"], leg, impact.posture.q)
        foreground, most = corners_around(impact), largest_impulse(impact)
        self._size = float(np.linalg.norm(np.ptp(foreground, axis=0)))
        self._scale = 0.45 * self._size / most if most > 0 else 0.0
        radii = impulse_ellipsoid(impact.posture)[0]
        self._per_root = ELLIPSOID_SHARE * self._size / max(float(radii.max()), 1e-9)
        curve = curve_of(path, CURVE_POINTS)
        self._forward = marks.level_direction(curve[-1] - curve[0])
        longer = curve[0] + LONGEST_SHARE * (curve - curve[0])  # so that other flights are seen
        far = np.vstack([corners, marks.box_corners(longer, ball.radius)])
        self._camera = marks.camera_for(foreground, far, self._forward)
        marks.set_stage(viewer, self._camera, np.vstack([foreground, curve]))
        foot = self._ground(impact)
        length = float(np.hypot(*(curve[-1] - foot)[:2]))
        stripe = marks.stripe_width(length + self._size)
        reach = 3 * length + 8 * self._size
        marks.draw_ground(viewer["ground"], foot, self._forward, stripe, reach)
        marks.draw_ball(viewer["ball"], ball.radius, impact.ball_before.position)
        viewer["ellipsoid"].set_object(shapes.Sphere(1.0), marks.overlay(ELLIPSOID, opacity=0.3))
        self.arrow_nodes: set[str] = set()
        self.page = Page(viewer, leg.name or "leg", self._draw(viewer, impact, path, caption))

    def moves(self, impact: Impact, path: BallPath | None = None, caption: str = "") -> Page:
        """Return a page of the changes of the scene for another kick of the same leg."""
        viewer = recording_viewer()
        panel = self._draw(viewer, impact, _flown(impact, path), caption)
        return Page(viewer, self.page.title, panel)

    def _ground(self, impact: Impact) -> Array:
        centre = impact.ball_before.position
        bottom = float(centre[2]) - impact.ball.radius
        depths = find_depths(impact.posture.leg, impact.posture.q, bottom).values()
        return np.array([*centre[:2], bottom - max(depths, default=0.0)])

    def _draw(self, viewer: Any, impact: Impact, path: BallPath, caption: str) -> str:
        for joint, pose in enumerate(joint_poses(impact.posture.leg, impact.posture.q)):
            viewer[f"leg/{joint}"].set_transform(pose)
        viewer["ball"].set_transform(tf.translation_matrix(impact.ball_before.position))
        viewer["ground"].set_transform(marks.level_pose(self._ground(impact), self._forward))
        radii, axes = impulse_ellipsoid(impact.posture)
        pose = np.eye(4)
        pose[:3, :3] = axes * np.maximum(self._per_root * radii, 1e-3 * self._size)
        pose[:3, 3] = impact.posture.contact_point
        viewer["ellipsoid"].set_transform(pose)
        curve = curve_of(path, CURVE_POINTS)
        width = self._camera.curve_width(curve)
        marks.draw_curve(viewer["curve"], curve, width, np.cross(self._forward, marks.UP_AXIS))
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


def _flown(impact: Impact, path: BallPath | None) -> BallPath:
    return fly(impact.ball_after, impact.ball, Air()) if path is None else path


ADDRESS = "127.0.0.1"

HEARTBEAT = 5.0
"""Time after which a browser hears that the server still runs, and the server of a browser that
has left [s]."""


class View:
    """A live view, as `show` returns it; in Jupyter it is shown as the result of its cell.

    Attributes:
        url: its address, which works on this machine only.
    """

    def __init__(self) -> None:
        token = secrets.token_urlsafe(16)
        self._changed = threading.Condition()
        self._page: Page | None = None
        self._version = self._camera_version = 0  # of the scene, and of the one that set the camera
        self._still: StillKick | None = None
        self._moves: Page | None = None  # from the scene to the present picture
        self._moves_version = 0
        self._open = True
        view = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                # under another name of this machine, a page from elsewhere could read the scene
                trusted = self.headers.get_all("Host") in hosts
                if not trusted or self.path not in (f"/{token}/", f"/{token}/events"):
                    self.send_error(404)
                    return
                is_page = self.path.endswith("/")
                kind = "text/html; charset=utf-8" if is_page else "text/event-stream"
                self.send_response(200)
                self.send_header("Content-Type", kind)
                self.send_header("Cache-Control", "no-store")
                self.end_headers()
                try:
                    if is_page:
                        self.wfile.write(html_document("kickdyn", (), is_live=True).encode())
                        return
                    for message in view._messages():
                        self.wfile.write(message.encode())
                        self.wfile.flush()
                except OSError:  # the browser has left
                    return

            def log_message(self, format: str, *args: object) -> None:
                pass

        self._server = ThreadingHTTPServer((ADDRESS, 0), Handler)
        self._server.daemon_threads = True
        port = self._server.server_port
        hosts = [f"{ADDRESS}:{port}"], [f"localhost:{port}"]
        self.url = f"http://{ADDRESS}:{port}/{token}/"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        atexit.register(self.close)

    @property
    def is_open(self) -> bool:
        """Whether it can still be seen."""
        return self._open

    def update(self, subject: Any, path: BallPath | None = None, *, caption: str = "") -> None:
        """Show another subject from where the camera is; the arguments are as for `page`.

        In a still view, another impact of the same leg moves the parts of the scene, within some
        milliseconds.

        Raises:
            InvalidInput: as for `page`.
        """
        still = self._still
        if still is None or not isinstance(subject, Impact) or subject.posture.leg is not still.leg:
            self._put(page(subject, path, caption=caption), keeps_camera=True)
            return
        moves = still.moves(subject, path, caption)
        with self._changed:
            self._moves = moves
            self._moves_version += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Stop the server; a second time does nothing. It also ends with the process."""
        with self._changed:
            if not self._open:
                return
            self._open = False
            self._changed.notify_all()
        atexit.unregister(self.close)
        self._server.shutdown()
        self._server.server_close()

    def _put(self, shown: Page, *, keeps_camera: bool, still: StillKick | None = None) -> None:
        with self._changed:
            self._page, self._still, self._moves = shown, still, None
            self._version += 1
            if not keeps_camera:
                self._camera_version = self._version
            self._changed.notify_all()

    def _messages(self) -> Iterator[str]:
        numbers: dict[bytes, int] = {}  # of the commands that the browser has
        version = moves_version = 0
        while self._open:
            with self._changed:
                if (self._version, self._moves_version) == (version, moves_version):
                    self._changed.wait(HEARTBEAT)
                shown, keeps_camera = self._page, version >= self._camera_version
                is_news, version = self._version > version, self._version
                moves = self._moves if is_news or self._moves_version > moves_version else None
                if not is_news:
                    moves_version = self._moves_version
            if not is_news or shown is None:
                if moves is None:
                    yield ": still here\n\n"
                    continue
                commands, parts = moves.viewer.window.commands, scene_parts(moves.scenes)
                packed = [base64.b64encode(command).decode() for command in commands]
                changed = {"moves": packed, "labels": parts.labels, "caption": parts.panels}
                yield f"data: {json.dumps(changed)}\n\n"
                continue
            moves_version = -1 if moves else self._moves_version  # next, what the scene lacks
            first_number = 1 + max(numbers.values(), default=-1)
            parts = scene_parts(shown.scenes, list(shown.pages), numbers, first_number)
            numbers = parts.numbers
            update = {
                "title": shown.title,
                "keeps_camera": keeps_camera,
                "labels": parts.labels,
                "caption": parts.buttons + parts.panels,
                "scenes": parts.scenes,
                "commands": [
                    [number, base64.b64encode(packed).decode()]
                    for packed, number in numbers.items()
                    if number >= first_number
                ],
            }
            yield f"data: {json.dumps(update)}\n\n"

    def __repr__(self) -> str:
        return f"<View at {self.url}>" if self._open else "<View, closed>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{self.url}" style="width: 100%; height: {FRAME_HEIGHT}px; border: 0">'
            "</iframe>"
        )


_view: View | None = None
"""The view of this process."""


def show(
    subject: Any,
    path: BallPath | None = None,
    *,
    caption: str = "",
    browser: bool | None = None,
    still: bool = False,
) -> View:
    """Show a leg, a posture, an impact, a plan, a motion or flights in a live 3-D view.

    The view is a tab of the browser, or in Jupyter the result of the cell. There is one view: what
    is shown next replaces what it shows, in the same tab, and `View.update` does so without moving
    the camera. It can be reached from this machine alone and ends with the process; a notebook
    that runs on another machine shows `kd.page(subject)` instead, which needs no connection.

    Args:
        subject: what `page` takes.
        path: path of the ball after an `Impact`; with None the ball flies through `Air()`.
        caption: line of plain text above the numbers.
        browser: whether to open a tab; with None, where there is no view yet, outside of Jupyter.
        still: whether an `Impact` is shown at its instant, with the impulses that take the same
            energy from the leg as an ellipsoid. `View.update` then moves its parts at once.

    Returns:
        The view.

    Raises:
        InvalidInput: the subject cannot be shown.
    """
    global _view
    validation.check_type(bool, type(None), browser=browser)
    validation.check_type(bool, still=still)
    if still:
        validation.check_type(Impact, subject=subject)
    made_still = StillKick(subject, path, caption) if still else None
    made_page = made_still.page if made_still else page(subject, path, caption=caption)
    is_new = _view is None or not _view.is_open
    if _view is None or is_new:
        _view = View()
    _view._put(made_page, keeps_camera=False, still=made_still)
    if browser or (browser is None and is_new and "ipykernel" not in sys.modules):
        webbrowser.open(_view.url)
    return _view
