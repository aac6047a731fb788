"""Joints that hold in an impact, against the same joints locked."""

import pickle

import numpy as np
import pytest
from chains import any_kick, by_pinocchio, constraint_speed, random_kick, random_leg
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.planning.kick import plan_kick
from kickdyn.robot.urdf_file import shipped_urdf
from kickdyn.sweeps.sweep_kick import (
    kick_from,
    slowest_joint_velocity,
    speed_use,
)

HUMAN = kd.Leg.human()
STIFF = HUMAN.with_stiff_joints("ankle")
Q = np.array([0.1, 0.4, -0.2])


def revolute_leg(seed):
    """A random chain of 3 to 6 joints, two of them stiff, and a generator."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, int(rng.integers(3, 7)))
    stiff = rng.choice(leg.joint_names, 2, replace=False).tolist()
    return rng, leg, leg.with_stiff_joints(*stiff)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_its_delassus_matrix_is_that_of_the_other_joints(seed):
    """Without the stiff joints' rows and columns, as if these were locked."""
    rng, leg, stiff = revolute_leg(seed)
    posture = stiff.posture(rng.uniform(-2, 2, size=leg.nq))
    moving = [leg.velocity_index(name) for name in set(leg.joint_names) - set(stiff.stiff_joints)]
    jacobian, inertia = posture.jacobian[:, moving], posture.inertia[np.ix_(moving, moving)]
    locked = jacobian @ np.linalg.solve(inertia, jacobian.T)
    assert posture.delassus() == pytest.approx(locked, abs=1e-10 * np.abs(locked).max())
    free = leg.posture(posture.q).delassus()
    assert posture.without_stiff_joints.delassus() == pytest.approx(free, abs=1e-12 * free.max())


@pytest.mark.parametrize("joints", [("ankle",), ("knee", "ankle"), ("hip",)])
def test_its_delassus_matrix_is_that_of_locked_joints(joints):
    values = dict(zip(HUMAN.joint_names, Q, strict=True))
    locked = HUMAN.locked({name: values[name] for name in joints})
    rest = locked.posture([values[name] for name in locked.joint_names]).delassus()
    delassus = HUMAN.with_stiff_joints(*joints).posture(Q).delassus()
    assert delassus == pytest.approx(rest, abs=1e-14 * rest.max())


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(["newton", "stronge"]), st.booleans())
def test_velocities_are_kept_and_momentum_and_energy_close(seed, law, spins):
    """Joints that move keep their speed: their motors do work on the rest."""
    rng, leg, stiff = revolute_leg(seed)
    (posture, v, ball, contact), options = random_kick(rng, stiff, friction=0.4 * spins)
    hit = kd.strike(posture, v, ball, contact, law, **options)
    at = [leg.velocity_index(name) for name in stiff.stiff_joints]
    jump = hit.v_after - v
    assert np.abs(jump[at]).max() < 1e-10 * np.abs(jump).max()
    holding = np.zeros(leg.nv)
    holding[at] = hit.constraint_impulses
    missing = posture.inertia @ jump + posture.jacobian.T @ hit.impulse - holding
    assert np.abs(missing).max() < 1e-10 * np.abs(posture.jacobian.T @ hit.impulse).max()
    assert hit.momentum_residual < 1e-10
    work = holding @ (v + hit.v_after) / 2
    kinetic = [0.5 * each @ posture.inertia @ each for each in (v, hit.v_after)]
    ends = [
        0.5 * (ball.mass * b.velocity @ b.velocity + ball.inertia * b.spin @ b.spin)
        for b in (hit.ball_before, hit.ball_after)
    ]
    lost, scale = kinetic[0] + ends[0] - kinetic[1] - ends[1], kinetic[0] + ends[0]
    assert hit.motor_work == pytest.approx(work, abs=1e-9 * scale)
    assert hit.energy_lost == pytest.approx(lost + hit.motor_work, abs=1e-9 * scale)
    loads = kd.joint_loads(hit)
    for name, impulse in zip(stiff.stiff_joints, hit.constraint_impulses, strict=True):
        assert np.linalg.norm(loads[name].axis) == pytest.approx(abs(impulse), rel=1e-8)


