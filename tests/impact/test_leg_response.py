"""Joint impulses against Newton and Euler for every body, and against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from chains import any_kick, constraint_speed, floating_leg, fourbar, random_kick, random_leg
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.impact.leg_response import NO_CONSTRAINTS, response_to_jump
from kickdyn.impact.pinocchio_engine import strike_by_pinocchio
from kickdyn.robot.catalog import ROBOTS

FREE = {
    f"{name} {base}": kd.Leg.from_robot(name, base=base, legs_only=name in ("icub", "romeo"))
    for name in ROBOTS
    for base in ("fixed", "floating")
}
STANDING = {
    f"{leg.name} on {kind}": leg.with_supports(
        kd.Support(ROBOTS[leg.name].stance, point=kind == "a point")
    )
    for name, leg in FREE.items()
    if name.endswith("floating")
    for kind in ("a sole", "a point")
    if not (leg.name == "bolt" and kind == "a sole")
}


def external_impulses(impact):
    """Impulse from outside on each body, about the world's origin: ball, ground and loops."""
    posture = impact.posture
    leg, model = posture.leg, posture.leg.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, posture.q)
    total = np.zeros((model.njoints, 6))

    def add(joint, point, linear, angular=(0.0, 0.0, 0.0)):
        total[joint] += np.concatenate([linear, np.cross(point, linear) + angular])

    add(leg.contact_joint, posture.contact_point, -impact.impulse)
    frames = {frame.name: k for k, frame in enumerate(model.frames)}
    for name, impulse in impact.support_impulses.items():
        k, angular = frames[name], impulse[3:] if len(impulse) == 6 else np.zeros(3)
        add(model.frames[k].parentJoint, data.oMf[k].translation, impulse[:3], angular)
    for names, impulse in impact.loop_impulses.items():
        for name, sign in zip(names, (-1.0, 1.0), strict=True):
            k = frames[name]
            add(model.frames[k].parentJoint, data.oMf[k].translation, sign * impulse)
    return total


def check_bodies(impact):
    """The momentum of each body changes by what its joints and the outside give it."""
    model = impact.posture.leg.model
    data, jump = model.createData(), impact.v_after - impact.v_before
    pin.forwardKinematics(model, data, impact.posture.q, jump)
    net = external_impulses(impact)
    gained = np.zeros_like(net)
    for i in range(1, model.njoints):
        transmitted = data.oMi[i].act(pin.Force(impact.joint_impulses[i - 1])).vector
        net[i] += transmitted
        net[model.parents[i]] -= transmitted
        gained[i] = data.oMi[i].act(model.inertias[i] * data.v[i]).vector
    agrees(net[1:], gained[1:], closed_form(100) * (1 + np.abs(net).max() / np.abs(gained).max()))
    assert impact.momentum_residual <= closed_form(10)


@pytest.mark.parametrize("offset", [False, True], ids=["", "offset"])
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["human", "testbed", "chain", "floating"])
def test_every_body_gains_what_acts_on_it(kind, seed, offset):
    rng = np.random.default_rng(seed)
    makers = {"chain": random_leg, "floating": floating_leg}
    leg = makers[kind](rng) if kind in makers else getattr(kd.Leg, kind)()
    if kind == "floating":
        kick, options = any_kick(rng, leg, friction=0.4)
    else:
        kick, options = random_kick(rng, leg, friction=0.4)
    if offset:
        posture, v, ball, _ = kick
        lever = rng.uniform(-0.2, 0.2, size=3)
        closing = posture.with_contact_offset(lever).point_velocity(v) - options["ball_velocity"]
        kick = posture, v, ball, kd.Contact(closing, 0.7, 0.4, lever)
    impact = kd.strike(*kick, **options)
    check_bodies(impact)
    jump = np.linalg.solve(impact.posture.inertia, -impact.posture.jacobian.T @ impact.impulse)
    condition = np.linalg.cond(impact.posture.inertia)
    agrees(impact.v_after - kick[1], jump, closed_form(condition))


@pytest.mark.parametrize("name", FREE | STANDING)
def test_every_robot_balances_and_pinocchio_agrees(name):
    kick, options = any_kick(np.random.default_rng(3), (FREE | STANDING)[name])
    impact, peer = kd.strike(*kick, **options), strike_by_pinocchio(*kick, **options)
    check_bodies(impact)
    agrees(impact.impulse, peer.impulse, closed_form(100))
    agrees(impact.v_after, peer.v_after, closed_form(100))
    agrees(impact.joint_impulses, peer.joint_impulses, closed_form(1000))
    for support, reaction in impact.support_impulses.items():
        agrees(peer.support_impulses[support], reaction, closed_form(10_000))
    assert peer.momentum_residual <= closed_form(1000)
    assert impact.restitution_residual <= closed_form(10)
    assert constraint_speed(impact) <= closed_form(1e3)
    if "floating" in name:  # nothing carries the base
        size = np.abs(impact.joint_impulses).max()
        np.testing.assert_allclose(impact.joint_impulses[0], 0.0, atol=closed_form(100) * size)


@pytest.mark.parametrize("seed", range(5))
def test_bodies_of_a_closed_loop_gain_what_acts_on_them_and_it_stays_closed(seed):
    rng, leg = np.random.default_rng(seed), fourbar()
    angles = {"hip": rng.uniform(0, 2), "rocker_b": rng.uniform(0, 1.3)}
    posture = leg.posture(leg.close_loops(leg.configuration(angles), keep=angles))
    v = posture.admissible(rng.normal(size=leg.nv) * 5)
    normal = posture.point_velocity(v) + rng.uniform(-0.2, 0.2, size=3)
    impact = kd.strike(posture, v, kd.Ball(), kd.Contact(normal, 0.8, friction=0.4))
    check_bodies(impact)
    assert constraint_speed(impact) <= closed_form(1e3)


@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_the_momentum_residual_is_relative_to_what_the_impulse_brings_into_the_joints(size):
    """With a jump that is wrong: |M jump + J^T p| over |J| |p|, whatever the impulse."""
    posture = kd.Leg.human().posture([0.7, 0.5, -0.3])
    impulse, jump = size * np.array([3.0, 0.0, 4.0]), size * np.array([2.0, -5.0, 1.0])
    response = response_to_jump(posture, np.zeros(3), jump, impulse, NO_CONSTRAINTS)
    missing = np.abs(posture.inertia @ jump + posture.jacobian.T @ impulse).max()
    expected = missing / (posture.jacobian_norm * 5.0 * size)
    assert response.momentum_residual == pytest.approx(expected, rel=closed_form(10))
