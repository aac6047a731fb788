"""Strikes of robots that stand: against Pinocchio's solver, momentum, restitution, reactions."""

import numpy as np
import pinocchio as pin
import pytest
from chains import any_kick, by_pinocchio, constraint_speed
from stacked import held_rows, inertia_of, rows_of, solved, struck

import kickdyn as kd
from kickdyn.impact.leg_response import footing, joint_impulses
from kickdyn.robot.catalog import ROBOTS

FREE = {
    **{
        f"{n} {base}": kd.Leg.from_robot(n, base=base, legs_only=n in ("icub", "romeo"))
        for n in ROBOTS
        for base in ("fixed", "floating")
    },
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
LEGS = FREE | STANDING


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("seed", range(4))
def test_every_robot_balances_and_pinocchio_agrees(name, seed):
    kick, options = any_kick(np.random.default_rng(seed), LEGS[name])
    hit, engine = kd.strike(*kick, **options), by_pinocchio(*kick, **options)
    for ours, theirs in (
        (hit.impulse, engine.impulse),
        (hit.v_after, engine.v_after),
        (hit.ball_after.velocity, engine.ball_after.velocity),
        (hit.joint_impulses, engine.joint_impulses),
    ):
        assert np.abs(ours - theirs).max() <= 1e-11 * np.abs(theirs).max()
    for name, reaction in hit.support_impulses.items():
        assert (
            np.abs(reaction - engine.support_impulses[name]).max() <= 1e-9 * np.abs(reaction).max()
        )
    assert engine.momentum_residual <= 1e-11
    assert hit.restitution_residual <= 1e-12
    assert hit.momentum_residual <= 1e-12
    assert constraint_speed(hit) <= 1e-10
    assert hit.energy_lost >= 0.0


@pytest.mark.parametrize("name", LEGS)
def test_with_friction_too(name):
    kick, options = any_kick(np.random.default_rng(9), LEGS[name], friction=0.4)
    hit = kd.strike(*kick, **options)
    assert hit.restitution_residual <= 1e-12
    assert hit.momentum_residual <= 1e-12
    assert constraint_speed(hit) <= 1e-10


@pytest.mark.parametrize("name", STANDING)
def test_the_strike_solves_one_dense_system(name):
    """Rows by differences, inertia by momenta, everything unknown solved for at once."""
    leg = STANDING[name]
    (posture, v, ball, contact), options = any_kick(np.random.default_rng(5), leg)
    hit = kd.strike(posture, v, ball, contact, **options)
    after, reaction, pressing = struck(leg, posture.q, v, ball, contact, options["ball_velocity"])
    assert hit.impulse == pytest.approx(pressing * contact.normal, abs=1e-7 * pressing)
    assert np.abs(hit.v_after - after).max() <= 1e-7 * np.abs(after).max()
    ((_, ours),) = hit.support_impulses.items()
    assert np.abs(ours - reaction).max() <= 1e-7 * np.abs(reaction).max()


@pytest.mark.parametrize("name", STANDING)
def test_with_friction_the_leg_answers_as_the_dense_system(name):
    leg = STANDING[name]
    kick, options = any_kick(np.random.default_rng(6), leg, friction=0.4)
    hit = kd.strike(*kick, **options)
    q, foot = hit.posture.q, rows_of(leg, hit.posture.q, leg.frame)[:3]
    jump, reaction = solved(inertia_of(leg, q), held_rows(leg, q), -foot.T @ hit.impulse)
    assert np.abs(hit.v_after - hit.v_before - jump).max() <= 1e-7 * np.abs(jump).max()
    assert np.abs(hit.constraint_impulses - reaction).max() <= 1e-7 * np.abs(reaction).max()


def momentum(leg, q, v):
    """Linear, and angular about the world's origin, of the whole robot."""
    model = leg.model
    data = model.createData()
    pin.computeCentroidalMomentum(model, data, q, v)
    centre = pin.centerOfMass(model, data, q)
    linear = data.hg.linear
    return np.concatenate([linear, data.hg.angular + np.cross(centre, linear)])


@pytest.mark.parametrize("name", STANDING)
def test_ground_and_ball_give_the_robot_its_momentum(name):
    """Outside the joints altogether: the robot's momentum against what acts from outside."""
    leg = STANDING[name]
    kick, options = any_kick(np.random.default_rng(3), leg, friction=0.4)
    hit = kd.strike(*kick, **options)
    ((frame, reaction),) = hit.support_impulses.items()
    model = leg.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, hit.posture.q)
    at = data.oMf[model.getFrameId(frame)].translation
    moment = reaction[3:] if len(reaction) == 6 else np.zeros(3)
    outside = np.concatenate(
        [
            reaction[:3] - hit.impulse,
            np.cross(at, reaction[:3]) + moment - np.cross(hit.posture.contact_point, hit.impulse),
        ]
    )
    gained = momentum(leg, hit.posture.q, hit.v_after) - momentum(leg, hit.posture.q, hit.v_before)
    assert gained == pytest.approx(outside, abs=1e-11 * np.abs(outside).max())
    assert np.abs(hit.joint_impulses[0]).max() <= 1e-12 * np.abs(outside).max()  # the free base
    assert np.linalg.norm(reaction[:3]) > 1e-3 * np.linalg.norm(hit.impulse)


