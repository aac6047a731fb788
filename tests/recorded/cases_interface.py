"""Names, arguments and defaults of every public function and class, and the constants of modules."""

import enum
import inspect
from dataclasses import is_dataclass
from importlib import import_module
from pkgutil import walk_packages

import numpy as np

import kickdyn as kd
from recorded.plain import plain, text_of


def modules():
    return {m.name: import_module(m.name) for m in walk_packages(kd.__path__, "kickdyn.") if "__main__" not in m.name
            and m.name != "kickdyn.posture_sweep"}  # fmt: skip


def default(value):
    if value is inspect.Parameter.empty:
        return ""
    return text_of(repr(plain(value, 2)))


def signature(function):
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return None
    return [
        f"{p.kind.name[0]} {p.name} {default(p.default)}".rstrip()
        for p in parameters
        if p.name not in ("self", "cls")
    ]


def signatures(name):
    """Return arguments of what a module defines and of methods, and attributes of classes."""
    module, found = import_module(name), {}
    for key, item in vars(module).items():
        if key.startswith("_") or getattr(item, "__module__", None) != name or not callable(item):
            continue
        if inspect.isclass(item) and issubclass(item, enum.Enum):
            found[key] = {member.name: str(member.value) for member in item}
        else:
            found[key] = signature(item)
        if inspect.isclass(item):
            for inner, method in vars(item).items():
                function = getattr(method, "__func__", method)
                if not inner.startswith("_") and inspect.isfunction(function):
                    found[f"{key}.{inner}"] = signature(function)
                elif (
                    inner[0] != "_"
                    and type(method) in (bool, int, float, str)
                    and not is_dataclass(item)
                ):
                    found[f"{key}.{inner}"] = method  # what subclasses and instances start with
    return found


def constants(name):
    """Return what a module names in capitals: numbers, text, arrays and tables of them."""
    module = import_module(name)
    return {
        key: plain(item, 1)
        for key, item in vars(module).items()
        if key.isupper() and not key.startswith("_") and isinstance(item, bool | int | float | str | tuple | list | dict | np.ndarray)
    }  # fmt: skip


CASES = {
    **{f"signatures of {name}": (lambda name=name: signatures(name)) for name in modules()},
    **{f"constants of {name}": (lambda name=name: constants(name)) for name in modules()},
    "public names": lambda: sorted(kd.__all__),
}
GROWS = True
"""A new function or constant is no unintended change."""
LOOSE = {"": 0.0}
"""A default of 0.0024 is not 0.002: only rounding to the last digits of a float64 is let pass."""
