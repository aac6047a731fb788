"""Compiling with numba, and keeping the machine code on disk, for compiling takes seconds."""

import gc
import logging
import os
import pickle
import subprocess
import sys
import types
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

log = logging.getLogger(__name__)
"""Says at level INFO what is compiled."""

_CALL = """
import os, pickle, sys, threading
sys.path[:], module, name = pickle.load(sys.stdin.buffer)
arguments = pickle.load(sys.stdin.buffer)
threading.Thread(target=lambda: (os.read(0, 1), os._exit(1)), daemon=True).start()
getattr(__import__(module, fromlist=[name]), name)(*arguments)
"""
"""Program of a process that calls a function whose machine code it shall leave on the disk.

It ends with its parent, even if that is killed: then its input ends.
"""


@contextmanager
def uncollected() -> Iterator[None]:
    """Stop Python's search for cyclic garbage, which takes a fifth of the time of a compilation."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def named(
    function: Callable[..., Any], name: str, *modules: types.ModuleType
) -> Callable[..., Any]:
    """Return a function under the name by which its machine code is kept on disk.

    numba looks for changes in the function's own file only, so the contents of the `modules` that
    it calls are part of the name. The linker goes by names too: of two functions of one name, each
    compiled in its own process and kept on disk, it would call the one loaded first for both.
    """
    sources = b"".join(Path(str(module.__file__)).read_bytes() for module in modules)
    function.__qualname__ = f"{name}_{zlib.crc32(sources):08x}" if modules else name
    return function


def is_kept(function: Callable[..., Any]) -> bool | None:
    """Return whether the machine code of a function is on disk; None where it cannot be kept."""
    import numba  # here, because it takes long to import

    try:
        folder = Path(str(numba.njit(cache=True)(function).stats.cache_path))
    except (RuntimeError, OSError):  # no folder that can be written to
        return None
    return any(folder.glob(f"*.{function.__qualname__}-*.nbi"))


@contextmanager
def calling_beside(what: str, function: Callable[..., Any], *arguments: Any) -> Iterator[None]:
    """Call a function that compiles `what` in another process, and wait for it at the end.

    The function is one of a module; its result and its errors are lost. It is called for the
    machine code that it leaves on disk. Where an error or Ctrl-C comes first, the other process is
    ended. It is not called where this process has one core, or where
    the arguments cannot be sent.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        target = pickle.dumps((sys.path, function.__module__, function.__name__))
        sent = target + pickle.dumps(arguments)
    except (pickle.PicklingError, AttributeError, TypeError):
        sent = b""
    if not sent or not sys.executable or cores == 1:
        yield
        return
    log.info("compiling %s in another process", what)
    lost = subprocess.DEVNULL
    with subprocess.Popen(
        [sys.executable, "-P", "-c", _CALL], stdin=subprocess.PIPE, stdout=lost, stderr=lost
    ) as process:
        assert process.stdin is not None
        with suppress(BrokenPipeError):
            process.stdin.write(sent)
            process.stdin.flush()
        try:
            yield
            process.wait()
        finally:
            process.terminate()


def compiled(
    function: Callable[..., Any], signature: Any, what: str, **options: Any
) -> Callable[..., Any]:
    """Return a function compiled for a signature; its machine code is kept on disk if possible.

    The log calls the function `what`, where it is compiled.

    numba looks for changes in the function's own file only: what is made of other files must have
    their contents among the variables of its closure, which are part of its key on disk.
    """
    import numba  # here, because it takes long to import

    if not is_kept(function):
        log.info("compiling %s", what)
    with uncollected():
        try:
            return numba.njit(signature, cache=True, nogil=True, **options)(function)  # type: ignore[no-any-return]
        except (RuntimeError, OSError):  # no folder that can be written to
            return numba.njit(signature, nogil=True, **options)(function)  # type: ignore[no-any-return]
