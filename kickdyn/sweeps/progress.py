"""How far a sweep is: speed, time left and the best so far, for who sits at a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Column
from rich.text import Text

from kickdyn.core.compilation import busy
from kickdyn.sweeps.block import Space
from kickdyn.sweeps.chunk_log import ChunkLog

PATIENCE = 1.0
"""After how long a sweep that has not begun says why [s]."""

COMPILING = "compiling, this once"

Best = tuple[float, int]
"""Ball speed [m/s] and number of a posture."""


class Done(Protocol):
    """What moves the bar."""

    def __call__(self, count: int, best: Best | None = None) -> None:
        """Take postures done since the last call, and the best of them, if known."""


class Rate(ProgressColumn):
    """Postures per second, lately; what was there before a resumed sweep does not count."""

    def render(self, task: Task) -> Text:
        """Return the speed as text."""
        return Text("" if task.speed is None else f"{task.speed:,.0f}/s")


class Said(ProgressColumn):
    """The best so far; before there is one, why it takes so long."""

    def render(self, task: Task) -> Text:
        """Return it as text."""
        slow = busy.is_set() and (task.elapsed or 0.0) >= PATIENCE
        return Text(task.fields["best"] or (COMPILING if slow else ""))


class Watch:
    """What the chunks of a store under way say is best.

    Whoever computes a chunk, thread, process or cluster, leaves a note in the store.
    """

    def __init__(self, store: Path) -> None:
        self._notes, self._read = ChunkLog(store), set[int]()
        self.best: Best | None = None

    def look(self) -> Best | None:
        """Read new notes; return the best so far."""
        for k in self._notes.done():
            if k in self._read:
                continue
            self._read.add(k)
            with suppress(OSError):  # the store is finished, and tidied up
                found = self._notes.read(k)["best"]
                if found is not None:
                    self.best = better(self.best, (found[0], found[1]))
        return self.best


def better(one: Best | None, other: Best | None) -> Best | None:
    """Return the faster of two, of equals the first posture."""
    found = [each for each in (one, other) if each is not None]
    return max(found, key=lambda each: (each[0], -each[1]), default=None)


@contextmanager
def progress(
    space: Space, store: Path | None = None, *, console: Console | None = None
) -> Iterator[Done]:
    """Show a bar while stderr is a terminal, else nothing; `NO_COLOR` is heeded (rich).

    Args:
        space: the joints.
        store: where chunks leave notes.
        console: where to show it.

    Yields:
        What moves it.
    """
    quiet = console is None and not sys.stderr.isatty()
    console = console or Console(stderr=True)
    columns = (
        TextColumn("postures"), BarColumn(8), TaskProgressColumn(), Rate(),
        TimeRemainingColumn(compact=True),
        Said(table_column=Column(ratio=1, no_wrap=True)),
    )  # fmt: skip
    watch = Watch(store) if store is not None else None
    with Progress(*columns, console=console, transient=True, disable=quiet, expand=True) as bar:
        task = bar.add_task("sweep", total=space.size, best="")
        top: Best | None = None

        def done(count: int, best: Best | None = None) -> None:
            nonlocal top
            if quiet:
                return
            top = better(top, watch.look() if watch is not None else best)
            said = "" if top is None else f"best {top[0]:.4g} m/s at {_brief(space, top[1])}"
            bar.update(task, advance=count, best=said)

        yield done


def _brief(space: Space, number: int) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in space.angles(number).items())
