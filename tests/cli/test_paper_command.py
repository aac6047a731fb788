import json
import subprocess
import sys

import pytest


def door(*arguments, cwd=None):
    noise = "ignore:zmq.eventloop.ioloop is deprecated"  # meshcat's
    command = [sys.executable, "-W", "error", "-W", noise, "-m", "kickdyn", "paper", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=3600, cwd=cwd)


def test_everything(tmp_path):
    ended = door("--json", "paper.json", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    for words in (
        "case 1 spin",
        "not-reachable",
        "wrote paper.json",
    ):
        assert words in ended.stdout
    items = json.loads((tmp_path / "paper.json").read_text())
    names = [item["item"] for item in items]
    assert len(names) == len(set(names)) > 180
    assert "Fig. 9 case 1 spin" in names
    assert "Fig. 8 drag range [lift wang]" in names


def test_json_on_stdout_stands_alone():
    ended = door("--only", "table 2", "--json", "-")
    assert len(json.loads(ended.stdout)) == 18


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only", "table 7"], "only is 'table 7': it must be one of fig1, fig7, "),
        (["--json", "no/where.json"], "cannot be written"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(tmp_path, arguments, words):
    (tmp_path / "file").write_text("")
    ended = door(*arguments, cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert words in ended.stderr
    assert ended.stderr.count("\n") == 1
