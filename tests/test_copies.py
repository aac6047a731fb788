"""Answers can be pickled and copied; a deep copy shares nothing, its arrays are read-only, too."""

import copy
import pickle

import numpy as np
import pytest

import kickdyn as kd

COPIES = {
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
}
SOLE = [(0.1, 0.03, -0.03), (0.1, -0.03, -0.03), (-0.05, 0, -0.03)]


def kick():
    support = kd.Support("left_ankle_roll_link", friction=0.7, sole=SOLE)
    leg = kd.Leg.from_robot("g1", base="floating").with_supports(support)
    posture = leg.posture(leg.configuration({"right_knee_joint": 0.5}))
    v = posture.joint_velocity([6, 0, 2])
    contact = kd.Contact((3, 0, 1), 0.8, 0.3, offset=(0.01, 0, 0))
    return kd.strike(posture, v, kd.Ball(), contact), support


def plain_kick():
    posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
    return kd.strike(posture, (6.6, -14.5, 6.6), kd.Ball(), kd.Contact((2, 0.3, 1), 0.7, 0.1))


def parts():
    hit, support = kick()
    return {
        "impact": hit,
        "posture": hit.posture,
        "hold": hit.posture.constraint_projector,
        "ball": hit.ball_after,
        "contact": hit.contact,
        "support": support,
        "scene": kd.Scene(
            hit.posture,
            hit.v_before,
            kd.Ball(),
            hit.contact,
            uncertainty={"q": 0.1},
        ),
        "sensitivity": hit.sensitivity(),
        "sensitivity of a human leg": plain_kick().sensitivity(),
        "uncertainty": hit.uncertainty(q=0.1, normal=0.02),
        "goal": kd.Goal((20, 1, 0), time=1.5),
        "launch": kd.plan_launch(kd.Goal((20, 1, 0), time=1.5), kd.Ball(), kd.Air()),
        "unilateral": kd.unilateral_strike(hit.posture, hit.v_before, kd.Ball(), hit.contact),
    }


def arrays(value):
    """All arrays of an object's attributes, and of mappings and tuples among them."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, dict):
        for part in value.values():
            yield from arrays(part)
    elif isinstance(value, tuple):
        for part in value:
            yield from arrays(part)


def writeable(one):
    """Names of public attributes with arrays that can be written to."""
    public = {key: value for key, value in vars(one).items() if key[0] != "_"}
    return [key for key, value in public.items() if any(a.flags.writeable for a in arrays(value))]


PARTS = parts()
AT_FIRST = {name: writeable(one) for name, one in PARTS.items()}
"""Before any copy, which shares the arrays of the original and protects them."""


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize("name", PARTS)
def test_copies_are_the_same(name, way):
    original = PARTS[name]
    copied = COPIES[way](original)
    assert type(copied) is type(original)
    found = list(arrays(vars(copied)))
    kept = list(arrays({key: getattr(original, key) for key in vars(copied)}))
    assert found
    for one, other in zip(found, kept, strict=True):
        assert (one == other).all()
        assert way == "copy" or not np.shares_memory(one, other)


@pytest.mark.parametrize("name", PARTS)
def test_public_arrays_cannot_be_written_to(name):
    assert AT_FIRST[name] == []
    for way in COPIES.values():
        assert writeable(way(PARTS[name])) == []
