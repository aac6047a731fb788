"""A slice of `tools/fuzz.py`, always the same, and all that it ever found."""

import os
import random
import subprocess
import sys
from itertools import islice
from pathlib import Path

import fuzz
import pytest

FOUND = sorted(fuzz.CORPUS.glob("*.txt"))


def test_something_was_found():
    assert FOUND


@pytest.mark.parametrize("file", FOUND, ids=lambda file: file.stem)
def test_what_was_found_stays_mended(file, tmp_path):
    text = file.read_bytes().decode("utf-8", "surrogatepass")
    fuzz.run(file.stem.split("-")[0], text, tmp_path)


KINDS = ["urdf", "mjcf", "scene", "trc", "mot", "drives", "reach", "cli"]


@pytest.mark.parametrize("seed", range(5))
def test_broken_input_is_refused(seed, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "TIMEOUT", 600.0)  # other programs may take the processor
    child = fuzz.Child()
    try:
        for kind, what in islice(fuzz.inputs(1000 + seed, KINDS), 25):
            fault, _ = child.feed(kind, what)
            assert fault == "", f"{kind}: {what!r}"
    finally:
        child.stop()


def test_the_watch_sees_a_process_that_dies(monkeypatch):
    monkeypatch.setattr(fuzz, "work", os._exit)  # which takes no pipe: the process ends with 1
    child = fuzz.Child()
    try:
        assert child.feed("urdf", "") == ("the process died, exit code 1", 0.0)
        assert child.process is None
    finally:
        child.stop()


def test_the_watch_sees_a_hang(monkeypatch):
    child = fuzz.Child()
    monkeypatch.setattr(fuzz, "TIMEOUT", 0.01)
    try:
        fault, _ = child.feed("urdf", Path(__file__).read_text("utf-8"))
        assert fault.startswith("hangs")
        assert child.process is None
    finally:
        child.stop()


@pytest.mark.parametrize(
    ("answers", "code"),
    [
        ([("", 100.0)] * 9, 0),
        ([("", 100.0)] * 8 + [("ValueError: no line", 100.0)], 1),
        ([("", 100.0)] * 8 + [("", 100.0 + fuzz.GROWTH + 1.0)], 1),
    ],
)
def test_it_fails_for_a_fault_and_for_a_leak(answers, code, monkeypatch, tmp_path, capsys):
    answers = iter(answers)
    monkeypatch.setattr(fuzz, "CORPUS", tmp_path / "corpus")
    monkeypatch.setattr(fuzz.Child, "feed", lambda *_: next(answers))
    monkeypatch.setattr(sys, "argv", ["fuzz", "--count", "9", "--kinds", "csv"])
    assert fuzz.main() == code
    printed = capsys.readouterr().out
    assert "9 inputs {'csv': 9}" in printed
    kept = list(tmp_path.glob("corpus/csv-*.txt"))
    assert len(kept) == ("no line" in printed)


def test_a_child_has_two_gigabytes():
    code = "import fuzz; fuzz.limit_memory(); bytearray(10**9); print('one'); bytearray(2 * 10**9)"
    path = os.pathsep.join(sys.path)
    ended = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path},
        capture_output=True, text=True,
    )  # fmt: skip
    assert ended.stdout == "one\n"
    assert ended.stderr.endswith("MemoryError\n")


@pytest.mark.parametrize("kind", ["csv", "c3d", "netcdf", "zarr", "mesh", "trc", "mot", "reach"])
def test_good_files_are_read(kind, tmp_path):
    for text in fuzz.seeds(kind)[:2]:
        assert fuzz.run(kind, text, tmp_path)


def test_broken_texts_are_broken():
    texts = fuzz.seeds("urdf")
    draw = random.Random(0)
    assert sum(fuzz.broken(draw, texts) not in texts for _ in range(100)) > 95
