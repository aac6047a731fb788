"""One number of the paper, beside ours."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["reproduced", "shape reproduced", "not reachable"]


@dataclass(frozen=True)
class Item:
    """A number of the paper, ours, and what to think of the difference.

    Attributes:
        item: where it stands, such as `Table 2 a total`.
        paper: what the paper prints; None where it gives only a curve.
        ours: what kickdyn computes.
        unit: of both.
        verdict: `reproduced`; `shape reproduced`, where the paper gives only a curve or an order;
            `not reachable`, where what the run computes, with the assumptions named, excludes it.
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


def shape(holds: bool) -> Verdict:
    """Return the verdict on a curve or an order."""
    return "shape reproduced" if holds else "not reachable"
