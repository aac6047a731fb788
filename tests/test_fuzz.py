"""A slice of `tools/fuzz.py`, always the same, and all that it ever found."""

import os
import random
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


@pytest.mark.parametrize("seed", range(5))
def test_broken_input_is_refused(seed, tmp_path):
    child = fuzz.Child()
    try:
        for kind, what in islice(fuzz.inputs(1000 + seed, ["urdf", "mjcf", "scene", "cli"]), 25):
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


def test_broken_texts_are_broken():
    texts = fuzz.seeds("urdf")
    draw = random.Random(0)
    assert sum(fuzz.broken(draw, texts) not in texts for _ in range(100)) > 95
