"""What fits on the screen, and how notes stand on it."""

import pytest
from rich.console import Console

from kickdyn.core import console
from kickdyn.core.console import PIPE_WIDTH, notes, screen_width, wrapped


@pytest.mark.parametrize(("terminal", "width"), [(True, 66), (False, PIPE_WIDTH)])
def test_without_a_screen_there_is_room(monkeypatch, terminal, width):
    monkeypatch.setattr(console, "Console", lambda: Console(width=66, force_terminal=terminal))
    assert screen_width() == width


def test_notes_are_numbered_and_hang():
    said = notes(["short", " ".join(["words"] * 20)], 40).splitlines()
    assert said[0] == "  1  short"
    assert said[1].startswith("  2  words words")
    assert said[2].startswith("     words")
    assert max(map(len, said)) <= 40
    assert max(map(len, notes(["a " * 300], PIPE_WIDTH).splitlines())) <= 80


def test_a_line_goes_on_below_where_it_began():
    said = wrapped("leg     speed 100% and torque 19%, at-most-of-it", 24, indent=8)
    assert said.splitlines() == [
        "leg     speed 100% and",
        "        torque 19%,",
        "        at-most-of-it",
    ]
    assert wrapped("  hip      9.16 deg", 24) == "  hip      9.16 deg"
