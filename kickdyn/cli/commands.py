"""The commands of `kickdyn`: a table, from which each is imported when it is called."""

from __future__ import annotations

import re
from importlib import import_module
from typing import NoReturn

import click
from click.shell_completion import CompletionItem, get_completion_class

from kickdyn._version import __version__
from kickdyn.cli.command import run
from kickdyn.core.files import shipped

COMMANDS = {
    "posture-sweep": "Kick from a grid of postures.",
    "plan": "Plan a kick for a given target.",
    "paper": "Reproduce the ICRA 2005 paper, item by item.",
    "tradeoff": "Measure error against cost.",
    "simulate": "Simulate a scene file to a tolerance.",
    "identify": "Fit launch, spin and drag to a measured ball track.",
    "view": "Show a scene file as a 3-D page or a picture.",
}
"""Each command and its summary: `plan` is the function `plan` of `kickdyn.cli.plan_command`."""


class _FileOrName(click.types.StringParamType):
    """A text that names a file, or a leg or a scene that comes with kickdyn."""

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the names that begin so, and leave files to the shell."""
        names = [CompletionItem(name) for name in _names(param) if name.startswith(incomplete)]
        # bash forgets what comes before a file
        return [CompletionItem(incomplete, type="file"), *names]


def _names(param: click.Parameter) -> list[str]:
    """Return the names of legs or of scenes, where a parameter takes one."""
    if param.name == "leg_name":
        from kickdyn.cli.named_legs import LEGS  # imports Pinocchio

        return [*LEGS]
    if param.name in ("scene", "scene_file"):
        return sorted(scene.stem for scene in shipped("scenes").glob("*.toml"))
    return []


class _Commands(click.Group):
    """A group that lists the commands of the table without importing them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands."""
        return [*COMMANDS, *self.commands]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command, imported now, or None where there is none of that name."""
        if cmd_name not in COMMANDS:
            return super().get_command(ctx, cmd_name)
        name = cmd_name.replace("-", "_")
        command: click.Command = getattr(import_module(f"kickdyn.cli.{name}_command"), name)
        for param in command.params:
            if param.type is click.STRING and re.search("FILE|DIR|SCENE", param.metavar or ""):
                param.type = _FileOrName()
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a line of help for each command."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, self._summary(name)) for name in self.list_commands(ctx)])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands, and the options before them, that begin so."""
        names = [name for name in self.list_commands(ctx) if name.startswith(incomplete)]
        items = [CompletionItem(name, help=self._summary(name)) for name in names]
        return [*items, *click.Command.shell_complete(self, ctx, incomplete)]

    def _summary(self, name: str) -> str:
        """Return what a command does, in one line."""
        return COMMANDS.get(name) or self.commands[name].get_short_help_str()


@click.group("kickdyn", _Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="kickdyn")
def kickdyn_command() -> None:
    """Impact of a leg on a ball: impulses, launch, flight."""


@kickdyn_command.command("completion", short_help="Make bash, zsh or fish complete commands.")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the script by which a shell completes commands and options.

    Example: source <(kickdyn completion bash)
    """
    kind = get_completion_class(shell)
    if kind is not None:
        click.echo(kind(kickdyn_command, {}, "kickdyn", "_KICKDYN_COMPLETE").source())


def main() -> NoReturn:
    """Run `kickdyn COMMAND`, the console script."""
    run(kickdyn_command)
