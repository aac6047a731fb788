"""The pages tell the truth: snippets print what they say, and every public name is explained."""

import contextlib
import io
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import kickdyn
from kickdyn.view.photo import BROWSERS

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
SNIPPETS = [page for page in sorted(DOCS.glob("*.md")) if "```python" in page.read_text("utf-8")]
DECLARED = {"compliance.md"}
"""Pages whose snippets only name what there is."""


def comparable(text):
    """Return the lines, what is rounding left out: it differs from processor to processor."""
    tiny = re.sub(r"\d(\.\d+)?e-(0[89]|1\d)", "tiny", text)
    return [line.rstrip() for line in tiny.strip("\n").splitlines()]


@pytest.mark.parametrize("page", SNIPPETS, ids=lambda page: page.stem)
def test_snippets_print_what_is_said(page, tmp_path):
    """Blocks of a page run one after the other, as a reader would run them."""
    if page.name in DECLARED:
        return
    for folder in ("urdf", "scenes"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    if "save_photo" in page.read_text("utf-8") and not any(map(shutil.which, BROWSERS)):
        pytest.skip("no chromium or google-chrome to take a picture with")
    blocks = re.findall(r"```(\w+)\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    names = {"__name__": "__main__"}
    printed = None
    for kind, text in blocks:
        if kind == "python":
            assert not (printed or "").strip(), f"nothing says that this prints: {printed}"
            out = io.StringIO()
            with contextlib.redirect_stdout(out), contextlib.chdir(tmp_path):
                exec(compile(text, page.name, "exec"), names)
            printed = out.getvalue()
        elif kind == "text" and printed is not None:
            assert comparable(printed) == comparable(text)
            printed = None
    assert not (printed or "").strip(), f"nothing says that this prints: {printed}"


def test_every_public_name_is_in_the_api():
    source = Path(kickdyn.__file__).read_text("utf-8")
    public = set(re.findall(r"import \w+ as (\w+)$", source, re.MULTILINE)) - {"__version__"}
    api = (DOCS / "api.md").read_text("utf-8")
    listed = re.findall(r"auto\w+:: kickdyn\.(\w+)$", api, re.MULTILINE)
    assert sorted(listed) == sorted(public)


def test_the_site_builds_without_a_warning(tmp_path):
    """But for the notebooks' outputs: those are run by their own tests."""
    pytest.importorskip("sphinx")
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q"]
    options = ["-D", "nb_execution_mode=off", "-d", tmp_path / "trees", DOCS, tmp_path / "site"]
    ended = subprocess.run([*command, *options], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert 'id="kickdyn.Leg.posture"' in (tmp_path / "site" / "api.html").read_text("utf-8")
