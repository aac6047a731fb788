"""The schema agrees with what the scene's parts take."""

from kickdyn.impact.sensitivity import UNITS
from kickdyn.scene import schema


def test_sources_are_those_of_the_uncertainty():
    assert set(schema.SECTIONS["uncertainty"]) == set(schema.UNCERTAINTY)
    assert {name for name, *_ in schema.UNCERTAINTY.values()} <= set(UNITS)


def test_degrees_only_where_the_name_says_so():
    for key, (source, _, scale, _) in schema.UNCERTAINTY.items():
        assert (scale == 1.0) == (not key.endswith("_deg")), source
