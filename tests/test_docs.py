"""Snippets and commands of the docs run, and print the numbers that the pages show."""

import contextlib
import doctest
import io
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from shown_numbers import first_missing

import kickdyn
from kickdyn.cli.commands import kickdyn_command
from kickdyn.view.document import BROWSERS

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
GUIDES = [DOCS / "tutorial.md", *sorted((DOCS / "how-to").glob("*.md"))]
SNIPPETS = [
    page
    for page in [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
    if page in GUIDES or "```python" in page.read_text("utf-8")
]
MADE = runpy.run_path(str(DOCS / "reference_tables.py"))
API = MADE["read"]("reference/api")

SLOW = {
    *("standing", "own-robot", "pages", "carry-out", "sweeps", "learning", "identification"),
    *("which-function", "measured-impacts", "moving-balls", "api"),
    *("choose_surface", "reach", "run_in_mujoco", "run_with_noise", "simulate_many"),
}
"""Pages and functions whose snippets are run by `make test-slow`."""


def named(names):
    """Return parameters with their names, the slow ones marked."""
    slow = pytest.mark.slow
    return [
        pytest.param(names[name], id=name, marks=slow if name in SLOW else ()) for name in names
    ]


def run_command(line):
    """Return what one line of a shell prints if it is a command of kickdyn; run no others."""
    program, *words = shlex.split(line, comments=True) or [""]
    if program != "kickdyn":
        return ""
    result = CliRunner().invoke(kickdyn_command, words)
    assert result.exit_code == 0, f"{line}\n{result.output}"
    return result.output


@pytest.mark.parametrize("page", named({page.stem: page for page in SNIPPETS}))
def test_snippets_run_and_print_the_numbers_shown(page, tmp_path):
    """As a reader would run them; in the guides also `sh` blocks and commands after a `$`.

    Blocks of `bash` are not run: they take long, or need files of others.
    """
    for folder in ("urdf", "scenes", "data"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    text = page.read_text("utf-8")
    if '.save("picture.png")' in text and not any(map(shutil.which, BROWSERS)):
        pytest.skip("no chromium or google-chrome to take a picture with")
    names, printed, with_commands = {"__name__": "__main__"}, "", page in GUIDES
    for kind, block in re.findall(r"^```(\w+)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.chdir(tmp_path):
            if kind == "python":
                exec(compile(block, page.name, "exec"), names)
                printed = out.getvalue()
            elif kind == "sh" and with_commands:
                for line in block.replace("\\\n", " ").splitlines():
                    run_command(line)
            elif kind == "text":
                shown = block
                if block.startswith("$ kickdyn ") and with_commands:
                    line, shown = block.removeprefix("$ ").split("\n", 1)
                    printed = run_command(line)
                missing = first_missing(shown, printed) if printed else None
                assert missing is None, f"{missing} is shown, but printed is:\n{printed}"
                printed = ""


@pytest.mark.parametrize("page", MADE["PAGES"])
def test_a_page_has_a_place_for_each_table_that_is_made(page):
    text = (DOCS / f"{page}.md").read_text("utf-8")
    assert set(re.findall(r"<!-- (\w+) -->", text)) == MADE["PAGES"][page].keys()
    assert all(block() in MADE["read"](page) for block in MADE["PAGES"][page].values())


def test_every_public_name_is_in_the_api():
    listed = re.findall(r"auto\w+:: kickdyn\.(\w+)$", API, re.MULTILINE)
    assert sorted(listed) == sorted(kickdyn.__all__)


EXAMPLES = {
    test.name: test
    for name in kickdyn.__all__
    for test in doctest.DocTestFinder().find(getattr(kickdyn, name), name, module=False, globs={})
    if test.examples
}


class Checker(doctest.OutputChecker):
    """Compares numbers to the digits shown."""

    def check_output(self, want, got, flags):
        return bool(got.strip()) == bool(want.strip()) and first_missing(want, got) is None


@pytest.mark.parametrize("example", named(EXAMPLES))
def test_examples_in_docstrings_give_the_numbers_shown(example):
    assert doctest.DocTestRunner(Checker()).run(example).failed == 0


def test_imports_of_snippets_and_notebooks_are_in_the_api():
    listed = set(re.findall(r"auto\w+:: (kickdyn\.\S+)$", API, re.MULTILINE))
    texts = [page.read_text("utf-8") for page in SNIPPETS]
    texts += [file.read_text("utf-8") for file in (ROOT / "notebooks").glob("*.ipynb")]
    pairs = {
        (module, name)
        for text in texts
        for module, names in re.findall(r"from (kickdyn\.[\w.]+) import ([\w, ]+)", text)
        for name in names.replace(" ", "").split(",")
    }
    assert pairs
    assert not [pair for pair in pairs if not {pair[0], ".".join(pair)} & listed]


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    """The notebooks are not executed here; their own tests do that."""
    for package in ("sphinx", "latex2mathml", "sphinx_click"):
        pytest.importorskip(package)
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q"]
    options = ["-D", "nb_execution_mode=off", "-d", tmp_path / "trees", DOCS, tmp_path / "site"]
    ended = subprocess.run([*command, *options], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")
    pages = {page.stem: page.read_text("utf-8") for page in (tmp_path / "site").rglob("*.html")}
    assert 'id="kickdyn.Leg.posture"' in pages["api"]
    for name, html in pages.items():
        assert not re.search(r"<(script|img|link)[^>]*(src|href)=\"(https?:)?//", html), name
        assert not re.search(r"\\[(\[]\S|\$\$", re.sub(r"(?s)<pre>.*?</pre>", "", html)), name
    assert pages["theory"].count("<math") > 30
