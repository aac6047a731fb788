"""Commands of the README run, and its links exist; `test_docs.py` runs its snippets."""

import re
import shlex
import shutil
from itertools import pairwise
from pathlib import Path

import pytest
from click.testing import CliRunner

from kickdyn.cli.commands import kickdyn_command

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"(?m)^kickdyn (.*)$", "".join(re.findall(r"(?s)```sh\n(.*?)```", README)))


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
    assert COMMANDS
    assert not [link for link in links if not (ROOT / link).exists()]
