"""What `kickdyn` can do: every command, , loaded when it is asked for."""

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
    "posture-sweep": (
        "kickdyn.cli.posture_sweep_command",
        "posture_sweep",
        "Kick from a grid of postures.",
    ),
    "plan": ("kickdyn.cli.plan_command", "plan", "From a wished-for flight to the kick."),
    "paper": ("kickdyn.cli.paper_command", "paper", "Reproduce the ICRA 2005 paper, item by item."),
    "tradeoff": ("kickdyn.cli.tradeoff_command", "tradeoff", "Measure error against cost."),
    "extremes": ("kickdyn.accuracy.extremes", "extremes", "Compare with 50 digits at extremes."),
    "view": ("kickdyn.cli.view_command", "view", "Show a scene file as a 3-D page or a picture."),
}
"""Module, name and summary of each command. A module is loaded when its command is."""


class _Place(click.types.StringParamType):
    """A text that names a file, which a shell completes; or a leg or a scene, by name or file."""

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete names of files, and of legs or scenes where one is asked for."""
        found = [CompletionItem(name) for name in _names(param) if name.startswith(incomplete)]
        return [CompletionItem(incomplete, type="file"), *found]  # bash drops what is before a file


def _names(param: click.Parameter) -> list[str]:
    if param.name == "leg_name":
        from kickdyn.cli.named_inputs import LEGS

        return [*LEGS]
    if param.name in ("scene", "scene_file"):
        return sorted(scene.stem for scene in shipped("scenes").glob("*.toml"))
    return []


class _Commands(click.Group):
    """A group that says what it has without loading it."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names."""
        return [*COMMANDS, *self.commands]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command, loaded now."""
        if cmd_name not in COMMANDS:
            return super().get_command(ctx, cmd_name)
        module, name, _ = COMMANDS[cmd_name]
        found: click.Command = getattr(import_module(module), name)
        for each in found.params:
            if each.type is click.STRING and re.search("FILE|DIR|SCENE", each.metavar or ""):
                each.type = _Place()
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a line for each."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, self._summary(name)) for name in self.list_commands(ctx)])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete names of commands, and options before them."""
        names = [name for name in self.list_commands(ctx) if name.startswith(incomplete)]
        items = [CompletionItem(name, help=self._summary(name)) for name in names]
        return [*items, *click.Command.shell_complete(self, ctx, incomplete)]

    def _summary(self, name: str) -> str:
        return COMMANDS[name][2] if name in COMMANDS else self.commands[name].get_short_help_str()


@click.group("kickdyn", _Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="kickdyn")
def kickdyn_command() -> None:
    """Impact of a leg on a ball: impulses, launch, flight."""


@kickdyn_command.command("completion", short_help="Teach bash, zsh or fish to complete.")
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
