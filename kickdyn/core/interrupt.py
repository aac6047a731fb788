"""Ctrl-C that waits until what must not be torn apart is done."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from typing import Any


@contextmanager
def held() -> Iterator[None]:
    """Hold Ctrl-C back; raise `KeyboardInterrupt` in the end if there was one.

    A terminal sends it to every process. What is blocked here stays so in threads and processes
    that are begun meanwhile, which never hear it; the handler is for the threads that are there
    already.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    heard: list[int] = []
    before: Any = signal.getsignal(signal.SIGINT)
    notes = current_thread() is main_thread() and callable(before)
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    if notes:
        signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        if notes:
            signal.signal(signal.SIGINT, before)
    if heard:
        raise KeyboardInterrupt
