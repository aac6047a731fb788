"""docs/robots.md tells the truth: its table is recomputed."""

import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "robots.md").read_text(encoding="utf-8")


def test_table_is_what_the_script_prints():
    script = runpy.run_path(str(ROOT / "benchmarks" / "robots_table.py"))
    assert script["table"]() in TEXT
