"""Text is broken to the width of the screen, and numbered notes hang."""

import pytest
from rich.console import Console

from kickdyn.core import console
from kickdyn.core.console import PIPE_WIDTH, PROSE, notes, screen_width


@pytest.mark.parametrize(("terminal", "width"), [(True, 66), (False, PIPE_WIDTH)])
def test_the_screen_is_a_terminal_or_a_pipe(monkeypatch, terminal, width):
    monkeypatch.setattr(console, "Console", lambda: Console(width=66, force_terminal=terminal))
    assert screen_width() == width


@pytest.mark.parametrize(("screen", "most"), [(40, 40), (PIPE_WIDTH, PROSE)])
def test_notes_are_numbered_and_hang(screen, most):
    short, *lines = notes(["short", "words " * 40], screen).splitlines()
    assert short.split() == ["1", "short"]
    assert lines[0].split()[:2] == ["2", "words"]
    assert {len(line) - len(line.lstrip()) for line in lines[1:]} == {short.index("short")}
    assert most - 6 <= max(map(len, lines)) <= most
