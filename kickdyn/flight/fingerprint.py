"""What a Python function is made of, as a name under which its machine code can be kept."""

from __future__ import annotations

import hashlib
import math
import types
from collections.abc import Iterator
from typing import Any

import numpy as np

from kickdyn.aerodynamics.coefficient_model import CoefficientModel

_LIBRARIES = (math, np)
"""Modules whose names mean the same tomorrow; the attributes of others may be anything."""

_PLAIN = (int, float, complex, bool, str, bytes, type(None), type(...), types.BuiltinFunctionType)


def fingerprint(value: Any, *more: bytes) -> str | None:
    """Return a name that two functions share only if they and all that they call do the same.

    Args:
        value: a function, whose code, defaults, and the values of the names it uses count; a plain
            value; or a tuple of those.
        more: what counts besides.

    Returns:
        32 hexadecimal digits; None where it uses what has no plain value: an array, a module of
        someone's own, a function that is compiled already.
    """
    digest = hashlib.sha256()
    try:
        for part in (*more, *_parts(value, set())):
            digest.update(b"%d:" % len(part) + part)
    except TypeError:
        return None
    return digest.hexdigest()[:32]


def _parts(value: Any, met: set[int]) -> Iterator[bytes]:
    """Yield the bytes a value is made of; raise `TypeError` where that cannot be said."""
    if isinstance(value, CoefficientModel):
        value = value.function
    if isinstance(value, types.FunctionType) and not value.__module__.startswith("numpy"):
        if id(value) in met:  # it calls itself
            yield value.__qualname__.encode()
            return
        met.add(id(value))
        for part in (
            value.__code__,
            value.__defaults__,
            tuple((value.__kwdefaults__ or {}).items()),
            tuple(cell.cell_contents for cell in value.__closure__ or ()),
            tuple(used(value).items()),
        ):
            yield from _parts(part, met)
    elif isinstance(value, types.CodeType):
        yield value.co_code
        names = value.co_names, value.co_varnames, value.co_freevars, value.co_cellvars
        yield from _parts((*names, value.co_argcount, value.co_flags, value.co_consts), met)
    elif isinstance(value, tuple | frozenset):
        ordered = value if isinstance(value, tuple) else sorted(value, key=repr)
        yield b"%d" % len(ordered)
        for part in ordered:
            yield from _parts(part, met)
    elif isinstance(value, types.FunctionType | np.ufunc) or any(value is m for m in _LIBRARIES):
        yield f"{getattr(value, '__module__', '')} {value.__name__}".encode()
    elif isinstance(value, _PLAIN):
        yield f"{type(value).__name__} {value!r}".encode()
    else:
        raise TypeError(f"a {type(value).__name__} has no plain value")


def used(function: types.FunctionType) -> dict[str, Any]:
    """Return the global names a function uses, with their values."""
    return {
        name: function.__globals__[name]
        for name in sorted(_names(function.__code__))
        if name in function.__globals__
    }


def _names(code: types.CodeType) -> set[str]:
    inner = (constant for constant in code.co_consts if isinstance(constant, types.CodeType))
    return set(code.co_names).union(*(_names(each) for each in inner))
