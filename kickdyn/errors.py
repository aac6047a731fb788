"""What kickdyn raises: one clear line that names the value and what would be valid."""

from __future__ import annotations

from collections.abc import Sequence


def printable(text: str) -> str:
    """Return a text with its control characters as escapes: a terminal would obey them."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class KickdynError(Exception):
    """Base of every error kickdyn raises on purpose."""


class InvalidInput(KickdynError, ValueError):
    """A value that cannot be used; the message names it and says what is valid."""


class UrdfError(InvalidInput):
    """A robot description that is refused, with every fault found in it.

    Attributes:
        source: the file, as the caller named it.
        faults: one line per fault, in the order of the file.
    """

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.source = source
        self.faults = tuple(faults)
        super().__init__(f"{source}: {'; '.join(self.faults)}")

    def __reduce__(self) -> tuple[type[UrdfError], tuple[str, tuple[str, ...]]]:
        return (UrdfError, (self.source, self.faults))


class SceneError(InvalidInput):
    """A scene that is refused, with every fault found in it, one line each.

    Attributes:
        source: the file, as the caller named it.
        faults: one line per fault.
    """

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.source = printable(source)
        self.faults = tuple(printable(fault) for fault in faults)
        super().__init__("\n".join([f"{self.source}:", *self.faults]))

    def __reduce__(self) -> tuple[type[SceneError], tuple[str, tuple[str, ...]]]:
        return (SceneError, (self.source, self.faults))


class Unfinished(KickdynError):
    """Stopped before the end; what is done stays, and can be gone on with."""


class NoImpact(KickdynError):
    """The foot does not move towards the ball along the contact normal: nothing is struck."""


class EnergyCreated(KickdynError):
    """A law gives leg and ball more kinetic energy than they had; raised by `strict=True` only."""
