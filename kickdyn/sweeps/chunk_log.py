"""What a store that is being filled says of its chunks: a note of each that is done."""

from __future__ import annotations

import json
import shutil
from base64 import b64decode, b64encode
from pathlib import Path
from typing import Any

import numpy as np


class ChunkLog:
    """The notes of a store, in its folder `progress`; a finished store has none.

    Args:
        store: the folder of the store.
    """

    def __init__(self, store: Path) -> None:
        self._folder = store / "progress"

    def done(self) -> list[int]:
        """Return the numbers of the chunks that are done, ascending."""
        return sorted(int(file.stem) for file in self._folder.glob("*.json"))

    def write(self, k: int, chunk_summary: dict[str, Any]) -> None:
        """Note that chunk `k` is done, and what is told of it: the note is there whole, or not.

        Args:
            k: number of the chunk.
            chunk_summary: plain values, and `front`, shape `(n, 3)`.
        """
        draft = self._folder / f"{k}.draft"
        front = b64encode(chunk_summary["front"].astype("<f8").tobytes()).decode()
        draft.write_text(
            json.dumps({**chunk_summary, "front": front})
        )  # as text it would take longest
        draft.replace(self._folder / f"{k}.json")

    def read(self, k: int) -> dict[str, Any]:
        """Return what was told of a chunk; raise `OSError` where there is no note."""
        chunk_summary: dict[str, Any] = json.loads((self._folder / f"{k}.json").read_text())
        chunk_summary["front"] = np.frombuffer(b64decode(chunk_summary["front"]), "<f8").reshape(
            -1, 3
        )
        return chunk_summary

    def clear(self) -> None:
        """Remove them all."""
        shutil.rmtree(self._folder, ignore_errors=True)
