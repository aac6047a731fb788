"""The tables of docs/explanation/compliance.md are the output of a script."""

import contextlib
import io
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SCRIPT, PAGE = (
    ROOT / "benchmarks" / "compliance.py",
    ROOT / "docs" / "explanation" / "compliance.md",
)


def printed_by(script):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        runpy.run_path(str(script), run_name="__main__")
    return printed.getvalue()


@pytest.mark.skipif(not SCRIPT.exists(), reason="benchmarks come with the checkout only")
def test_the_numbers_of_the_page_are_the_output_of_the_script():
    printed = printed_by(SCRIPT)
    tables = [part.splitlines() for part in printed.split("\n\n") if part.startswith("|")]
    page = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    assert page in tables
    stiffer = next(rows for rows in tables if "order in k" in rows[0])
    orders = [float(row.strip("| ").split(" | ")[-1]) for row in stiffer[-2:]]
    assert orders == pytest.approx([-0.4, -0.4], abs=0.005)
    assert "instant: impulse 8.533 N s" in printed
    assert (
        "60 random kicks: impulse 2.9%, direction 2.2 deg at most in half, 10.9% and 4.1 deg at "
        "most in nine tenths"
    ) in printed
