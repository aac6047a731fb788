"""The files of a robot: XML, read without entities, and the meshes and files that it names.

A page contains the meshes that it shows, and is passed on; the robot's file may come from anyone.
So one rule holds for all of them: a file is read if its real path, links followed, lies in a
package that contains the robot's file (in its folder, if no package does), or in a folder that the
user or ROS names. Without a package, meshes are read from folders beside the robot's, too, as from
`meshes/` beside `urdf/`.
"""

import os
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException, DTDForbidden
from defusedxml.ElementTree import fromstring

from kickdyn.core.files import check_file, read_text
from kickdyn.core.validation import brief
from kickdyn.errors import FaultyFile, InvalidInput

MAX_BYTES = 5_000_000
"""Size of the largest robot file that is read [bytes]; files of robots have up to 0.5 MB."""

MAX_DEPTH = 64
"""Levels of tags of an XML document: parsers of robots' files call themselves at each level."""

MANIFEST = "package.xml"
"""The file that makes a folder a ROS package, and has its name (REP 149)."""

MAX_LEVELS = 4
"""Folders above a robot's file, its own included, that can be a package without a manifest."""

MAX_MESH = 100_000_000
"""Size of the largest mesh that is read [bytes]: an STL file of two million triangles."""


def read_xml(
    path: str | os.PathLike[str], source: str, error: type[FaultyFile] = FaultyFile
) -> Element:
    """Return the root of an XML file of at most `MAX_BYTES`.

    Raises `error`, which calls the file `source`, unless it is a regular file of well-formed XML
    without a document type.
    """
    try:
        return parse_xml(read_text(path, source, MAX_BYTES, error))
    except FaultyFile:
        raise
    except ValueError as fault:
        raise error(source, [str(fault)]) from None


def parse_xml(text: str) -> Element:
    """Return the root of an XML document; raise `ValueError` with the reason.

    A document type, with which entities come, is refused. Whatever encoding the document declares,
    it is taken as the text that it is.
    """
    if not text.strip():
        raise ValueError("is empty")
    try:
        root: Element = fromstring(text, forbid_dtd=True)
    except DTDForbidden as error:
        if error.name.lower() == "html":
            raise ValueError("is an HTML page") from None
        raise ValueError("has a DOCTYPE: entities are not expanded, remove it") from None
    except (ParseError, DefusedXmlException, ValueError) as error:
        raise ValueError(f"is not well-formed XML ({error})") from None
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
        if depth > MAX_DEPTH:
            raise ValueError(f"nests tags deeper than {MAX_DEPTH}")
    return root


def list_folders(package_dirs: Iterable[str | os.PathLike[str]]) -> tuple[Path, ...]:
    """Return folders by their real paths; raise `InvalidInput` where there is none."""
    if isinstance(package_dirs, str | os.PathLike) or not isinstance(package_dirs, Iterable):
        raise InvalidInput(f"package_dirs is {package_dirs!r}: it must be a list of folders")
    folders = tuple(package_dirs)
    for folder in folders:
        if not isinstance(folder, str | os.PathLike) or not os.path.isdir(folder):  # noqa: PTH112
            raise InvalidInput(f"package_dirs names {brief(str(folder))}: there is no such folder")
    return tuple(Path(folder).resolve() for folder in folders)


