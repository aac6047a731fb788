"""Compiling with numba, and keeping the machine code on disk, for compiling takes seconds."""

import gc
import grp
import logging
import os
import pickle
import pwd
import stat
import subprocess
import sys
import types
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

log = logging.getLogger(__name__)
"""Says at level INFO what is compiled."""

T = TypeVar("T")

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


def cache_folder(function: Callable[..., Any]) -> Path | None:
    """Return the folder in which numba keeps a function's machine code; None without a safe one.

    numba reads it by pickle, which runs any code: nobody else may be able to write there.
    """
    import numba  # here, because it takes long to import

    try:
        folder = Path(str(numba.njit(cache=True)(function).stats.cache_path))
        return folder if _is_private(folder) else None
    except (RuntimeError, OSError):  # no folder that can be written to
        return None


@cache
def _is_private(folder: Path) -> bool:
    """Return whether only this user and root can write to a folder; warn once if others can."""
    status, user = folder.stat(), os.geteuid()
    shared = bool(status.st_mode & stat.S_IWOTH)
    if status.st_mode & stat.S_IWGRP:
        try:
            name, group = pwd.getpwuid(user).pw_name, grp.getgrgid(status.st_gid)
            shared = shared or group.gr_name != name or bool({*group.gr_mem} - {name})
        except KeyError:
            shared = True
    if not shared and status.st_uid in (0, user):
        return True
    log.warning(
        "each process compiles anew: others can write to %s; NUMBA_CACHE_DIR names another folder",
        folder,
    )
    return False


def is_kept(function: Callable[..., Any]) -> bool | None:
    """Return whether the machine code of a function is on disk; None where it cannot be kept."""
    folder = cache_folder(function)
    return None if folder is None else any(folder.glob(f"*.{function.__qualname__}-*.nbi"))


def from_cache(function: Callable[..., Any], jit: Callable[[], T]) -> T:
    """Return `jit()`, which reads a function's machine code from disk; remove damaged files."""
    import numba

    try:
        return jit()
    except numba.TypingError:
        raise
    except Exception:  # a truncated pickle ends in errors of many kinds
        for file in (cache_folder(function) or Path()).glob(f"*.{function.__qualname__}-*.nb?"):
            file.unlink(missing_ok=True)
        return jit()


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

    kept = is_kept(function)
    if not kept:
        log.info("compiling %s", what)
    options |= {"nogil": True}
    with uncollected():
        if kept is not None:
            with suppress(OSError):  # a full disk
                jit = numba.njit(signature, cache=True, **options)
                return from_cache(function, lambda: jit(function))  # type: ignore[no-any-return]
        return numba.njit(signature, **options)(function)  # type: ignore[no-any-return]
