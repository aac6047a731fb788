"""The tables of times are made from the stored figures."""

import json

import pytest
import speed

STORED = json.loads(speed.STORED.read_text())


@pytest.mark.parametrize("page", speed.TABLES)
def test_a_page_shows_the_stored_figures(page):
    text = (speed.ROOT / page).read_text("utf-8")
    assert speed.TABLES[page](STORED) in text
    assert STORED["machine"] in text
    assert speed.with_table(text, speed.TABLES[page](STORED)) == text


def test_a_changed_figure_changes_both_pages():
    changed = json.loads(json.dumps(STORED))
    changed["functions"]["collide"]["seconds"] = 1.25e-2
    for page, table in speed.TABLES.items():
        text = (speed.ROOT / page).read_text("utf-8")
        new = speed.with_table(text, table(changed))
        assert "12 ms" in new
        old, lines = text.splitlines(), new.splitlines()
        assert sum(a != b for a, b in zip(old, lines, strict=True)) == 1


@pytest.mark.parametrize(
    ("seconds", "text"), [(3.456, "3.5 s"), (0.0214, "21 ms"), (9.94e-7, "990 ns"), (1e-6, "1 µs")]
)
def test_times_have_two_digits(seconds, text):
    assert speed.shown(seconds) == text
