"""Every example runs from any folder, without warnings and without the network."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parent.parent / "examples").glob("*.py"))
QUIET = ["-W", "error", "-W", "ignore:zmq.eventloop.ioloop is deprecated:DeprecationWarning"]
OFFLINE = """
import runpy, socket, sys
def connect(*_): raise OSError("an example asked for the network")
socket.socket.connect = connect
runpy.run_path(sys.argv[1], run_name="__main__")
"""


@pytest.mark.slow
@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_runs(file, tmp_path):
    command = [sys.executable, *QUIET, "-c", OFFLINE, str(file)]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout
    assert "nan" not in ended.stdout.split()
