"""docs/planning.md tells the truth: its snippet prints what it says."""

import contextlib
import io
import re
from pathlib import Path

TEXT = (Path(__file__).resolve().parent.parent / "docs" / "planning.md").read_text("utf-8")


def test_snippet_prints_what_is_said():
    code, said = re.findall(r"```(?:python|text)\n(.*?)```", TEXT, re.DOTALL)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "planning.md", "exec"), {})
    assert printed.getvalue().strip() == said.strip()
