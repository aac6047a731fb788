"""Compiling with numba, and keeping the machine code on disk, for compiling takes seconds."""

import gc
import logging
import types
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

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


def compiled(
    function: Callable[..., Any], signature: Any, what: str, **options: Any
) -> Callable[..., Any]:
    """Return a function compiled for a signature; its machine code is kept on disk if possible.

    The log calls the function `what`, where it is compiled.

    numba looks for changes in the function's own file only: what is made of other files must have
    their contents among the variables of its closure, which are part of its key on disk.
    """
    import numba  # here, because it takes long to import

    try:
        folder = Path(str(numba.njit(cache=True)(function).stats.cache_path))
    except (RuntimeError, OSError):  # no folder that can be written to
        folder = None
    if folder is None or not any(folder.glob(f"*.{function.__qualname__}-*.nbi")):
        log.info("compiling %s", what)
    with uncollected():
        jit = numba.njit(signature, cache=folder is not None, nogil=True, **options)
        return jit(function)  # type: ignore[no-any-return]
