"""The README is short, its snippets print the outputs that it shows, and its links exist."""

import contextlib
import io
import re
import shlex
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest
from click.testing import CliRunner

from kickdyn.cli.commands import kickdyn_command

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
PAIRS = [
    (code, expected)
    for (kind, code), (next_kind, expected) in pairwise(BLOCKS)
    if kind == "python" and next_kind == "text"
]


def test_the_readme_is_short_and_has_snippets():
    assert PAIRS
    assert len(README.splitlines()) < 140


@pytest.mark.parametrize(("code", "expected"), PAIRS)
def test_snippets_print_the_outputs_shown(code, expected):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.chdir(ROOT):
        exec(compile(code, "README.md", "exec"), {})
    assert printed.getvalue().strip() == expected.strip()


COMMANDS = [
    line.removeprefix("kickdyn ")
    for kind, text in BLOCKS
    for line in text.splitlines()
    if kind == "sh" and line.startswith("kickdyn ")
]


@pytest.mark.parametrize("command", COMMANDS, ids=[line.split()[0] for line in COMMANDS])
def test_commands_run(command, tmp_path, monkeypatch):
    for folder in ("urdf", "data"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    arguments = shlex.split(command)
    if "mujoco" in command:
        pytest.importorskip("mujoco")
    if "--motion" in command:
        pytest.importorskip("casadi")
    ended = CliRunner().invoke(kickdyn_command, arguments)
    assert ended.exit_code == 0, ended.output
    for option, file in pairwise(arguments):
        if option in ("--view", "--out", "--scene-out"):
            assert Path(file).exists()


def test_the_posture_sweep_module_is_named_once_and_the_script_elsewhere():
    assert re.findall(r"python -m (\S+?)`", README) == ["kickdyn.posture_sweep"]
    assert README.count("python -m kickdyn") == 1


def test_make_targets_exist():
    for target in re.findall(r"^make (\w+)", README, re.MULTILINE):
        ended = subprocess.run(["make", "-n", target], cwd=ROOT, capture_output=True, text=True)
        assert ended.returncode == 0, ended.stderr


def test_pictures_and_links_exist():
    for link in re.findall(r"\]\(([^)#:]+)[)#]", README):
        assert (ROOT / link).exists(), link


def test_the_versions_of_python_are_those_of_the_package():
    tested = re.findall(r"Python :: (3\.\d+)\"", (ROOT / "pyproject.toml").read_text("utf-8"))
    versions = f"{tested[0]} to {tested[-1]}"
    badge = (ROOT / "docs" / "images" / "badge-python.svg").read_text("utf-8")
    install = (ROOT / "docs" / "install.md").read_text("utf-8")
    assert f"Python {versions}" in README
    assert f"Python {versions}" in install
    assert f"python: {versions}" in badge
