import math
import pickle

import numpy as np
import pinocchio as pin
import pytest
from chains import by_pinocchio, constraint_speed, random_inertia, random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from stacked import held_rows, inertia_of, rows_of, solved

import kickdyn as kd
from kickdyn.robot.urdf_file import shipped_urdf

G1 = kd.Leg.from_robot("g1", base="floating")
FOOT, OTHER = "left_ankle_roll_link", "right_ankle_roll_link"


def test_supports_are_kept_and_let_go():
    sole = [(0.1, 0.03, -0.03), (0.1, -0.03, -0.03), (-0.05, 0, -0.03)]
    support = kd.Support(FOOT, friction=0.7, sole=sole)
    leg = G1.with_supports(support)
    assert leg.constraints.supports == (support,)
    assert leg.constraints.size == support.size == 6
    copy = pickle.loads(pickle.dumps(leg))
    kept = copy.constraints.supports[0]
    assert (kept.frame, kept.point, kept.friction) == (FOOT, False, 0.7)
    assert kept.sole.tolist() == [list(corner) for corner in sole]
    assert kept == support
    assert hash(kept) == hash(support)
    assert kept != kd.Support(FOOT, friction=0.7)
    assert leg.locked({"waist_yaw_joint": 0.1}).constraints.supports == (support,)
    assert leg.with_armature({"waist_yaw_joint": 0.1}).constraints.supports == (support,)
    assert leg.with_supports().constraints is None
    other = leg.with_supports("left_ankle_pitch_link")  # in place of, not as well
    assert other.constraints.names == ["left_ankle_pitch_link"]
    loops = ("left_wrist_yaw_link", "right_wrist_yaw_link"), ("left_wrist_yaw_link", "torso_link")
    assert leg.with_loops(loops[0]).with_loops(loops[1]).constraints.loops == loops[1:]
    assert G1.constraints is None
    with pytest.raises(ValueError, match="read-only"):
        support.sole[0, 0] = 1


@pytest.mark.parametrize(
    ("supports", "said"),
    [
        (("left_toe",), "frame 'left_toe' is unknown: did you mean 'left_ankle_roll_link'"),
        ((OTHER,), f"support {OTHER} is on the kicking limb, .* right_ankle_roll_joint"),
        ((FOOT, "right_knee_link"), "support right_knee_link is on the kicking limb"),
        ((7,), "support is 7"),
        ((None,), "support is None"),
    ],
)
def test_what_cannot_stand_is_refused(supports, said):
    with pytest.raises(kd.InvalidInput, match=said):
        G1.with_supports(*supports)


def test_beyond_the_kicking_foot_is_the_kicking_limb_too():
    leg = kd.Leg.from_robot("g1", frame="left_knee_link", base="floating")
    with pytest.raises(kd.InvalidInput, match=f"{FOOT} is on the kicking limb"):
        leg.with_supports(FOOT)


