"""Every effect that a scene has can be taken out, and is not there any more."""

import math

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.effects import EFFECTS, first_order_sizes, neglect_effects
from kickdyn.scene.launch_and_end import fly_scene

LEG = kd.Leg.human().with_armature({"hip": 0.1})
BY_NAME = {effect.name: effect for effect in EFFECTS}
LAUNCH = kd.BallState((0, 0, 0), (4, 0, 3), (0, -40, 5))


def scene(**parts):
    posture = LEG.posture(np.radians([5, 10, -5]))
    v = posture.joint_velocity([9, 0, 4])
    contact = kd.Contact((2, 0, 1), 0.8, 0.4, (0, 0, 0.01))
    options = {"air": kd.Air(drag="brazuca", wind=(1, 2, 0)), "name": "all", **parts}
    return kd.Scene(posture, v, kd.Ball(), contact, **options)


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


@pytest.mark.parametrize("name", [effect.name for effect in EFFECTS if effect.in_flight])
@pytest.mark.parametrize("plane", [None, kd.Plane((2, 0, 0), (-1, 0.2, 0))])
def test_first_order_sizes_are_near_the_measured_ones(name, plane):
    made, effect = scene(plane=plane), BY_NAME[name]
    whole = fly_scene(made, LAUNCH)
    less = fly_scene(effect.without(made, LAUNCH), LAUNCH)
    moved = math.dist(less.state.position, whole.state.position)
    assert moved > 1e-8
    sizes = first_order_sizes(made, [effect], whole.path)
    assert sizes == {name: pytest.approx(moved, rel=0.2)}


def test_a_ball_that_grazes_what_ends_its_flight_has_no_size():
    grazing = kd.BallState((0, 0, 0), (4, 0, 0))
    made = scene()
    path = fly_scene(made, grazing).path
    assert path.landing.velocity[2] == 0.0
    assert first_order_sizes(made, [BY_NAME["drag"]], path) == {"drag": math.inf}


def test_the_smallest_effects_are_neglected_and_their_error_is_measured():
    made = scene()
    whole = fly_scene(made, LAUNCH)
    everything = neglect_effects(made, whole, math.inf)
    sizes = {verdict.effect: verdict.size for verdict in everything.verdicts}
    known = sorted(size for size in sizes.values() if not math.isnan(size))
    assert len(known) == 6
    for number in range(1, len(known)):
        allowed = math.fsum(known[:number]) * (1 + 1e-12)
        reduction = neglect_effects(made, whole, allowed)
        neglected = {verdict.effect for verdict in reduction.verdicts if not verdict.modelled}
        smallest = {name for name, size in sizes.items() if size in known[:number]}
        assert smallest - {max(smallest, key=lambda name: sizes[name])} <= neglected <= {
            *smallest, "drag crisis", "wind", "spin decay"
        }  # fmt: skip
        assert reduction.error <= allowed
        moved = math.dist(reduction.end.state.position, whole.state.position)
        assert reduction.error == pytest.approx(moved, abs=1e-15)
    strike_effects = {"friction", "ball rotation", "armature"}
    assert {name for name, size in sizes.items() if math.isnan(size)} == strike_effects


def test_effects_that_together_do_more_than_is_allowed_are_modelled(monkeypatch):
    """Even if their sizes to first order said otherwise."""
    made = scene()
    whole = fly_scene(made, LAUNCH)
    tiny = dict.fromkeys(BY_NAME, 1e-6)
    monkeypatch.setattr("kickdyn.scene.effects.first_order_sizes", lambda *_: tiny)
    reduction = neglect_effects(made, whole, 1e-2)
    assert reduction.error <= 1e-2
    modelled = {verdict.effect for verdict in reduction.verdicts if verdict.modelled}
    assert "buoyancy" in modelled


def test_an_effect_whose_absence_cannot_be_computed_is_modelled(monkeypatch):
    """As where a ball without it leaves the range of a coefficient that refuses to extrapolate."""
    made = scene()
    whole = fly_scene(made, LAUNCH)

    def refusing(reduced, launch):
        if not reduced.air.wind.any():
            raise kd.InvalidInput("the flight leaves a coefficient's range")
        return fly_scene(reduced, launch)

    monkeypatch.setattr("kickdyn.scene.effects.fly_scene", refusing)
    reduction = neglect_effects(made, whole, math.inf)
    sizes = {v.effect: v.size for v in reduction.verdicts if not math.isnan(v.size)}
    smaller = {name for name, size in sizes.items() if size < sizes["wind"]}
    assert smaller
    assert {v.effect for v in reduction.verdicts if not v.modelled} == smaller
