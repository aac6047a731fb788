"""The tables of times on the pages are made from the measured figures of docs/speed.json."""

import json

import pytest
import speed

STORED = json.loads(speed.STORED.read_text())


@pytest.mark.parametrize("page", speed.TABLES)
def test_a_page_shows_the_measured_figures(page):
    text = (speed.ROOT / page).read_text("utf-8")
    assert speed.TABLES[page](STORED) in text
    assert STORED["machine"] in text
    changed = json.loads(json.dumps(STORED))
    changed["functions"]["collide"]["seconds"] = 1.25e-2
    assert "12 ms" in speed.with_table(text, speed.TABLES[page](changed))


@pytest.mark.parametrize(
    ("seconds", "text"), [(3.456, "3.5 s"), (0.0214, "21 ms"), (9.94e-7, "990 ns"), (1e-6, "1 µs")]
)
def test_times_have_two_digits(seconds, text):
    assert speed.shown(seconds) == text