def test_the_fixed_base_stands_already():
    leg = kd.Leg.from_robot("g1")
    with pytest.raises(kd.InvalidInput, match="pelvis is fixed to the base: it stands already"):
        leg.with_supports("pelvis")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"friction": -0.1}, f"friction under {FOOT} is -0.1"),
        ({"friction": np.nan}, f"friction under {FOOT} is nan"),
        ({"sole": [(0, 0, 0), (1, 0, 0)]}, r"has shape \(2, 3\): it must be \(k, 3\)"),
        ({"sole": [0, 0, 0]}, r"has shape \(3,\)"),
        ({"sole": np.zeros((4, 2))}, r"has shape \(4, 2\)"),
        ({"sole": [(0, 0, np.inf)] * 3}, "sole .*finite"),
        ({"sole": np.eye(3), "point": True}, "corners of a flat foot"),
    ],
)
def test_bad_soles_are_refused(options, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Support(FOOT, **options)


@pytest.mark.parametrize(
    ("loops", "said"),
    [
        ((("pelvis", "tip"),), "frame 'tip' is unknown"),
        ((("torso_link", "torso_link"),), "loop torso_link - torso_link joins a body to itself"),
        (("pelvis",), "loop is 'pelvis': it must be a pair"),
        ((("pelvis",),), "it must be a pair"),
    ],
)
def test_bad_loops_are_refused(loops, said):
    with pytest.raises(kd.InvalidInput, match=said):
        G1.with_loops(*loops)


def test_an_open_loop_is_refused_with_its_gap():
    leg = G1.with_loops(("left_wrist_yaw_link", "right_wrist_yaw_link"))
    q = leg.configuration()
    hands = [
        kd.Leg.from_robot("g1", f"{side}_wrist_yaw_link", base="floating").posture(q)
        for side in ("left", "right")
    ]
    gap = np.linalg.norm(hands[0].contact_point - hands[1].contact_point)
    with pytest.raises(kd.InvalidInput, match=rf"open by {gap:.6g} m in Posture\(g1.*close_loops"):
        leg.posture(q)


def test_rows_are_the_frames_velocities():
    """Against the frame's own motion, by finite differences."""
    import pinocchio as pin

    rng = np.random.default_rng(2)
    leg = G1.with_supports(FOOT, kd.Support("right_wrist_yaw_link", point=True))
    model = leg.model
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-0.6, 0.6, size=leg.nv))
    v, h = rng.normal(size=leg.nv), 1e-6
    places = []
    for step in (-h, h):
        data = model.createData()
        pin.framesForwardKinematics(model, data, pin.integrate(model, q, step * v))
        places.append([data.oMf[model.getFrameId(s.frame)] for s in leg.constraints.supports])
    (foot_0, hand_0), (foot_1, hand_1) = places
    rows = leg.posture(q).constraint_projector.rows @ v
    linear = (foot_1.translation - foot_0.translation) / (2 * h)
    angular = pin.log3(foot_1.rotation @ foot_0.rotation.T) / (2 * h)
    hand = (hand_1.translation - hand_0.translation) / (2 * h)
    assert rows == pytest.approx(np.concatenate([linear, angular, hand]), abs=1e-8)


def test_nothing_is_held_twice():
    for again in (FOOT, kd.Support(FOOT, point=True)):
        with pytest.raises(kd.InvalidInput, match=f"{FOOT} is constrained twice"):
            G1.with_supports(FOOT, again)
    hands = ("left_rubber_hand", "right_rubber_hand")
    with pytest.raises(kd.InvalidInput, match="hand is constrained twice"):
        G1.with_loops(hands, hands[::-1])


def test_a_support_is_a_name_and_a_sole_has_an_area():
    for wrong, said in (
        ({"frame": 5}, "frame is 5"),
        ({"frame": FOOT, "point": "no"}, "point of .* is 'no'"),
        ({"frame": FOOT, "sole": [(0, 0, 0), (1, 1, 0), (2, 2, 0)]}, "must span an area"),
    ):
        with pytest.raises(kd.InvalidInput, match=said):
            kd.Support(**wrong)


LEFT = "left_ankle_roll_link"
LEFT_JOINT = "left_ankle_roll_joint"  # a frame at the same place
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
    for strike in (kd.strike, by_pinocchio):
        with pytest.raises(
            kd.InvalidInput, match=rf"v moves {LEFT}, a constraint of the leg, at \S+ rad/s in"
        ):
            strike(posture, v, kd.Ball(), contact)
    v = posture.admissible(np.ones(leg.nv))
    v[0] += 3
    with pytest.raises(kd.InvalidInput, match=rf"{LEFT}, a constraint of the leg, at \S+ m/s"):
        posture.check_velocity(v)


def test_the_second_support_that_is_moved_is_the_one_named():
    """The right hand's origin must stay; the elbow before it moves it, and not the foot."""
    hand = "right_wrist_yaw_link"
    leg = G1.with_supports(LEFT, kd.Support(hand, point=True))
    posture = leg.posture(somewhere(leg, 8))
    v = posture.admissible(np.ones(leg.nv))
    v[leg.velocity_index("right_elbow_joint")] += 1.0
    name, speed, unit = posture.constraint_projector.find_violation(v)
    lever = posture.constraint_projector.rows[6:, leg.velocity_index("right_elbow_joint")]
    assert (name, unit) == (hand, "m/s")
    assert speed == pytest.approx(np.abs(lever).max(), rel=1e-9)


