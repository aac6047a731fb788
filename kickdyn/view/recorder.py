"""A meshcat window that only remembers: no socket, no server, no child process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import meshcat
import umsgpack

from kickdyn.view.document import static_document


class Recorder:
    """What `meshcat.Visualizer` draws into; it keeps what a browser needs to show the scene.

    Attributes:
        web_url: what a `meshcat.Visualizer` names as its address; there is none.
        listener: called with each new command, so that a server can pass it on.
    """

    web_url = "in memory"

    def __init__(self) -> None:
        self._commands: dict[tuple[str, str, str], bytes] = {}
        self.listener: Callable[[bytes], None] | None = None

    def send(self, command: Any) -> None:
        """Keep a meshcat command in place of the one it supersedes."""
        said = command.lower()
        kind, path = said["type"], said["path"]
        packed = umsgpack.packb(said)
        if kind == "delete":
            self._forget(path)
        else:
            key = (kind, path, said.get("property", ""))
            self._commands.pop(key, None)  # so that it comes last again
            self._commands[key] = packed
        if self.listener:
            self.listener(packed)

    def commands(self) -> list[bytes]:
        """Return the commands that rebuild the scene, in order."""
        return list(self._commands.values())

    def get_scene(self) -> str:
        """Return the scene as a page of its own; `meshcat.Visualizer.static_html` asks for it."""
        return static_document(self.commands(), title="kickdyn")

    def _forget(self, path: str) -> None:
        root = path.rstrip("/")
        for key in list(self._commands):
            if key[1] == path or key[1].startswith(root + "/"):
                del self._commands[key]


def recorder() -> Any:
    """Return a `meshcat.Visualizer` that draws into memory (`viewer.window` is a `Recorder`)."""
    return meshcat.Visualizer(window=Recorder())
