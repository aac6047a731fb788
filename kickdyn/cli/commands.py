"""The commands of `kickdyn`: a table, from which each is imported when it is called."""

from importlib import import_module
from typing import NoReturn

import click

from kickdyn._version import __version__
from kickdyn.cli.command import HELP_OPTIONS, run

COMMANDS = {
    "check": "Say what kickdyn sees in a file, and what is wrong with it.",
    "check-motion": "Strike a ball in each frame of a recorded motion.",
    "posture-sweep": "Kick from a grid of postures.",
    "plan": "Plan a kick for a given target.",
    "reach": "Find the largest launch in each direction.",
    "kick-library": "Plan motions for a range of launches.",
    "paper": "Reproduce the ICRA 2005 paper, item by item.",
    "tradeoff": "Measure what each effect of a scene changes.",
    "simulate": "Simulate a scene file to a tolerance.",
    "tune-mujoco": "Find contact parameters for a ball in MuJoCo.",
    "identify": "Fit launch, spin and drag to a measured ball track.",
    "view": "Show a scene file as a 3-D page or a picture.",
}
"""Each command and its summary: `plan` is the function `plan` of `kickdyn.cli.plan_command`.

Tests require an example and the option `--json` in its help, and its row
and options in `docs/reference/commands.md`.
"""


class _Commands(click.Group):
    """A group whose commands are a summary each until one of them is called, and imported."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name, command, remaining = super().resolve_command(ctx, args)
        if name in COMMANDS:
            function = name.replace("-", "_")
            command = getattr(import_module(f"kickdyn.cli.{function}_command"), function)
        return name, command, remaining


@click.group("kickdyn", _Commands, context_settings=HELP_OPTIONS)
@click.version_option(__version__, prog_name="kickdyn")
def kickdyn_command() -> None:
    """Impact of a leg on a ball: impulses, launch, flight."""


for _name, _summary in COMMANDS.items():
    kickdyn_command.add_command(click.Command(_name, short_help=_summary))


def main() -> NoReturn:
    """Run `kickdyn COMMAND`, the console script."""
    run(kickdyn_command)
