"""How every command runs and ends: 0 done, 2 bad input with a line per fault, 1 anything else."""

import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import NoReturn

import click

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


@contextmanager
def busy(activity: str) -> Iterator[Callable[[str], None]]:
    """Show on standard error, while it is a terminal, what a command is doing.

    It yields a function that replaces the activity shown, such as "planning the swing".
    """
    from rich.console import Console  # takes a tenth of a second to import

    with Console(stderr=True).status(activity) as status:
        yield status.update


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
    except FaultyFile as error:
        _fail(name, 2, str(error))
    except InvalidInput as error:
        _fail(name, 2, *error.faults)
    except NoImpact as error:
        _fail(name, 2, str(error))
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
    """Write what standard output still holds, or discard it, lest Python tries again at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(name: str, code: int, *faults: str) -> NoReturn:
    """Exit with a code, after a line on standard error for each fault."""
    for fault in faults:
        line = without_long_words(" ".join(fault.split()))
        print(f"{name}: {printable(line)}", file=sys.stderr)
    sys.exit(code)
