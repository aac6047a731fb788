"""The same scene, served to browsers on this machine and changed while they watch."""

from __future__ import annotations

import asyncio
import socket
import threading
from types import TracebackType
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from kickdyn.ball import Ball
from kickdyn.errors import InvalidInput
from kickdyn.flight.flight_result import Flight
from kickdyn.impact.impact_result import Impact
from kickdyn.view.caption import caption_panel
from kickdyn.view.document import live_document
from kickdyn.view.kick_page import page_title
from kickdyn.view.kick_scene import draw_kick
from kickdyn.view.recorder import Recorder, recorder

ADDRESS = "127.0.0.1"
SOCKET_PATH = "/scene"

HOSTS = r"(127\.0\.0\.1|localhost)"
"""Names a request may ask for; under another, a page from elsewhere could read the scene."""


def serve(hit: Impact, ball: Ball, path: Flight, *, caption: str = "", port: int = 0) -> LiveServer:
    """Serve a kick; what is drawn into the server's `viewer` later is shown at once.

    Args:
        hit: the impact.
        ball: what was struck.
        path: the ball's flight from there.
        caption: a line of plain text above the numbers.
        port: 0 takes a free one.

    Returns:
        A server that runs until `stop`, or until the end of its `with` block.

    Raises:
        InvalidInput: the leg cannot be drawn, as `kick_page` says, or the port is not free.
    """
    viewer = recorder()
    drawn = draw_kick(viewer, hit, ball, path)
    panel = caption_panel(hit, path, drawn, caption)
    return LiveServer(viewer, title=page_title(hit), panel=panel, port=port)


class LiveServer:
    """A server in a thread of this process, for this machine alone.

    Attributes:
        viewer: the `meshcat.Visualizer` that is shown.
        url: of the page.
    """

    def __init__(self, viewer: Any, *, title: str, panel: str = "", port: int = 0) -> None:
        """Start to serve.

        Args:
            viewer: made by `recorder`.
            title: of the page, plain text.
            panel: HTML laid over the scene.
            port: 0 takes a free one.

        Raises:
            InvalidInput: there is no such port, or it is not free.
        """
        if not 0 <= port <= 65535:
            raise InvalidInput(f"port is {port}: it must be 0 to 65535")
        try:
            door = socket.create_server((ADDRESS, port))
        except OSError as error:
            raise InvalidInput(f"port {port} cannot be served ({error})") from None
        door.setblocking(False)
        self.viewer = viewer
        self.url = f"http://{ADDRESS}:{door.getsockname()[1]}/"
        self._recorder: Recorder = viewer.window
        self._browsers: set[_Socket] = set()
        self._loop = asyncio.new_event_loop()
        self._leave = asyncio.Event()
        page = live_document(SOCKET_PATH, title=title, panel=panel)
        self._thread = threading.Thread(
            target=self._run, args=(door, page), name="kickdyn live view", daemon=True
        )
        self._thread.start()
        self._recorder.listener = lambda packed: self._call(self._show, packed)

    def stop(self) -> None:
        """Close all connections and wait for the thread to end; a second time does nothing."""
        self._recorder.listener = None
        self._call(self._leave.set)
        self._thread.join()

    def __enter__(self) -> LiveServer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _call(self, what: Any, *args: Any) -> None:
        try:
            self._loop.call_soon_threadsafe(what, *args)
        except RuntimeError:  # the loop has ended
            return

    def _show(self, packed: bytes) -> None:
        for browser in list(self._browsers):
            browser.pass_on(packed)

    def _run(self, door: socket.socket, page: str) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve(door, page))

    async def _serve(self, door: socket.socket, page: str) -> None:
        app = Application(log_function=lambda handler: None)  # a server of a library is silent
        app.add_handlers(
            HOSTS,
            [
                (r"/", _Page, {"page": page}),
                (SOCKET_PATH, _Socket, {"recorder": self._recorder, "browsers": self._browsers}),
            ],
        )
        server = HTTPServer(app)
        server.add_socket(door)
        await self._leave.wait()
        server.stop()
        for browser in list(self._browsers):
            browser.close(1001)  # going away
        await server.close_all_connections()


class _Page(RequestHandler):
    def initialize(self, page: str) -> None:
        self._page = page

    def get(self) -> None:
        self.set_header("Cache-Control", "no-store")
        self.write(self._page)


class _Socket(WebSocketHandler):
    """A browser that watches; tornado lets only pages of this server connect."""

    def initialize(self, recorder: Recorder, browsers: set[_Socket]) -> None:
        self._recorder, self._browsers = recorder, browsers

    def open(self, *args: str, **kwargs: str) -> None:
        # What is drawn meanwhile is passed on once this has run, so that nothing is missed.
        self._browsers.add(self)
        for packed in self._recorder.commands():
            self.pass_on(packed)

    def pass_on(self, packed: bytes) -> None:
        try:
            self.write_message(packed, binary=True)
        except WebSocketClosedError:
            self._browsers.discard(self)

    def on_message(self, message: str | bytes) -> None:
        """Ignore what a browser says."""

    def on_close(self) -> None:
        self._browsers.discard(self)
