"""Where a mesh that a robot's file names is: in the file's own package, or in one that ROS knows.

A page contains the meshes that it shows, and is passed on; the robot's file may come from anyone.
So only files inside these folders are read, wherever links and `..` lead.
"""

import os
from collections.abc import Iterable
from functools import cache, cached_property
from pathlib import Path
from urllib.parse import unquote

from kickdyn.core.files import read_text
from kickdyn.core.xml_text import parse_xml
from kickdyn.errors import FaultyFile, InvalidInput

MANIFEST = "package.xml"
"""The file that makes a folder a ROS package, and has its name (REP 149)."""

MAX_BYTES = 1_000_000
"""Size of the largest manifest that is read."""


class MeshFinder:
    """Finds the files of meshes by the names that a robot's file has for them.

    A name is a path relative to the robot's file; an absolute one, with `file://` or without; or
    `package://NAME/...`, also written `model://NAME/...`. A package is looked up in `package_dirs`,
    then among the folders that contain the robot's file, then in those of ROS.

    Args:
        folder: of the robot's file.
        package_dirs: packages, or folders that contain packages.
    """

    def __init__(self, folder: Path, package_dirs: Iterable[Path] = ()) -> None:
        self._folder = folder.resolve()
        above = [self._folder, *self._folder.parents]
        self._around = [each for each in above if _package_name(each) is not None]
        self._home = self._around[0] if self._around else self._folder
        self._dirs = [each.resolve() for each in package_dirs]
        self._package = cache(self._find_package)

    def find(self, name: str) -> Path:
        """Return the real path of a mesh, links followed.

        Raises:
            InvalidInput: it is missing, lies outside the folders that may be read, or belongs to a
                package that is not found.
        """
        scheme, mark, path = name.partition("://")
        if not mark:
            return self._inside(name, [self._folder / name], [self._home, *self._dirs, *self._ros])
        if scheme == "file" and path.startswith("/"):
            return self._inside(name, [Path(unquote(path))], [self._home, *self._dirs, *self._ros])
        if scheme not in ("package", "model"):
            raise InvalidInput(f"mesh {name!r} is refused: only files are read, no addresses")
        package, _, below = path.lstrip("/").partition("/")
        found = self._package(package)
        if found is not None:
            return self._inside(name, [found / below.lstrip("/")], [found])
        # without a manifest, the folder of the robot's file may be the package, or contain it
        here = [self._folder / each.lstrip("/") for each in (path, below) if each.strip("/")]
        try:
            return self._inside(name, here, [self._folder])
        except _MissingMesh:
            raise InvalidInput(
                f"mesh {name!r} is missing: package {package!r} is unknown, name its folder in "
                "package_dirs (--package-dir) or ROS_PACKAGE_PATH"
            ) from None

    def _inside(self, name: str, places: list[Path], roots: list[Path]) -> Path:
        """Return the real path of the first place that exists; refuse any outside the roots."""
        try:
            found = [place.resolve() for place in places]
            present = [place for place in found if place.exists()]
        except (OSError, ValueError, RuntimeError) as error:  # links in a circle, a NUL
            raise InvalidInput(f"mesh {name!r} cannot be found ({error})") from None
        if not all(any(place.is_relative_to(root) for root in roots) for place in found):
            raise InvalidInput(f"mesh {name!r} is refused: it lies outside {roots[0]}")
        if not present:
            raise _MissingMesh(f"mesh {name!r} is missing from {roots[0]}")
        return present[0]

    @cached_property
    def _ros(self) -> list[Path]:
        """The folders of packages that the environment names, of ROS 1 and of ROS 2."""
        folders = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
        prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        named = [Path(each) for each in folders if each]
        named += [Path(each) / "share" for each in prefixes if each]
        return [each.resolve() for each in named if each.is_absolute()]

    def _find_package(self, name: str) -> Path | None:
        """Return the folder of a package; None where there is none of that name."""
        if name in ("", ".", "..") or "\0" in name:
            return None
        for folder in self._dirs:
            if folder.name == name:
                return folder
            if (found := _below(folder, name)) is not None:
                return found
        for folder in self._around:
            if name in (folder.name, _package_name(folder)):
                return folder
        in_ros = (_below(folder, name) for folder in self._ros)
        return next((folder for folder in in_ros if folder is not None), None)


class _MissingMesh(InvalidInput):
    """A mesh for which there is no file."""


def _below(folder: Path, name: str) -> Path | None:
    """Return the package of a name that is a folder or contained in it, two levels down at most.

    Links that lead out of the folder are not followed.
    """
    try:
        if _package_name(folder) == name:
            return folder
        manifests = (*folder.glob(f"*/{MANIFEST}"), *folder.glob(f"*/*/{MANIFEST}"))
        named = [each.parent for each in sorted(manifests) if _package_name(each.parent) == name]
        for place in (folder / name, *named):
            found = place.resolve()
            if found.is_dir() and found.is_relative_to(folder):
                return found
    except (OSError, RuntimeError):  # a folder that cannot be read, links in a circle
        pass
    return None


def _package_name(folder: Path) -> str | None:
    """Return the name of the ROS package that a folder is; None where it is none."""
    manifest = folder / MANIFEST
    try:
        root = parse_xml(read_text(manifest, str(manifest), MAX_BYTES, FaultyFile))
    except ValueError:  # there is none, or it cannot be read
        return None
    return (root.findtext("name") or "").strip() if root.tag == "package" else None
