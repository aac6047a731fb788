"""Where `kickdyn` begins: with next to no imports, so that Ctrl-C ends even those in one line."""

from __future__ import annotations

import sys
from typing import NoReturn


def main() -> NoReturn:
    """Run the console script."""
    try:
        from kickdyn.commands import kickdyn_command
        from kickdyn.door import run

        run(kickdyn_command)
    except KeyboardInterrupt:
        print("kickdyn: interrupted", file=sys.stderr)
        sys.exit(1)
