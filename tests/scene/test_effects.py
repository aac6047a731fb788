"""Every effect that a scene has can be taken out, and is not there any more."""

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.scene.effects import EFFECTS, effects_of, judge_effects
from kickdyn.scene.envelope import Envelope

LEG = kd.Leg.human().with_armature({"hip": 0.1})


def scene():
    posture = LEG.posture(np.radians([5, 10, -5]))
    v = posture.joint_velocity([9, 0, 4])
    contact = kd.Contact((2, 0, 1), 0.8, 0.4, (0, 0, 0.01))
    air = kd.Air(wind=(1, 2, 0))
    return kd.Scene(
        LEG, posture.q, v, kd.Ball(), contact, air=air, contact_time=0.01, name="all", law="newton"
    )


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_without(effect):
    full = scene()
    launch = kd.BallState((0, 0, 0), (9, 0, 4), (0, -20, 0))
    if effect.name == "supports":
        assert not effect.is_in(full)
        return
    assert effect.is_in(full)
    less = effect.without(full, launch)
    assert effect.name == "drag crisis" or not effect.is_in(less)
    others = [other for other in EFFECTS if other is not effect]
    lost = {other.name for other in others if other.is_in(full) and not other.is_in(less)}
    assert lost <= {other.name for other in EFFECTS if effect.name in other.through}
    assert (less.name, less.law) == ("all", "newton")


def test_stance_is_let_go():
    leg = kd.Leg.from_robot("g1", base="floating", legs_only=True)
    held = leg.with_supports("left_ankle_roll_link")
    made = kd.Scene(held, leg.configuration(), np.zeros(leg.nv), kd.Ball(), scene().contact)
    stance = next(effect for effect in EFFECTS if effect.name == "supports")
    assert stance.is_in(made)
    assert not stance.is_in(stance.without(made, kd.BallState()))


def test_constant_drag_is_that_of_the_launch():
    launch = kd.BallState((0, 0, 0), (10, 2, 0))
    crisis = next(effect for effect in EFFECTS if effect.name == "drag crisis")
    full = scene()
    less = crisis.without(full, launch)
    reynolds = 2 * full.ball.radius * full.air.density / full.air.viscosity * 9.0
    assert less.air.drag(1.0, 0.0) == less.air.drag(1e6, 0.3)
    assert less.air.drag(1.0, 0.0) == pytest.approx(full.air.drag(reynolds, 0.0), rel=1e-12)


def test_bounds_add_up_to_what_all_neglected_effects_do_together():
    """Of a ball that lands slowly: together they move the end by more than one by one."""
    posture = LEG.posture(np.radians([5, 10, -5]))
    contact = kd.Contact((1, 0, 0.1), 0.8)
    air = kd.Air(drag=kd.aerodynamics.drag.constant(0.2), lift=None, torque=None)
    made = kd.Scene(LEG, posture.q, np.zeros(LEG.nv), kd.Ball(), contact, air=air)
    around = Envelope(kd.BallState((0, 0, 0), (3, 0, 0.6)), made.environment)
    alone = {
        effect.name: around.shift(*effect.change(around))
        for effect in effects_of(made)
        if effect.change is not None and effect.name != "drag crisis"
    }
    acceleration = sum(
        effect.change(around)[0] for effect in effects_of(made) if effect.name in alone
    )
    together = around.shift(acceleration)
    assert together > 1.03 * sum(alone.values())
    verdicts = judge_effects(effects_of(made), around, together)
    assert [v.effect for v in verdicts if not v.modelled] == ["drag", "drag crisis", "buoyancy"]
    bounds = [verdict.bound for verdict in verdicts if not verdict.modelled]
    assert sum(bounds) == pytest.approx(together, rel=1e-12)
    fewer = judge_effects(effects_of(made), around, 0.99 * together)
    assert "buoyancy" not in [v.effect for v in fewer if not v.modelled]
