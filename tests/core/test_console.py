"""What fits on the screen, and how notes stand on it."""

import pytest
from rich.console import Console

from kickdyn.core import console
from kickdyn.core.console import WIDE, empty_table, fits, notes, screen_width, wrapped


def table():
    result = empty_table("A title that is longer than the table")
    result.add_column("first", no_wrap=True)
    result.add_column("second")
    result.add_row("12345", "12 3456")
    return result


def test_a_table_fits_where_none_of_its_cells_is_cut():
    least = next(width for width in range(1, 40) if fits(table(), width))
    for width, whole in ((least, True), (least - 1, False)):
        console = Console(width=width, highlight=False)
        with console.capture() as said:
            console.print(table())
        assert ("12345  12 3456" in said.get()) is whole
    assert least < 20, "its columns stand close"


@pytest.mark.parametrize(("terminal", "width"), [(True, 66), (False, WIDE)])
def test_without_a_screen_there_is_room(monkeypatch, terminal, width):
    monkeypatch.setattr(console, "Console", lambda: Console(width=66, force_terminal=terminal))
    assert screen_width() == width


def test_notes_are_numbered_and_hang():
    said = notes(["short", " ".join(["words"] * 20)], 40).splitlines()
    assert said[0] == "  1  short"
    assert said[1].startswith("  2  words words")
    assert said[2].startswith("     words")
    assert max(map(len, said)) <= 40
    assert max(map(len, notes(["a " * 300], WIDE).splitlines())) <= 80


def test_a_line_goes_on_below_where_it_began():
    said = wrapped("leg     speed 100% and torque 19%, at-most-of-it", 24, indent=8)
    assert said.splitlines() == [
        "leg     speed 100% and",
        "        torque 19%,",
        "        at-most-of-it",
    ]
    assert wrapped("  hip      9.16 deg", 24) == "  hip      9.16 deg"
