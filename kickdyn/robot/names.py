"""Names of joints and frames: which are meant, how they are listed, and how joints are locked."""

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import Any

from kickdyn.core import validation
from kickdyn.errors import InvalidInput

FOOT_WORDS = ("toe", "sole", "foot", "ankle")
"""Words in the names of frames that can kick a ball."""

MAX_NAME = 200
"""Largest number of characters of a name."""

MAX_LISTED = 20
"""Largest number of names that `unknown` lists."""

MAX_FAULTY = 6
"""Largest number of joints that a refusal names."""


def listed(names: Sequence[str], most: int = 40) -> str:
    """Return names in one line; those after the first `most` are counted."""
    omitted = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + omitted


def name_fault(kind: str, name: str) -> str:
    """Return the fault of a name in a robot's file; empty for a valid one."""
    if len(name) > MAX_NAME or not name.isprintable():
        return f"{kind} {name[:40]!r} is not a printable name of at most {MAX_NAME} characters"
    return f"{kind} 'universe' is reserved by Pinocchio" if name == "universe" else ""


def unknown(
    kind: str, name: object, owner: str, names: Sequence[str], ends: Sequence[str] = ()
) -> str:
    """Return the message for an unknown name; names like a foot's are sought among `ends`."""
    text = name.lower()[:200] if isinstance(name, str) else ""
    by_case = {known.lower(): known for known in reversed(names)}
    matches = [by_case[known] for known in get_close_matches(text, by_case, 8)]
    feet = [end for end in ends if any(word in end.lower() for word in FOOT_WORDS)] or list(ends)
    if any(word in text for word in FOOT_WORDS) and not get_close_matches(text, by_case, 1, 0.8):
        sides = [side for side in ("left", "right") if side in text]
        same_side = [end for end in feet if any(side in end.lower() for side in sides)] or feet
        by_case = {end.lower(): end for end in same_side}
        matches = [by_case[known] for known in get_close_matches(text, by_case, 8, 0.0)] or matches
    hint = f"did you mean {matches[0]!r}? " if matches else ""
    order = list(names)
    if len(names) > MAX_LISTED:
        order = list(dict.fromkeys([*matches, *(feet if kind == "frame" else ()), *names]))
    known = listed(order, MAX_LISTED) or f"no {kind}"
    return f"{kind} {name!r} is unknown: {hint}{owner} has {known}"


def expand_patterns(values: Mapping[str, float], names: Iterable[str]) -> dict[str, float]:
    """Return the values of the names that a key of `values` is, or matches as a shell pattern.

    A key that is a name takes precedence. Raises `InvalidInput` for a value that is not finite, or
    a name that matches two patterns with different values.
    """
    names = list(names)
    expanded = {name: values[name] for name in names if name in values}
    patterns = {key: value for key, value in values.items() if key not in expanded}
    matched: dict[str, str] = {}
    for pattern, value in patterns.items():
        number = validation.number(f"joint {pattern}", value)
        for name in names:
            if name not in values and isinstance(pattern, str) and fnmatchcase(name, pattern):
                other = matched.setdefault(name, pattern)
                if expanded.setdefault(name, number) != number:
                    raise InvalidInput(
                        f"joint {name!r} matches {other!r} and {pattern!r}, which have different "
                        "values: name the joint itself"
                    )
    return expanded


def lock_remedy(model: Any, joints: Sequence[str]) -> str:
    """Return the advice to lock joints, at 0 or in the middle of the range; empty if impossible."""
    names, values, options = list(model.names), dict[str, float](), list[str]()
    for joint in joints:
        number = names.index(joint)
        if model.nvs[number] == 1:
            address = model.idx_qs[number]
            low, high = model.lowerPositionLimit[address], model.upperPositionLimit[address]
            is_continuous = model.nqs[number] == 2  # and has no range
            value = 0.0 if is_continuous or low <= 0.0 <= high else (low + high) / 2
            values[joint] = float(f"{value:.3g}")
            slides = model.joints[number].shortname().startswith("JointModelP")
            text = f"{values[joint] if slides else math.degrees(values[joint]):.4g}"
            options.append(f"--lock {shlex.quote(f'{joint}={text}')}")
    if not values or len(values) == len(names) - 1:
        return ""
    if len(values) > 30:  # more would not be read
        return "lock them by locked={joint: value} in Python, by --lock JOINT=VALUE in commands"
    python = ", ".join(f"{name!r}: {value:g}" for name, value in values.items())
    pronoun = "it" if len(values) == 1 else "them"
    return f"lock {pronoun} by locked={{{python}}} in Python, by {' '.join(options)} in commands"
