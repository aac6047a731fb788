"""The contact of foot and ball: what it checks, and that it cannot change."""

import dataclasses
import math

import numpy as np
import pytest
from tolerances import EPSILON

import kickdyn as kd

GOOD = {"normal": (1, 0, 0), "restitution": 0.8, "friction": 0.4}


@pytest.mark.parametrize(("name", "value", "word"), [
    ("normal", (0, 0, 0), "length 0"), ("normal", (1, 0), "shape"),
    ("normal", (math.nan, 0, 1), "finite"), ("normal", "abc", "numbers"),
    *[("restitution", e, "at least 0 and at most 1") for e in (1.2, -0.1, math.nan, "0.5")],
    *[("restitution", e, "at least 0") for e in (True, None, math.inf, [0.5])],
    ("offset", (0, 0), "shape"), ("offset", (0, math.inf, 0), "finite"),
    *[("friction", mu, "at least 0") for mu in (-1e-9, math.nan, math.inf, "0.4", True)]
])  # fmt: skip
def test_bad_input(name, value, word):
    with pytest.raises(kd.InvalidInput, match=f"{name} .*{word}"):
        kd.Contact(**(GOOD | {name: value}))


@pytest.mark.parametrize("scale", [5e-324, 1e-160, 1.0, 1e300])
def test_normal_of_any_length_becomes_a_unit_vector(scale):
    normal = kd.Contact((scale, 0, -scale), 0.5).normal
    assert normal == pytest.approx([math.sqrt(0.5), 0, -math.sqrt(0.5)], abs=4 * EPSILON)


def test_a_contact_keeps_copies_of_its_vectors():
    normal, offset = np.array([0.0, 0.0, 1.0]), np.array([0.1, 0.0, 0.02])
    contact = kd.Contact(normal, 0.5, offset=offset)
    normal[0] = offset[0] = 9
    assert (contact.normal.tolist(), contact.offset.tolist()) == ([0, 0, 1], [0.1, 0.0, 0.02])


def test_an_impact_needs_a_normal():
    open_contact, leg = kd.Contact(restitution=0.7, friction=0.2), kd.Leg.human()
    posture, v = leg.posture([0.1, -0.4, 0.2]), [1.0, 2.0, 0.0]
    assert open_contact == kd.Contact(None, 0.7, 0.2) != kd.Contact((1, 0, 0), 0.7, 0.2)
    assert dataclasses.replace(open_contact, normal=(2, 0, 0)).normal.tolist() == [1.0, 0.0, 0.0]
    for impact in (kd.strike, kd.collide, kd.unilateral_strike, kd.Scene):
        with pytest.raises(kd.InvalidInput, match="has no normal"):
            impact(posture, v, kd.Ball(), open_contact)
