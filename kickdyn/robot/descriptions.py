"""Robots by the names of the package robot_descriptions, which downloads their files."""

import sys
from contextlib import redirect_stdout
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path

from kickdyn.errors import InvalidInput

DESCRIPTION = "_description"
"""How the names of that package end."""

INSTALL = 'pip install "kickdyn[descriptions]"'


@dataclass(frozen=True)
class Description:
    """The file of a robot, in the cache of robot_descriptions.

    Attributes:
        file: a URDF or an MJCF.
        is_mjcf: which of them.
        folders: of the robot's package, where its meshes and other files are.
    """

    file: Path
    is_mjcf: bool
    folders: tuple[Path, ...]


def find_description(name: str, other_names: list[str]) -> Description:
    """Return the files of a robot, downloaded the first time.

    Args:
        name: of a module of robot_descriptions, such as `atlas_v4_description`.
        other_names: names of robots that are known without the package, for the error.

    Raises:
        InvalidInput: no such name, the package is not installed, a download fails, or there is
            neither a URDF nor an MJCF.
    """
    known = _names()
    if name not in known:
        near = get_close_matches(str(name)[:200], [*other_names, *known], 1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        more = "a name of robot_descriptions" if known else f"install more with {INSTALL}"
        raise InvalidInput(
            f"robot {name!r} is unknown: {hint}choose {', '.join(other_names)}, or {more}"
        )
    reason = None
    try:
        with redirect_stdout(sys.stderr):  # it prints what it downloads
            module = import_module(f"robot_descriptions.{name}")
    except Exception as error:  # of git, of files, of a network
        reason = _reason(error)
    if reason is not None:  # not raised above: the line of its progress ends with the exception
        raise InvalidInput(
            f"robot {name!r} is not on this machine, and cannot be downloaded ({reason}): "
            "the download needs git and, once, the network; or set ROBOT_DESCRIPTIONS_CACHE to a "
            "folder that has it"
        )
    path = getattr(module, "URDF_PATH", None) or getattr(module, "MJCF_PATH", None)
    if path is None:
        raise InvalidInput(
            f"robot {name!r} has neither a URDF nor an MJCF: make a URDF of its xacro file, and "
            "read it with Leg.from_urdf"
        )
    package, repository = Path(module.PACKAGE_PATH), Path(module.REPOSITORY_PATH)
    folders = (package, repository, package.parent)
    return Description(Path(path), not hasattr(module, "URDF_PATH"), folders)


def _names() -> list[str]:
    """Return the names of robot_descriptions; none if it is not installed."""
    try:
        from robot_descriptions import DESCRIPTIONS
    except ImportError:
        return []
    return list(DESCRIPTIONS)


def _reason(error: Exception) -> str:
    """Return the first line that says what went wrong, git's own before that of its wrapper."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    fatal = [line.partition("fatal: ")[2].rstrip("'") for line in lines if "fatal: " in line]
    return (fatal or lines or [type(error).__name__])[0][:200]
