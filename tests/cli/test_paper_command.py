"""`kickdyn paper`: the items of a section as JSON, with those of other coefficients."""

import pytest

from kickdyn.paper.reproduce import chosen


@pytest.mark.processor_limit(6)
@pytest.mark.parametrize("only", ["table 2", "fig 8"])
def test_a_section_has_the_items_of_the_library(only, kickdyn):
    (section,) = chosen(only)
    items, varied = section.compare()
    right = [item.as_json() | {"notes": list(item.notes)} for item in (*items, *varied)]
    assert kickdyn(f"paper --only '{only}' --json -").json == right
