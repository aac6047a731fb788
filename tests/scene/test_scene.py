"""A scene made in Python is checked as its parts are, and prints their numbers."""

import pickle
import re

import numpy as np
import pytest

import kickdyn as kd

LEG = kd.Leg.human()
POSTURE = LEG.posture([0.1, 0.2, 0.0])
TOUCH = kd.Contact((1, 0, 0.2), 0.8, offset=(0, 0, 0.05))


def scene(**changes):
    parts = {"posture": POSTURE, "v": [3, 0, 0], "ball": kd.Ball(), "contact": TOUCH}
    return kd.Scene(**{**parts, **changes})


def test_the_ball_touches_the_contact_point():
    made = scene()
    point = LEG.posture(made.q).with_contact_offset(TOUCH.offset).contact_point
    np.testing.assert_allclose(made.ball_position, point + kd.Ball().radius * TOUCH.normal)


def test_ahead_is_horizontal_from_the_ball_to_the_plane():
    made = scene(plane=kd.Plane((3, 4, 7), (-1, 0, 0)))
    way = np.array([3, 4, 0]) - made.ball_position * [1, 1, 0]
    np.testing.assert_allclose(made.ahead, way / np.linalg.norm(way))


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"posture": "human"}, "kickdyn.Posture"),
        ({"ball": None}, "kickdyn.Ball"),
        ({"air": "paper"}, "kickdyn.Air"),
        ({"v": [1, 2]}, "v has shape"),
        ({"law": "none"}, "law is 'none'"),
        ({"incoming": [1, 2, 3]}, "kickdyn.BallState"),
        ({"incoming": kd.BallState(velocity=np.ones((2, 3)))}, r"incoming .*\(2, 3\)"),
        ({"law": kd.Compliance(), "contact": kd.Contact((1, 0, 0), 0.0)}, r"is 0.*0\.01"),
        ({"law": kd.Compliance(stiffness="pressure")}, "pressure is None"),
        ({"ball": kd.Ball(mass=np.inf)}, "mass"),
        ({"uncertainty": np.nan}, "uncertainty is nan"),
        ({"uncertainty": {"q": np.nan}}, "uncertainty of q is nan"),
        ({"uncertainty": {"friction": None}}, "uncertainty of friction is None"),
        ({"uncertainty": {1: 2}}, "uncertainty of 1 is unknown: choose q, v"),
    ],
    ids=lambda value: str(value)[:30],
)  # fmt: skip
def test_bad_parts_are_refused(changes, word):
    with pytest.raises(kd.InvalidInput, match=word):
        scene(**changes)


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ({"contact_time": 0}, "contact time is 0"),
        ({"contact_time": 10}, r"contact time is 10.*0\.1"),
        ({"contact_time": 0.01, "stiffness": 1e5}, "only one"),
        ({"stiffness": "soft"}, "stiffness is 'soft'"),
        ({"stiffness": -1.0}, "stiffness is -1"),
    ],
)
def test_a_bad_compliance_is_refused(values, word):
    with pytest.raises(kd.InvalidInput, match=word):
        kd.Compliance(**values)


def test_a_scene_cannot_be_changed():
    given = {"q": 0.1}
    made = scene(uncertainty=given)
    for array in (made.q, made.v, made.incoming.velocity):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
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


ROWS = {
    "contact point": lambda made: made.posture.contact_point,
    "foot speed": lambda made: [np.linalg.norm(made.posture.point_velocity(made.v))],
    "ball": lambda made: [made.ball.mass, made.ball.radius],
    "ball's velocity": lambda made: made.incoming.velocity,
    "ball's spin": lambda made: made.incoming.spin,
    "contact": lambda made: [
        *made.contact.normal, made.contact.restitution, made.contact.friction, *made.contact.offset
    ],
    "contact time": lambda made: [12],
    "air": lambda made: [made.air.density],
    "ground": lambda made: [made.ground.height],
    "plane": lambda made: [*made.plane.point, *made.plane.normal],
    "wall": lambda made: [made.wall.distance, made.wall.height, made.wall.width],
}  # fmt: skip


def printed(made):
    """Return the numbers of a printed scene by the names of their rows."""
    rows = dict(re.split(r"  +", line.strip(), maxsplit=1) for line in repr(made).splitlines()[1:])
    pattern = r"(?<![\w^.])-?\d+\.?\d*(?:e[-+]?\d+)?"
    return {name: [float(n) for n in re.findall(pattern, text)] for name, text in rows.items()}


@pytest.mark.parametrize("name", ROWS)
def test_printed_numbers_are_those_of_the_scene(name):
    made = scene(
        law=kd.Compliance(contact_time=0.012),
        incoming=kd.BallState(velocity=(-3, 0.5, 0), spin=(0, 12, 1)),
        air=kd.Air(), ground=kd.Ground(-0.9, "turf"),
        plane=kd.Plane((9, 1, 0), (-1, 0.2, 0), "back"), wall=kd.Wall(4, 1.9),
    )  # fmt: skip
    assert printed(made)[name] == pytest.approx(ROWS[name](made), rel=2e-4, abs=1e-9)


def test_printed_compliances_have_their_unit():
    assert printed(scene(law=kd.Compliance()))["contact time"] == [10]  # the default of `collide`
    assert printed(scene(law=kd.Compliance(stiffness=3e5)))["stiffness"] == [3e5]
    assert "stronge" in repr(scene(law="stronge"))
    assert "ball's" not in repr(scene())


def test_errors_can_be_pickled():
    error = kd.SceneError("a.toml", ["one", "two"])
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.faults) == (str(error), ("one", "two"))
