"""Postures that are held: projection, redundancy, contradiction."""

import numpy as np
import pinocchio as pin
import pytest
from stacked import held_rows, inertia_of, rows_of, solved

import kickdyn as kd

LEFT = "left_ankle_roll_link"
LEFT_JOINT = "left_ankle_roll_joint"  # a frame at the same place
G1 = kd.Leg.from_robot("g1", base="floating")
KICKER = kd.Leg.from_robot("g1", "right_wrist_yaw_link", base="floating")


def somewhere(leg, seed):
    model = leg.model
    step = np.random.default_rng(seed).uniform(-0.6, 0.6, size=leg.nv)
    return pin.integrate(model, pin.neutral(model), step)


DIFFERENCES = 1e-7
"""Rounding of differences, times the condition of the stacked system."""

STANCES = {
    "flat foot": (G1, (LEFT,)),
    "point foot": (G1, (kd.Support(LEFT, point=True),)),
    "two feet": (KICKER, (LEFT, "right_ankle_roll_link")),
    "foot twice": (G1, (LEFT, kd.Support(LEFT_JOINT, point=True))),
    "foot and toe": (G1, (LEFT, "left_ankle_pitch_link")),
    "pelvis": (G1, ("pelvis",)),
}


@pytest.mark.parametrize("stance", STANCES)
@pytest.mark.parametrize("seed", range(3))
def test_a_held_leg_solves_the_stacked_system(stance, seed):
    leg, supports = STANCES[stance]
    leg = leg.with_supports(*supports)
    posture = leg.posture(somewhere(leg, seed))
    rng = np.random.default_rng(seed)
    impulse = rng.normal(size=leg.nv)
    jump, held = posture.respond(impulse)
    inertia, rows = inertia_of(leg, posture.q), held_rows(leg, posture.q)
    exact, reaction = solved(inertia, rows, impulse)
    size = np.abs(exact).max()
    assert np.abs(jump - exact).max() <= DIFFERENCES * size
    assert np.abs(held - reaction).max() <= DIFFERENCES * np.abs(reaction).max()
    assert np.abs(posture.constraint_projector.rows @ jump).max() <= 1e-12 * size
    assert (posture.solve(impulse) == jump).all()
    # the Delassus matrix is the response to impulses at the contact point
    jacobian = rows_of(leg, posture.q, leg.frame)[:3]
    columns = [jacobian @ solved(inertia, rows, row)[0] for row in jacobian]
    delassus = posture.delassus()
    assert np.abs(delassus - np.array(columns).T).max() <= DIFFERENCES * np.abs(delassus).max()


@pytest.mark.parametrize(
    ("stance", "rank"), [("flat foot", 6), ("foot twice", 6), ("two feet", 12)]
)
def test_rank_is_counted(stance, rank):
    leg, supports = STANCES[stance]
    leg = leg.with_supports(*supports)
    assert leg.posture(somewhere(leg, 1)).constraint_projector.rank == rank


def test_redundant_supports_share_alike():
    """The same point held twice: the smallest split is half and half."""
    points = [kd.Support(name, point=True) for name in (LEFT, LEFT_JOINT)]
    posture = G1.with_supports(*points).posture(somewhere(G1, 4))
    alone = G1.with_supports(points[0]).posture(somewhere(G1, 4))
    impulse = np.random.default_rng(4).normal(size=G1.nv)
    (_, both), (_, one) = posture.respond(impulse), alone.respond(impulse)
    assert both[:3] == pytest.approx(one / 2, rel=1e-10)
    assert both[3:] == pytest.approx(one / 2, rel=1e-10)


def test_a_held_pelvis_is_a_fixed_base():
    q = somewhere(kd.Leg.from_robot("g1"), 5)
    fixed = kd.Leg.from_robot("g1").posture(q)
    leg = G1.with_supports("pelvis")
    held = leg.posture(np.concatenate([leg.configuration()[:7], q]))
    assert held.delassus() == pytest.approx(fixed.delassus(), abs=1e-13)
    wish = (3.0, -1.0, 2.0)
    v = held.joint_velocity(wish)
    assert v[:6] == pytest.approx(np.zeros(6), abs=1e-14)
    assert v[6:] == pytest.approx(fixed.joint_velocity(wish), abs=1e-11)