def test_at_rest_it_strikes_as_if_it_were_locked():
    locked = HUMAN.locked({"ankle": Q[2]})
    other = locked.posture(Q[:2])
    v, contact = other.joint_velocity([4, 0, 1]), kd.Contact((1, 0, 0.2), 0.7, friction=0.3)
    one = kd.strike(STIFF.posture(Q), [*v, 0.0], kd.Ball(), contact)
    two = kd.strike(other, v, kd.Ball(), contact)
    assert one.impulse == pytest.approx(two.impulse, rel=1e-13)
    assert one.v_after == pytest.approx([*two.v_after, 0.0], rel=1e-12)
    assert one.joint_impulses[:2] == pytest.approx(two.joint_impulses, rel=1e-11, abs=1e-13)


def test_both_engines_agree_with_moving_stiff_joints():
    for seed in range(5):
        rng, _, stiff = revolute_leg(seed)
        kick, options = random_kick(rng, stiff)
        closed, engine = kd.strike(*kick, **options), by_pinocchio(*kick, **options)
        assert engine.impulse == pytest.approx(closed.impulse, rel=1e-8)
        assert engine.v_after == pytest.approx(closed.v_after, rel=1e-8, abs=1e-8)
        assert engine.momentum_residual < 1e-10


def test_velocities_before_are_those_of_the_free_leg():
    posture, free = STIFF.posture(Q), HUMAN.posture(Q)
    assert posture.joint_velocity([4, 0, 1]).tolist() == free.joint_velocity([4, 0, 1]).tolist()
    assert posture.admissible([1.0, 2.0, 3.0]).tolist() == [1, 2, 3]
    posture.check_velocity(np.ones(3))
    kick = kd.Kick(speed=5.0, air=None)
    assert kick_from(posture, kick).speed_use == pytest.approx(kick_from(free, kick).speed_use)
    wish = np.array([4.0, 0.0, 1.0])
    slowest = slowest_joint_velocity(posture, wish)
    assert speed_use(posture, slowest) == pytest.approx(
        speed_use(free, slowest_joint_velocity(free, wish)), rel=1e-6
    )
    assert posture.point_velocity(slowest) == pytest.approx(wish, abs=1e-8)
    far = posture.with_contact_offset([0.02, 0, -0.03])
    assert far.without_stiff_joints.jacobian.tolist() == far.jacobian.tolist()
    offset = free.with_contact_offset([0.02, 0, -0.03])
    assert far.joint_velocity([4, 0, 1]) == pytest.approx(offset.joint_velocity([4, 0, 1]))


def test_both_effective_masses_are_shown():
    posture = STIFF.posture(Q)
    v, contact = posture.joint_velocity([4, 0, 1]), kd.Contact((4, 0, 1), 0.7)
    hit = kd.strike(posture, v, kd.Ball(), contact)
    free = HUMAN.posture(Q).effective_mass((4, 0, 1))
    assert hit.free_effective_mass == pytest.approx(free, rel=1e-13)
    assert hit.free_effective_mass < hit.effective_mass
    assert "with all joints free" in str(hit)
    assert "stiff joints" in posture._repr_html_()
    plain = kd.strike(HUMAN.posture(Q), v, kd.Ball(), contact)
    assert plain.free_effective_mass == plain.effective_mass
    assert "free" not in str(plain)
    assert abs(hit.motor_work) > 0.1
    assert f"work of the motors    {hit.motor_work:.4g} J" in str(hit)
    assert plain.motor_work == 0.0
    assert "motors" not in str(plain)


def test_with_supports_loops_and_a_floating_base():
    """Every constraint in one projection; derivatives of the same impact by differences."""
    robot = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
    fourbar = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
    looped = fourbar.with_loops(("shank_pin", "rocker_b_tip"))
    for leg, stiff in ((robot, "FR_KFE"), (looped, "ankle")):
        held = leg.with_stiff_joints(stiff)
        for kick, options in [any_kick(np.random.default_rng(seed), held) for seed in range(3)]:
            hit = kd.strike(*kick, **options)
            at = leg.velocity_index(stiff)
            assert hit.v_after[at] == pytest.approx(kick[1][at], abs=1e-9)
            assert hit.momentum_residual < 1e-10
            assert constraint_speed(hit) < 1e-9
            assert len(hit.support_impulses) + len(hit.loop_impulses) == 1


def test_sensitivities_are_differences():
    contact = kd.Contact((4, 0, 1), 0.7, friction=0.1)
    v, h = np.array([1.0, -8.0, -2.0]), 1e-6

    def struck(q, v):
        return kd.strike(STIFF.posture(q), v, kd.Ball(), contact)

    slopes = struck(Q, v).sensitivity()
    for name in ("impulse", "v_after"):
        by = getattr(slopes, name)
        for source in ("q", "v"):
            for k, unit in enumerate(h * np.eye(3)):
                dq, dv = (unit, 0.0) if source == "q" else (0.0, unit)
                ends = [getattr(struck(Q + s * dq, v + s * dv), name) for s in (1, -1)]
                assert by[source][:, k] == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=2e-6)


