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


def test_the_page_has_every_measurement_and_explains_what_is_outside():
    cells = [line.strip("| ").split(" | ") for line in rows(PAGE)]
    names = {row[0] for row in cells}
    expected = {f"M{k}" for k in range(1, 12)} | {f"A{k}" for k in range(1, 5)}
    assert names == expected | {"Table 4", "Table 5"}
    for row in cells:
        if "outside" in row[4] or "not comparable" in row[4]:
            assert len(row) == 6, row
            assert row[5], row


def test_the_readme_repeats_rows_of_the_page():
    page = [line.strip("| ").split(" | ") for line in rows(PAGE)]
    given = {(row[0], *row[2:5]) for row in page}
    for line in rows(README):
        number, _, *values = line.strip("| ").split(" | ")
        assert (number, *values) in given