def test_joint_velocity_holds_the_support():
    leg = G1.with_supports(LEFT)
    posture = leg.posture(somewhere(leg, 6))
    v = posture.joint_velocity((4, 1, 2))
    assert posture.point_velocity(v) == pytest.approx([4, 1, 2], abs=1e-12)
    assert np.abs(posture.constraint_projector.rows @ v).max() < 1e-12
    free = G1.posture(posture.q).joint_velocity((4, 1, 2))
    assert v @ posture.inertia @ v > free @ posture.inertia @ free


def test_admissible_is_the_nearest_velocity():
    leg = G1.with_supports(LEFT)
    posture = leg.posture(somewhere(leg, 7))
    rng = np.random.default_rng(7)
    v = rng.normal(size=leg.nv)
    near = posture.admissible(v)
    assert np.abs(posture.constraint_projector.rows @ near).max() < 1e-12
    posture.check_velocity(near)
    assert posture.admissible(near) == pytest.approx(near, abs=1e-12)
    # what is taken away is orthogonal to all that is let through
    other = posture.admissible(rng.normal(size=leg.nv))
    assert abs(other @ posture.inertia @ (v - near)) < 1e-11
    assert (G1.posture(posture.q).admissible(v) == v).all()


def test_velocity_that_moves_the_support_is_refused():
    leg = G1.with_supports(LEFT)
    posture = leg.posture(somewhere(leg, 8))
    v = posture.admissible(np.ones(leg.nv))
    v[leg.velocity_index("left_knee_joint")] += 0.1
    contact = kd.Contact((1, 0, 0), 0.8)
    for strike in (kd.strike, kd.engine_strike):
        with pytest.raises(
            kd.InvalidInput, match=rf"v moves {LEFT}, which is held, at \S+ rad/s in"
        ):
            strike(posture, v, kd.Ball(), contact)
    v = posture.admissible(np.ones(leg.nv))
    v[0] += 3
    with pytest.raises(kd.InvalidInput, match=rf"{LEFT}, which is held, at \S+ m/s"):
        posture.check_velocity(v)


def test_supports_that_leave_no_motion_contradict_each_other():
    bolt = kd.Leg.from_robot("bolt", "base_link", base="floating")
    angles = np.random.default_rng(0).uniform(-1, 1, size=6)
    q = bolt.configuration(dict(zip(bolt.joint_names[1:], angles, strict=True)))
    with pytest.raises(
        kd.InvalidInput, match=r"FL_FOOT, FR_FOOT contradict .* rank 12 of 12 rows, .* none of 12"
    ):
        bolt.with_supports("FL_FOOT", "FR_FOOT").posture(q)
    points = (kd.Support(frame, point=True) for frame in ("FL_FOOT", "FR_FOOT"))
    assert bolt.with_supports(*points).posture(q).constraint_projector.rank == 6


def chain_held():
    """A fixed base and a foot that stands: the whole stance leg cannot move."""
    leg = kd.Leg.from_robot("g1").with_supports(LEFT)
    return leg.posture(leg.configuration({"left_knee_joint": 0.4, "right_knee_joint": 0.5}))


def test_a_chain_that_is_held_still_may_move_by_rounding():
    posture = chain_held()
    v = posture.joint_velocity([6, 0, 2])
    stance = [posture.leg.velocity_index(n) for n in posture.leg.joint_names if n[:5] == "left_"]
    assert 0 < np.abs(posture.constraint_projector.rows @ v).max() < 1e-13  # nothing but rounding
    assert np.abs(v[stance]).max() > 0
    contact = kd.Contact((3, 0, 1), 0.8)
    hit = kd.strike(posture, v, kd.Ball(), contact)
    assert np.isfinite(hit.sensitivity().impulse["q"]).all()
    assert np.isfinite(hit.impulse).all()
    assert kd.engine_strike(posture, v, kd.Ball(), contact).impulse == pytest.approx(
        hit.impulse, rel=1e-12
    )
    v[posture.leg.velocity_index("left_knee_joint")] += 1e-6
    with pytest.raises(kd.InvalidInput, match=f"v moves {LEFT}, which is held, at"):
        posture.check_velocity(v)
