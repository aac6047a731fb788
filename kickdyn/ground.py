"""The ground the ball comes down on."""

from __future__ import annotations

from dataclasses import dataclass

from kickdyn import checks


@dataclass(frozen=True)
class Ground:
    """A level plane; a flight ends where the ball's lowest point touches it.

    Args:
        height: of the plane [m, world frame z].
    """

    height: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "height", checks.number("ground height", self.height, unit="m"))
