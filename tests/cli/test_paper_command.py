import json
import subprocess
import sys

import matplotlib.image as image
import pytest


def door(*arguments, cwd=None):
    noise = "ignore:zmq.eventloop.ioloop is deprecated"  # meshcat's
    command = [sys.executable, "-W", "error", "-W", noise, "-m", "kickdyn", "paper", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=cwd)


def test_everything(tmp_path):
    ended = door("--json", "paper.json", "--figures", "figures", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    for words in (
        "case 1 spin",
        "not-reachable",
        "with other coefficients than drag brazuca",
        "wrote figures/fig_8.png",
    ):
        assert words in ended.stdout
    items = json.loads((tmp_path / "paper.json").read_text())
    names = [item["item"] for item in items]
    assert len(names) == len(set(names)) > 200
    assert "Fig. 9 case 1 spin" in names
    figures = sorted((tmp_path / "figures").iterdir())
    assert [file.name for file in figures] == [
        "fig_1.png",
        "fig_10_11.png",
        "fig_13_15.png",
        "fig_8.png",
        "fig_9.png",
        "table_2.png",
    ]
    for file in figures:
        assert image.imread(file)[..., :3].std() > 0.02  # not blank


def test_json_on_stdout_stands_alone():
    ended = door("--only", "table 2", "--json", "-", "--no-sensitivity")
    assert len(json.loads(ended.stdout)) == 18


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only", "table 7"], "only is 'table 7': it must be one of fig1, fig7, "),
        (["--json", "no/where.json"], "cannot be written"),
        (["--figures", "file/figures"], "cannot be created"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(tmp_path, arguments, words):
    (tmp_path / "file").write_text("")
    ended = door(*arguments, cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert words in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_outputs_never_meet(tmp_path):
    folder = tmp_path / "figures"
    folder.mkdir()
    (folder / "fig_9.png").mkdir()
    ended = door("--figures", "figures", cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert [file.name for file in folder.iterdir()] == ["fig_9.png"]
    ended = door("--only", "fig 8", "--figures", ".", "--json", "fig_8.png", cwd=tmp_path)
    assert ended.returncode == 2
    assert "named for two outputs" in ended.stderr


def test_no_folder_where_nothing_is_drawn(tmp_path):
    ended = door("--only", "table3", "--figures", "new", cwd=tmp_path)
    assert ended.returncode == 2
    assert ended.stderr == "kickdyn: --figures is 'new': table3 has no figure\n"
    assert not (tmp_path / "new").exists()
