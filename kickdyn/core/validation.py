"""Checks of values from outside: each returns the value or raises `InvalidInput` in one line."""

import functools
import inspect
import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from importlib import import_module
from types import UnionType
from typing import (
    TYPE_CHECKING,
    Any,
    NoReturn,
    ParamSpec,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from kickdyn.errors import LONGEST, InvalidInput

if TYPE_CHECKING:
    from numpy.typing import ArrayLike as ArrayLike
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
else:  # signatures print short names, and not what numpy's aliases stand for
    Array = np.ndarray
    ArrayLike = type("ArrayLike", (), {"__module__": "numpy.typing"})

Choice = TypeVar("Choice", bound=StrEnum)
P = ParamSpec("P")
Result = TypeVar("Result")

_FLOAT64 = np.dtype(np.float64)
_NO_NUMBERS = (str, bytes, bytearray, bool, np.bool_, np.complexfloating, np.ma.MaskedArray)


def number(
    name: str,
    value: object,
    *,
    above: float = -math.inf,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    unit: str = "",
) -> float:
    """Return `value` as a float, finite and inside the bounds, or raise `InvalidInput`."""
    shown = None
    try:
        # float() would take them, and older versions of NumPy an array of one number
        if not isinstance(value, _NO_NUMBERS) and getattr(value, "ndim", 0) == 0:
            result = float(value)  # type: ignore[arg-type]
            if math.isfinite(result) and result > above and at_least <= result <= at_most:
                return result
            shown = repr(result)
    except (TypeError, ValueError, OverflowError):
        pass
    limits = [f"above {above:g}"] if above > -math.inf else []
    limits += [f"at least {at_least:g}"] if at_least > -math.inf else []
    limits += [f"at most {at_most:g}"] if at_most < math.inf else []
    valid = f"a finite number {' and '.join(limits)}".rstrip() + (f" [{unit}]" if unit else "")
    raise InvalidInput(f"{name} is {shown or brief(value)}: it must be {valid}")


def whole(name: str, value: object, *, at_least: int, at_most: float = math.inf) -> int:
    """Return `value` as an integer inside the bounds, or raise `InvalidInput`."""
    result = number(name, value, at_least=at_least, at_most=at_most)
    if result != int(result):
        raise InvalidInput(f"{name} is {value!r}: it must be a whole number")
    return int(result)


def vector(name: str, value: ArrayLike, size: int, *, unit: str = "", many: str = "") -> Array:
    """Return `value` as a new, finite float64 array of shape `(size,)`, or raise `InvalidInput`.

    The error for shape `(n, size)` names `many`, the function that takes n at once.
    """
    if type(value) is np.ndarray and value.dtype is _FLOAT64 and value.shape == (size,):
        usual: Array = value.copy()
        if math.hypot(*usual.tolist()) < math.inf:  # neither NaN nor inf
            return usual
    array = floats(name, value, unit=unit)
    if array.shape != (size,):
        rows = array.ndim == 2 and array.shape[1] == size
        hint = f"; {many} takes (n, {size})" if many and rows else ""
        raise InvalidInput(f"{name} has shape {array.shape}: it must be ({size},){hint}")
    return array


def floats(name: str, value: ArrayLike, *, unit: str = "") -> Array:
    """Return `value` as a new, finite float64 array of any shape, or raise `InvalidInput`."""
    of_unit = f" [{unit}]" if unit else ""
    try:
        raw: Any = np.asanyarray(value)
    except ValueError:  # ragged
        raise InvalidInput(f"{name} is {brief(value)}: it must be an array of numbers") from None
    if np.ma.is_masked(raw):
        raise InvalidInput(f"{name} has masked entries: fill them first")
    if raw.dtype.kind not in "fiu" or _holds_bool(value):
        raise InvalidInput(f"{name} is {brief(value)}: it must contain real numbers{of_unit}")
    with np.errstate(over="ignore"):  # of longdouble
        array = np.array(raw, dtype=np.float64)  # native byte order: Pinocchio misreads any other
    finite = np.isfinite(array)
    if not finite.all():
        shown = array.tolist() if array.size <= 20 else f"an array with {array[~finite][0]} in it"
        raise InvalidInput(f"{name} is {shown}: every entry must be finite{of_unit}")
    return array


def read_only(array: Array) -> Array:
    """Return a copy of an array that cannot be written to."""
    result = array.copy()
    result.setflags(write=False)
    return result


def protect(*arrays: Any) -> None:
    """Make arrays read-only, in the fewest nanoseconds: an impact makes a dozen of them."""
    for array in arrays:
        array.setflags(False)  # with the name of the argument, a third longer


def brief(value: object) -> str:
    """Return the `repr` of a value, cut after `LONGEST` characters."""
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        return f"a {type(value).__name__} that is too long to show"
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _holds_bool(value: object) -> bool:
    """Return whether nested lists contain True or False, which numpy would take for 1 and 0."""
    if not isinstance(value, (list, tuple)):
        return isinstance(value, (bool, np.bool_))
    return any(map(_holds_bool, value))


def check_type(*kinds: type, **values: object) -> None:
    """Raise `InvalidInput` for a value that is of none of the types."""
    for name, value in values.items():
        if not isinstance(value, kinds):
            _refuse_type(name, value, kinds)


def check_arguments(function: Callable[P, Result]) -> Callable[P, Result]:
    """Return a function that raises `InvalidInput` where an argument is not of its annotated type.

    It checks annotations of classes, such as `Air | None`, `bool` and `str`. Numbers, mappings and
    what becomes an array are left to the function, which converts them.
    """
    names = list(inspect.signature(function).parameters)
    expected: dict[str, tuple[type, ...]] = {}

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> Result:
        if not expected:  # at the first call: annotations may name what is defined further down
            hints = get_type_hints(function)
            expected.update((name, _classes(hints.get(name))) for name in names)
        for name, value, kinds in zip(names, args, expected.values(), strict=False):
            if not isinstance(value, kinds):
                _refuse_type(name, value, kinds)
        for name, value in kwargs.items():
            if name in expected and not isinstance(value, expected[name]):
                _refuse_type(name, value, expected[name])
        return function(*args, **kwargs)

    return checked


def _classes(hint: object) -> tuple[type, ...]:
    """Return the classes of a type annotation, `object` where values are converted to it."""
    hints = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    kinds = [get_origin(member) or member for member in hints]
    converted = (int, float, Any, ArrayLike, Mapping)
    if any(kind in converted or not isinstance(kind, type) for kind in kinds):
        return (object,)
    return (*kinds, np.bool_) if bool in kinds else tuple(kinds)


def _refuse_type(name: str, value: object, kinds: tuple[type, ...]) -> NoReturn:
    names = {type(None): "None", bool: "True", np.bool_: "False"}
    *former, last = (
        names.get(kind)
        or f"a {'kickdyn.' if kind.__module__.startswith('kickdyn') else ''}{kind.__name__}"
        for kind in kinds
    )
    valid = f"{', '.join(former)} or {last}" if former else last
    shown = brief(value)
    if "\n" in shown:  # a table
        shown = f"of the type {type(value).__name__}"
    makers = [kind.MADE_BY for kind in kinds if hasattr(kind, "MADE_BY")]
    raise InvalidInput("; ".join([f"{name} is {shown}: it must be {valid}", *makers]))


def check_installed(package: str, extra: str, what: str) -> None:
    """Raise `InvalidInput` if an optional package, which `what` needs, cannot be imported."""
    try:
        import_module(package)
    except ImportError:
        install = f'pip install "kickdyn[{extra}]"'
        raise InvalidInput(
            f"{what} need the package {package}: install it with {install}"
        ) from None


def flag(name: str, value: object) -> bool:
    """Return `value` if it is True or False, or raise `InvalidInput`."""
    check_type(bool, np.bool_, **{name: value})
    return bool(value)


def choice(name: str, value: object, kind: type[Choice]) -> Choice:
    """Return the member of a `StrEnum` that `value` is or names, or raise `InvalidInput`."""
    try:
        return kind(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):  # TypeError: not hashable
        valid = ", ".join(kind)
        raise InvalidInput(f"{name} is {brief(value)}: it must be one of {valid}") from None


def times(t: ArrayLike, duration: float, what: str) -> Array:
    """Return times from 0 to `duration`, a number or shape `(n,)` [s], or raise `InvalidInput`."""
    moments = floats("t", t, unit="s")
    if moments.ndim > 1:
        raise InvalidInput(f"t has shape {moments.shape}: it must be a number or (n,)")
    outside = moments[(moments < 0) | (moments > duration)]
    if outside.size:
        time = float(outside.flat[0])
        raise InvalidInput(f"t is {time:g} s: {what} lasts from 0 to {duration:g} s")
    return moments


def mapping(name: str, value: object) -> dict[str, Any]:
    """Return a mapping as a dict, None as an empty one; else raise `InvalidInput`."""
    if value is None or isinstance(value, Mapping):
        return dict(value or {})
    raise InvalidInput(f"{name} is {brief(value)}: it must map names to values")


def direction(name: str, value: ArrayLike) -> Array:
    """Return the unit vector along `value`, shape `(3,)`; any length but zero is valid."""
    array = vector(name, value, 3)
    largest = float(np.abs(array).max())
    if largest == 0.0:
        raise InvalidInput(f"{name} is {array.tolist()}: a vector of length 0 has no direction")
    array /= largest  # so that squares neither overflow nor vanish
    return np.asarray(array / math.sqrt(float(array @ array)))


def length(vectors: Array) -> Array:
    """Return the length of vectors along the last axis; squares neither overflow nor vanish."""
    # numpy is slow along short axes
    components = [vectors[..., k] for k in range(vectors.shape[-1])]
    largest = functools.reduce(np.maximum, (np.abs(component) for component in components))
    safe = np.where(largest > 0, largest, 1.0)
    squares = ((component / safe) ** 2 for component in components)
    return np.asarray(safe * np.sqrt(functools.reduce(np.add, squares)))
