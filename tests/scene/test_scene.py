"""A scene made in Python is checked as its nouns are."""

import pickle
import re

import numpy as np
import pytest

import kickdyn as kd

LEG = kd.Leg.human()
POSTURE = LEG.posture([0.1, 0.2, 0.0])
TOUCH = kd.Contact((1, 0, 0), 0.8, offset=(0, 0, 0.05))


def scene(**changes):
    parts = {"posture": POSTURE, "v": [3, 0, 0], "ball": kd.Ball(), "contact": TOUCH}
    return kd.Scene(**{**parts, **changes})


def test_the_ball_lies_before_the_contact_point():
    made = scene()
    point = LEG.posture(made.q).with_contact_offset(TOUCH.offset).contact_point
    np.testing.assert_array_equal(made.ball_position, point + kd.Ball().radius * TOUCH.normal)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"posture": "human"}, "kickdyn.Posture"),
        ({"ball": None}, "kickdyn.Ball"),
        ({"air": "paper"}, "kickdyn.Air"),
        ({"v": [1, 2]}, "v has shape"),
        ({"law": "none"}, "law is 'none'"),
        ({"incoming": [1, 2, 3]}, "kickdyn.BallState"),
        ({"incoming": kd.BallState(velocity=np.ones((2, 3)))}, "incoming has velocities of shape"),
        ({"law": kd.Compliance(), "contact": kd.Contact((1, 0, 0), 0.0)}, "restitution is 0: in"),
        ({"law": kd.Compliance(stiffness="pressure")}, "ball pressure is None"),
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
    for array in (made.q, made.v, made.incoming.velocity):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    given["q"] = 2
    assert made.uncertainty == {"q": 0.1}


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"contact_time": 0}, "contact time is 0"),
        ({"contact_time": 0.01, "stiffness": 1e5}, "give only one"),
        ({"stiffness": "soft"}, "stiffness is 'soft'"),
        ({"stiffness": -1.0}, "stiffness is -1"),
    ],
)
def test_a_bad_compliance_is_refused(values, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Compliance(**values)


@pytest.mark.parametrize(
    ("law", "line"),
    [
        ("stronge", "law            stronge"),
        (kd.Compliance(contact_time=0.012), "contact time   12 ms"),
        (kd.Compliance(), "contact time   10 ms"),
        (kd.Compliance(stiffness=3e5), "stiffness      3e+05 N/m^1.5"),
    ],
)
def test_print_names_the_law_or_the_compliance_with_its_unit(law, line):
    assert f"  {line}\n" in f"{scene(law=law)!r}\n"


def shown(made):
    """Return the rows of a printed scene by their names."""
    lines = repr(made).splitlines()[1:]
    return dict(re.split(r"  +", line.strip(), maxsplit=1) for line in lines)


ROWS = {
    "contact point": lambda made: made.posture.contact_point,
    "foot speed": lambda made: [np.linalg.norm(made.posture.point_velocity(made.v))],
    "ball": lambda made: [made.ball.mass, made.ball.radius],
    "ball's velocity": lambda made: made.incoming.velocity,
    "ball's spin": lambda made: made.incoming.spin,
    "contact": lambda made: [
        *made.contact.normal, made.contact.restitution, made.contact.friction, *made.contact.offset
    ],
    "contact time": lambda made: [1e3 * made.law.contact_time],
    "air": lambda made: [made.air.density],
    "ground": lambda made: [made.ground.height],
    "plane": lambda made: [*made.plane.point, *made.plane.normal],
    "wall": lambda made: [made.wall.distance, made.wall.height, made.wall.width],
}  # fmt: skip


def test_every_printed_number_is_that_of_the_scene():
    made = scene(
        name="all",
        law=kd.Compliance(contact_time=0.012),
        incoming=kd.BallState(velocity=(-3, 0.5, 0), spin=(0, 12, 1)),
        air=kd.Air(),
        ground=kd.Ground(-0.9, "turf"),
        plane=kd.Plane((9, 1, 0), (-1, 0.2, 0), "back"),
        wall=kd.Wall(4, 1.9),
    )
    rows = shown(made)
    assert rows.pop("name") == made.name
    assert rows.pop("leg") == made.leg.name
    assert rows.keys() == ROWS.keys()
    assert rows["contact time"] == "12 ms"
    for name, text in rows.items():
        numbers = [float(n) for n in re.findall(r"(?<![\w^.])-?\d+\.?\d*(?:e-?\d+)?", text)]
        assert numbers == pytest.approx(ROWS[name](made), rel=2e-4, abs=1e-9), name


def test_the_motion_before_the_contact_is_printed_where_there_is_any():
    moving = scene(incoming=kd.BallState(velocity=(-3, 0, 0), spin=(0, 12, 0)))
    assert "ball's velocity" in repr(moving)
    assert "ball's spin" in repr(moving)
    assert "ball's" not in repr(scene())


def test_the_offset_of_a_posture_stays_with_another_leg():
    shifted = POSTURE.with_contact_offset((0, 0, 0.03))
    made = scene(posture=shifted, contact=kd.Contact((1, 0, 0), 0.8))
    other = made.with_leg(LEG.with_armature({"hip": 0.1}))
    np.testing.assert_array_equal(other.posture.contact_point, shifted.contact_point)
    assert other.leg.model.armature.any()


def test_errors_can_be_pickled():
    error = kd.SceneError("a.toml", ["one", "two"])
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.faults) == ("a.toml:\none\ntwo", ("one", "two"))
