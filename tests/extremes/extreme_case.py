"""One case at the extremes: how right an answer is, or that kickdyn refuses it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

FULL = 16.0
"""Digits that a float64 can have."""


class Correctness(StrEnum):
    """How an answer compares; `as-claimed`: fewer digits than possible, but as many as it says."""

    RIGHT = "right"
    AS_CLAIMED = "as-claimed"
    REFUSED = "refused"
    WRONG = "wrong"


@dataclass(frozen=True)
class ExtremeCase:
    """How right one answer is, or that there is none.

    Attributes:
        family, case: the input.
        quantity: of its answers, the one nearest to the limit.
        error: of that quantity, relative to 50 digits.
        condition: of that quantity; see `extreme_impacts.conditions`.
        refusal: the message, where kickdyn refuses.
        claimed: digits that the answer itself says it has at least.
    """

    family: str
    case: str
    quantity: str = ""
    error: float = 0.0
    condition: float = 1.0
    refusal: str = ""
    claimed: float = FULL

    def __str__(self) -> str:
        if self.refusal:
            return f"{self.family}: {self.case}: refused: {self.refusal}"
        sizes = f"{self.quantity} has an error of {self.error:.1e}, condition {self.condition:.1e}"
        return f"{self.family}: {self.case}: {self.verdict}: {sizes}"

    @property
    def allowed(self) -> float:
        """Digits that the condition allows, 15 - log10(condition), none below 0."""
        return max(0.0, 15.0 - math.log10(self.condition))

    @property
    def verdict(self) -> Correctness:
        """How the answer compares with what the condition allows, and with what it claims."""
        if self.refusal:
            return Correctness.REFUSED
        if self.error == math.inf or digits(self.error) < min(self.allowed, self.claimed):
            return Correctness.WRONG
        right = digits(self.error) >= self.allowed
        return Correctness.RIGHT if right else Correctness.AS_CLAIMED


def digits(error: float) -> float:
    """Return how many digits a relative error leaves, 0 to 16."""
    return min(FULL, max(0.0, -math.log10(error))) if error else FULL


def compare(
    family: str,
    case: str,
    errors: Mapping[str, float],
    conditions: Mapping[str, float],
    claims: Mapping[str, float],
) -> ExtremeCase:
    """Return the case with the worst verdict; among equals, the one with least digits to spare."""
    order = (Correctness.WRONG, Correctness.AS_CLAIMED, Correctness.RIGHT)
    cases = [
        ExtremeCase(family, case, name, error, conditions[name], claimed=claims.get(name, FULL))
        for name, error in errors.items()]  # fmt: skip
    return min(
        cases, key=lambda case: (order.index(case.verdict), digits(case.error) - case.allowed)
    )
