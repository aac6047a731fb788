import io
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from kickdyn.core.compilation import busy
from kickdyn.sweeps.block import Space
from kickdyn.sweeps.chunk_log import ChunkLog
from kickdyn.sweeps.progress import Said, Watch, better, progress

SPACE = Space.of({"hip": np.radians([0.0, 10.0, 20.0])}, {"hip": "rad"})


def terminal():
    return Console(file=io.StringIO(), force_terminal=True, width=80)


def test_a_terminal_sees_how_many_and_the_best():
    console = terminal()
    with progress(SPACE, console=console) as done:
        done(1, (3.25, 1))
        done(1, (2.0, 0))
        done(0)
    said = console.file.getvalue()
    assert "67%" in said
    assert "best 3.25 m/s at hip 10" in said
    assert "\x1b[3" in said


def test_80_columns_hold_it_all():
    joints = {name: np.radians([-10.5, 120.5]) for name in ("hip", "knee", "ankle")}
    space, console = Space.of(joints, dict.fromkeys(joints, "rad")), terminal()
    with progress(space, console=console) as done:
        done(3, (10.13, 7))
    assert "best 10.13 m/s at hip 120.5, knee 120.5, ankl" in console.file.getvalue()
    assert "38%" in console.file.getvalue()


def test_no_color_is_heeded(monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    console = terminal()
    with progress(SPACE, console=console) as done:
        done(3, (3.25, 1))
    assert "\x1b[3" not in console.file.getvalue()
    assert "100%" in console.file.getvalue()


@pytest.mark.parametrize("forced", [None, "1"])
def test_what_is_no_terminal_sees_nothing(monkeypatch, capsys, forced):
    if forced:
        monkeypatch.setenv("FORCE_COLOR", forced)
    with progress(SPACE) as done:
        done(3, (3.25, 1))
    assert capsys.readouterr() == ("", "")


def test_notes_of_chunks_say_what_is_best(tmp_path):
    (tmp_path / "progress").mkdir()
    watch = Watch(tmp_path)
    assert watch.look() is None
    for k, best in enumerate(([2.0, 7], None, [4.0, 9], [4.0, 8])):
        ChunkLog(tmp_path).write(k, {"best": best, "front": np.empty((0, 3))})
        watch.look()
    assert watch.look() == (4.0, 8)
    (tmp_path / "progress" / "5.draft").write_text("{")
    assert watch.look() == (4.0, 8)


def test_of_equals_the_first_posture():
    assert better((1.0, 5), (1.0, 3)) == (1.0, 3)
    assert better(None, (0.5, 3)) == (0.5, 3)
    assert better((1.0, 5), None) == (1.0, 5)
    assert better(None, None) is None


@pytest.mark.parametrize(
    ("compiles", "elapsed", "best", "said"),
    [(True, 2.0, "", "compiling, this once"), (True, 0.1, "", ""), (False, 2.0, "", ""),
     (True, 2.0, "best 3 m/s", "best 3 m/s")],
)  # fmt: skip
def test_while_it_compiles_it_says_so(compiles, elapsed, best, said):
    if compiles:
        busy.set()
    try:
        assert Said().render(SimpleNamespace(fields={"best": best}, elapsed=elapsed)).plain == said
    finally:
        busy.clear()
