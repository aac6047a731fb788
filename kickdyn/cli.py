"""Where the script `kickdyn` begins."""

from __future__ import annotations

from typing import NoReturn

from kickdyn.door import enter


def main() -> NoReturn:
    """Run the console script."""
    enter("kickdyn", "kickdyn.commands", "kickdyn_command")
