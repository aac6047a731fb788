"""A slice of `tools/fuzz.py`, always the same, and all inputs that it ever failed with."""

from itertools import islice

import fuzz
import pytest

CORPUS = sorted(fuzz.CORPUS.glob("*.txt"))
KINDS = ["urdf", "mjcf", "scene", "trc", "mot", "drives", "reach"]


@pytest.mark.parametrize("file", CORPUS, ids=lambda file: file.stem)
def test_an_input_that_failed_once_gives_a_result_or_a_line(file, tmp_path):
    text = file.read_bytes().decode("utf-8", "surrogatepass")
    fuzz.run(file.stem.split("-")[0], text, tmp_path)


@pytest.mark.parametrize("kind", ["urdf", "mjcf", "trc", "mot", "drives", "mesh", "csv", "motion"])
def test_broken_input_gives_a_result_or_a_line(kind, tmp_path):
    for _, text in islice(fuzz.inputs(1000, [kind]), 12):
        try:
            fuzz.run(kind, text, tmp_path)
        except Exception as error:
            raise AssertionError(f"{kind}: {text!r}") from error


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_broken_input_ends_no_process(seed, monkeypatch):
    monkeypatch.setattr(fuzz, "TIMEOUT", 600.0)  # other programs may take the processor
    child = fuzz.Child()
    try:
        for kind, what in islice(fuzz.inputs(1000 + seed, [*KINDS, "cli"]), 25):
            fault, _ = child.feed(kind, what)
            assert fault == "", f"{kind}: {what!r}"
    finally:
        child.stop()


@pytest.mark.parametrize("kind", [
    "csv", "mesh", "trc", "mot", "motion",
    *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("c3d", "netcdf", "zarr", "reach"))
])  # fmt: skip
def test_good_files_are_read(kind, tmp_path):
    for text in fuzz.seeds(kind)[:2]:
        assert fuzz.run(kind, text, tmp_path)
