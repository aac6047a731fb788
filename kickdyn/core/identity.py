"""Digests of functions and numbers that do not depend on the Python version or the processor."""

import ast
import builtins
import hashlib
import inspect
import sys
import textwrap
import types
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any

import numpy as np

DIGITS = 12
"""Significant digits of floats that count: later ones differ between processors."""

LIBRARIES = {"numpy", "scipy", "kickdyn", *sys.stdlib_module_names}
"""Packages whose modules, classes and compiled functions are identified by their names."""


class NotIdentifiedError(Exception):
    """A value has no digest; the message is the reason."""


def digest(value: Any) -> str:
    """Return the SHA-256 of a value: numbers, texts, arrays, containers, functions.

    A function counts by its name, its source text and the values that it uses: defaults, variables
    of enclosing functions and globals, functions among them likewise. Floats count to `DIGITS`
    digits. Bytecode does not count, so that every version of Python returns the same digest.

    Raises:
        NotIdentifiedError: a function has no source text (it was made by `exec` or typed at a
            prompt), or uses an object of another kind.
    """
    result = hashlib.sha256()
    for text in _texts(value, set()):
        encoded = text.encode()
        result.update(b"%d:" % len(encoded) + encoded)
    return result.hexdigest()


def _texts(value: Any, visited: set[int]) -> Iterator[str]:
    """Yield the texts that identify a value; `visited` has the ids of functions met before."""
    value = getattr(value, "py_func", value)  # what numba has compiled
    if isinstance(value, float | np.floating):
        yield f"float {value + 0.0:.{DIGITS}g}"  # no -0
    elif value is None or isinstance(value, bool | int | str | bytes | np.integer | np.bool_):
        plain = value.item() if isinstance(value, np.generic) else value
        yield f"{type(plain).__name__} {plain!r}"
    elif isinstance(value, list | tuple):
        yield f"{type(value).__name__} {len(value)}"
        for item in value:
            yield from _texts(item, visited)
    elif isinstance(value, np.ndarray):
        yield f"array {value.shape}"
        yield from _texts(value.ravel().tolist(), visited)
    elif isinstance(value, Mapping):
        yield from _texts(list(value.items()), visited)
    elif is_dataclass(value) and _package(value) == "kickdyn" and not isinstance(value, type):
        yield type(value).__qualname__
        for field in fields(value):
            yield field.name
            yield from _texts(getattr(value, field.name), visited)
    elif isinstance(value, types.FunctionType) and _package(value) not in LIBRARIES - {"kickdyn"}:
        yield from _of_function(value, visited)
    elif isinstance(value, types.ModuleType) and value.__name__.split(".")[0] in LIBRARIES:
        yield f"module {value.__name__}"
    elif _package(value) in LIBRARIES and hasattr(value, "__name__"):
        yield f"{_package(value)} {value.__name__}"
    else:
        name = getattr(value, "__name__", "")
        raise NotIdentifiedError(f"the {type(value).__name__} {name}".rstrip() + " has no text")


def _package(value: Any) -> str:
    """Return the name of the package that a class or function belongs to."""
    if isinstance(value, np.ufunc):
        return "numpy"
    return str(getattr(value, "__module__", None) or "").split(".")[0]


def _of_function(function: types.FunctionType, visited: set[int]) -> Iterator[str]:
    yield f"function {function.__name__}"
    if id(function) in visited:  # it calls itself, or is called twice
        return
    visited.add(id(function))
    text = source_text(function)
    yield text
    yield from _texts((function.__defaults__, function.__kwdefaults__), visited)
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    for name in sorted(_names(function.__code__)):
        try:
            value = cells[name].cell_contents if name in cells else function.__globals__[name]
        except (KeyError, ValueError):  # a builtin; the cell is empty
            continue
        if getattr(builtins, name, None) is not value:
            yield name
            yield from _texts(value, visited)


def source_text(function: types.FunctionType) -> str:
    """Return the source text of a function, of a lambda the statement in which it stands.

    Raises `NotIdentifiedError` if there is none.
    """
    code, name = function.__code__, function.__name__
    missing = NotIdentifiedError(f"the function {name!r} has no source text")
    if code.co_filename == "<string>":  # of `exec`
        raise missing
    try:
        text = "".join(inspect.findsource(function)[0])
        statements = _statements(text)
    except (OSError, TypeError, SyntaxError, IndexError):
        raise missing from None
    line = code.co_firstlineno
    if code.co_name == "<lambda>":
        ends = ((node, node.end_lineno or 0) for node in statements)
        around = [node for node, end in ends if _first_line(node) <= line <= end]
    else:
        around = [
            node for node in statements
            if (getattr(node, "name", ""), _first_line(node)) == (code.co_name, line)
        ]  # fmt: skip
    if not around:
        raise missing
    innermost = max(around, key=lambda node: (_first_line(node), node.col_offset))
    return textwrap.dedent(ast.get_source_segment(text, innermost, padded=True) or "")


@lru_cache(maxsize=16)
def _statements(text: str) -> tuple[ast.stmt, ...]:
    return tuple(node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.stmt))


def _first_line(node: ast.stmt) -> int:
    lines = [line.lineno for line in getattr(node, "decorator_list", [])]
    return int(min([node.lineno, *lines]))


def _names(code: types.CodeType) -> set[str]:
    """Return the names of globals and enclosing variables that a code may use, and more."""
    inner = (constant for constant in code.co_consts if isinstance(constant, types.CodeType))
    return {*code.co_names, *code.co_freevars}.union(*map(_names, inner))
