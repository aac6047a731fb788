"""`kickdyn paper`: all items as JSON, with those of other coefficients, and the table of some."""

import json

import pytest

from kickdyn.paper.reproduce import SECTIONS, chosen


def test_a_section_has_the_items_of_the_library(kickdyn):
    (section,) = chosen("table 2")
    right = [item.as_json() for item in section.compare()[0]]
    assert kickdyn("paper --only 'table 2' --json -").json == json.loads(json.dumps(right))


@pytest.mark.slow
def test_every_item_is_written_once_and_every_section_shown(kickdyn, tmp_path):
    ended = kickdyn("paper --json paper.json")
    names = [item["item"] for item in json.loads((tmp_path / "paper.json").read_text())]
    assert len(names) == len(set(names))
    assert "Fig. 9 case 1 spin" in names
    assert "Fig. 8 drag range [lift wang]" in names
    assert all(section.name in ended.out for section in SECTIONS)
