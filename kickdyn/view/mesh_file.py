"""Meshes of a URDF: only from its own folder, and only their bare triangles.

A mesh may name further files (textures, materials, buffers), and would pull any file of this
machine into a page that is passed on. So it is read once, from memory, with nothing to look
further files up with.
"""

from __future__ import annotations

import io
import logging
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kickdyn.core.validation import Array
from kickdyn.errors import InvalidInput
from kickdyn.view.mesh_size import FORMATS, MAX_BYTES, MAX_VERTICES, check_size, too_large

logging.getLogger("trimesh").addHandler(logging.NullHandler())  # tracebacks of what it passes over

PACKAGE = "package://"
UPRIGHT = {
    b"X": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    b"Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""By the axis that points up: from a COLLADA file's axes to ours (COLLADA 1.4.1, up_axis)."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """One surface of one colour.

    Attributes:
        vertices: shape `(n, 3)` [m, frame of the visual].
        faces: indices of vertices, shape `(m, 3)`.
        rgba: its own colour, 0 to 1; None where the file gives none.
    """

    vertices: Array
    faces: Array
    rgba: Array | None


def read_mesh(filename: str, folder: Path, scale: object = None) -> list[Triangles]:
    """Read a mesh that a URDF names.

    Args:
        filename: relative to the folder, or `package://NAME/...`, also looked up there.
        folder: of the URDF; no file outside is opened.
        scale: None, a number, or three.

    Raises:
        InvalidInput: the mesh lies outside, is missing, or cannot be read.
    """
    import trimesh  # takes half a second; most legs have no mesh

    file = _inside(filename, folder)
    stretch = _stretch(filename, scale)
    ending = file.suffix.lower()
    try:
        content = file.read_bytes()
        check_size(filename, content, ending)
        scene = trimesh.load_scene(io.BytesIO(content), file_type=ending[1:], resolver=None)
        turn = _upright(content) if ending == ".dae" else np.eye(3)
        parts = list(_parts(filename, scene, np.diag(stretch) @ turn))
    except InvalidInput:
        raise
    except Exception as error:  # each format has its own
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise InvalidInput(f"mesh {filename!r} cannot be read ({reason})") from None
    if not any(len(part.faces) for part in parts):
        raise InvalidInput(f"mesh {filename!r} has no triangles")
    return parts


def _stretch(filename: str, scale: object) -> Array:
    try:
        stretch = np.ones(3) if scale is None else np.asarray(scale, dtype=float)
        if stretch.shape in ((), (3,)) and np.isfinite(stretch).all():
            return np.broadcast_to(stretch, 3)
    except (TypeError, ValueError, OverflowError):
        pass
    raise InvalidInput(f"mesh {filename!r} has scale {scale}: it must be one number or three")


def _parts(filename: str, scene: Any, turn: Array) -> Iterator[Triangles]:
    """Yield the surfaces where the scene has them; its images are left alone."""
    import trimesh

    total = 0
    for node in scene.graph.nodes_geometry:
        place, name = scene.graph[node]
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):  # lines, or points
            continue
        total += len(part.vertices)
        if total > MAX_VERTICES:
            raise too_large(filename, total)
        faces = np.asarray(part.faces)
        mirrored = np.linalg.det(place[:3, :3]) < 0.0
        yield Triangles(
            (np.asarray(part.vertices) @ place[:3, :3].T + place[:3, 3]) @ turn.T,
            faces[:, ::-1] if mirrored else faces,
            _colour(part),
        )


def _upright(content: bytes) -> Array:
    """Return the turn that brings a COLLADA file's axes to z up, which trimesh leaves out."""
    named = re.search(rb"<up_axis>\s*([XYZ])_UP", content)
    return UPRIGHT.get(named[1] if named else b"Z", np.eye(3))


def _colour(part: object) -> Array | None:
    visual = getattr(part, "visual", None)
    if visual is None or not visual.defined:
        return None
    source = visual.material if visual.kind == "texture" else visual
    return np.asarray(source.main_color, dtype=float) / 255.0


def _inside(filename: str, folder: Path) -> Path:
    """Return the real path of a regular file under the folder, links followed."""
    root = folder.resolve()
    named = filename.removeprefix(PACKAGE)
    if "://" in named:
        raise InvalidInput(f"mesh {filename!r} is refused: only files are read, no addresses")
    candidates = [root / named]
    below = named.partition("/")[2].lstrip("/")
    if filename.startswith(PACKAGE) and below:  # this folder may be the package's own
        candidates.append(root / below)
    try:
        found = [path.resolve() for path in candidates]
        present = [path for path in found if path.exists()]
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links, a NUL in the name
        raise InvalidInput(f"mesh {filename!r} cannot be found ({error})") from None
    if not all(path.is_relative_to(root) for path in found):
        raise InvalidInput(
            f"mesh {filename!r} is refused: it lies outside the URDF's folder {root}"
        )
    if not present:
        raise InvalidInput(f"mesh {filename!r} is missing from the URDF's folder {root}")
    return _regular(filename, present[0])


def _regular(filename: str, path: Path) -> Path:
    if path.suffix.lower() not in FORMATS:
        raise InvalidInput(f"mesh {filename!r} has no known ending: {', '.join(FORMATS)} are read")
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):  # a FIFO would block for ever
        raise InvalidInput(f"mesh {filename!r} is not a regular file")
    if status.st_size > MAX_BYTES:
        raise InvalidInput(
            f"mesh {filename!r} has {status.st_size} bytes: at most {MAX_BYTES} are read"
        )
    return path
