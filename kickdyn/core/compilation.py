"""Machine code that is kept on the disk, for compiling takes seconds."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event
from typing import Any

busy = Event()
"""Set while a function is compiled, or read from the disk."""


def named(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return a function under a name of its own, as each needs that is made in a function.

    The linker goes by names: two of one name, each compiled in a process of its own and kept on the
    disk, it takes for the same, and the first loaded answers for both.
    """
    function.__qualname__ = name
    return function


def compiled(function: Callable[..., Any], signature: Any, **how: Any) -> Callable[..., Any]:
    """Compile a function now, or take it from the disk where it can be kept there.

    numba looks for changes in the function's own file only: what is made of other files must have
    their contents among what it closes over, which is part of its name there.
    """
    import numba  # here, so that who only asks whether it is busy need not wait for it

    busy.set()
    try:
        return numba.njit(signature, cache=True, nogil=True, **how)(function)  # type: ignore[no-any-return]
    except (RuntimeError, OSError):  # nowhere to keep it
        return numba.njit(signature, nogil=True, **how)(function)  # type: ignore[no-any-return]
    finally:
        busy.clear()
