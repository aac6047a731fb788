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
