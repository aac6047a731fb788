"""Every effect that a scene has can be taken out, and is not there any more."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.effects import EFFECTS

LEG = kd.Leg.human().with_armature({"hip": 0.1})
BY_NAME = {effect.name: effect for effect in EFFECTS}


def scene(**parts):
    posture = LEG.posture(np.radians([5, 10, -5]))
    v = posture.joint_velocity([9, 0, 4])
    contact = kd.Contact((2, 0, 1), 0.8, 0.4, (0, 0, 0.01))
    options = {"air": kd.Air(drag="brazuca", wind=(1, 2, 0)), "name": "all", **parts}
    return kd.Scene(posture, v, kd.Ball(), contact, **options)


def test_constant_drag_is_that_of_the_wind_at_the_height_of_the_launch():
    launch = kd.BallState((0, 0, 2), (10, 0, 0))
    full = scene(air=kd.Air(drag="brazuca", wind=lambda height: (height, 0.0, 0.0)))
    less = BY_NAME["drag crisis"].without(full, launch)
    per_speed = 2 * full.ball.radius * full.air.density / full.air.viscosity
    assert less.air.drag(1.0, 0.0) == pytest.approx(full.air.drag(per_speed * 8.0, 0.0), rel=1e-12)
    assert less.air.drag(1.0, 0.0) != pytest.approx(full.air.drag(per_speed * 10, 0.0), rel=0.01)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_without(effect):
    full = scene(law=kd.Compliance(contact_time=0.01))
    launch = kd.BallState((0, 0, 0), (9, 0, 4), (0, -20, 0))
    if effect.name == "supports":
        assert not effect.is_in(full)
        return
    assert effect.is_in(full)
    less = effect.without(full, launch)
    assert effect.name == "drag crisis" or not effect.is_in(less)
    others = [other for other in EFFECTS if other is not effect]
    lost = {other.name for other in others if other.is_in(full) and not other.is_in(less)}
    assert lost == ({"drag crisis"} if effect.name == "drag" else set())
    assert less.name == "all"


def test_wind_and_spin_decay_act_through_drag_and_lift_only():
    bare = scene(air=kd.Air(drag=None, lift=None, wind=(1, 2, 0)))
    assert not BY_NAME["wind"].is_in(bare)
    assert not BY_NAME["spin decay"].is_in(bare)
    assert BY_NAME["wind"].is_in(scene(air=kd.Air(drag=None, wind=(1, 2, 0))))


def test_stance_is_let_go():
    leg = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    standing = leg.with_supports("left_ankle_roll_link")
    posture = standing.posture(leg.configuration())
    made = kd.Scene(posture, np.zeros(leg.nv), kd.Ball(), scene().contact)
    stance = BY_NAME["supports"]
    assert stance.is_in(made)
    assert not stance.is_in(stance.without(made, kd.BallState()))


def test_constant_drag_is_that_of_the_launch():
    """At its speed through the air, which is not its speed in the world: there is a wind."""
    launch = kd.BallState((0, 0, 0), (10, 2, 0))
    full = scene()
    less = BY_NAME["drag crisis"].without(full, launch)
    per_speed = 2 * full.ball.radius * full.air.density / full.air.viscosity
    expected = full.air.drag(per_speed * 9.0, 0.0)  # 10 - 1 and 2 - 2 m/s
    assert expected != pytest.approx(full.air.drag(per_speed * math.hypot(10, 2), 0.0), rel=0.01)
    assert less.air.drag(1.0, 0.0) == less.air.drag(1e6, 0.3)
    assert less.air.drag(1.0, 0.0) == pytest.approx(expected, rel=1e-12)
