"""Text is broken to the width of the screen, and numbered notes hang."""

import pytest
from rich.console import Console

from kickdyn.core import console
from kickdyn.core.console import PIPE_WIDTH, PROSE, notes, screen_width, wrapped


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


def test_lines_are_broken_between_words_only():
    text = "leg speed 100% and torque 19%, at-most-of-it"
    lines = wrapped(text, 24, indent=8).splitlines()
    assert " ".join(line.strip() for line in lines) == text
    assert all(line.startswith(" " * 8) for line in lines[1:])
    assert max(map(len, lines)) <= 24
