"""Where two answers differ, as sentences: numbers to a tolerance, text to the rounding of its numbers."""

import math
import re

NEGLIGIBLE = 1e-6
"""Size below which numbers are equal: residuals and rounding differ from machine to machine."""

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w|\.\w)")


def differences(expected, actual, relative=1e-6, place="") -> list[str]:
    """Return a line for each field that differs."""
    if isinstance(expected, dict) and isinstance(actual, dict):
        lines = []
        for key in expected.keys() | actual.keys():
            below = f"{place}.{key}" if place else str(key)
            if key not in actual:
                lines.append(f"{below}: missing, it was {_short(expected[key])}")
            elif key not in expected:
                lines.append(f"{below}: new, {_short(actual[key])}")
            else:
                lines += differences(expected[key], actual[key], relative, below)
        return sorted(lines)
    if isinstance(expected, list) and isinstance(actual, list):
        if len(expected) != len(actual):
            return [
                f"{place}: {len(actual)} entries for {len(expected)}: {_short(actual)} for {_short(expected)}"
            ]
        one, other = _numbers(expected), _numbers(actual)
        if one is not None and other is not None and len(one) == len(other):
            scale = max(map(abs, one), default=0.0)
            if all(_close(a, b, relative, scale) for a, b in zip(one, other, strict=True)):
                return []
            return [f"{place}: {_short(actual)} for {_short(expected)}"]
        return [
            line
            for k, (a, b) in enumerate(zip(expected, actual, strict=True))
            for line in differences(a, b, relative, f"{place}[{k}]")
        ]
    if _is_number(expected) and _is_number(actual):
        same = _close(expected, actual, relative, abs(expected))
    elif isinstance(expected, str) and isinstance(actual, str):
        same = same_text(expected, actual, relative)
        if not same:
            return [f"{place}: {_first(expected, actual, relative)}"]
    else:
        same = expected == actual and type(expected) is type(actual)
    return [] if same else [f"{place}: {_short(actual)} for {_short(expected)}"]


def same_text(expected: str, actual: str, relative: float = 1e-6) -> bool:
    """Return whether two texts are the same but for spaces and the rounding of their numbers.

    With `relative` 0 they are the same letter by letter.
    """
    if expected == actual or relative == 0.0:
        return expected == actual
    if _words(expected) != _words(actual):
        return False
    pairs = zip(NUMBER.findall(expected), NUMBER.findall(actual), strict=True)
    return all(_same_digits(a, b, relative) for a, b in pairs)


def _words(text: str) -> str:
    words = re.sub(r"-{3,}|─{3,}", "-", NUMBER.sub("#", text)).split()
    return ("" if "array(" in text else " ").join(words)  # the spaces of arrays depend on signs


def _same_digits(a: str, b: str, relative: float) -> bool:
    """Return whether two printed numbers differ by a unit of the last digit at most.

    It is the last digit of the number with more of them: 0.5 is 0.499, but not 0.55.
    """
    one, other = float(a), float(b)
    unit = min(_unit(a), _unit(b)) if "." in a + b or "e" in a + b else 0.0
    return abs(one - other) <= max(
        1.01 * unit, NEGLIGIBLE if max(abs(one), abs(other)) <= NEGLIGIBLE else 0.0,
        relative * abs(one),
    ) or max(abs(one), abs(other)) <= NEGLIGIBLE  # fmt: skip


def _unit(text: str) -> float:
    mantissa, _, exponent = text.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return float(10.0 ** (int(exponent or 0) - decimals))


def _is_number(value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _numbers(values):
    """Return the numbers of nested lists that hold nothing else, else None."""
    flat = []
    for value in values:
        if isinstance(value, list):
            inner = _numbers(value)
            if inner is None:
                return None
            flat += inner
        elif _is_number(value):
            flat.append(value)
        else:
            return None
    return flat


def _close(a, b, relative, scale) -> bool:
    if (isinstance(a, int) and isinstance(b, int)) or relative == 0.0:
        return a == b or (not isinstance(a + b, int) and math.isclose(a, b, rel_tol=1e-12))
    return abs(a - b) <= max(relative * max(scale, abs(b) if math.isfinite(b) else 0.0), NEGLIGIBLE)


def _short(value) -> str:
    text = repr(value)
    return text if len(text) < 160 else f"{text[:157]}..."


def _first(expected: str, actual: str, relative: float) -> str:
    """Return the first line of a text that differs."""
    if len(expected) + len(actual) < 160:
        return f"{actual!r} for {expected!r}"
    theirs = expected.replace("</tr>", "\n").replace("</div>", "\n").splitlines()
    ours = actual.replace("</tr>", "\n").replace("</div>", "\n").splitlines()
    for a, b in zip(theirs, ours, strict=False):
        if not same_text(a, b, relative):
            return f"{b[:300]!r} for {a[:300]!r}"
    return f"{len(ours)} lines for {len(theirs)}"
