"""At the extremes every answer is right, as exact as it claims, or refused."""

import re
from pathlib import Path

import pytest

from extremes import extreme_flights, extreme_impacts
from extremes.exact_coefficients import FORMULAS, MODELS
from extremes.extreme_case import ExtremeCase

PAGE = Path(__file__).resolve().parents[2] / "docs" / "explanation" / "verification.md"
EXACT = ("posture", "mass", "coefficient", "approach")
"""Families of which every row has the digits that its condition allows, at least 12."""


@pytest.mark.slow
def test_every_extreme_is_right_or_as_claimed_or_refused_and_counted_on_the_page():
    """Without the longest chain, whose reference takes half a minute."""
    finite = [*extreme_impacts.impact_cases(longest=50), *extreme_flights.flight_cases()]
    right = sum(row.verdict == "right" for row in finite)
    assert [row for row in finite if row.verdict == "wrong"] == []
    assert [row for row in finite if row.family in EXACT and row.allowed < 12] == []
    assert [row for row in finite if row.family in EXACT and row.verdict != "right"] == []
    assert sum(bool(row.refusal) for row in finite) <= 4
    page = " ".join(PAGE.read_text("utf-8").split())
    (about,) = re.findall(r"50 digits in about (\d+) extreme cases", page)
    (least,) = re.findall(r"In more than (\d+) cases the result has all of these", page)
    assert len(finite) == pytest.approx(int(about), abs=10)
    assert int(least) < right < int(least) + 30


@pytest.mark.parametrize("family", extreme_impacts.FAMILIES)
def test_the_first_impact_of_every_family(family):
    kicks = extreme_impacts.FAMILIES[family]()
    row = extreme_impacts.judge(family, next(kicks))
    assert row.verdict in ("right", "as-claimed"), row
    if family in EXACT:
        assert row.verdict == "right", row
        assert row.allowed >= 12, row


@pytest.mark.parametrize(("kind", "name"), FORMULAS)
def test_coefficients_of_the_air_agree_with_their_sources(kind, name):
    reynolds = (1e-300, 0.5, 3.0, 1e3, 4e4, 6e4, 1.9e5, 5.2e5, 9e5)
    row = extreme_flights.coefficient_case(kind, name, reynolds, (0.0, 0.05, 0.2))
    assert row.verdict == "right", row


def test_every_shipped_model_has_a_formula_in_any_number_of_digits():
    assert set(FORMULAS) == {(kind, name) for kind, models in MODELS.items() for name in models}


@pytest.mark.parametrize(("error", "condition", "claimed", "verdict"),
    [(1e-9, 1e5, 16, "wrong"), (1e-11, 1e5, 16, "right"), (1e-9, 1e5, 8, "as-claimed"),
    (1e-9, 1e5, 9.5, "wrong"), (float("inf"), 1e20, 16, "wrong")])  # fmt: skip
def test_verdicts(error, condition, claimed, verdict):
    row = ExtremeCase("", "", "", error, condition, claimed=claimed)
    assert row.verdict == verdict
