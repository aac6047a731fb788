"""The schema names what the rooms above and the nouns know."""

from kickdyn.impact.laws import LAWS
from kickdyn.impact.sensitivity import UNITS
from kickdyn.scene import schema


def test_laws_are_those_of_the_impact():
    assert set(schema.LAWS) == set(LAWS)


def test_sources_are_those_of_the_uncertainty():
    assert set(schema.SECTIONS["uncertainty"]) == set(schema.SOURCES)
    assert {name for name, _ in schema.SOURCES.values()} <= set(UNITS)


def test_degrees_only_where_the_name_says_so():
    for key, (source, scale) in schema.SOURCES.items():
        assert (scale == 1.0) == (not key.endswith("_deg")), source
