"""Snippets and commands of the README run and print its numbers; its links exist."""

import contextlib
import io
import re
import shlex
import shutil
from itertools import pairwise
from pathlib import Path

import pytest
from click.testing import CliRunner
from shown_numbers import first_missing

from kickdyn.cli.commands import kickdyn_command

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
SNIPPETS = [
    (code, shown)
    for (kind, code), (next_kind, shown) in pairwise(BLOCKS)
    if (kind, next_kind) == ("python", "text")
]
COMMANDS = [
    line.removeprefix("kickdyn ")
    for kind, text in BLOCKS
    for line in text.splitlines()
    if kind == "sh" and line.startswith("kickdyn ")
]


@pytest.mark.parametrize(("code", "shown"), SNIPPETS, ids=lambda text: text.splitlines()[0][:40])
def test_snippets_print_the_numbers_shown(code, shown):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.chdir(ROOT):
        exec(compile(code, "README.md", "exec"), {})
    assert first_missing(shown, printed.getvalue()) is None, printed.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_commands_run(command, tmp_path, monkeypatch):
    for folder in ("urdf", "data"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    for word, package in (("mujoco", "mujoco"), ("--motion", "casadi")):
        if word in command:
            pytest.importorskip(package)
    words = shlex.split(command)
    ended = CliRunner().invoke(kickdyn_command, words)
    assert ended.exit_code == 0, ended.output
    for option, file in pairwise(words):
        if option in ("--view", "--out", "--scene-out"):
            assert Path(file).exists()


def test_pictures_and_links_exist():
    links = re.findall(r"\]\(([^)#:]+)[)#]", README)
    assert links
    assert not [link for link in links if not (ROOT / link).exists()]


@pytest.mark.parametrize("file", ["README.md", "docs/install.md", "docs/images/badge-python.svg"])
def test_the_versions_of_python_are_those_of_the_package(file):
    tested = re.findall(r"Python :: (3\.\d+)\"", (ROOT / "pyproject.toml").read_text("utf-8"))
    assert f"{tested[0]} to {tested[-1]}" in (ROOT / file).read_text("utf-8")
