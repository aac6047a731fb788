"""docs/robots.md tells the truth: its snippet prints what it says, its table is recomputed."""

import contextlib
import io
import re
import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "robots.md").read_text(encoding="utf-8")


def test_snippet_prints_what_is_said():
    code, said = re.findall(r"```(?:python|text)\n(.*?)```", TEXT, re.DOTALL)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "robots.md", "exec"), {})
    assert printed.getvalue().strip() == said.strip()


def test_table_is_what_the_script_prints():
    script = runpy.run_path(str(ROOT / "benchmarks" / "robots_table.py"))
    assert script["table"]() in TEXT