def test_new_supports_keep_loops_and_the_cone_and_new_loops_keep_supports():
    robot = kd.Leg.from_robot("g1", base="floating")
    hands = ("left_wrist_yaw_link", "right_wrist_yaw_link")
    for leg in (
        robot.with_loops(hands).with_supports(LEFT),
        robot.with_supports(LEFT).with_loops(hands),
        robot.with_supports("pelvis").with_loops(hands).with_supports(LEFT),
        robot.with_supports(LEFT).with_loops(hands).with_model(robot.model),
    ):
        assert [support.frame for support in leg.constraints.supports] == [LEFT]
        assert leg.constraints.loops == (hands,)
        assert leg.contact_normal_cone.tolist() == robot.contact_normal_cone.tolist()


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


def test_stiff_joints_are_named_with_the_supports():
    bolt = kd.Leg.from_robot("bolt", "base_link", base="floating")
    stiff = bolt.with_stiff_joints("FL_KFE", "FR_KFE").with_supports("FL_FOOT")
    names = ["FL_FOOT", "FL_KFE, which is stiff", "FR_KFE, which is stiff"]
    assert list(stiff.constraints.names) == names


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
    assert by_pinocchio(posture, v, kd.Ball(), contact).impulse == pytest.approx(
        hit.impulse, rel=1e-12
    )
    v[posture.leg.velocity_index("left_knee_joint")] += 1e-6
    with pytest.raises(kd.InvalidInput, match=f"v moves {LEFT}, a constraint of the leg, at"):
        posture.check_velocity(v)


TREE = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
LOOP = ("shank_pin", "rocker_b_tip")
LEG = TREE.with_loops(LOOP)


def flexed(drive):
    return LEG.close_loops(
        LEG.configuration({"rocker_b": drive}), keep=("hip", "rocker_b", "ankle")
    )


def test_straight_it_is_closed_and_hinged_at_the_knee():
    """The rockers cross at the knee's centre; they are light, so little else differs."""
    ours, hinge = LEG.posture(np.zeros(5)), kd.Leg.human().posture(np.zeros(3))
    assert ours.contact_point == pytest.approx(hinge.contact_point, abs=1e-15)
    assert ours.delassus() == pytest.approx(hinge.delassus(), rel=1e-3, abs=1e-12)
    assert ours.constraint_projector.rank == 2  # of 3 rows: nothing moves along y
    cut = TREE.posture(np.zeros(5))
    assert cut.effective_mass([1, 0, 0]) < 0.99 * ours.effective_mass([1, 0, 0])


@pytest.mark.parametrize("drive", [0.1, 0.4, 0.8, 1.3])
def test_closed_is_the_circles_intersection(drive):
    """Two pins on the thigh, two rods, one bar between: by the law of cosines."""
    q = dict(zip(LEG.joint_names, flexed(drive), strict=True))
    assert (q["hip"], q["ankle"], q["rocker_b"]) == (0, 0, drive)
    rod, bar = math.hypot(0.035, 0.035), 0.03

    def turned(x, z, angle):  # about y
        return np.array(
            [math.cos(angle) * x + math.sin(angle) * z, math.cos(angle) * z - math.sin(angle) * x]
        )

    front, back = np.array([0.02, 0.02]), np.array([-0.02, 0.02])
    tip = back + turned(0.035, -0.035, drive)
    pin_a = front + turned(-0.035, -0.035, q["rocker_a"])
    assert np.linalg.norm(tip - pin_a) == pytest.approx(bar, abs=1e-14)
    assert np.linalg.norm(pin_a - front) == pytest.approx(rod, abs=1e-15)
    flexion = q["rocker_a"] + q["shank_pin_a"]
    assert pin_a + turned(bar, 0, flexion) == pytest.approx(tip, abs=1e-14)
    assert LEG.lower[1] <= q["rocker_a"] <= LEG.upper[1]
    assert LEG.lower[2] <= q["shank_pin_a"] <= LEG.upper[2]


