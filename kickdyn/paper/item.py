"""One number of the paper, beside ours."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["reproduced", "shape reproduced", "fitted", "ours", "not reachable"]

COMPUTED = 0.003
"""How near to a number that the paper computed ours must be, relative."""

MEASURED = 0.1
"""Likewise to a number of the test bed, or of its simulation."""

FITTED = 0.005
"""Likewise where what the paper leaves out is fitted to it."""

MEANINGS: dict[str, str] = {
    "reproduced": f"within {100 * COMPUTED:g} % of the paper's number in Fig. 8, within "
    f"{100 * MEASURED:g} % in Tables 4-5, which are of the test bed",
    "shape reproduced": "the paper gives a curve or an order only, and ours has it",
    "fitted": "what the paper leaves out is chosen so that its number comes out, in Table 2 and "
    f"Fig. 9 within {100 * FITTED:g} %: no confirmation",
    "ours": "the paper has no number to compare with, or the goal only",
    "not reachable": "excluded by what the run computes, with the assumptions named",
}
"""Every verdict in words."""


@dataclass(frozen=True)
class Item:
    """A number of the paper, ours, and what to think of the difference.

    Attributes:
        item: where it stands, such as `Table 2 a total`.
        paper: what the paper prints; None where it gives only a curve.
        ours: what kickdyn computes.
        unit: of both.
        verdict: one of `MEANINGS`.
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
        """Ours over the paper's, less 1; None where the paper prints no number, or 0."""
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


def near(ours: float, paper: float, limit: float, verdict: Verdict = "reproduced") -> Verdict:
    """Return the verdict on a number that is to be within a limit of the paper's, relative."""
    return verdict if abs(ours / paper - 1) <= limit else "not reachable"


def shape(holds: bool) -> Verdict:
    """Return the verdict on a curve or an order."""
    return "shape reproduced" if holds else "not reachable"
