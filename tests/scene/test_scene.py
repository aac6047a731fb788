"""Scenes made in Python: their parts are checked and printed; each effect can be left out."""

import math
from dataclasses import astuple

import numpy as np
import pytest
from tolerances import closed_form, optimized

import kickdyn as kd
from kickdyn.scene.scene import FRAME, MOUTH, Passage, passage_on, read_wall, score_at
from kickdyn.scene.simulate import scenes_without

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


def test_a_replacement_changes_its_part_only_and_no_change_of_an_argument_does():
    parts, given = {"name": "one", "air": kd.Air(), "v": [1, 2, 3]}, {"q": 0.1}
    made = scene(law=kd.Compliance(contact_time=0.01), uncertainty=given, **parts)
    given["q"] = 2
    instant = made.as_instant()
    assert made.uncertainty == instant.uncertainty == {"q": 0.1}
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


RADIUS = 0.11
HALF, BAR = 7.32 / 2, 2.44  # IFAB, Laws of the Game, Law 1


@pytest.mark.parametrize(("passage", "numbers", "clear"), [
    ((0.1, -1.06, 0.3), ["0.1"], True), ((-1.9, 0.25, 1.46), ["0.25", "left"], True),
    ((-1.9, 0.25, -1.46), ["0.25", "right"], True),
    ((-0.2, -0.06, 1.3), ["0.2", "0.06", "hits"], False)])  # fmt: skip
def test_a_ball_passes_over_or_beside_a_wall_or_hits_it(passage, numbers, clear):
    assert Passage(*passage).is_clear is clear
    assert all(number in str(Passage(*passage)) for number in numbers)


@pytest.mark.parametrize(("left", "up", "end"), [
    (0, 0, "in"), (-HALF + RADIUS + 1e-6, BAR - 2 * RADIUS - 1e-6, "in"),
    (HALF - RADIUS + 1e-6, 0, "post"), (-HALF - RADIUS - FRAME + 1e-6, 0, "post"),
    (HALF + RADIUS + FRAME + 1e-6, 0, "beside"), (0, BAR - 2 * RADIUS + 1e-6, "bar"),
    (0, BAR + FRAME - 1e-6, "bar"), (0, BAR + FRAME + 1e-6, "over"),
    (HALF + 0.5, BAR + 1.0, "over"), (HALF + 1.0, BAR + 0.5, "beside")])  # fmt: skip
def test_a_ball_meets_a_goal(left, up, end):
    score = score_at(left, up, RADIUS, arrives=True)
    assert score.end == end
    assert score.post == pytest.approx(HALF - abs(left) - RADIUS)
    assert score.bar == pytest.approx(BAR - up - 2 * RADIUS)
    assert score_at(left, up, RADIUS, arrives=False) == ("short", score.post, score.bar)
    assert MOUTH == (2 * HALF, BAR)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_in_a_vacuum_a_passage_is_that_of_the_parabola(side):
    v, ahead, start = np.array([9.0, 2.0 * side, 6.0]), np.array([0.96, 0.28 * side, 0.0]), 0.3
    path = kd.fly(kd.BallState((1, 2, 0.5), v), kd.Ball(), None, kd.Ground(0.5 - RADIUS - start))
    t = 5.0 / (ahead @ v)
    x, y = v[0] * t, v[1] * t
    left = ahead[0] * y - ahead[1] * x
    passage = passage_on(path, kd.Wall(5.0, 1.5, 0.5), ahead, RADIUS, start)
    right = 6.0 * t - 9.81 / 2 * t**2 + start - 1.5, abs(left) - 0.25 - RADIUS, left
    assert passage == pytest.approx(right, rel=optimized(1e-11), abs=optimized(1e-11))
    end = float(ahead @ (path.landing.position - path.launch.position))
    for share, passes in ((0.999, True), (1.001, False)):
        assert (passage_on(path, kd.Wall(share * end, 1.5), ahead, RADIUS) is not None) is passes


def test_a_wall_is_read_with_its_default_width_of_five_players():
    assert astuple(read_wall("9.15:1.9")) == astuple(kd.Wall(9.15, 1.9)) == (9.15, 1.9, 2.5)
    assert astuple(read_wall("9.15:1.9:3.5")) == (9.15, 1.9, 3.5)
    for text in ("9" * 1000, "1:2:3:4", "a:b"):
        with pytest.raises(kd.InvalidInput, match="DISTANCE:HEIGHT"):
            read_wall(text)


GEARED = kd.Leg.human().with_armature({"hip": 0.1})
OF_AIR = {"drag", "drag crisis", "lift", "spin decay", "wind", "buoyancy"}
OF_CONTACT = {"contact time", "friction", "ball rotation", "armature", "supports"}
LAUNCH = kd.BallState((0, 0, 2), (10, 2, 0), (0, -20, 0))


def all_effects(**parts):
    posture = GEARED.posture(np.radians([5, 10, -5]))
    contact = kd.Contact((2, 0, 1), 0.8, 0.4, (0, 0, 0.01))
    options = {"air": kd.Air(drag="brazuca", wind=(1, 2, 0)), "name": "all", **parts}
    return kd.Scene(posture, posture.joint_velocity([9, 0, 4]), kd.Ball(), contact, **options)


@pytest.mark.parametrize("name", sorted(OF_AIR | OF_CONTACT))
def test_an_effect_alone_is_left_out(name):
    full = all_effects(law=kd.Compliance(contact_time=0.01))
    if name == "supports":
        leg = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
        full = full.replace(posture=leg.posture(leg.configuration()), v=np.zeros(leg.nv))
    less = scenes_without(full, LAUNCH)[name]
    assert (less.air is full.air) == (name in OF_CONTACT)
    lost = scenes_without(full, LAUNCH).keys() - scenes_without(less, LAUNCH).keys()
    # without drag there is no drag crisis; a constant drag is still a drag
    assert lost == {"drag": {"drag", "drag crisis"}, "drag crisis": set()}.get(name, {name})
    assert less.name == "all"


@pytest.mark.parametrize(("wind", "speed"), [
    ((1, 2, 0), 9.0), (lambda z: (z, 0.0, 0.0), math.hypot(8.0, 2.0))])  # fmt: skip
def test_constant_drag_is_that_of_the_launch_relative_to_the_air(wind, speed):
    full = all_effects(air=kd.Air(drag="brazuca", wind=wind))
    drag = scenes_without(full, LAUNCH)["drag crisis"].air.drag
    per_speed = 2 * full.ball.radius * full.air.density / full.air.viscosity
    right = full.air.drag(per_speed * speed, full.ball.radius * 20 / speed)
    assert drag(1.0, 0.0) == pytest.approx(right, rel=closed_form())
    assert drag(1.0, 0.0) == drag(1e6, 0.3)


@pytest.mark.parametrize(("air", "names"), [
    (None, set()), (kd.Air(density=0.0, wind=(1, 2, 0)), set()),
    (kd.Air(drag=None, lift=None, wind=(1, 2, 0)), {"buoyancy"}),
    (kd.Air(drag=None, wind=(1, 2, 0)), {"wind", "lift", "spin decay", "buoyancy"}),
    (kd.Air(lift=None, torque=None, buoyancy=False), {"drag", "drag crisis"}),
], ids=["vacuum", "no density", "no force", "lift", "drag"])  # fmt: skip
def test_wind_and_spin_decay_act_through_drag_and_lift_only(air, names):
    assert scenes_without(all_effects(air=air), LAUNCH).keys() & OF_AIR == names
