"""One number of the paper, beside ours."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum

from kickdyn.core.files import plain

MEASURED = 0.1
"""How near our number must be to one of the test bed, or of its simulation, relative."""

FITTED = 0.005
"""The same where quantities that the paper does not give are fitted to the number."""

DECISIVE_RATIO = 2.0
"""Ratio of our numbers with two coefficients from which on the item depends on the coefficient."""


class Finding(StrEnum):
    """How our number compares with the paper's; `MEANINGS` says it in words."""

    REPRODUCED = "reproduced"
    SHAPE_REPRODUCED = "shape-reproduced"
    DEPENDS = "depends-on-coefficient"
    FITTED = "fitted"
    OURS = "ours"
    NOT_REACHABLE = "not-reachable"


MEANINGS = {
    Finding.REPRODUCED: f"predicted, and within {100 * MEASURED:g} % of the value of the test bed",
    Finding.SHAPE_REPRODUCED: "agrees with a curve, an order or a statement of the paper",
    Finding.DEPENDS: "another drag or lift coefficient, of which the paper prints none, changes "
    f"the verdict, or the value by more than a factor of {DECISIVE_RATIO:g}",
    Finding.FITTED: "a quantity that the paper does not give is chosen so that the paper's value "
    f"results within {100 * FITTED:g} %; the agreement confirms nothing",
    Finding.OURS: "the paper has no value to compare with, or only the goal",
    Finding.NOT_REACHABLE: "computed to be impossible under the assumptions in the note",
}


@dataclass(frozen=True)
class Item:
    """A number of the paper, ours, and a verdict on the difference.

    Attributes:
        item: where it stands, such as `Table 2 a total`.
        paper: the number that the paper prints; None if it gives only a curve or words.
        ours: the number that kickdyn computes.
        unit: of both.
        verdict: see `MEANINGS`.
        why: in one line.
        source: equation or assumption used.
        variant: other coefficients than in `DEFAULT`, where they are used.
        notes: warnings of the flights, and results of other coefficients.
    """

    item: str
    paper: float | None
    ours: float
    unit: str
    verdict: Finding
    why: str
    source: str
    variant: str = ""
    notes: tuple[str, ...] = ()

    @property
    def relative_error(self) -> float | None:
        """Our number over the paper's, less 1; None if the paper prints none, or 0."""
        return self.ours / self.paper - 1 if self.paper else None

    @property
    def difference(self) -> str:
        """The relative error as it is shown, with two digits of a per cent; empty if it is None."""
        error = self.relative_error
        return "" if error is None else f"{100 * error:+.2f} %".replace("-0.00", "+0.00")

    def as_json(self) -> dict[str, object]:
        """Return plain values, as documented for `--json`."""
        values = asdict(self) | {
            "item": f"{self.item} [{self.variant}]" if self.variant else self.item,
            "ours": plain(self.ours),
            "relative_error": self.relative_error,
        }
        del values["variant"]
        return values


def near(ours: float, paper: float, limit: float, verdict: Finding = Finding.REPRODUCED) -> Finding:
    """Return the verdict where our number is within a relative limit of the paper's."""
    return verdict if abs(ours / paper - 1) <= limit else Finding.NOT_REACHABLE


def shape(holds: bool) -> Finding:
    """Return the verdict on a curve or an order."""
    return Finding.SHAPE_REPRODUCED if holds else Finding.NOT_REACHABLE


def judged(item: Item, variants: Sequence[Item], coefficients: str) -> Item:
    """Return an item with `DEPENDS` as its verdict where other coefficients give another answer.

    A note then has both numbers, the item's own with the name of its `coefficients`: the other one
    is the farthest away, of those with another verdict if there are any.
    """

    def distance(other: Item) -> float:
        small, large = sorted((abs(item.ours), abs(other.ours)))
        return large / small if small else 1.0

    changed = [other for other in variants if other.verdict != item.verdict]
    farthest = max(changed or variants, key=distance, default=item)
    if not changed and distance(farthest) <= DECISIVE_RATIO:
        return item
    unit = "" if item.unit == "1" else f" {item.unit}"
    note = (
        f"{item.ours:.3g}{unit} with {coefficients}; {farthest.ours:.3g}{unit} with "
        f"{farthest.variant}"
    )
    if changed:
        note += f", for which the verdict is {farthest.verdict}"
    return replace(item, verdict=Finding.DEPENDS, notes=(*item.notes, note))
