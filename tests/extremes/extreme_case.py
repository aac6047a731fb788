"""One case at the extremes: how right an answer is, or that kickdyn refuses it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum

from kickdyn.errors import KickdynError

FULL = 16.0
"""Digits that a float64 can have."""

NOT_FINITE = "not finite"
"""Family of the cases whose arguments are NaN, inf, or a Reynolds number of 0."""


class Correctness(StrEnum):
    """How an answer compares with the reference.

    `as-claimed` is an answer of fewer digits than its condition allows, which says how many it has,
    and has them.
    """

    RIGHT = "right"
    AS_CLAIMED = "as-claimed"
    REFUSED = "refused"
    WRONG = "wrong"


@dataclass(frozen=True)
class ExtremeCase:
    """How right one answer is, or that there is none.

    Attributes:
        family, case: what was asked.
        quantity: of its answers, the one nearest to the limit.
        error: of that quantity, relative to 50 digits.
        condition: of that quantity; see `exact_impact.conditions`.
        worst_error: the largest of all answers.
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
    def verdict(self) -> Correctness:
        """How the answer compares with what the condition allows, and with what it claims."""
        if self.refusal:
            return Correctness.REFUSED
        if self.error == math.inf or self.digits < min(self.allowed, self.claimed):
            return Correctness.WRONG
        return Correctness.RIGHT if self.digits >= self.allowed else Correctness.AS_CLAIMED

    def as_json(self) -> dict[str, object]:
        """Return plain values and the verdict; what is infinite, of something wrong, as null."""
        values = {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }
        return values | {"verdict": self.verdict}


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
    """Return the case with the worst verdict; among equals, what has least digits to spare.

    Relative errors, conditions and the digits claimed are those of its answers by name; an answer
    that claims none has `FULL`.
    """
    worst = max(errors.values())
    cases = [
        ExtremeCase(
            family, case, name, error, conditions[name], worst, claimed=claims.get(name, FULL)
        )
        for name, error in errors.items()
    ]
    order = (Correctness.WRONG, Correctness.AS_CLAIMED, Correctness.RIGHT)
    return min(cases, key=lambda case: (order.index(case.verdict), case.digits - case.allowed))


def expect_refusal(case: str, attempt: Callable[[], object]) -> ExtremeCase:
    """Return the case of an argument that must be refused."""
    try:
        attempt()
    except KickdynError as error:
        return ExtremeCase(NOT_FINITE, case, refusal=str(error))
    return ExtremeCase(NOT_FINITE, case, "taken", math.inf, 1.0, math.inf)
