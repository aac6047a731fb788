"""Errors of kickdyn: one clear line that names the value and what would be valid."""

import re
from collections.abc import Sequence

LONGEST = 200
"""Characters of a value, a word or the name of a file that a message shows."""


class KickdynError(Exception):
    """Base class of every error that kickdyn raises on purpose; its message is one printable line.

    Args:
        message: line breaks in it, as in a quoted array, become blanks; long words, as
            the names of files may be, lose their middle.
    """

    def __init__(self, message: str) -> None:
        line = " ".join(line.strip() for line in message.splitlines())
        super().__init__(printable(without_long_words(line)))


class InvalidInput(KickdynError, ValueError):
    """A value that cannot be used; the message names it and says what is valid.

    Attributes:
        faults: one line per fault; the message has all of them.
    """

    faults: tuple[str, ...]

    def __init__(self, *faults: str) -> None:
        super().__init__("; ".join(faults))
        self.faults = tuple(str(KickdynError(fault)) for fault in faults)


class FaultyFile(InvalidInput):
    """A file that is refused, with all its faults.

    Attributes:
        source: the file, as the caller named it.
        faults: one line per fault, in the order of the file.
    """

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.source = printable(source)
        super().__init__(f"{shortened(self.source)}: {'; '.join(map(printable, faults))}")
        self.faults = tuple(printable(fault) for fault in faults)

    def __reduce__(self) -> "tuple[type[FaultyFile], tuple[str, tuple[str, ...]]]":
        return (type(self), (self.source, self.faults))


class UrdfError(FaultyFile):
    """A robot description that is refused; all its faults are in one line."""


class MjcfError(FaultyFile):
    """An MJCF model that is refused, with its fault."""


class SceneError(FaultyFile):
    """A scene file that is refused; of several faults, each has a line of its own."""

    def __str__(self) -> str:
        if len(self.faults) == 1:
            return f"{shortened(self.source)}: {self.faults[0]}"
        return "\n".join([f"{shortened(self.source)}:", *self.faults])


class Unfinished(KickdynError):
    """A computation that was stopped before its end; what is stored can be continued."""


class NoImpact(KickdynError):
    """The foot does not move towards the ball along the contact normal, so there is no impact."""


def printable(text: str) -> str:
    """Return a text with its control characters as escapes, which a terminal would obey."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str) -> str:
    """Return a text, such as the name of a file, without its middle if it is long."""
    if len(text) <= LONGEST:
        return text
    return f"{text[: LONGEST // 2]}...{text[-LONGEST // 2 :]}"


def without_long_words(text: str) -> str:
    """Return a text whose long words have lost their middle."""
    return re.sub(rf"\S{{{LONGEST + 1},}}", lambda word: shortened(word[0]), text)
