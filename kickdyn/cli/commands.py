"""The commands of `kickdyn`: a table, from which each is imported when it is called."""

import re
from difflib import get_close_matches
from importlib import import_module
from typing import NoReturn

import click
from click.shell_completion import CompletionItem, get_completion_class

from kickdyn._version import __version__
from kickdyn.cli.command import run
from kickdyn.core.files import shipped
from kickdyn.errors import InvalidInput

COMMANDS = {
    "posture-sweep": "Kick from a grid of postures.",
    "plan": "Plan a kick for a given target.",
    "paper": "Reproduce the ICRA 2005 paper, item by item.",
    "tradeoff": "Measure error against cost.",
    "simulate": "Simulate a scene file to a tolerance.",
    "tune-mujoco": "Find contact parameters for a ball in MuJoCo.",
    "identify": "Fit launch, spin and drag to a measured ball track.",
    "view": "Show a scene file as a 3-D page or a picture.",
}
"""Each command and its summary: `plan` is the function `plan` of `kickdyn.cli.plan_command`.

Tests require an example and the option `--json` in its help, and its row
and options in `docs/reference/commands.md`.
"""


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


class _JointName(click.types.StringParamType):
    """A text that begins with the name of a joint of the leg that the command line names."""

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the names that begin so, with `=` where a value follows."""
        from kickdyn.cli.named_legs import load_leg  # imports Pinocchio

        given = ctx.params
        try:
            leg = load_leg(given.get("leg_name") or "human", given.get("frame"))
        except (InvalidInput, OSError):
            return []
        value = "=" if "=" in (param.metavar or "") else ""
        names = [f"{name}{value}" for name in leg.joint_names]
        return [CompletionItem(name) for name in names if name.startswith(incomplete)]


class _Commands(click.Group):
    """A group whose commands are a summary each until one of them is called, and imported."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that is named first; an unknown one is refused with a suggestion."""
        near = get_close_matches(args[0][:100], self.commands, 1)
        if near and near[0] != args[0] and not args[0].startswith("-"):
            ctx.fail(f"No such command '{args[0]}'. Did you mean '{near[0]}'?")
        name, command, rest = super().resolve_command(ctx, args)
        return name, _imported(name) if name in COMMANDS else command, rest


def _imported(name: str) -> click.Command:
    """Return a command of the table, its parameters ready for completion."""
    name = name.replace("-", "_")
    command: click.Command = getattr(import_module(f"kickdyn.cli.{name}_command"), name)
    for param in command.params:
        if param.type is click.STRING and re.search("FILE|DIR|SCENE", param.metavar or ""):
            param.type = _FileOrName()
        if param.name in ("joints", "locked", "stiff_joints"):
            param.type = _JointName()
    return command


_BARE = "COMPREPLY+=($value)"
"""How the script for bash takes a name: blanks split it, and stars are replaced by files."""

_QUOTED = """COMPREPLY+=("$(printf %q "$value")")
            [[ $value == *= ]] && compopt -o nospace"""
"""The same, the name quoted where it has to be, and no blank after an `=`."""


@click.group("kickdyn", _Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="kickdyn")
def kickdyn_command() -> None:
    """Impact of a leg on a ball: impulses, launch, flight."""


for _name, _summary in COMMANDS.items():
    kickdyn_command.add_command(click.Command(_name, short_help=_summary))


@kickdyn_command.command("completion", short_help="Make bash, zsh or fish complete commands.")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the script by which a shell completes commands and options.

    Example: source <(kickdyn completion bash)
    """
    kind = get_completion_class(shell)
    if kind is not None:
        script = kind(kickdyn_command, {}, "kickdyn", "_KICKDYN_COMPLETE").source()
        click.echo(script.replace(_BARE, _QUOTED))


def main() -> NoReturn:
    """Run `kickdyn COMMAND`, the console script."""
    run(kickdyn_command)
