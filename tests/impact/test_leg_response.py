"""Joint impulses against Newton and Euler for every body, and against Pinocchio."""

import numpy as np
import pytest
from bodies import check_bodies
from chains import any_kick, constraint_speed, floating_leg, fourbar, random_kick, random_leg
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.impact.leg_response import NO_CONSTRAINTS, response_to_jump
from kickdyn.impact.strike import strike_by_pinocchio
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


@pytest.mark.parametrize("offset", [False, True], ids=["", "offset"])
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["human", "testbed", "chain", "floating"])
def test_every_body_gains_what_acts_on_it(kind, seed, offset):
    rng = np.random.default_rng(seed)
    makers = {"chain": random_leg, "floating": floating_leg}
    leg = makers[kind](rng) if kind in makers else getattr(kd.Leg, kind)()
    maker = any_kick if kind == "floating" else random_kick
    (posture, v, ball, contact), options = maker(rng, leg, friction=0.4)
    touched = posture
    if offset:
        lever = rng.uniform(-0.2, 0.2, size=3)
        touched = posture.with_contact_offset(lever)
        closing = touched.point_velocity(v) - options["ball_velocity"]
        contact = kd.Contact(closing, 0.7, 0.4, lever)
    impact = kd.strike(posture, v, ball, contact, **options)
    centre = touched.contact_point + ball.radius * contact.normal
    agrees(impact.ball_after.position, centre, closed_form())
    agrees(impact.foot_velocity, touched.point_velocity(v), closed_form(10))
    check_bodies(impact)
    jump = np.linalg.solve(impact.posture.inertia, -impact.posture.jacobian.T @ impact.impulse)
    condition = np.linalg.cond(impact.posture.inertia)
    agrees(impact.v_after - v, jump, closed_form(condition))


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
    impact = kd.strike(posture, posture.joint_velocity([3, 0, 4]), kd.Ball(), kd.Contact([3, 0, 4]))
    solution = impact.solution._replace(impulses=impulse[None])
    impact = type(impact)(impact.approach, "newton", solution, response=response)
    missing = np.abs(posture.inertia @ jump + posture.jacobian.T @ impulse).max()
    expected = missing / (posture.jacobian_norm * 5.0 * size)
    assert impact.momentum_residual == pytest.approx(expected, rel=closed_form(10))