def test_closing_what_is_closed_changes_nothing():
    q = flexed(0.7)
    assert LEG.close_loops(q) == pytest.approx(q, abs=1e-13)
    assert TREE.close_loops([0.1, 0.2, 0.3, 0.4, 0.5]).tolist() == [0.1, 0.2, 0.3, 0.4, 0.5]


def test_foot_velocity_keeps_the_loop_closed():
    posture = LEG.posture(flexed(0.7))
    v = posture.joint_velocity([2, 0, 1])
    h = 1e-5
    ahead = LEG.posture(LEG.close_loops(posture.q + h * v))
    moved = (ahead.contact_point - posture.contact_point) / h
    assert moved == pytest.approx([2, 0, 1], abs=2e-3)


@pytest.mark.parametrize(
    ("drive", "keep"), [(2.5, ("rocker_b",)), (0.8, ("rocker_a", "rocker_b", "shank_pin_a"))]
)
def test_what_cannot_be_closed_is_refused_with_its_gap(drive, keep):
    with pytest.raises(
        kd.InvalidInput, match=r"loop shank_pin - rocker_b_tip stays open by .* m: .*rank \d of 3"
    ):
        LEG.close_loops(LEG.configuration({"rocker_b": drive}), keep=keep)


def test_loops_that_contradict_each_other_are_refused():
    both = TREE.with_loops(LOOP, ("shank_pin", "base"))  # the hip is farther away
    with pytest.raises(kd.InvalidInput, match=r"base stays open by .*rank \d of 6"):
        both.close_loops(np.zeros(5))


def test_bad_input():
    with pytest.raises(kd.InvalidInput, match="joint 'knee' is unknown"):
        LEG.close_loops(np.zeros(5), keep=("knee",))
    with pytest.raises(kd.InvalidInput, match=r"q has shape \(3,\)"):
        LEG.close_loops(np.zeros(3))


def test_two_hands_together():
    """A loop across a whole robot, its base afloat and a foot on the ground."""
    robot = kd.Leg.from_robot("g1", base="floating").with_supports("left_ankle_roll_link")
    hands = ("left_rubber_hand", "right_rubber_hand")
    leg = robot.with_loops(hands)
    q = leg.close_loops(leg.configuration({"left_elbow_joint": 0.4, "right_elbow_joint": 0.3}))
    posture = leg.posture(q)
    assert posture.constraint_projector.rank == 9
    assert q[:7] == pytest.approx([0, 0, 0, 0, 0, 0, 1], abs=1e-15)  # the base has no part in it
    v = posture.joint_velocity((3, 0, 0))
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact((1, 0, 0.2), 0.8, friction=0.4))
    assert hit.momentum_residual <= 1e-12
    assert constraint_speed(hit) <= 1e-10
    assert list(hit.support_impulses) == ["left_ankle_roll_link"]
    assert list(hit.loop_impulses) == [hands]


def test_only_the_loops_own_joints_move():
    """From far off, too, where closing starts anew."""
    q = {"hip": 0.5, "ankle": 0.2, "rocker_b": 0.05, "rocker_a": -1.5, "shank_pin_a": 2}
    closed = dict(
        zip(LEG.joint_names, LEG.close_loops(LEG.configuration(q), ["rocker_b"]), strict=True)
    )
    assert {name: closed[name] for name in ("hip", "ankle", "rocker_b")} == {
        name: q[name] for name in ("hip", "ankle", "rocker_b")
    }
    LEG.posture(list(closed.values()))


def test_what_is_no_configuration_is_refused():
    with pytest.raises(kd.InvalidInput, match="keep is 'rocker_b'"):
        LEG.close_loops(np.zeros(5), keep="rocker_b")
    with pytest.raises(kd.InvalidInput, match="must have length 1"):
        kd.Leg.from_robot("g1", base="floating").close_loops(np.zeros(36))


