"""A scene made in Python is checked as its parts are, and prints their numbers."""

import numpy as np
import pytest

import kickdyn as kd

LEG = kd.Leg.human()
POSTURE = LEG.posture([0.1, 0.2, 0.0])
TOUCH = kd.Contact((1, 0, 0.2), 0.8, offset=(0, 0, 0.05))


def scene(**changes):
    parts = {"posture": POSTURE, "v": [3, 0, 0], "ball": kd.Ball(), "contact": TOUCH}
    return kd.Scene(**{**parts, **changes})


def test_the_ball_touches_the_contact_point_and_its_way_to_the_plane_is_level():
    made = scene(plane=kd.Plane((3, 4, 7), (-1, 0, 0)))
    point = LEG.posture(made.q).with_contact_offset(TOUCH.offset).contact_point
    np.testing.assert_allclose(made.ball_position, point + kd.Ball().radius * TOUCH.normal)
    way = np.array([3, 4, 0]) - made.ball_position * [1, 1, 0]
    np.testing.assert_allclose(made.ahead, way / np.linalg.norm(way))


@pytest.mark.parametrize(("changes", "word"), [
    ({"v": [1, 2]}, "v has shape"), ({"law": "none"}, "law is 'none'"),
    ({"incoming": kd.BallState(velocity=np.ones((2, 3)))}, r"incoming .*\(2, 3\)"),
    ({"law": kd.Compliance(), "contact": kd.Contact((1, 0, 0), 0.0)}, r"is 0.*0\.01"),
    ({"law": kd.Compliance(stiffness="pressure")}, "pressure is None"),
    ({"ball": kd.Ball(mass=np.inf)}, "mass"), ({"uncertainty": np.nan}, "uncertainty is nan"),
    ({"uncertainty": {"q": np.nan}}, "uncertainty of q is nan"),
    ({"uncertainty": {1: 2}}, "uncertainty of 1 is unknown: choose q, v"),
    ({"wall": kd.Wall(9, 1)}, "without a plane"),
    ({"wall": kd.Wall(9, 1), "plane": kd.Plane((3, 4, 7), (-1, 0, 0))}, "wall is at 9 m"),
], ids=lambda value: str(value)[:30])  # fmt: skip
def test_bad_parts_are_refused(changes, word):
    with pytest.raises(kd.InvalidInput, match=word):
        scene(**changes)


def test_a_scene_does_not_change_with_what_it_was_made_of():
    given = {"q": 0.1}
    made = scene(uncertainty=given)
    given["q"] = 2
    assert made.uncertainty == {"q": 0.1}


def test_a_replacement_changes_its_part_only():
    made = scene(law=kd.Compliance(contact_time=0.01), name="one", air=kd.Air(), v=[1, 2, 3])
    instant = made.as_instant()
    assert (made.is_compliant, instant.is_compliant, instant.law) == (True, False, "newton")
    for name in ("ball", "contact", "air", "name", "incoming"):
        assert getattr(instant, name) == getattr(made, name), name
    assert instant.v.tolist() == [1, 2, 3]


def test_the_offset_of_a_posture_stays_with_another_leg():
    shifted = POSTURE.with_contact_offset((0, 0, 0.03))
    made = scene(posture=shifted, contact=kd.Contact((1, 0, 0), 0.8))
    other = made.with_leg(LEG.with_armature({"hip": 0.1}))
    np.testing.assert_allclose(other.posture.contact_point, shifted.contact_point)
    assert other.leg.model.armature.any()
