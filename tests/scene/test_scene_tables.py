"""The tables of scene files agree with the constructors that they name."""

import math
import re

import pytest

import kickdyn as kd
from kickdyn.impact.sensitivity import UNITS
from kickdyn.scene.scene_tables import TABLES

BY_NAME = {table.name: table for table in TABLES}
KEYS = [(table, key) for table in TABLES for key in table.keys]


def taking(start):
    """Return the tables and keys whose values are described by a text that starts so."""
    keys = [(t, k) for t, k in KEYS if isinstance(k.takes, str) and k.takes.startswith(start)]
    return pytest.mark.parametrize(("table", "key"), keys, ids=lambda entry: entry.name)


def construct(table, key, value):
    """Return what a table makes of one key, beside those that it must have."""
    groups = [group for group in table.required if key.name not in group]
    content = {name: example for group in groups for name, example in [*group.items()][:1]}
    arguments = {k.argument: content[k.name] for k in table.keys if k.name in content}
    return table.constructor(**{**arguments, key.argument: value})


@taking("number, ")
def test_limits_of_the_reference_page_are_those_of_the_constructor(table, key):
    limits = re.findall(r"(above|at least|at most) (-?[\d.e]+(?:/\d)?)", key.takes)
    assert limits
    for kind, text in limits:
        limit = 2.0 / 3.0 if text == "2/3" else float(text)
        beyond = limit + (1.0 if kind == "at most" else -1.0) * max(1e-9, 1e-9 * abs(limit))
        with pytest.raises(kd.InvalidInput):
            construct(table, key, limit if kind == "above" else beyond)
        if kind != "above" and abs(limit) < 1000:  # beyond these another value may be at fault
            construct(table, key, limit)


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)
def test_keys_are_distinct_and_their_names_valid(table):
    names = [key.name for key in table.keys]
    assert len(set(names)) == len(names)
    assert {needed for key in table.keys for needed in key.needs} <= set(names)
    assert {name for group in table.required for name in group} <= set(names)
    for key in table.keys:
        for choice in () if isinstance(key.takes, str) else key.takes:
            construct(table, key, choice)


def test_uncertainty_is_in_the_units_of_its_sources():
    table = BY_NAME["uncertainty"]
    assert {key.argument for key in table.keys} <= set(UNITS)
    made = table.constructor(**{key.argument: 180.0 for key in table.keys})
    right = {k.argument: math.pi if k.name.endswith("_deg") else 180.0 for k in table.keys}
    assert made == pytest.approx(right)
