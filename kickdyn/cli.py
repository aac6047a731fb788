"""The console script `kickdyn`: every door as a sub-command."""

from __future__ import annotations

from typing import NoReturn

import click
from click.shell_completion import get_completion_class

from kickdyn.door import run
from kickdyn.paper.command import paper
from kickdyn.plan import plan
from kickdyn.posture_sweep import posture_sweep
from kickdyn.tradeoff import tradeoff
from kickdyn.version import __version__
from kickdyn.view.command import view


@click.group("kickdyn", context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="kickdyn")
def kickdyn_command() -> None:
    """Impact of a leg on a ball: impulses, launch, flight."""


kickdyn_command.add_command(posture_sweep)
kickdyn_command.add_command(paper)
kickdyn_command.add_command(plan)
kickdyn_command.add_command(tradeoff)
kickdyn_command.add_command(view)


@kickdyn_command.command("completion")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print what teaches a shell to complete commands and options.

    Example: source <(kickdyn completion bash)
    """
    kind = get_completion_class(shell)
    if kind is not None:
        click.echo(kind(kickdyn_command, {}, "kickdyn", "_KICKDYN_COMPLETE").source())


def main() -> NoReturn:
    """Run the console script."""
    run(kickdyn_command)
