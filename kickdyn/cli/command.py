"""How every command line ends: 0 done, 2 bad input in a line per fault, 1 anything else."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn

import click

from kickdyn.errors import InvalidInput, KickdynError, NoImpact, SceneError, printable


@contextmanager
def busy(what: str) -> Iterator[Callable[[str], None]]:
    """Say on stderr, while that is a terminal, what takes so long; yield what says something else.

    Args:
        what: in a few words, as "planning the swing".
    """
    from rich.console import Console  # a tenth of a second

    with Console(stderr=True).status(what) as status:
        yield status.update


def run(command: click.Command) -> NoReturn:
    """Run a command and leave the process; bad input never ends in a traceback."""
    name = command.name or "kickdyn"
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name the terminal cannot show
    try:
        command.main(standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help() if error.ctx else "")
    except click.exceptions.Exit as leave:
        sys.exit(leave.exit_code)
    except click.ClickException as error:
        _fail(name, error.format_message(), 2)
    except SceneError as error:
        _fail(name, [f"{error.source}: {fault}" for fault in error.faults], 2)
    except (InvalidInput, NoImpact) as error:
        _fail(name, str(error), 2)
    except KickdynError as error:
        _fail(name, str(error), 1)
    except (KeyboardInterrupt, click.Abort):
        _fail(name, "interrupted", 1)
    except BrokenPipeError:  # the reader has seen enough
        sys.stderr.close()
        sys.exit(1)
    except OSError as error:
        _fail(name, f"the output cannot be written ({error.strerror})", 1)
    sys.exit(0)


def _fail(name: str, messages: str | list[str], code: int) -> NoReturn:
    for message in [messages] if isinstance(messages, str) else messages:
        print(f"{name}: {printable(' '.join(message.split()))}", file=sys.stderr)
    sys.exit(code)
