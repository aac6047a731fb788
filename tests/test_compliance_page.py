"""The tables of docs/compliance.md are the output of their script."""

import contextlib
import io
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SCRIPT, PAGE = ROOT / "benchmarks" / "compliance.py", ROOT / "docs" / "compliance.md"


@pytest.mark.skipif(not SCRIPT.exists(), reason="benchmarks come with the checkout only")
def test_every_row_is_the_output_of_the_script():
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        runpy.run_path(str(SCRIPT), run_name="__main__")
    rows = [line for line in printed.getvalue().splitlines() if line.startswith("|")]
    page = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    assert rows == page
    assert "instant: impulse 8.533 N s" in printed.getvalue()
