"""The commands of `kickdyn`: a table, from which each is imported when it is called.

Every command ends with 0 if it is done, 2 for bad input with a line per fault, 1 for all else.
"""

import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, NoReturn

import click

from kickdyn._version import __version__
from kickdyn.errors import (
    FaultyFile,
    InvalidInput,
    KickdynError,
    NoImpact,
    SceneError,
    printable,
    shortened,
    without_long_words,
)

HELP_OPTIONS = {"help_option_names": ["-h", "--help"]}
"""Settings of click: the names of the option that shows the help."""


class Command(click.Command):
    """A command that refuses options and arguments whose text is empty."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **{"context_settings": HELP_OPTIONS, **settings})

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments of a command line into the context."""
        remaining = super().parse_args(ctx, args)
        for param in self.params:
            value = ctx.params.get(param.name or "")
            if not ctx.resilient_parsing and "" in (value if isinstance(value, tuple) else [value]):
                name = param.opts[0] if isinstance(param, click.Option) else param.metavar
                raise InvalidInput(f"{name} is empty: it needs a value")
        return remaining


def check_page_name(page: str) -> None:
    """Raise `InvalidInput` unless a page, or a picture of one, can be written under a name."""
    from kickdyn.core.files import checked_ending  # imports NumPy

    if checked_ending(page, (".html", ".htm", ".png"), "a page is written as") == ".png":
        from kickdyn.view.document import find_browser

        find_browser()


@contextmanager
def busy(activity: str) -> Iterator[Callable[[str], None]]:
    """Show progress on a terminal; yields a function that replaces the activity shown."""
    from rich.console import Console  # takes a tenth of a second to import

    with Console(stderr=True).status(activity) as status:
        yield status.update


def print_wrapped(text: str, indent: int = 8) -> None:
    """Print a text as wide as the screen is; continued lines are indented."""
    from kickdyn.core.representation import screen_width, wrapped  # rich takes time to import

    width = screen_width()
    click.echo("\n".join(wrapped(line, width, indent) for line in text.splitlines()))


def warn(warnings: Iterable[str]) -> None:
    """Write warnings to standard error, a line each."""
    for warning in warnings:
        click.echo(f"warning: {printable(warning)}", err=True)


def run(command: click.Command) -> NoReturn:
    """Run a command with the arguments of this process, and exit.

    Whatever goes wrong ends in one line per fault on standard error, `kickdyn: ...`, not in a
    traceback.
    """
    name = command.name or "kickdyn"
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # for names the terminal cannot show
    try:
        command.main(standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help() if error.ctx else "")
    except click.exceptions.Exit as end:
        sys.exit(end.exit_code)
    except click.ClickException as error:
        _fail(name, 2, error.format_message())
    except SceneError as error:
        _fail(name, 2, *(f"{shortened(error.source)}: {fault}" for fault in error.faults))
    except (FaultyFile, NoImpact) as error:
        _fail(name, 2, str(error))
    except InvalidInput as error:
        _fail(name, 2, *error.faults)
    except KickdynError as error:
        _fail(name, 1, str(error))
    except (KeyboardInterrupt, click.Abort):
        _fail(name, 1, "interrupted")
    except BrokenPipeError:  # the reader of a pipe, such as head, has ended
        _end_output()
        sys.exit(1)
    except OSError as error:
        _end_output()
        file = "" if error.filename is None else f"{shortened(str(error.filename))}: "
        _fail(name, 1, f"{file}{error.strerror or error}")
    sys.exit(0)


def _end_output() -> None:
    """Flush standard output, or discard it: Python would otherwise fail again when it exits."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(name: str, code: int, *faults: str) -> NoReturn:
    for fault in faults:
        print(f"{name}: {printable(without_long_words(' '.join(fault.split())))}", file=sys.stderr)
    sys.exit(code)


COMMANDS = {
    "check": ("check_commands", "Say what kickdyn sees in a file, and what is wrong with it."),
    "check-motion": ("check_commands", "Strike a ball in each frame of a recorded motion."),
    "posture-sweep": ("posture_sweep_command", "Kick from a grid of postures."),
    "plan": ("plan_command", "Plan a kick for a given target."),
    "reach": ("range_commands", "Find the largest launch in each direction."),
    "kick-library": ("range_commands", "Plan motions for a range of launches."),
    "paper": ("paper_command", "Reproduce the ICRA 2005 paper, item by item."),
    "tradeoff": ("scene_commands", "Measure what each effect of a scene changes."),
    "simulate": ("scene_commands", "Simulate a scene file to a tolerance."),
    "tune-mujoco": ("tune_mujoco_command", "Find contact parameters for a ball in MuJoCo."),
    "identify": ("identify_command", "Fit launch, spin and drag to a measured ball track."),
    "view": ("scene_commands", "Show a scene file as a 3-D page or a picture."),
}
"""Each command, the file of `kickdyn.cli` with its function, and its summary.

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
            module = import_module(f"kickdyn.cli.{COMMANDS[name][0]}")
            command = getattr(module, name.replace("-", "_"))
        return name, command, remaining


@click.group("kickdyn", _Commands, context_settings=HELP_OPTIONS)
@click.version_option(__version__, prog_name="kickdyn")
def kickdyn_command() -> None:
    """Impact of a leg on a ball: impulses, launch, flight."""


for _name, (_, _summary) in COMMANDS.items():
    kickdyn_command.add_command(click.Command(_name, short_help=_summary))


def main() -> NoReturn:
    """Run `kickdyn COMMAND`, the console script."""
    run(kickdyn_command)
