"""How every command line begins and ends: 0 done, 2 bad input in a line per fault, 1 else.

It has next to no imports: Ctrl-C ends even those of a command in one line.
"""

from __future__ import annotations

import io
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from kickdyn.errors import InvalidInput, KickdynError, NoImpact, SceneError, printable

if TYPE_CHECKING:
    import click


@contextmanager
def busy(what: str) -> Iterator[Callable[[str], None]]:
    """Say on stderr, while that is a terminal, what takes so long; yield what says something else.

    Args:
        what: in a few words, as "planning the swing".
    """
    from rich.console import Console  # a tenth of a second

    with Console(stderr=True).status(what) as status:
        yield status.update


AGAIN = 0.3
"""After how long Ctrl-C in an import is tried again [s]."""


def enter(name: str, module: str, command: str) -> NoReturn:
    """Import a command and run it.

    Args:
        name: what it is called, should it end before it is there.
        module: that has it.
        command: its name there.
    """
    try:
        with _interruptible():
            found: click.Command = getattr(import_module(module), command)
        run(found)
    except KeyboardInterrupt:
        _fail(name, "interrupted", 1)


def run(command: click.Command) -> NoReturn:
    """Run a command and leave the process; bad input never ends in a traceback."""
    import click

    name = command.name or "kickdyn"
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name the terminal cannot show
    try:
        with _interruptible():
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


@contextmanager
def _interruptible() -> Iterator[None]:
    """Let Ctrl-C end imports too: some packages take it for a dependency that is not there."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield  # as whoever started this has it
        return
    signal.signal(signal.SIGINT, _interrupt)
    again = hasattr(signal, "setitimer")
    if again:
        signal.signal(signal.SIGALRM, _interrupt)
    try:
        yield
    finally:
        if again:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _interrupt(number: int, frame: FrameType | None) -> NoReturn:
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    if frame is not None and hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
    raise KeyboardInterrupt


def _fail(name: str, messages: str | list[str], code: int) -> NoReturn:
    for message in [messages] if isinstance(messages, str) else messages:
        print(f"{name}: {printable(' '.join(message.split()))}", file=sys.stderr)
    sys.exit(code)