def test_derivatives_beside_a_loop_are_differences_along_it():
    leg = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf")).with_loops(
        ("shank_pin", "rocker_b_tip")
    )
    leg = leg.with_stiff_joints("hip")
    q = leg.close_loops(leg.configuration({"rocker_b": 0.6}), ["rocker_b"])
    posture, contact = leg.posture(q), kd.Contact((1, 0, 0.2), 0.7, friction=0.4)
    v, h = posture.joint_velocity([6, 0, 1]), 1e-6
    slopes = kd.strike(posture, v, kd.Ball(), contact).sensitivity()
    along = posture.admissible(np.ones(5))
    ends = []
    for sign in (1, -1):
        there = leg.posture(leg.close_loops(q + sign * h * along, ["hip", "rocker_b", "ankle"]))
        ends.append((kd.strike(there, there.admissible(v), kd.Ball(), contact), there.q))
    step = (ends[0][1] - ends[1][1]) / (2 * h)
    for name in ("impulse", "v_after"):
        by = getattr(slopes, name)["q"] @ step
        difference = (getattr(ends[0][0], name) - getattr(ends[1][0], name)) / (2 * h)
        assert by == pytest.approx(difference, abs=1e-4 * np.abs(difference).max())


def test_a_contact_that_takes_time_keeps_the_speed():
    posture = STIFF.posture(Q)
    v, contact = np.array([1.0, -8.0, -2.0]), kd.Contact((4, 0, 1), 0.7)
    hit = kd.collide(posture, v, kd.Ball(), contact, contact_time=1e-4)
    assert hit.v_after[2] == pytest.approx(-2.0, abs=1e-9)
    assert hit.q_after[2] == pytest.approx(Q[2] - 2.0 * hit.contact_time, abs=1e-12)
    assert hit.impulse == pytest.approx(kd.strike(posture, v, kd.Ball(), contact).impulse, rel=5e-3)
    assert hit.energy_residual < 1e-6


def test_a_sweep_has_both_masses():
    data = kd.sweep(STIFF, {"hip": [0.1, 0.3], "knee": 0.4}, kd.Kick(air=None))
    free = kd.sweep(HUMAN, {"hip": [0.1, 0.3], "knee": 0.4}, kd.Kick(air=None))
    assert (data.effective_mass > free.effective_mass).all()
    assert data.speed_use.values == pytest.approx(free.speed_use.values, rel=1e-9)
    assert data.attrs["model_sha256"] != free.attrs["model_sha256"]


def test_stiff_joints_are_kept_and_let_go():
    for leg in (pickle.loads(pickle.dumps(STIFF)), STIFF.with_armature({"hip": 0.1})):
        assert leg.stiff_joints == ("ankle",)
    assert STIFF.with_stiff_joints().constraints is None
    assert STIFF.locked({"ankle": 0.1}).stiff_joints == ()
    assert STIFF.locked({"hip": 0.1}).stiff_joints == ("ankle",)
    assert STIFF.with_supports().with_loops().stiff_joints == ("ankle",)


@pytest.mark.parametrize(
    ("joints", "said"),
    [
        (("toe",), "joint 'toe' is unknown"),
        ((7,), "joint 7 is unknown"),
        (("hip", "hip"), "joint 'hip' is stiff twice: name it once"),
        (("hip", "knee", "ankle"), "all joints of leg_human are stiff: one must be free"),
    ],
)
def test_bad_names_are_refused(joints, said):
    with pytest.raises(kd.InvalidInput, match=said):
        HUMAN.with_stiff_joints(*joints)


def test_a_plan_is_for_free_joints():
    bolt = kd.Leg.from_robot("bolt", base="floating").with_supports("FL_FOOT")
    with pytest.raises(kd.InvalidInput, match=r"bolt has stiff joints \(FR_KFE\): kicks are"):
        plan_kick(bolt.with_stiff_joints("FR_KFE"), kd.Goal(10, time=1.0), kd.Ball())
    with pytest.raises(kd.InvalidInput, match=r"leg_human has stiff joints \(ankle\): kicks are"):
        plan_kick(STIFF, kd.Goal(10, time=1.0), kd.Ball())
