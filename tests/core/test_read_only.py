"""What cannot be written to cannot in a copy either."""

import copy
import pickle
from types import MappingProxyType

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.core.read_only import read_only

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
            hit.posture.leg, hit.posture.q, hit.v_before, kd.Ball(), hit.contact, spread={"q": 0.1}
        ),
        "sensitivity": hit.sensitivity(),
        "uncertainty": hit.uncertainty(q=0.1, normal=0.02),
        "unilateral": kd.unilateral_strike(hit.posture, hit.v_before, kd.Ball(), hit.contact),
    }


PARTS = parts()


def arrays(value):
    """All arrays of an object's attributes, and of mappings among them."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, dict | MappingProxyType):
        for part in value.values():
            yield from arrays(part)


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize("name", PARTS)
def test_copies_are_the_same_and_sealed(name, way):
    original = PARTS[name]
    copied = COPIES[way](original)
    assert type(copied) is type(original)
    found = list(arrays(vars(copied)))
    kept = list(arrays({key: getattr(original, key) for key in vars(copied)}))
    assert found
    for one, other in zip(found, kept, strict=True):
        assert not one.flags.writeable
        assert (one == other).all()


def test_mappings_stay_closed():
    slopes = pickle.loads(pickle.dumps(PARTS["sensitivity"]))
    budget = copy.deepcopy(PARTS["uncertainty"])
    for mapping in (slopes.impulse, budget.by_source, budget.by_source["q"]):
        with pytest.raises(TypeError):
            mapping["q"] = 0
    assert str(budget) == str(PARTS["uncertainty"])


def test_an_array_is_copied_and_sealed():
    own = np.zeros(3)
    sealed = read_only(own)
    own[0] = 1
    assert sealed.tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        sealed[0] = 1