def test_a_floating_robot_is_not_carried_by_its_base():
    kick, options = any_kick(np.random.default_rng(3), FREE["talos floating"])
    hit = kd.strike(*kick, **options)
    assert hit.support_impulses == {}
    assert hit.loop_impulses == {}
    assert hit.posture.leg.joint_names[0] == "root_joint"
    assert np.abs(hit.joint_impulses[0]).max() <= 1e-13


def test_standing_makes_the_foot_heavier():
    free, held = FREE["g1 floating"], STANDING["g1 on a sole"]
    q = free.configuration({"right_hip_pitch_joint": -0.3, "right_knee_joint": 0.5})
    masses = [leg.posture(q).effective_mass((1, 0, 0)) for leg in (free, held)]
    assert masses[0] < masses[1]


def test_an_earlier_strike_leaves_nothing_behind():
    kick, options = any_kick(np.random.default_rng(3), STANDING["g1 on a sole"])
    posture = kd.strike(*kick, **options).posture
    constraint_impulses = np.zeros(len(posture.constraint_projector.rows))
    forces, left_over = joint_impulses(
        posture, np.zeros(posture.leg.nv), np.zeros(3), constraint_impulses
    )
    assert not forces.any()
    assert not left_over.any()


SOLE = np.array([(0.15, 0.05, -0.04), (0.15, -0.05, -0.04), (-0.05, -0.05, -0.04)])
SOLE = np.vstack([SOLE, (-0.05, 0.05, -0.04)])
FOOT = kd.Support("foot", friction=0.5, sole=SOLE)


def wrench(force, at):
    """Of a force at a point given in the foot's frame."""
    return np.concatenate([force, np.cross(at, force)])


@pytest.mark.parametrize(
    ("force", "at", "does"),
    [
        ((0, 0, 1), (0, 0, -0.04), "stands"),
        ((0.49, 0, 1), (0.149, 0.049, -0.04), "stands"),
        ((0.3, -0.3, 1), (-0.049, -0.049, -0.04), "stands"),
        ((0, 0, -1), (0, 0, -0.04), "lifts-off"),
        ((0.51, 0, 1), (0, 0, -0.04), "slips"),
        ((0.4, 0.4, 1), (0, 0, -0.04), "slips"),
        ((0.4, 0, 1), (0.151, 0, -0.04), "tips"),
        ((0, 0.4, 1), (0, -0.051, -0.04), "tips"),
        ((0, 0, 1), (-0.051, 0, -0.04), "tips"),
        ((0, 0, 0), (0, 0, 0), "stands"),
    ],
)
@pytest.mark.parametrize("order", [[0, 1, 2, 3], [2, 0, 3, 1]])
def test_what_the_ground_allows(force, at, does, order):
    support = kd.Support("foot", friction=0.5, sole=SOLE[order])
    for size, scale in ((1.0, 1.0), (7.0, 3.0), (0.02, 5.0)):
        impulse = size * wrench(force, at)
        assert footing(support, impulse, np.eye(3), scale) == does


def test_what_is_negligible_is_so_beside_the_impulse_on_the_ball():
    """A pull of 1e-13 of the kick is rounding; the same pull in a feeble kick is not."""
    pull = wrench((0, 0, -1e-12), (0, 0, -0.04))
    assert footing(FOOT, pull, np.eye(3), 10.0) == "stands"
    assert footing(FOOT, pull, np.eye(3), 0.1) == "lifts-off"


@pytest.mark.parametrize("turn", [-1, 1])
def test_friction_has_a_largest_moment_about_the_vertical(turn):
    """In the middle of the sole: all four corners slide about it, at the same distance."""
    middle = np.array([0.05, 0.0, -0.04])
    twist = turn * 0.5 * 3.0 * np.hypot(0.1, 0.05) * np.eye(6)[5]
    for share, does in ((0.0, "stands"), (0.99, "stands"), (1.01, "turns")):
        impulse = wrench((0, 0, 3.0), middle) + twist * share
        assert footing(FOOT, impulse, np.eye(3), 1.0) == does
        assert footing(kd.Support("foot", sole=SOLE), impulse, np.eye(3), 1.0) == "stands"
    # sliding takes a part of the friction
    both = wrench((1.2, 0, 3.0), middle) + twist * 0.7
    assert footing(FOOT, both, np.eye(3), 1.0) == "turns"


def test_the_sole_turns_with_the_foot():
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for at, does in (((0, 0.14, -0.04), "stands"), ((0.14, 0, -0.04), "tips")):
        assert footing(FOOT, wrench((0, 0, 1), at), quarter, 1.0) == does


def test_only_what_is_given_is_judged():
    sliding = wrench((3, 0, 1), (0.5, 0, -0.04))
    assert footing(kd.Support("foot"), sliding, np.eye(3), 1.0) == "stands"
    assert footing(kd.Support("foot", friction=0.5), sliding, np.eye(3), 1.0) == "slips"
    assert footing(kd.Support("foot", sole=SOLE), sliding, np.eye(3), 1.0) == "tips"
    point = kd.Support("foot", point=True, friction=0.5)
    assert footing(point, np.array([0.4, 0, 1]), np.eye(3), 1.0) == "stands"
    assert footing(point, np.array([0.6, 0, 1]), np.eye(3), 1.0) == "slips"


def test_a_moment_alone_tips_and_a_tilted_sole_is_said():
    assert footing(FOOT, np.array([0, 0, 0, 0, 0.1, 0]), np.eye(3), 1.0) == "tips"
    c, s = np.cos(0.1), np.sin(0.1)
    tilt = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    assert footing(FOOT, wrench((0, 0, 1), (0, 0, -0.04)), tilt, 1.0) == "tilted"
