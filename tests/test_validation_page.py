"""The tables of validation.md and README.md are the output of benchmarks/validation.py."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGE, README = ROOT / "docs" / "explanation" / "validation.md", ROOT / "README.md"
BENCHMARKS = ROOT / "benchmarks"


def rows(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    row = re.compile(r"\| ([MA]\d+|Table [45]) \|( .* \|){3}")
    return [line for line in lines if row.match(line)]


@pytest.mark.skipif(not BENCHMARKS.exists(), reason="benchmarks come with the checkout only")
def test_the_rows_are_those_of_the_script(monkeypatch):
    """All but those of whole flights of the match, which take long, are computed."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import validation

    try:
        found = [row for part in validation.PARTS if part != validation.tracked for row in part()]
    finally:
        for name in ("validation", "compliance", "spin_offset"):
            sys.modules.pop(name, None)
    page = [line for line in rows(PAGE) if not line.startswith("| A1 |")]
    assert validation.lines(found)[2:] == page
    readme = [line for line in rows(README) if not line.startswith("| A1 |")]
    assert validation.short_lines(found)[2:] == readme


@pytest.mark.skipif(not BENCHMARKS.exists(), reason="benchmarks come with the checkout only")
def test_the_rules_of_the_verdicts(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import validation

    try:
        found = [validation.within(1, 3, *values) for values in ((1, 3), (0.9, 2), (0.9, 3.1))] + [
            validation.range_within(1, 3, *ends)
            for ends in ((1, 3), (0.5, 1), (2, 4), (0.5, 4), (0.1, 0.9), (3.1, 4))
        ]
        assert validation.close((1.09, 1.0), (0.91, 1.0)) == "inside"
        assert validation.close((1.11, 1.0), (0.91, 1.0)) == "**partly**"
        assert validation.sign(-0.1, 1) == "**outside**, not this sign"
    finally:
        for name in ("validation", "compliance", "spin_offset"):
            sys.modules.pop(name, None)
    partly, outside = "**partly**", "**outside**"
    assert found == ["inside", partly, outside, "inside", *[partly] * 3, outside, outside]


def test_the_page_has_every_measurement_and_explains_what_is_outside():
    cells = [line.strip("| ").split(" | ") for line in rows(PAGE)]
    names = {row[0] for row in cells}
    expected = {f"M{k}" for k in range(1, 12)} | {f"A{k}" for k in range(1, 5)}
    assert names == expected | {"Table 4", "Table 5"}
    for row in cells:
        if any(word in row[4] for word in ("outside", "partly", "not comparable")):
            assert len(row) == 6, row
            assert row[5], row


def test_the_readme_repeats_rows_of_the_page():
    page = [line.strip("| ").split(" | ") for line in rows(PAGE)]
    given = {(row[0], *row[2:5]) for row in page}
    for line in rows(README):
        number, _, *values = line.strip("| ").split(" | ")
        assert (number, *values) in given
