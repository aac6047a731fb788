"""Compiling with numba, and keeping the machine code on disk, for compiling takes seconds."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


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


def named(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return a function under a unique name, which one that is made in a function needs.

    The linker goes by names: of two functions of one name, each compiled in its own process and
    kept on disk, it would call the one loaded first for both.
    """
    function.__qualname__ = name
    return function


def compiled(function: Callable[..., Any], signature: Any, **options: Any) -> Callable[..., Any]:
    """Return a function compiled for a signature; its machine code is kept on disk if possible.

    numba looks for changes in the function's own file only: what is made of other files must have
    their contents among the variables of its closure, which are part of its key on disk.
    """
    import numba  # here, because it takes long to import

    with uncollected():
        try:
            return numba.njit(signature, cache=True, nogil=True, **options)(function)  # type: ignore[no-any-return]
        except (RuntimeError, OSError):  # no folder that can be written to
            return numba.njit(signature, nogil=True, **options)(function)  # type: ignore[no-any-return]
