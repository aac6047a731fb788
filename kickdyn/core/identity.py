"""Digests of functions and numbers that do not depend on the Python version or the processor."""

import ast
import builtins
import dis
import hashlib
import inspect
import symtable
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

RETURNING = {"RESUME", "LOAD_CONST", "LOAD_SMALL_INT", "RETURN_CONST", "RETURN_VALUE"}
"""Instructions of a function that returns a constant."""

Function = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda


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
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    enclosing = dict(cells)
    for name in _outer_names(text):
        try:
            if name in enclosing:
                value = enclosing[name].cell_contents
            elif name in function.__globals__:
                value = function.__globals__[name]
            else:
                continue  # a builtin
        except ValueError:  # the cell is empty
            continue
        if getattr(builtins, name, None) is not value:
            yield name
            yield from _texts(value, visited)


def source_text(function: types.FunctionType) -> str:
    """Return the source text of a function or a lambda, without its decorators and indentation.

    Raises `NotIdentifiedError` if there is none.
    """
    code, name = function.__code__, function.__name__
    missing = NotIdentifiedError(f"the function {name!r} has no source text")
    if code.co_filename == "<string>":  # of `exec`
        raise missing
    try:
        text = "".join(inspect.findsource(function)[0])
        functions = _functions(text)
    except (OSError, TypeError, SyntaxError, IndexError):
        raise missing from None
    parameters = set(inspect.signature(function, follow_wrapped=False).parameters)
    candidates = [
        node
        for node in functions
        if _first_line(node) == code.co_firstlineno
        and getattr(node, "name", "<lambda>") == code.co_name
        and {argument.arg for argument in _arguments(node)} == parameters
    ]
    if len(candidates) > 1 and code.co_name == "<lambda>":  # in one line
        candidates = _around(candidates, code)
    if len(candidates) != 1:
        raise missing
    segment = ast.get_source_segment(text, candidates[0], padded=True)
    return textwrap.dedent(segment or "")


@lru_cache(maxsize=16)
def _functions(text: str) -> tuple[Function, ...]:
    """Return the functions of a module in the order of its text."""
    return tuple(node for node in ast.walk(ast.parse(text)) if isinstance(node, Function))


def _first_line(node: Function) -> int:
    decorators = [] if isinstance(node, ast.Lambda) else node.decorator_list
    return min([node.lineno, *(decorator.lineno for decorator in decorators)])


def _arguments(node: Function) -> list[ast.arg]:
    every = node.args
    starred = [argument for argument in (every.vararg, every.kwarg) if argument is not None]
    return [*every.posonlyargs, *every.args, *every.kwonlyargs, *starred]


def _around(lambdas: list[Function], code: types.CodeType) -> list[Function]:
    """Return the smallest lambda whose text encloses all instructions of a code, if any.

    From Python 3.12 on, a lambda that returns a constant has instructions without a place: it is
    the one with that constant.
    """
    places = [
        ((line, column), (end_line, end_column))
        for line, end_line, column, end_column in code.co_positions()
        if line and end_line and column is not None and end_column
        if (line, column) < (end_line, end_column)
    ]
    if not places:
        if any(instruction.opname not in RETURNING for instruction in dis.get_instructions(code)):
            return []  # Python was started with `-X no_debug_ranges`
        return [node for node in lambdas if _constant(node) == repr(code.co_consts[-1:])][-1:]
    enclosing = [
        node
        for node in lambdas
        if (node.lineno, node.col_offset) <= min(begin for begin, _ in places)
        and max(end for _, end in places) <= (node.end_lineno or 0, node.end_col_offset or 0)
    ]
    return enclosing[-1:]  # ast.walk visits outer functions before inner ones


def _constant(node: Function) -> str:
    """Return the constant that a lambda returns, as `repr` of a tuple."""
    if not isinstance(node, ast.Lambda):
        return ""
    return repr(compile(ast.Expression(node.body), "lambda", "eval").co_consts[-1:])


def _outer_names(text: str) -> list[str]:
    """Return the names that a function reads and does not define, sorted."""
    in_brackets = f"({text.strip()})"
    try:
        table = symtable.symtable(in_brackets, "lambda", "eval")
    except SyntaxError:
        try:
            table = symtable.symtable(text, "def", "exec")
        except SyntaxError as error:
            raise NotIdentifiedError(f"the names of a function are not clear ({error})") from None
    tables, names = list(table.get_children()), set()
    while tables:
        inner = tables.pop()
        tables += inner.get_children()
        names |= {symbol.get_name() for symbol in inner.get_symbols() if symbol.is_global()}
    return sorted(names)
