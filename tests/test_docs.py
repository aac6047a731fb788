"""The pages show what snippets and commands print, and have every name, key and variable."""

import ast
import contextlib
import doctest
import io
import json
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

import kickdyn
from kickdyn.cli.commands import kickdyn_command
from kickdyn.view.document import BROWSERS

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
GUIDES = [DOCS / "tutorial.md", *sorted((DOCS / "how-to").glob("*.md"))]
SNIPPETS = [
    page
    for page in sorted(DOCS.rglob("*.md"))
    if page in GUIDES or "```python" in page.read_text("utf-8")
]


def comparable(text):
    """Return the lines without the blanks at their ends."""
    return [line.rstrip() for line in text.strip("\n").splitlines()]


def run_command(line):
    """Return what one line of a shell prints if it is a command of kickdyn; run no others."""
    program, *arguments = shlex.split(line, comments=True) or [""]
    if program != "kickdyn":
        return ""
    result = CliRunner().invoke(kickdyn_command, arguments)
    assert result.exit_code == 0, f"{line}\n{result.output}"
    return result.output


@pytest.mark.parametrize("page", SNIPPETS, ids=lambda page: page.stem)
def test_snippets_print_the_outputs_shown(page, tmp_path):
    """Blocks of a page run one after the other, as a reader would run them.

    In the tutorial and the how-to guides these are the commands of `sh` blocks too, and those whose
    output is shown after a `$`. Blocks of `bash` are not run: they take long, or need files that
    the repository does not contain.
    """
    for folder in ("urdf", "scenes", "data"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    if '.save("picture.png")' in page.read_text("utf-8") and not any(map(shutil.which, BROWSERS)):
        pytest.skip("no chromium or google-chrome to take a picture with")
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    with_commands = page in GUIDES
    names = {"__name__": "__main__"}
    printed = None
    for kind, text in blocks:
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.chdir(tmp_path):
            if kind == "python":
                assert not (printed or "").strip(), f"no output block shows: {printed}"
                exec(compile(text, page.name, "exec"), names)
                printed = out.getvalue()
            elif kind == "sh" and with_commands:
                for line in text.replace("\\\n", " ").splitlines():
                    run_command(line)
            elif kind == "text" and text.startswith("$ kickdyn ") and with_commands:
                line, shown = text.removeprefix("$ ").split("\n", 1)
                assert comparable(run_command(line)) == comparable(shown)
            elif kind == "text" and printed is not None:
                assert comparable(printed) == comparable(text)
                printed = None
    assert not (printed or "").strip(), f"no output block shows: {printed}"


@pytest.mark.parametrize("page", ["scene-file.md", "dataset.md", "bibliography.md"])
def test_tables_made_from_the_code_are_current(page):
    """`python docs/reference_tables.py` writes them."""
    made = runpy.run_path(str(DOCS / "reference_tables.py"))["current"](page)
    current = (DOCS / "reference" / page).read_text("utf-8")
    assert made == current, "run python docs/reference_tables.py"


def test_the_scene_of_the_reference_is_valid(tmp_path):
    page = (DOCS / "reference" / "scene-file.md").read_text("utf-8")
    (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "volley.toml").write_text(text, "utf-8")
    assert kickdyn.load_scene(tmp_path / "volley.toml").name == "volley"


def test_every_attribute_of_a_sweep_is_in_the_reference():
    page = (DOCS / "reference" / "dataset.md").read_text("utf-8")
    kick = kickdyn.Kick(restitution="peacock-ball")
    data = kickdyn.sweep(kickdyn.Leg.human(), {"knee": [0.5]}, kick)
    attributes = page.split("## Attributes")[1]
    assert {f"`{name}`" for name in data.attrs} == set(re.findall(r"`\w+`", attributes)) - {
        "`carry`"
    }


def test_every_extra_is_in_the_installation_page():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    page = (DOCS / "install.md").read_text("utf-8")
    for extra in settings["project"]["optional-dependencies"]:
        assert f"`{extra}`" in page, extra


def test_every_public_name_is_in_the_api():
    api = (DOCS / "reference" / "api.md").read_text("utf-8")
    listed = re.findall(r"auto\w+:: kickdyn\.(\w+)$", api, re.MULTILINE)
    assert sorted(listed) == sorted(kickdyn.__all__)


EXAMPLES = {
    test.name: test
    for name in kickdyn.__all__
    for test in doctest.DocTestFinder().find(getattr(kickdyn, name), name, module=False, globs={})
    if test.examples
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_in_docstrings_give_what_they_show(name):
    assert doctest.DocTestRunner().run(EXAMPLES[name]).failed == 0


def imported():
    """Return the full names that snippets and notebooks import from modules of kickdyn."""
    notebooks = sorted((ROOT / "notebooks").glob("*.ipynb"))
    cells = [cell for file in notebooks for cell in json.loads(file.read_text("utf-8"))["cells"]]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    for page in [ROOT / "README.md", *SNIPPETS]:
        code += re.findall(r"```python\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    trees = [ast.parse(re.sub(r"(?m)^%.*$", "", text)) for text in code]
    return {
        f"{node.module}.{name.name}"
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module.startswith("kickdyn.")
        for name in node.names
    }


def test_imports_of_snippets_and_notebooks_are_in_the_api():
    api = (DOCS / "reference" / "api.md").read_text("utf-8")
    listed = set(re.findall(r"auto\w+:: (kickdyn\.\S+)$", api, re.MULTILINE))
    names = imported()
    assert "kickdyn.view.wall_and_goal.wall_boxes" in names
    assert sorted(name for name in names - listed if name.rpartition(".")[0] not in listed) == []


def test_the_site_builds_without_a_warning(tmp_path):
    """The notebooks are not executed here; their own tests do that."""
    pytest.importorskip("sphinx")
    pytest.importorskip("latex2mathml")
    pytest.importorskip("sphinx_click")
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q"]
    options = ["-D", "nb_execution_mode=off", "-d", tmp_path / "trees", DOCS, tmp_path / "site"]
    ended = subprocess.run([*command, *options], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")
    api = (tmp_path / "site" / "reference" / "api.html").read_text("utf-8")
    assert 'id="kickdyn.Leg.posture"' in api
    assert "ArrayLike" in api
    assert "_SupportsArray" not in api
    index = (tmp_path / "site" / "searchindex.js").read_text("utf-8")
    index = json.loads(index[index.index("{") : index.rindex("}") + 1])
    for word in ("mimic", "restitut", "mujoco"):  # the stems that the search looks for
        assert word in index["titleterms"], word
    pages = {page.stem: page.read_text("utf-8") for page in (tmp_path / "site").rglob("*.html")}
    for name, html in pages.items():
        assert not re.search(r"<(script|img|link)[^>]*(src|href)=\"(https?:)?//", html), name
        assert not re.search(r"\\[(\[]\S|\$\$", re.sub(r"(?s)<pre>.*?</pre>", "", html)), name
    assert pages["theory"].count("<math") > 30
    assert "(2-4)" in pages["theory"]
