"""Numbers in texts: what docs show agrees with what is printed, to the digits shown."""

import re
from typing import NamedTuple

NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)

RESIDUAL = 1e-6
"""Numbers below it are residuals, which are rounding and differ between machines."""


class Number(NamedTuple):
    """A number of a text, and the unit of its last digit."""

    text: str
    value: float
    last: float

    def agrees(self, printed):
        """Return whether a printed number is this one: 1 %, or a unit of the last digit shown."""
        if max(abs(self.value), abs(printed.value)) < RESIDUAL:
            return True
        tolerance = max(1.001 * self.last, 0.01 * abs(self.value))
        return abs(self.value - printed.value) <= tolerance


def numbers_of(text):
    """Return the numbers of a text."""
    numbers = []
    for number in NUMBER.findall(text):
        mantissa, _, exponent = number.lower().partition("e")
        last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
        numbers.append(Number(number, float(number), last))
    return numbers


def first_missing(shown, printed):
    """Return the first number shown that is not among those printed, in their order, or None."""
    remaining = iter(numbers_of(printed))
    for number in numbers_of(shown):
        if not any(number.agrees(other) for other in remaining):
            return number.text
    return None