def test_joints_to_keep_are_a_list():
    leg = kd.Leg.human()
    for keep in (None, 3, "hip"):
        with pytest.raises(kd.InvalidInput, match=r"keep is .*must be a list of joints' names"):
            leg.close_loops(leg.configuration(), keep=keep)


def random_loop(rng):
    """Two random branches on one body that meet at random joint values, and these values."""
    model, ends = pin.Model(), []
    model.name = "loop"
    trunk = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "trunk")
    model.appendBodyToJoint(trunk, random_inertia(rng), pin.SE3.Identity())
    for branch in "ab":
        parent = trunk
        for k in range(rng.integers(2, 5)):
            axis = rng.normal(size=3)
            joint = pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))
            place = pin.SE3(random_rotation(rng), rng.uniform(-0.4, 0.4, size=3))
            parent = model.addJoint(parent, joint, place, f"{branch}{k}")
            model.appendBodyToJoint(parent, random_inertia(rng), pin.SE3.Identity())
        ends.append(parent)
    q, data = rng.uniform(-1, 1, size=model.nq), model.createData()
    pin.forwardKinematics(model, data, q)
    meeting = pin.SE3(random_rotation(rng), rng.uniform(-0.5, 0.5, size=3))
    for branch, end in zip("ab", ends, strict=True):
        place = data.oMi[end].actInv(meeting)
        model.addFrame(pin.Frame(f"end_{branch}", end, 0, place, pin.FrameType.OP_FRAME))
    tip = pin.SE3(np.eye(3), rng.uniform(-0.3, 0.3, size=3))
    model.addFrame(pin.Frame("toe", ends[0], 0, tip, pin.FrameType.OP_FRAME))
    return kd.Leg.from_model(model, "toe").with_loops(("end_a", "end_b")), q


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(["newton", "stronge"]))
def test_random_loops_keep_momentum_and_energy(seed, law):
    """M dv is what ball and loop give, the loop does no work, and stays closed."""
    rng = np.random.default_rng(seed)
    leg, q = random_loop(rng)
    posture = leg.posture(q)
    v = posture.admissible(rng.normal(size=leg.nv))
    rows = posture.constraint_projector.rows
    assert np.abs(rows @ v).max() < 1e-10
    foot = posture.point_velocity(v)
    normal = foot / np.linalg.norm(foot) + rng.uniform(-0.2, 0.2, size=3)
    contact = kd.Contact(normal, rng.uniform(0, 1), friction=rng.uniform(0, 1))
    hit = kd.strike(posture, v, kd.Ball(), contact, law)
    jump, loop = hit.v_after - v, hit.loop_impulses[("end_a", "end_b")]
    expected = rows.T @ loop - posture.jacobian.T @ hit.impulse
    assert posture.inertia @ jump == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
    speed = np.abs(hit.v_after).max()
    assert np.abs(rows @ hit.v_after).max() < 1e-9 * speed
    energy = 0.5 * (v @ posture.inertia @ v - hit.v_after @ posture.inertia @ hit.v_after)
    ball = hit.ball_after
    gained = 0.5 * (
        hit.ball.mass * ball.velocity @ ball.velocity + hit.ball.inertia * ball.spin @ ball.spin
    )
    assert energy - gained == pytest.approx(hit.energy_lost, abs=1e-9 * energy)
    assert hit.momentum_residual < 1e-9


@pytest.mark.parametrize(("width", "is_closed"), [(0.8e-9, True), (1.2e-9, False)])
def test_the_tolerance_of_a_loop_is_a_nanometre(width, is_closed):
    leg = TREE.with_loops(("shank_pin", "rocker_b_tip"))
    q = leg.close_loops(leg.configuration())
    model, data = leg.model, leg.model.createData()
    step = np.eye(leg.nv)[leg.velocity_index("rocker_b")]
    pin.forwardKinematics(model, data, q + 1e-4 * step)
    gap = float(np.linalg.norm(leg.constraints.gaps(model, data)))
    opened = q + 1e-4 * width / gap * step
    if is_closed:
        leg.posture(opened)
        return
    with pytest.raises(kd.InvalidInput, match=r"is open by 1\.2e-09 m"):
        leg.posture(opened)


