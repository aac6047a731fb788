"""Every example runs from any folder, without warnings and without the network."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
QUIET = ["-W", "error", "-W", "ignore:zmq.eventloop.ioloop is deprecated:DeprecationWarning"]
OFFLINE = """
import runpy, socket, sys
def connect(*_): raise OSError("an example asked for the network")
socket.socket.connect = connect
runpy.run_path(sys.argv[1], run_name="__main__")
"""


def test_they_are_short():
    assert len(EXAMPLES) >= 8
    for file in EXAMPLES:
        assert len(file.read_text().splitlines()) < 40, file.name


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_runs(file, tmp_path):
    ended = subprocess.run(
        [sys.executable, *QUIET, "-c", OFFLINE, str(file)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=3600,
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout
    for line in ended.stdout.splitlines():
        assert "nan" not in line.split()
    written = [path.suffix for path in tmp_path.rglob("*")]
    assert ".html" in written or file.stem in ("posture_sweep", "self_motion", "uncertainty")
