"""Compiling a ball's equations of motion with numba, plug-in coefficients included."""

from __future__ import annotations

import builtins
import copy
import math
import types
import uuid
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.core.dispatcher import Dispatcher

from kickdyn.aerodynamics.coefficient_model import Coefficient, CoefficientModel
from kickdyn.air import Air
from kickdyn.ball import Ball
from kickdyn.errors import InvalidInput
from kickdyn.flight import lanes
from kickdyn.flight.fingerprint import fingerprint, used
from kickdyn.flight.forces import forces, reynolds_number
from kickdyn.flight.lanes import HOW, SIGNATURE, inlined, mathematics, side_by_side

_KEPT = 200
"""Compiled functions that are remembered; each holds some 100 kB of machine code."""

_ON_DISK = 200
"""Files of equations that are kept, two for a ball and its air."""

_SOURCES = (numba.__version__.encode(), Path(str(lanes.__file__)).read_bytes())
"""What the equations are made of besides their own functions: `exp`, and how to compile."""

_compiled: dict[object, Any] = {}


@lru_cache(maxsize=16)
def compiled_rates(ball: Ball, air: Air) -> Any:
    """Return `side_by_side(forces(ball, air))` as machine code.

    Raises:
        InvalidInput: wind or a coefficient is something that numba cannot compile.
    """
    whole, straight, bound = copy.copy(air), copy.copy(air), 0.0
    for name in ("drag", "lift", "torque"):
        model = getattr(air, name)
        if not isinstance(model, CoefficientModel):
            continue
        if model.refuses:
            object.__setattr__(whole, name, _refusing(model))
            object.__setattr__(straight, name, _refusing(model))
        elif model.branch_free is not None:
            object.__setattr__(straight, name, model.branch_free[1])
            bound = max(bound, model.branch_free[0])
    rates = side_by_side(
        forces(ball, whole), forces(ball, straight), reynolds_number(ball, air), bound
    )
    return _kept(rates, air)


def _kept(rates: Callable[..., Any], air: Air) -> Any:
    """Return the equations of motion as machine code, from the disk where they are there."""
    name = fingerprint(rates, *_SOURCES)
    if name is None:
        return _made(rates, air)
    # numba keeps a function by its name and what it closes over: the name says all, and what is
    # called is left out, so that nothing is compiled where the disk has it
    called: dict[str, Any] = {"__builtins__": builtins, "__name__": __name__}
    twin = types.FunctionType(_call.__code__, called, f"equations_{name}")
    twin.__qualname__ = twin.__name__
    try:
        try:
            return numba.njit(SIGNATURE, cache=True, **HOW)(twin)
        except numba.TypingError:
            called["rates"] = _made(rates, air)
            dispatcher = numba.njit(SIGNATURE, cache=True, **HOW)(twin)
            _forget(Path(dispatcher.stats.cache_path))
            return dispatcher
    except (RuntimeError, OSError):  # nowhere to keep it
        return _made(rates, air)


def _made(rates: Callable[..., Any], air: Air) -> Any:
    """Compile the equations of motion, and before them what of the air may be someone's own."""
    for name in ("wind", "drag", "lift", "torque"):
        part = getattr(air, name)
        part = part.function if isinstance(part, CoefficientModel) else part
        if callable(part):
            arguments = (numba.float64,) * (1 if name == "wind" else 2)
            _compile(part, arguments, f"the air's {name}")
    return _compile(rates, SIGNATURE, "the equations of motion")


def _call(scene: Any, state: Any, rate: Any) -> None:
    rates(scene, state, rate)  # type: ignore[name-defined]  # noqa: F821


def _forget(folder: Path) -> None:
    """Remove the oldest equations that are kept on the disk, but for so many."""
    for file in sorted(folder.glob("*.equations_*"), key=_age)[_ON_DISK:]:
        file.unlink(missing_ok=True)


def _age(file: Path) -> float:
    try:
        return -file.stat().st_mtime
    except FileNotFoundError:  # another process was faster
        return 0.0


def _refusing(model: CoefficientModel) -> Coefficient:
    """Return a model that is not a number where `fly` would refuse it."""
    function, (low, high), (least, most) = model.function, model.reynolds, model.spin

    def within(reynolds: float, spin_parameter: float) -> float:
        if low <= reynolds <= high and least <= spin_parameter <= most:
            return function(reynolds, spin_parameter)
        return math.nan

    return within


def _compile(function: Callable[..., Any], signature: Any, name: str) -> Any:
    """Compile now, so that what is wrong shows here and under its name."""
    try:
        dispatcher = _tree(function, SIGNATURE if signature is SIGNATURE else None)
        if signature is not SIGNATURE:
            dispatcher.compile(signature)
    except Exception as error:  # numba has no common base for what it cannot do
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        told = [line for line in lines if not line.startswith(("Failed in", "During:", "File "))]
        raise InvalidInput(
            f"{name} {getattr(function, '__name__', function)!r} cannot be compiled by numba "
            f"({told[0] if told else type(error).__name__}): write it with floats and math only, "
            "or call fly for each flight"
        ) from error
    return dispatcher


def _tree(function: Any, signature: Any = None) -> Any:
    """Return the compiled form of a Python function and of all that it calls.

    numba takes the names a function uses as constants, but can call only those among them that
    are compiled themselves.
    """
    if isinstance(function, CoefficientModel):
        function = function.function
    if isinstance(function, Dispatcher):
        return function
    if not isinstance(function, types.FunctionType):
        raise TypeError(f"a {type(function).__name__} is not a function written in Python")
    cells = tuple(_known(cell.cell_contents) for cell in function.__closure__ or ())
    names = {name: _known(value) for name, value in used(function).items()}
    key = _key(function, cells, names, signature)
    if key in _compiled:
        return _compiled[key]
    twin = types.FunctionType(
        function.__code__,
        {"__builtins__": builtins, "__name__": function.__module__, **names},
        function.__name__,
        function.__defaults__,
        tuple(types.CellType(cell) for cell in cells) or None,
    )
    twin.__kwdefaults__ = function.__kwdefaults__
    # the linker goes by names: of two that are the same, one of them kept by another process, it
    # would take either
    twin.__qualname__ = f"{function.__name__}_{fingerprint(function) or uuid.uuid4().hex}"
    dispatcher = inlined(twin) if signature is None else numba.njit(signature, **HOW)(twin)
    if len(_compiled) >= _KEPT:
        _compiled.clear()
    _compiled[key] = dispatcher
    return dispatcher


def _known(value: Any) -> Any:
    """Return a constant as it is, and a function of someone's own compiled."""
    if value is math:
        return mathematics
    if isinstance(value, CoefficientModel):
        return _tree(value)
    ours = isinstance(value, types.FunctionType)
    return _tree(value) if ours and not value.__module__.startswith("numpy") else value


def _key(function: Any, cells: tuple[Any, ...], used: dict[str, Any], signature: Any) -> object:
    """Return what makes two functions the same: two equal `Air` then compile once."""
    parts = (*cells, *used.values(), *(function.__defaults__ or ()))
    # by value where that is safe, by identity else: the function, kept alive with the key, keeps
    # alive what it refers to
    plain = (int, float, bool, str, type(None))
    names = tuple((type(p), repr(p)) if isinstance(p, plain) else id(p) for p in parts)
    mutable = any(not isinstance(p, (*plain, Dispatcher, types.ModuleType)) for p in parts)
    return (function.__code__, tuple(used), names, signature is None, function if mutable else None)
