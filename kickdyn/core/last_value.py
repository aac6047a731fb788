"""The last result of a function, kept for solvers that ask for parts of it one after the other."""

from collections.abc import Callable
from typing import TypeVar

from kickdyn.core.validation import Array

Result = TypeVar("Result")


def keep_last(function: Callable[[Array], Result]) -> Callable[[Array], Result]:
    """Return the function with a memory of its last argument and result.

    Solvers of scipy ask for values and derivatives in two calls at the same place; a function that
    computes them together then does so once. The argument is an array; equal bytes are the same
    place.
    """
    last: dict[bytes, Result] = {}

    def kept(place: Array) -> Result:
        key = place.tobytes()
        if key not in last:
            result = function(place.copy())  # solvers may change theirs
            last.clear()
            last[key] = result
        return last[key]

    return kept
