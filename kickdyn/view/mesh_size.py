"""How large a mesh is, before it is read: a small file can promise a lot.

Headers are taken at their word by who reads them, and nodes that stand for others multiply.
"""

from __future__ import annotations

import json
import re
import struct
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any
from xml.parsers import expat

from kickdyn.errors import InvalidInput

MAX_BYTES = 50_000_000
MAX_VERTICES = 3_000_000
"""Of a mesh, and corners of its faces: a million triangles, as an STL file of 50 MB has."""

MAX_PARTS = 1000
"""Surfaces, and the nodes that place them."""

CORNER = 4
"""Indices of a corner in a COLLADA file, at most: of its vertex, normal, texture and colour."""

Size = tuple[int, int]
"""Vertices (or corners of faces, if they are more), and parts."""


def check_size(filename: str, content: bytes, ending: str) -> None:
    """Raise `InvalidInput` unless what a mesh file promises can be read in seconds.

    Args:
        filename: for the message.
        content: of the file.
        ending: by which it is read, such as `.stl`.

    Raises:
        InvalidInput: too much; or a DOCTYPE, whose entities a reader would expand.
        Exception: it is no such file; which, depends on what is wrong.
    """
    vertices, parts = _SIZES[ending](content)
    if vertices > MAX_VERTICES:
        raise too_large(filename, vertices)
    if parts > MAX_PARTS:
        raise InvalidInput(f"mesh {filename!r} has {parts} parts: at most {MAX_PARTS} are read")


def too_large(filename: str, vertices: int) -> InvalidInput:
    """Return what is to be raised for so many vertices."""
    return InvalidInput(
        f"mesh {filename!r} has {vertices} vertices: at most {MAX_VERTICES} are read"
    )


def _stl(content: bytes) -> Size:
    (triangles,) = struct.unpack_from("<I", content, 80) if len(content) >= 84 else (0,)
    binary = len(content) == 84 + 50 * triangles
    return 3 * triangles if binary else content.count(b"vertex"), 1


def _obj(content: bytes) -> Size:
    text = content.replace(b"\r\n", b"\n").replace(b"\\\n", b"")
    vertices = len(re.findall(rb"^[ \t]*v[ \t]", text, re.MULTILINE))
    faces = re.findall(rb"^[ \t]*f[ \t].*$", text, re.MULTILINE)
    corners = sum(len(face.split()) - 1 for face in faces)
    parts = len(re.findall(rb"^[ \t]*(?:usemtl|o|g)[ \t]", text, re.MULTILINE))
    return max(vertices, corners), parts


def _ply(content: bytes) -> Size:
    header = content.partition(b"end_header")[0]
    return sum(int(count) for count in re.findall(rb"element\s+\S+\s+(\d+)", header)), 1


def _glb(content: bytes) -> Size:
    (length,) = struct.unpack_from("<I", content, 12)
    about: dict[str, Any] = json.loads(content[20 : 20 + length])
    views = sum(abs(view["byteLength"]) for view in about.get("bufferViews", []))
    if views > MAX_BYTES:  # each is a copy
        raise ValueError(f"its bufferViews have {views} bytes: at most {MAX_BYTES} are read")
    counts = [abs(each["count"]) for each in about.get("accessors", [])]
    surfaces = [each for mesh in about.get("meshes", []) for each in mesh["primitives"]]
    shown = [each["attributes"].get("POSITION") for each in surfaces]
    shown += [each.get("indices") for each in surfaces]
    used = sum(counts[number] for number in shown if number is not None)
    placed = sum(1 + len(node.get("children", [])) for node in about.get("nodes", []))
    return max(sum(counts), used), max(len(surfaces), placed)


def _dae(content: bytes) -> Size:
    seen = _Collada()
    seen.read(content)
    numbers, parts = seen.size("")
    return numbers // CORNER, parts


class _Collada:
    """What the scene of a COLLADA file holds, with nodes that stand for others counted as those."""

    def __init__(self) -> None:
        self._numbers: Counter[str] = Counter()
        self._holds: dict[str, list[str]] = defaultdict(list)
        self._within = [""]
        self._sizes: dict[str, Size] = {}
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartDoctypeDeclHandler = _refused
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end

    def read(self, content: bytes) -> None:
        """See the whole file."""
        self._parser.Parse(content, True)

    def size(self, name: str) -> Size:
        """Return the numbers of all faces in a node, and how many nodes and surfaces it has."""
        if name not in self._sizes:
            parts = [self.size(each) for each in self._holds.get(name, ())]
            numbers = self._numbers[name] + sum(size[0] for size in parts)
            self._sizes[name] = (numbers, 1 + sum(size[1] for size in parts))
        return self._sizes[name]

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        tag = tag.rpartition(":")[2]
        if tag in ("node", "geometry"):
            name = "#" + attributes.get("id", f" {len(self._holds)}, unnamed")
            if tag == "node":
                self._holds[self._within[-1]].append(name)
            self._within.append(name)
            self._holds[name]  # is there now
        elif tag in ("instance_node", "instance_geometry"):
            self._holds[self._within[-1]].append(attributes.get("url", ""))
        elif tag == "p":
            self._parser.CharacterDataHandler = self._indices

    def _end(self, tag: str) -> None:
        tag = tag.rpartition(":")[2]
        if tag in ("node", "geometry"):
            self._within.pop()
        elif tag == "p":
            self._parser.CharacterDataHandler = None

    def _indices(self, text: str) -> None:
        self._numbers[self._within[-1]] += len(text.split())


def _refused(*_: object) -> None:
    raise ValueError("it has a DOCTYPE: entities are not expanded, remove it")


_SIZES: dict[str, Callable[[bytes], Size]] = {
    ".stl": _stl,
    ".obj": _obj,
    ".ply": _ply,
    ".glb": _glb,
    ".dae": _dae,
}
FORMATS = tuple(_SIZES)
