"""Where a mesh that a robot's file names is: in the file's own package, or in one that ROS knows.

A page contains the meshes that it shows, and is passed on; the robot's file may come from anyone.
So only files inside these folders are read, wherever links and `..` lead.
"""

import os
from collections.abc import Iterable
from functools import cache, cached_property
from itertools import chain
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

    Attributes:
        home: the package of the robot's file; its folder, if that is in no package.
    """

    def __init__(self, folder: Path, package_dirs: Iterable[Path] = ()) -> None:
        self._folder = folder.resolve()
        named = ((_package_name(each), each) for each in (self._folder, *self._folder.parents))
        self._around = [(name, each) for name, each in named if name is not None]
        self.home = self._around[0][1] if self._around else self._folder
        self._dirs = [each.resolve() for each in package_dirs]
        self._packages_in = cache(_packages_in)  # a file may name thousands of packages

    def find(self, name: str) -> Path:
        """Return the real path of a mesh, links followed.

        Raises:
            InvalidInput: it is missing, lies outside the folders that may be read, or belongs to a
                package that is not found.
        """
        scheme, mark, path = name.partition("://")
        if not mark:
            return self._inside(name, [self._folder / name])
        if scheme == "file" and path.startswith("/"):
            return self._inside(name, [Path(unquote(path))])
        if scheme not in ("package", "model"):
            raise InvalidInput(f"mesh {name!r} is refused: only files are read, no addresses")
        package, _, below = path.lstrip("/").partition("/")
        found = self._find_package(package)
        if found is not None:
            return self._inside(name, [found / below.lstrip("/")], found)
        # without a manifest, the folder of the robot's file may be the package, or contain it
        here = [self._folder / each.lstrip("/") for each in (path, below) if each.strip("/")]
        try:
            return self._inside(name, here, self._folder)
        except _MissingMesh:
            raise InvalidInput(
                f"mesh {name!r} is missing: package {package!r} is unknown, for {self._searched()}"
                "; name the package's folder, or the folder that contains it, in package_dirs= or "
                "--package-dir, or in the environment variable ROS_PACKAGE_PATH"
            ) from None

    def _searched(self) -> str:
        """Return where a package was looked for in vain, as a clause."""
        known = ", ".join(sorted({each for each, _ in self._around if each}))
        above = (
            f"the folders above the robot's file are other packages ({known})"
            if known
            else f"no folder above the robot's file has a {MANIFEST}"
        )
        given = ", ".join(map(str, self._dirs))
        return above + (
            f" and no folder of that name, or with that name in its {MANIFEST}, is in {given}"
            if given
            else ""
        )

    def _inside(self, name: str, places: list[Path], package: Path | None = None) -> Path:
        """Return the real path of the first place that exists.

        Places outside the package are refused; without one, those outside all that may be read.
        """
        roots = [package] if package else [self.home, *self._dirs, *self._ros]
        try:
            found = [place.resolve() for place in places]
            present = [place for place in found if place.exists()]
        except (OSError, ValueError, RuntimeError) as error:  # links in a circle, a NUL
            raise InvalidInput(f"mesh {name!r} cannot be found ({error})") from None
        if not all(any(place.is_relative_to(root) for root in roots) for place in found):
            remedy = "" if package else "; name its folder in package_dirs= or --package-dir"
            raise InvalidInput(f"mesh {name!r} is refused: it lies outside {roots[0]}{remedy}")
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
        own = [folder for known, folder in self._around if name in (known, folder.name)]
        found = chain(
            (self._look_in(folder, name) for folder in self._dirs),
            own,
            (self._look_in(folder, name) for folder in self._ros),
        )
        return next((folder for folder in found if folder is not None), None)

    def _look_in(self, folder: Path, name: str) -> Path | None:
        """Return the package of a name that a folder is or contains; None if there is none."""
        if folder.name == name:
            return folder
        try:
            place = (folder / name).resolve()
            if place.is_dir() and place.is_relative_to(folder):
                return place
        except (OSError, RuntimeError):  # a name that is too long, links in a circle
            return None
        return self._packages_in(folder).get(name)


class _MissingMesh(InvalidInput):
    """A mesh for which there is no file."""


def _packages_in(folder: Path) -> dict[str, Path]:
    """Return packages by name: the folder and what is in it, two levels down at most.

    Links that lead out of the folder are not followed.
    """
    found: dict[str, Path] = {}
    try:
        for pattern in (MANIFEST, f"*/{MANIFEST}", f"*/*/{MANIFEST}"):
            for manifest in sorted(folder.glob(pattern)):
                place = manifest.parent.resolve()
                name = _package_name(place) if place.is_relative_to(folder) else None
                if name is not None:
                    found.setdefault(name, place)
    except (OSError, RuntimeError):  # a folder that cannot be read, links in a circle
        pass
    return found


def _package_name(folder: Path) -> str | None:
    """Return the name of the ROS package that a folder is; None where it is none."""
    manifest = folder / MANIFEST
    try:
        root = parse_xml(read_text(manifest, str(manifest), MAX_BYTES, FaultyFile))
    except ValueError:  # there is none, or it cannot be read
        return None
    return (root.findtext("name") or "").strip() if root.tag == "package" else None
