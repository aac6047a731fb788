"""Reading a URDF file: a regular file of sane size, strict XML, and a sound robot."""

from __future__ import annotations

import stat
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree

from kickdyn.core.resources import shipped
from kickdyn.errors import InvalidInput, UrdfError
from kickdyn.robot.urdf_validation import faults_of

MAX_BYTES = 20_000_000
MAX_DEPTH = 32


@dataclass(frozen=True)
class UrdfFile:
    """The text of a URDF that passed every check, and where it came from.

    Attributes:
        text: the document as it was checked, written out anew; everything later is read from it,
            never from the file again.
        folder: where the file lies, for its meshes.
        source: the file as the caller named it.
    """

    text: str
    folder: Path
    source: str


def read_urdf(path: str | PathLike[str]) -> UrdfFile:
    """Read and check a URDF file.

    Raises:
        UrdfError: with all faults of the file in one message.
        InvalidInput: `path` is no path at all.
    """
    urdf = read_document(path)
    faults = faults_of(ElementTree.fromstring(urdf.text))
    if faults:
        raise UrdfError(urdf.source, faults)
    return urdf


def read_document(path: str | PathLike[str]) -> UrdfFile:
    """Read a URDF file as `read_urdf` does, without judging the robot that it describes."""
    try:
        file, source = Path(path), str(path)
    except TypeError:
        raise InvalidInput(f"URDF path is {path!r}: it must be a str or a Path") from None
    root = _parse(_decode(_read(file, source), source), source)
    # Written anew, so that Pinocchio's parser cannot read what ours did not: theirs keeps line
    # ends inside a name, for one.
    text = ElementTree.tostring(root, encoding="unicode")
    return UrdfFile(text, file.resolve().parent, source)


def shipped_urdf(name: str) -> Path:
    """Return the path of a URDF that comes with kickdyn."""
    return shipped("urdf") / name


def _read(file: Path, source: str) -> bytes:
    try:
        status = file.stat()
        if not stat.S_ISREG(status.st_mode):  # a FIFO would block for ever, /dev/zero never end
            raise UrdfError(source, ["is not a regular file"])
        if status.st_size > MAX_BYTES:
            raise UrdfError(source, [f"has {status.st_size} bytes: at most {MAX_BYTES} are read"])
        return file.read_bytes()
    except UrdfError:  # a ValueError as well
        raise
    except FileNotFoundError:
        raise UrdfError(source, ["there is no such file"]) from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise UrdfError(source, [f"cannot be read ({reason})"]) from None


def _decode(raw: bytes, source: str) -> str:
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        fault = f"is not UTF-8 text (byte {error.start}): save it as UTF-8"
        raise UrdfError(source, [fault]) from None


class _StrictBuilder(ElementTree.TreeBuilder):
    """Builds the tree; refuses a DOCTYPE, and with it every entity, and absurd nesting."""

    depth = 0

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        if name.lower() == "html":
            raise _Refused("is not a URDF: it is an HTML page")
        raise _Refused("has a DOCTYPE: entities are not expanded, remove it")

    def start(self, tag: str, attrs: dict[str, str], /) -> ElementTree.Element:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise _Refused(f"nests tags deeper than {MAX_DEPTH}")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ElementTree.Element:
        self.depth -= 1
        return super().end(tag)


class _Refused(Exception):
    pass


def _parse(text: str, source: str) -> ElementTree.Element:
    if not text.strip():
        raise UrdfError(source, ["is empty"])
    try:
        parser = ElementTree.XMLParser(target=_StrictBuilder(), encoding="utf-8")
        return ElementTree.fromstring(text.encode(), parser=parser)
    except ElementTree.ParseError as error:
        raise UrdfError(source, [f"is not well-formed XML ({error})"]) from None
    except _Refused as refusal:
        raise UrdfError(source, [str(refusal)]) from None
    except (ValueError, LookupError) as error:  # an encoding declared but unknown
        raise UrdfError(source, [f"cannot be parsed ({error})"]) from None
