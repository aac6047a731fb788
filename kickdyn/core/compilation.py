"""Compiling with numba, and keeping the machine code on disk, for compiling takes seconds."""

import gc
import grp
import logging
import os
import pwd
import stat
import types
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from kickdyn.core.lanes import JITABLE

log = logging.getLogger(__name__)
"""Says at level INFO what is compiled."""


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


OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
"""How `kickdyn.core.lanes` is compiled: without memory management, since all arrays are the
caller's."""


def register_jitable_functions() -> None:
    """Let machine code call the functions that are marked in `kickdyn.core.lanes`."""
    from numba.extending import register_jitable

    from kickdyn.core import simd  # noqa: F401  # what batches are

    for function, inline in JITABLE.items():
        if function not in _registered:
            options = {"forceinline": True} if inline else {}
            register_jitable(**OPTIONS, **WITHIN, **options)(function)
            _registered.add(function)


_registered: set[Callable[..., Any]] = set()


WITHIN: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of numba for what machine code calls, and Python must not: a tenth less to compile."""


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
    """Return whether only this user and root can write to a folder; warn once if others can.

    In a shared folder above it others could replace it, unless there is a sticky bit. Folders above
    kickdyn itself do not count: who can replace the one can replace the other.
    """
    trusted = (0, os.geteuid())
    shared = None
    if folder.stat().st_uid not in trusted or _is_shared(folder.stat()):
        shared = folder
    above = {*folder.absolute().parents, *folder.resolve().parents}
    for place in above.difference(Path(__file__).resolve().parents):
        status = place.stat()
        if _is_shared(status) and not (status.st_mode & stat.S_ISVTX and status.st_uid in trusted):
            shared = place
    if shared is not None:
        log.warning(
            "each process compiles again, because others can write to %s: set NUMBA_CACHE_DIR",
            shared,
        )
    return shared is None


def _is_shared(status: os.stat_result) -> bool:
    """Return whether others than a folder's user can write to it; a group may be his alone."""
    if not status.st_mode & stat.S_IWGRP:
        return bool(status.st_mode & stat.S_IWOTH)
    try:
        name, group = pwd.getpwuid(os.geteuid()).pw_name, grp.getgrgid(status.st_gid)
    except KeyError:
        return True
    alone = group.gr_name == name and not {*group.gr_mem} - {name}
    return not alone or bool(status.st_mode & stat.S_IWOTH)


def compiled(
    function: Callable[..., Any], signature: Any, what: str, **options: Any
) -> Callable[..., Any]:
    """Return a function compiled for a signature; its machine code is kept on disk if possible.

    The log calls the function `what`, where it is compiled. The contents of other files that it
    calls are in its name (`named`) or among the variables of its closure, which are part of its key
    on disk.
    """
    import numba  # here, because it takes long to import

    register_jitable_functions()
    folder = cache_folder(function)
    if not is_on_disk(function):
        log.info("compiling %s", what)
    options |= {"nogil": True}
    with uncollected():
        if folder is not None:
            jit: Any = numba.njit(signature, cache=True, **options)
            with suppress(OSError):  # a full disk
                try:
                    return jit(function)  # type: ignore[no-any-return]
                except numba.TypingError:
                    raise
                except Exception:  # a truncated pickle ends in errors of many kinds
                    for file in folder.glob(f"*.{function.__qualname__}-*.nb?"):
                        file.unlink(missing_ok=True)
                    return jit(function)  # type: ignore[no-any-return]
        return numba.njit(signature, **options)(function)  # type: ignore[no-any-return]


LOADING = 0.5
"""Processor time to import numba and to read machine code from the disk, roughly [s]."""


class Source(NamedTuple):
    """What machine code is made of: a function named by `named`, its signature, numba's options."""

    function: Callable[..., Any]
    signature: Any
    options: Mapping[str, Any]


class MachineCode:
    """A function that numba compiles when it is needed: call it to get the compiled function.

    Args:
        source: function that returns the source, and does its imports.
        what: its name in the log.
        seconds: processor time of its compilation, and of what is compiled with it, roughly [s].
    """

    def __init__(self, source: Callable[[], Source], what: str, seconds: float) -> None:
        self._source, self._what, self._seconds = source, what, seconds
        self._code: Callable[..., Any] | None = None
        self._in_python = 0.0

    def __call__(self) -> Callable[..., Any]:
        """Return the machine code, from the disk if it is there."""
        if self._code is None:
            function, signature, options = self._source()
            self._code = compiled(function, signature, self._what, **options)
        return self._code

    def pays(self, in_python: float) -> bool:
        """Return whether machine code is to compute what takes Python some seconds of processor.

        It is where it is loaded already; or where Python would by now have taken longer than it
        takes to load machine code that is on the disk, or else to compile it. So all calls
        together take at most twice the least time, whichever way is faster.
        """
        if self._code is not None:
            return True
        self._in_python += in_python
        if self._in_python < LOADING:
            return False
        return self._in_python >= self._seconds or is_on_disk(self._source().function)


def is_on_disk(function: Callable[..., Any]) -> bool:
    """Return whether there is machine code of a function on the disk."""
    folder = cache_folder(function)
    return folder is not None and any(folder.glob(f"*.{function.__qualname__}-*.nbi"))
