"""A page served to browsers on this machine."""

from __future__ import annotations

import threading
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from kickdyn.errors import InvalidInput

ADDRESS = "127.0.0.1"


class PageServer:
    """A server in a thread of this process, for this machine alone; `url` is the page's address.

    Raises:
        InvalidInput: there is no such port, or it is not free.
    """

    def __init__(self, html: str, port: int = 0) -> None:
        if not 0 <= port <= 65535:
            raise InvalidInput(f"port is {port}: it must be 0 to 65535")
        try:
            handler = partial(_Handler, html.encode())
            self._server = ThreadingHTTPServer((ADDRESS, port), handler)
        except OSError as error:
            raise InvalidInput(f"port {port} cannot be served ({error})") from None
        self.url = f"http://{ADDRESS}:{self._server.server_port}/"
        self._thread = threading.Thread(
            target=self._server.serve_forever, name="kickdyn page server", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop to serve; a second time does nothing."""
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()

    def __enter__(self) -> PageServer:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()


class _Handler(BaseHTTPRequestHandler):
    """Answers `GET /` with a page, and everything else with 404."""

    timeout = 10.0

    def __init__(self, page: bytes, *args: Any) -> None:
        self._page = page
        super().__init__(*args)

    def do_GET(self) -> None:
        """Answer a request."""
        host = self.headers.get("Host", "").partition(":")[0]
        # Under another name of this machine a foreign page could read the scene.
        if self.path != "/" or host not in (ADDRESS, "localhost"):
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(self._page)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(self._page)

    def log_message(self, format: str, *args: object) -> None:
        """Stay silent, as a library does."""
