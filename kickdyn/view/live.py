"""A page served to browsers on this machine, which follow what is drawn later."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from kickdyn.errors import InvalidInput
from kickdyn.view.document import Recorder, live_document

ADDRESS = "127.0.0.1"
SOCKET_PATH = "/scene"

HOSTS = r"(127\.0\.0\.1|localhost)"
"""Host names that are answered; under another one a foreign page could read the scene."""


class LiveServer:
    """A server in a thread of this process, for this machine alone.

    Attributes:
        viewer: the `meshcat.Visualizer` that is shown.
        url: of the page.
    """

    def __init__(self, viewer: Any, title: str, panel: str, port: int = 0) -> None:
        """Start to serve.

        Args:
            viewer: from `recording_viewer`.
            title: of the page, plain text.
            panel: HTML laid over the scene.
            port: 0 takes a free one.

        Raises:
            InvalidInput: there is no such port, or it is not free.
        """
        if not 0 <= port <= 65535:
            raise InvalidInput(f"port is {port}: it must be 0 to 65535")
        try:
            server_socket = socket.create_server((ADDRESS, port))
        except OSError as error:
            raise InvalidInput(f"port {port} cannot be served ({error})") from None
        server_socket.setblocking(False)
        self.viewer = viewer
        self.url = f"http://{ADDRESS}:{server_socket.getsockname()[1]}/"
        self._recorder: Recorder = viewer.window
        self._browsers: set[_Socket] = set()
        self._loop = asyncio.new_event_loop()
        self._leave = asyncio.Event()
        page = live_document(SOCKET_PATH, title, panel)
        self._thread = threading.Thread(
            target=self._run, args=(server_socket, page), name="kickdyn live view", daemon=True
        )
        self._thread.start()
        self._recorder.listener = lambda packed: self._call(self._send, packed)

    def stop(self) -> None:
        """Close all connections and wait for the thread to end; a second time does nothing."""
        self._recorder.listener = None
        self._call(self._leave.set)
        self._thread.join()

    def __enter__(self) -> LiveServer:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def _call(self, function: Callable[..., None], *args: object) -> None:
        """Call a function in the server's thread, if that still runs."""
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(function, *args)

    def _send(self, packed: bytes) -> None:
        """Send a command to all browsers."""
        for browser in list(self._browsers):
            browser.send(packed)

    def _run(self, server_socket: socket.socket, page: str) -> None:
        """Run the server's loop until it is stopped."""
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve(server_socket, page))

    async def _serve(self, server_socket: socket.socket, page: str) -> None:
        """Answer requests until the server is stopped."""
        app = Application(log_function=lambda handler: None)  # a server of a library is silent
        app.add_handlers(
            HOSTS,
            [
                (r"/", _Page, {"page": page}),
                (SOCKET_PATH, _Socket, {"recorder": self._recorder, "browsers": self._browsers}),
            ],
        )
        server = HTTPServer(app)
        server.add_socket(server_socket)
        await self._leave.wait()
        server.stop()
        for browser in list(self._browsers):
            browser.close(1001)  # going away
        await server.close_all_connections()


class _Page(RequestHandler):
    """Answers with the page."""

    def initialize(self, page: str) -> None:
        """Keep the page."""
        self._page = page

    def get(self) -> None:
        """Answer a request."""
        self.set_header("Cache-Control", "no-store")
        self.write(self._page)


class _Socket(WebSocketHandler):
    """The connection to a browser; tornado lets only pages of this server connect."""

    def initialize(self, recorder: Recorder, browsers: set[_Socket]) -> None:
        """Keep the recorded scene, and the set of connected browsers."""
        self._recorder, self._browsers = recorder, browsers

    def open(self, *args: str, **kwargs: str) -> None:
        """Send the scene; what is drawn meanwhile is sent after it, by the same thread."""
        self._browsers.add(self)
        for packed in self._recorder.commands():
            self.send(packed)

    def send(self, packed: bytes) -> None:
        """Send a command."""
        with suppress(WebSocketClosedError):  # then `on_close` follows
            self.write_message(packed, binary=True)

    def on_message(self, message: str | bytes) -> None:
        """Ignore messages of a browser."""

    def on_close(self) -> None:
        """Forget the browser."""
        self._browsers.discard(self)
