"""Each effect of a scene can be left out, and no other effect is lost with it."""

import math

import numpy as np
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.scene.effects import EFFECTS, effects_of

LEG = kd.Leg.human().with_armature({"hip": 0.1})
BY_NAME = {effect.name: effect for effect in EFFECTS}
LAUNCH = kd.BallState((0, 0, 2), (10, 2, 0), (0, -20, 0))


def scene(**parts):
    posture = LEG.posture(np.radians([5, 10, -5]))
    contact = kd.Contact((2, 0, 1), 0.8, 0.4, (0, 0, 0.01))
    options = {"air": kd.Air(drag="brazuca", wind=(1, 2, 0)), "name": "all", **parts}
    return kd.Scene(posture, posture.joint_velocity([9, 0, 4]), kd.Ball(), contact, **options)


@pytest.mark.parametrize("name", sorted(BY_NAME))
def test_an_effect_alone_is_left_out(name):
    full = scene(law=kd.Compliance(contact_time=0.01))
    if name == "supports":
        leg = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
        full = full.replace(posture=leg.posture(leg.configuration()), v=np.zeros(leg.nv))
    assert BY_NAME[name].is_in(full)
    less = BY_NAME[name].without(full, LAUNCH)
    lost = {effect.name for effect in effects_of(full)} - {e.name for e in effects_of(less)}
    # without drag there is no drag crisis; a constant drag is still a drag
    assert lost == {"drag": {"drag", "drag crisis"}, "drag crisis": set()}.get(name, {name})
    assert less.name == "all"


@pytest.mark.parametrize(
    ("wind", "speed"), [((1, 2, 0), 9.0), (lambda z: (z, 0.0, 0.0), math.hypot(8.0, 2.0))]
)
def test_constant_drag_is_that_of_the_launch_relative_to_the_air(wind, speed):
    full = scene(air=kd.Air(drag="brazuca", wind=wind))
    drag = BY_NAME["drag crisis"].without(full, LAUNCH).air.drag
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
    of_air = {effect.name for effect in EFFECTS if effect.in_flight}
    assert {effect.name for effect in effects_of(scene(air=air))} & of_air == names
