"""Every extreme but the long chains: right, as claimed, or refused; and a wrong answer is seen."""

import io
import json
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from extremes import extreme_flights, extreme_impacts, extremes_report
from extremes.extreme_case import NOT_FINITE, ExtremeCase
from extremes.gains import gains

VERDICTS = Path(__file__).parent / "verdicts.json"
PAGE = Path(__file__).resolve().parents[2] / "docs" / "explanation" / "verification.md"
EXACT = ("posture", "mass", "coefficient", "approach", "central", "rank", "short link", "turning")
EXACT += ("slow",)
"""Families of which every row has the digits that its condition allows."""


@pytest.fixture(scope="module")
def rows():
    return list(extremes_report.extreme_cases(longest=2, drags=["stokes"]))


def test_no_answer_is_wrong(rows):
    assert [row for row in rows if row.verdict == "wrong"] == []


def test_as_many_cases_are_right_as_the_page_says(rows):
    """About 180 with the drags that are left out here, more than 130 with all digits."""
    finite = [row.verdict for row in rows if row.family != NOT_FINITE]
    assert 160 < len(finite) < 175
    assert finite.count("right") > 130


def test_the_page_counts_what_make_extremes_stored(rows):
    """The stored verdicts are those of all cases; the ones computed here are among them.

    Whether a result has the last of its digits depends on the processor, so `right` and
    `as-claimed` count as equal.
    """
    stored = {(family, case): verdict for family, case, verdict in json.loads(VERDICTS.read_text())}
    equal = {"as-claimed": "right"}
    for row in rows:
        verdict = stored[row.family, row.case]
        assert equal.get(row.verdict, row.verdict) == equal.get(verdict, verdict), row
    finite = [verdict for (family, _), verdict in stored.items() if family != NOT_FINITE]
    page = " ".join(PAGE.read_text("utf-8").split())
    (about,) = re.findall(r"50 digits in about (\d+) extreme cases", page)
    (least,) = re.findall(r"In more than (\d+) cases the result has all of these", page)
    assert int(about) == round(len(finite), -1)
    assert 0 < finite.count("right") - int(least) <= 15
    assert "wrong" not in stored.values()
    assert {verdict for key, verdict in stored.items() if key[0] == NOT_FINITE} == {"refused"}


def test_what_numbers_can_hold_is_right_to_ten_digits(rows):
    for row in rows:
        if row.verdict == "right" and row.allowed >= 10:
            assert row.digits >= 10, row
        if row.family in EXACT:
            assert row.verdict == "right", row
            assert row.allowed >= 12, row


def test_only_what_has_no_answer_is_refused(rows):
    refusals = [row.case for row in rows if row.refusal and row.family != NOT_FINITE]
    cancel = [f"approach of {share:g} of the speed" for share in (1e-15, 1e-16)]
    assert refusals == ["links of 1e-06, 1, 1e+06 m", *cancel]
    assert all(row.refusal for row in rows if row.family == NOT_FINITE)


def test_long_chains_say_how_many_digits_their_joints_have():
    kick = next(kick for kick in extreme_impacts.sizes(50) if kick.name == "chain of 50")
    row = extreme_impacts.judge("size", kick)
    assert row.verdict == "as-claimed"
    hit = kick.impact()
    assert (np.diff(hit.joint_digits[::7]) > 0).all()  # more towards the foot
    assert hit.joint_digits[-1] > 10 > hit.joint_digits[0]


def test_a_wrong_answer_is_seen(monkeypatch):
    kick = next(extreme_impacts.masses())
    right = extreme_impacts.answers
    monkeypatch.setattr(
        extreme_impacts, "answers", lambda hit: right(hit) | {"impulse": hit.impulse * (1 + 1e-12)}
    )
    row = extreme_impacts.judge("mass", kick)
    assert (row.verdict, row.quantity) == ("wrong", "impulse")


def test_formulas_in_use_keep_what_the_plain_ones_lose():
    for gain in gains():
        allowed = 1e-10 if "bent" in gain.what else 1e-14  # the condition takes five digits there
        assert gain.our_error < allowed
        assert gain.plain_error > 20 * gain.our_error


def test_arguments_that_are_no_numbers_count_by_themselves():
    found = [
        ExtremeCase("f", "a"),
        ExtremeCase("f", "b", refusal="no"),
        ExtremeCase(NOT_FINITE, "c", refusal="no"),
    ]
    said = extremes_report.summary(found)
    assert said == (
        "2 cases: 1 right, 0 as-claimed, 1 refused, 0 wrong; not finite: 1 of 1 refused"
    )
    taken = ExtremeCase(NOT_FINITE, "d", "taken", math.inf, 1.0, math.inf)
    assert extremes_report.summary([*found, taken]).endswith("not finite: 1 of 2 refused, 1 wrong")


def test_verdicts_are_whole_at_eighty_columns():
    found = [
        ExtremeCase(
            "f", "bent by 1e-200 rad, normal along it", "effective mass", 1e-12, 1.5, claimed=8.1
        ),
        ExtremeCase(
            "f", "ball", refusal="the joint-space inertia is not positive definite: " + 50 * "x "
        ),
    ]
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(extremes_report.case_table(found))
    lines = console.export_text().splitlines()
    assert any(line.rstrip().endswith(" as-claimed (8.1)") for line in lines)
    assert any(line.rstrip().endswith(" refused") for line in lines)
    assert max(map(len, lines)) <= 80


def test_flights_at_a_tolerance_are_judged_by_another_integrator(monkeypatch):
    monkeypatch.setattr(extreme_flights, "exact_landing", lambda *_: np.array([30.0, 0.0, 0.0]))
    assert next(extreme_flights.tolerances()).verdict == "wrong"


def test_the_command_refuses_before_it_works(tmp_path):
    command = [
        sys.executable,
        str(Path(__file__).parent),
        "--json",
        str(tmp_path / "no" / "x"),
    ]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (2, "")