def test_the_ends_of_an_open_loop_are_found():
    (line,) = TREE.warnings
    assert line.startswith("shank_pin and rocker_b_tip are at one place at q = 0")
    assert "with_loops(('shank_pin', 'rocker_b_tip'))" in line
    assert TREE.posture(np.full(5, 0.1)).warnings == (line,)
    assert "ends of a loop" in TREE._repr_html_()
    assert TREE.with_loops(LOOP[::-1]).warnings == ()
    assert TREE.locked({"rocker_a": 0, "rocker_b": 0, "shank_pin_a": 0}).warnings == ()
    assert kd.Leg.human().warnings == G1.warnings == ()


def _moved(file):
    """The tip at its place, on the thigh."""
    file.write_text(
        file.read_text().replace('<origin xyz="0.035 0 -0.035"/>', '<origin xyz="0.015 0 -0.386"/>')
    )
    return kd.Leg.from_urdf(file)


MASS = """<inertial><mass value="0.1"/>
<inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>"""


def test_frames_apart_or_of_one_branch_are_no_open_loop(tmp_path):
    text = shipped_urdf("leg_fourbar.urdf").read_text()
    for old, new in (
        ('<origin xyz="0.035 0 -0.035"/>', '<origin xyz="0.035 0 -0.03501"/>'),  # 10 um off
        ('<parent link="rocker_b"/>', '<parent link="thigh"/>'),  # which carries the other
        ('<link name="shank_pin"/>', '<link name="shank_pin">' + MASS + "</link>"),
    ):
        assert old in text
        file = tmp_path / "leg.urdf"
        file.write_text(text.replace(old, new))
        leg = kd.Leg.from_urdf(file) if "thigh" not in new else _moved(file)
        assert leg.open_loops == ()


def test_the_bias_is_the_acceleration_of_every_support_and_loop():
    """Central differences of the frames' velocities while the joints' velocity is constant."""
    loops = ("left_wrist_yaw_link", "right_wrist_yaw_link"), ("left_elbow_link", "torso_link")
    leg = G1.with_supports(FOOT).with_loops(*loops)
    draw, h = np.random.default_rng(4), 1e-5
    model, data = leg.model, leg.model.createData()
    q = pin.integrate(model, leg.configuration(), draw.uniform(-0.5, 0.5, leg.nv))
    v = draw.normal(size=leg.nv)

    def velocities(step):
        pin.forwardKinematics(model, data, pin.integrate(model, q, step * v), v)
        moved = [
            pin.getFrameVelocity(model, data, model.getFrameId(name), pin.LOCAL_WORLD_ALIGNED)
            for name in (FOOT, *loops[0], *loops[1])
        ]
        foot, *ends = (motion.vector for motion in moved)
        return np.concatenate([foot, (ends[1] - ends[0])[:3], (ends[3] - ends[2])[:3]])

    rate = (velocities(h) - velocities(-h)) / (2 * h)
    bias = leg.constraints.bias(model, data, q, v)
    assert bias == pytest.approx(rate, abs=1e-6)
    assert (np.abs(bias) > 1e-3).all()


@pytest.mark.parametrize("order", [1, -1])
def test_the_widest_gap_is_named_with_its_width(order):
    """A pendulum of 1 m below its pins: one is 3 m away, one 0.5 m from the middle of the rod."""
    model = pin.Model()
    for name in ("hip", "knee"):
        parent = model.njoints - 1
        joint = model.addJoint(parent, pin.JointModelRY(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    for name, joint, z in (
        *(("tip", 1, -1.0), ("middle", 1, -0.5), ("far", 0, -3.0), ("near", 0, -1.0)),
        ("toe", 2, -2.0),
    ):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))
        model.addFrame(pin.Frame(name, joint, place, pin.FrameType.OP_FRAME))
    loops = [("tip", "far"), ("middle", "near")][::order]
    leg = kd.Leg.from_model(model, "toe").with_loops(*loops)
    with pytest.raises(kd.InvalidInput, match="loop tip - far stays open by 2 m"):
        leg.close_loops(np.zeros(2))
