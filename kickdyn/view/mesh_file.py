"""Meshes of a URDF: only from its own folder, and only their bare triangles.

A mesh may name further files (textures, materials, buffers), and would pull any file of this
machine into a page that is passed on. So it is read once, from memory, with nothing to look
further files up with.
"""

from __future__ import annotations

import io
import re
import stat
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kickdyn.checks import Array
from kickdyn.errors import InvalidInput

MAX_BYTES = 100_000_000
FORMATS = (".stl", ".obj", ".dae", ".ply", ".glb")
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
    stretch = np.ones(3) if scale is None else np.asarray(scale, dtype=float)
    if stretch.shape not in ((), (3,)) or not np.isfinite(stretch).all():
        raise InvalidInput(f"mesh {filename!r} has scale {scale}: it must be one number or three")
    try:
        content = file.read_bytes()
        scene = trimesh.load_scene(
            io.BytesIO(content), file_type=file.suffix[1:].lower(), resolver=None
        )
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    except Exception as error:  # each format has its own
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise InvalidInput(f"mesh {filename!r} cannot be read ({reason})") from None
    if not any(len(part.faces) for part in parts):
        raise InvalidInput(f"mesh {filename!r} has no triangles")
    turn = _upright(content) if file.suffix.lower() == ".dae" else np.eye(3)
    return [
        Triangles(
            np.asarray(part.vertices) @ turn.T * stretch, np.asarray(part.faces), _colour(part)
        )
        for part in parts
    ]


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
