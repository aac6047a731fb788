"""One number of the paper, beside ours."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

COMPUTED = 0.003
"""How near our number must be to one that the paper computed, relative."""

MEASURED = 0.1
"""The same for a number of the test bed, or of its simulation."""

FITTED = 0.005
"""The same where what the paper does not give is fitted to the number."""


class Verdict(StrEnum):
    """How our number compares with the paper's."""

    REPRODUCED = "reproduced"
    SHAPE_REPRODUCED = "shape-reproduced"
    FITTED = "fitted"
    OURS = "ours"
    NOT_REACHABLE = "not-reachable"


MEANINGS = {
    Verdict.REPRODUCED: f"within {100 * COMPUTED:g} % of the paper's number in Fig. 8, within "
    f"{100 * MEASURED:g} % in Tables 4-5, which are of the test bed",
    Verdict.SHAPE_REPRODUCED: "the paper gives a curve or an order only, and ours has it",
    Verdict.FITTED: "what the paper does not give is chosen so that its number results, in Table 2 "
    f"and Fig. 9 within {100 * FITTED:g} %: no confirmation",
    Verdict.OURS: "the paper has no number to compare with, or the goal only",
    Verdict.NOT_REACHABLE: "excluded by what the run computes, with the assumptions named",
}
"""Every verdict in words."""


@dataclass(frozen=True)
class Item:
    """A number of the paper, ours, and a verdict on the difference.

    Attributes:
        item: where it stands, such as `Table 2 a total`.
        paper: what the paper prints; None where it gives only a curve.
        ours: what kickdyn computes.
        unit: of both.
        verdict: see `MEANINGS`.
        why: in one line.
        source: equation or assumption used.
        variant: other coefficients than the default ones, where they are used.
    """

    item: str
    paper: float | None
    ours: float
    unit: str
    verdict: Verdict
    why: str
    source: str
    variant: str = ""

    @property
    def relative_error(self) -> float | None:
        """Our number over the paper's, less 1; None where the paper prints none, or 0."""
        return self.ours / self.paper - 1 if self.paper else None

    @property
    def difference(self) -> str:
        """The relative error as it is shown, with two digits of a per cent; empty if it is None."""
        error = self.relative_error
        return "" if error is None else f"{100 * error:+.2f} %".replace("-0.00", "+0.00")

    def as_json(self) -> dict[str, object]:
        """Return plain values, as documented for `--json`."""
        return {
            "item": f"{self.item} [{self.variant}]" if self.variant else self.item,
            "paper": self.paper,
            "ours": self.ours if math.isfinite(self.ours) else None,
            "unit": self.unit,
            "relative_error": self.relative_error,
            "verdict": self.verdict,
            "why": self.why,
            "source": self.source,
        }


def near(ours: float, paper: float, limit: float, verdict: Verdict = Verdict.REPRODUCED) -> Verdict:
    """Return the verdict where our number is within a relative limit of the paper's."""
    return verdict if abs(ours / paper - 1) <= limit else Verdict.NOT_REACHABLE


def shape(holds: bool) -> Verdict:
    """Return the verdict on a curve or an order."""
    return Verdict.SHAPE_REPRODUCED if holds else Verdict.NOT_REACHABLE
