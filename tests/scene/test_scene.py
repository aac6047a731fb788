"""A scene made in Python is checked as its nouns are."""

import pickle

import numpy as np
import pytest

import kickdyn as kd

LEG = kd.Leg.human()
TOUCH = kd.Contact((1, 0, 0), 0.8, offset=(0, 0, 0.05))


def scene(**changes):
    parts = {"leg": LEG, "q": [0.1, 0.2, 0.0], "v": [3, 0, 0], "ball": kd.Ball(), "contact": TOUCH}
    return kd.Scene(**{**parts, **changes})


def test_the_ball_lies_before_the_contact_point():
    made = scene()
    point = LEG.posture(made.q).with_contact_offset(TOUCH.offset).contact_point
    np.testing.assert_array_equal(made.ball_position, point + kd.Ball().radius * TOUCH.normal)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"leg": "human"}, "kickdyn.Leg"),
        ({"ball": None}, "kickdyn.Ball"),
        ({"air": "paper"}, "kickdyn.Air"),
        ({"v": [1, 2]}, "v has shape"),
        ({"q": [1, np.nan, 2]}, "q is"),
        ({"contact_time": 0}, "contact time"),
        ({"law": "none"}, "law is 'none'"),
        ({"ball_spin": [1, 2]}, "ball spin"),
        ({"uncertainty": np.nan}, "uncertainty is nan"),
        ({"uncertainty": {"q": np.nan}}, "uncertainty of q is nan"),
        ({"uncertainty": {"friction": None}}, "uncertainty of friction is None"),
        ({"uncertainty": {1: 2}}, "uncertainty of 1 is unknown: choose q, v"),
    ],
)
def test_bad_parts_are_refused(changes, said):
    with pytest.raises(kd.InvalidInput, match=said):
        scene(**changes)


def test_a_scene_stays_as_it_is():
    given = {"q": 0.1}
    made = scene(uncertainty=given)
    with pytest.raises(ValueError, match="read-only"):
        made.q[0] = 1
    given["q"] = 2
    assert made.uncertainty == {"q": 0.1}


def test_errors_can_be_pickled():
    error = kd.SceneError("a.toml", ["one", "two"])
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.faults) == ("a.toml:\none\ntwo", ("one", "two"))
