"""The table of docs/robots.md is the output of its script."""

import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "robots.md").read_text(encoding="utf-8")


def test_table_is_the_output_of_the_script():
    script = runpy.run_path(str(ROOT / "benchmarks" / "robots_table.py"))
    assert script["table"]() in TEXT
