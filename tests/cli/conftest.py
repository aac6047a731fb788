"""`kickdyn(...)` runs a command line in this process, in an empty folder."""

import json
import shlex
from pathlib import Path
from typing import NamedTuple

import pytest

from kickdyn.cli.commands import kickdyn_command, run

ROOT = Path(__file__).resolve().parents[2]


class Ended(NamedTuple):
    """How a command ended: its exit code, and what it wrote to standard output and error."""

    code: int
    out: str
    err: str

    @property
    def json(self):
        return json.loads(self.out)


@pytest.fixture
def kickdyn(tmp_path, monkeypatch, capsys):
    """Return a function of a line as a shell reads it, and of further words; `code` is expected."""
    monkeypatch.chdir(tmp_path)

    def command(line, *words, code=0):
        words = [*shlex.split(line), *map(str, words)]
        monkeypatch.setattr("sys.argv", ["kickdyn", *words])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            run(kickdyn_command)
        ended = Ended(end.value.code, *capsys.readouterr())
        assert ended.code == code, f"kickdyn {shlex.join(words)}\n{ended.err}"
        return ended

    return command


@pytest.fixture
def written(tmp_path):
    """Return a function that writes a text to a file of the folder."""

    def write(name, text):
        (tmp_path / name).write_text(text, "utf-8")
        return tmp_path / name

    return write


@pytest.fixture
def match_ball(written):
    """Return a function that writes a part of the measured match to match.csv."""
    rows = (ROOT / "data" / "match_ball.csv").read_text("utf-8").splitlines()
    return lambda first, last: written("match.csv", "\n".join([rows[0], *rows[first:last]]) + "\n")
