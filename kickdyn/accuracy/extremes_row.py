"""One line of the table of extremes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

from kickdyn.errors import KickdynError

FULL = 16.0
"""Digits that a float64 can have."""


@dataclass(frozen=True)
class Row:
    """How right one answer is, or that there is none.

    Attributes:
        family, case: what was asked.
        quantity: of its answers, the one nearest to the limit.
        error: of it, relative to 50 digits; `worst_error` is the largest of all.
        condition: of it; see `exact_impact.conditions`.
        worst_error: of all answers.
        refusal: the message, where kickdyn refuses.
        claimed: digits that the answer itself says it has at least.
    """

    family: str
    case: str
    quantity: str = ""
    error: float = 0.0
    condition: float = 1.0
    worst_error: float = 0.0
    refusal: str = ""
    claimed: float = FULL

    @property
    def digits(self) -> float:
        """Digits that are right."""
        return digits(self.error)

    @property
    def allowed(self) -> float:
        """Digits that the condition allows, 15 - log10(condition), none below 0."""
        return max(0.0, 15.0 - math.log10(self.condition))

    @property
    def verdict(self) -> str:
        """`right`, to what the condition allows, `as claimed`, `refused`, or `WRONG`.

        As claimed is an answer of fewer digits which says how many it has, and has them.
        """
        if self.refusal:
            return "refused"
        if self.error == math.inf or self.digits < min(self.allowed, self.claimed):
            return "WRONG"
        return "right" if self.digits >= self.allowed else "as claimed"

    def as_json(self) -> dict[str, object]:
        """Return plain values and the verdict; what is infinite, of something wrong, as null."""
        values = {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }
        return values | {"verdict": self.verdict}


def digits(error: float) -> float:
    """Return how many digits an error leaves, 0 to 16."""
    return min(FULL, max(0.0, -math.log10(error))) if error else FULL


def compared(
    family: str,
    case: str,
    errors: Mapping[str, float],
    conditions: Mapping[str, float],
    claims: Mapping[str, float],
) -> Row:
    """Return the row of the worst verdict; among equals, of what has least digits to spare."""
    worst = max(errors.values())
    rows = [
        Row(
            family, case, name, errors[name], conditions[name], worst,
            claimed=claims.get(name, FULL),
        )
        for name in errors
    ]  # fmt: skip
    order = ("WRONG", "as claimed", "right")
    return min(rows, key=lambda row: (order.index(row.verdict), row.digits - row.allowed))


def refused(case: str, made: Callable[[], object]) -> Row:
    """Return the row of something that must be refused."""
    try:
        made()
    except KickdynError as error:
        return Row("no number", case, refusal=str(error))
    return Row("no number", case, "taken", math.inf, 1.0, math.inf)
