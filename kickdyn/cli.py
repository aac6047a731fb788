"""The console script `kickdyn`: every door as a sub-command."""

from __future__ import annotations

from typing import NoReturn

import click

from kickdyn.door import run
from kickdyn.paper.command import paper
from kickdyn.plan import plan
from kickdyn.posture_sweep import posture_sweep
from kickdyn.tradeoff import tradeoff
from kickdyn.version import __version__


@click.group("kickdyn", context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="kickdyn")
def kickdyn_command() -> None:
    """Impact of a leg on a ball: impulses, launch, flight."""


kickdyn_command.add_command(posture_sweep)
kickdyn_command.add_command(paper)
kickdyn_command.add_command(plan)
kickdyn_command.add_command(tradeoff)


def main() -> NoReturn:
    """Run the console script."""
    run(kickdyn_command)
