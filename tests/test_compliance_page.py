"""The numbers of compliance.md are those that the benchmark prints."""

import contextlib
import io
import re
import runpy
from pathlib import Path

import pytest
from shown_numbers import first_missing

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "explanation" / "compliance.md").read_text("utf-8")


def printed_by(script):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        runpy.run_path(str(ROOT / "benchmarks" / script), run_name="__main__")
    return printed.getvalue()


@pytest.mark.slow
def test_the_table_of_the_page_is_printed_and_the_order_is_that_of_hertz(monkeypatch):
    """As the stiffness k grows, the contact time of a Hertzian spring falls with k^-0.4."""
    monkeypatch.setattr("sys.argv", ["compliance.py"])
    printed = printed_by("compliance.py")
    for row in re.findall(r"(?m)^\| \d.*", PAGE):
        assert first_missing(row, printed) is None, row
    tables = [part.splitlines() for part in printed.split("\n\n") if part.startswith("|")]
    stiffer = next(rows for rows in tables if "order in k" in rows[0])
    orders = [float(row.strip("| ").split(" | ")[-1]) for row in stiffer[-2:]]
    assert orders == pytest.approx([-0.4, -0.4], abs=0.005)