class PackageFiles:
    """Finds files by the names that a robot's file has for them.

    A name is a path relative to the robot's file; an absolute one, with `file://` or without; or
    `package://NAME/...`, also written `model://NAME/...`. A package is looked up in `package_dirs`,
    then among the folders that contain the robot's file, then in the folders of ROS.

    Args:
        folder: of the robot's file.
        package_dirs: packages, or folders that contain packages.
    """

    def __init__(self, folder: Path, package_dirs: Iterable[Path] = ()) -> None:
        self._folder = folder.resolve()
        containing = [self._folder, *self._folder.parents]
        self._packages = [path for path in containing if _package_name(path) is not None]
        self._near = containing[:MAX_LEVELS]
        self._dirs = [path.resolve() for path in package_dirs]

    def find(self, name: str, what: str = "mesh", folder: Path | None = None) -> Path:
        """Return the real path of a file.

        Args:
            name: as the robot's file has it.
            what: the file is, for errors.
            folder: where a relative path starts; the default is the folder of the robot's file.

        Raises:
            MissingFile: there is no such file.
            InvalidInput: it lies outside the folders that may be read, or is not named by a path.
        """
        scheme, mark, path = name.partition("://")
        if not mark:
            return self._first(name, what, [(folder or self._folder) / name])
        if scheme == "file" and path.startswith("/"):
            return self._first(name, what, [Path(unquote(path))])
        if scheme not in ("package", "model"):
            raise InvalidInput(f"{what} {name!r} is refused: only files are read, no addresses")
        package, _, below = path.lstrip("/").partition("/")
        for place in self._places(package):
            if os.path.isdir(place):  # noqa: PTH112 any text may be a name
                return self._first(name, what, [place / below.lstrip("/")])
        for place in self._near:  # packages from pip have no manifest
            if place.name == package and (place / below).exists():
                return self._first(name, what, [place / below.lstrip("/")], place)
        # without a manifest, the folder of the robot's file may be the package, or contain it
        paths = [self._folder / inner.lstrip("/") for inner in (path, below) if inner.strip("/")]
        try:
            return self._first(name, what, paths)
        except MissingFile:
            raise MissingFile(
                f"{what} {name!r} is missing: package {package!r} is unknown; name the package's "
                "folder, or the folder that contains it under that name, in package_dirs= or "
                "--package-dir, or in the environment variable ROS_PACKAGE_PATH"
            ) from None

    def read_mesh(self, name: str, folder: Path | None = None) -> bytes:
        """Return the content of a mesh; raise `InvalidInput` as `find`, or if it is too large."""
        path = self.find(name, folder=folder)
        check_file(path, f"mesh {name!r}", MAX_MESH, FaultyFile)
        return path.read_bytes()

    def _first(self, name: str, what: str, paths: list[Path], package: Path | None = None) -> Path:
        """Return the real path of the first file that exists, if all may be read."""
        roots = [*(self._packages or [package or self._folder]), *self._dirs, *self._ros]
        beside = self._folder.parent if what == "mesh" and not self._packages else None
        try:
            real = [path.resolve() for path in paths]
            present = [path for path in real if path.exists()]
        except (OSError, ValueError, RuntimeError) as error:  # links in a circle, a NUL
            raise InvalidInput(f"{what} {name!r} cannot be found ({error})") from None
        for path in real:
            is_beside = beside is not None and beside in path.parent.parents
            if not is_beside and not any(path.is_relative_to(root) for root in roots):
                raise InvalidInput(
                    f"{what} {name!r} is refused: it lies outside {roots[0]}, the folder or ROS "
                    "package of the robot's file; package_dirs= or --package-dir names its folder"
                )
        if not present:
            raise MissingFile(f"{what} {name!r} is missing from {roots[0]}")
        return present[0]

    def _places(self, package: str) -> list[Path]:
        """Return the folders where a package of a name would be, in the order of the search."""
        if package in ("", ".", ".."):
            return []

        def in_or_below(folders: list[Path]) -> list[Path]:
            return [path for folder in folders for path in (*named([folder]), folder / package)]

        def named(folders: list[Path]) -> list[Path]:
            return [path for path in folders if package in (path.name, _package_name(path))]

        return [*in_or_below(self._dirs), *named(self._packages), *in_or_below(self._ros)]

    @cached_property
    def _ros(self) -> list[Path]:
        """The folders of packages that the environment names, of ROS 1 and of ROS 2."""
        folders = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
        prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        named = [Path(path) for path in folders if path]
        named += [Path(path) / "share" for path in prefixes if path]
        return [path.resolve() for path in named if path.is_absolute()]


class MissingFile(InvalidInput):
    """A robot's file names a file that does not exist."""


def _package_name(folder: Path) -> str | None:
    """Return the name of the ROS package that a folder is; None if it is none."""
    manifest = folder / MANIFEST
    try:
        root = read_xml(manifest, str(manifest))
    except ValueError:  # there is none, or it cannot be read
        return None
    return (root.findtext("name") or "").strip() if root.tag == "package" else None
