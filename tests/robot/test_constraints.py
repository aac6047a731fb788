"""Supports, loops and stiff joints: rows by differences, responses by other equations."""

import math
import pickle

import numpy as np
import pinocchio as pin
import pytest
from chains import kinetic_energy, random_inertia, random_kick, random_leg, random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, closed_form, differenced, optimized

import kickdyn as kd
from kickdyn.impact.strike import strike_by_pinocchio
from kickdyn.robot.urdf_file import shipped_urdf

G1 = kd.Leg.from_robot("g1", base="floating")
FOOT, OTHER = "left_ankle_roll_link", "right_ankle_roll_link"
FOOT_JOINT = "left_ankle_roll_joint"
"""A frame at the same place as the foot."""

TREE = kd.Leg.from_urdf(shipped_urdf("leg_fourbar.urdf"))
HAND = "right_wrist_yaw_link"
KICKER = kd.Leg.from_robot("g1", HAND, base="floating")
HANDS = "left_wrist_yaw_link", HAND
CORNERS = [(0.1, 0.03, -0.03), (0.1, -0.03, -0.03), (-0.05, 0, -0.03)]

STACKED = closed_form(1e4)
"""Rounding times the condition of the stacked system."""


def random_posture(leg, seed):
    step = np.random.default_rng(seed).uniform(-0.6, 0.6, size=leg.nv)
    return leg.posture(pin.integrate(leg.model, pin.neutral(leg.model), step))


def test_constraints_replace_their_own_kind_and_stay_with_others():
    support = kd.Support(FOOT, friction=0.7, sole=CORNERS)
    leg = G1.with_supports(support)
    (copy,) = pickle.loads(pickle.dumps(leg)).constraints.supports
    assert (copy, hash(copy)) == (support, hash(support))
    assert copy != kd.Support(FOOT, friction=0.7)
    for other in (leg.locked({"waist_yaw_joint": 0.1}), leg.with_armature({"waist_yaw_joint": 0.1}),
                  leg.with_loops(HANDS), leg.with_model(G1.model),
                  G1.with_loops(HANDS).with_supports(support)):  # fmt: skip
        assert other.constraints.supports == (support,)
        assert other.contact_normal_cone.tolist() == G1.contact_normal_cone.tolist()
    assert leg.with_supports(OTHER.replace("right", "left")).constraints.size == 6
    assert leg.with_supports().constraints is None
    loops = HANDS, ("left_wrist_yaw_link", "torso_link")
    assert leg.with_loops(loops[0]).with_loops(loops[1]).constraints.loops == loops[1:]
    with pytest.raises(ValueError, match="read-only"):
        support.sole[0, 0] = 1


@pytest.mark.parametrize(("change", "said"), [
    (lambda: G1.with_supports("left_toe"), f"'left_toe' .*'{FOOT}'"),
    (lambda: G1.with_supports(OTHER), f"{OTHER} is on the kicking limb"),
    (lambda: kd.Leg.from_robot("g1", "left_knee_link", base="floating").with_supports(FOOT),
     f"{FOOT} is on the kicking limb"),  # beyond the kicking foot
    (lambda: kd.Leg.from_robot("g1").with_supports("pelvis"), "pelvis is fixed to the base"),
    (lambda: G1.with_stiff_joints("toe"), "'toe' is unknown"),
    (lambda: TREE.with_stiff_joints("hip", "hip"), "'hip' is stiff twice"),
    (lambda: TREE.with_stiff_joints(*TREE.joint_names), "all joints .* are stiff"),
    (lambda: G1.with_supports(FOOT, FOOT), f"{FOOT} is constrained twice"),
    (lambda: kd.Support(FOOT, point="no"), "point of .* is 'no'"),
    (lambda: kd.Support(FOOT, friction=-0.1), f"friction under {FOOT} is -0.1"),
    (lambda: kd.Support(FOOT, sole=CORNERS[:2]), r"\(2, 3\): .*\(k, 3\)"),
    (lambda: kd.Support(FOOT, sole=np.eye(3), point=True), "flat foot"),
    (lambda: kd.Support(FOOT, sole=np.outer(range(3), (1, 1, 0))), "span an area"),
    (lambda: G1.with_loops(("pelvis", "tip")), "'tip' is unknown"),
    (lambda: G1.with_loops(("torso_link", "torso_link")), "joins a body to itself"),
    (lambda: G1.with_loops("pelvis"), "'pelvis': .*pair"),
    (lambda: G1.with_loops(HANDS, HANDS[::-1]), "constrained twice")])  # fmt: skip
def test_bad_supports_and_loops_are_refused(change, said):
    with pytest.raises(kd.InvalidInput, match=said):
        change()


def test_rows_are_the_velocities_of_frames_and_the_bias_their_acceleration():
    """By central differences along a motion whose joints have a constant velocity."""
    loops = HANDS, ("left_elbow_link", "torso_link")
    leg = G1.with_supports(FOOT, kd.Support("right_elbow_link", point=True)).with_loops(*loops)
    draw, h = np.random.default_rng(4), 1e-5
    model, data = leg.model, leg.model.createData()
    q = pin.integrate(model, leg.configuration(), draw.uniform(-0.5, 0.5, leg.nv))
    v = draw.normal(size=leg.nv)
    frames = [FOOT, "right_elbow_link", *loops[0], *loops[1]]

    def places(step):
        pin.framesForwardKinematics(model, data, pin.integrate(model, q, step * v))
        return [data.oMf[model.getFrameId(name)].copy() for name in frames]

    def velocities(step):
        """Those of the rows: a frame's linear and angular one, then differences of two frames."""
        before, after = places(step - h), places(step + h)
        pairs = zip(before, after, strict=True)
        linear = [(b.translation - a.translation) / (2 * h) for a, b in pairs]
        turn = pin.log3(after[0].rotation @ before[0].rotation.T) / (2 * h)
        bars = linear[3] - linear[2], linear[5] - linear[4]
        return np.concatenate([linear[0], turn, linear[1], *bars])

    pin.forwardKinematics(model, data, q)
    rows, _ = leg.constraints.rows(model, data, q)
    # across a gap, the first body moves as at the second origin
    now, near = places(0.0), (places(-h), places(h))
    for k, (start, end) in enumerate(((2, 3), (4, 5))):
        gap = now[end].translation - now[start].translation
        turns = near[1][start].rotation @ near[0][start].rotation.T
        turn = pin.log3(turns) / (2 * h)
        rows[9 + 3 * k : 12 + 3 * k] += np.outer(np.cross(turn, gap), v) / (v @ v)
    agrees(rows @ v, velocities(0.0), differenced())
    rate = (velocities(100 * h) - velocities(-100 * h)) / (200 * h)
    bias = leg.constraints.bias(model, data, q, v)
    agrees(bias, rate, 1e-4)  # differences of differences
    assert (np.abs(bias) > 1e-3).all()


STANCES = {  # leg, supports, rank of their rows
    "flat foot": (G1, (FOOT,), 6),
    "point foot": (G1, (kd.Support(FOOT, point=True),), 3),
    "two feet": (KICKER, (FOOT, OTHER), 12),
    "foot twice": (G1, (FOOT, kd.Support(FOOT_JOINT, point=True)), 6),
    "foot and toe": (G1, (FOOT, "left_ankle_pitch_link"), 7),
    "pelvis": (G1, ("pelvis",), 6),
}


@pytest.mark.parametrize("stance", STANCES)
def test_a_supported_leg_solves_the_stacked_system(stance):
    leg, supports, rank = STANCES[stance]
    leg = leg.with_supports(*supports)
    posture = random_posture(leg, 1)
    impulse = np.random.default_rng(1).normal(size=leg.nv)
    jump, supported = posture.respond(impulse)
    rows, n = posture.constraint_projector.rows, leg.nv
    system = np.block([[posture.inertia, -rows.T], [rows, np.zeros((len(rows), len(rows)))]])

    def stacked(impulse):
        """Jump, and the smallest impulses of the constraints."""
        right = np.concatenate([impulse, np.zeros(len(rows))])
        answer = np.linalg.lstsq(system, right, rcond=1e-12)[0]
        return answer[:n], answer[n:]

    exact, reaction = stacked(impulse)
    agrees(jump, exact, STACKED)
    agrees(supported, reaction, STACKED)
    assert posture.constraint_projector.rank == rank
    assert (posture.solve(impulse) == jump).all()
    np.testing.assert_allclose(rows @ jump, 0.0, atol=closed_form(10) * np.abs(exact).max())
    columns = [posture.jacobian @ stacked(row)[0] for row in posture.jacobian]
    agrees(posture.delassus(), np.array(columns).T, STACKED)


def test_velocities_of_a_supported_leg():
    """Of least energy for a velocity of the foot, and nearest to one that moves the support."""
    leg, rng = G1.with_supports(FOOT), np.random.default_rng(6)
    posture = random_posture(leg, 6)
    rows, rounding = posture.constraint_projector.rows, closed_form(posture.condition)
    v = posture.joint_velocity((4, 1, 2))
    agrees(posture.point_velocity(v), (4, 1, 2), rounding)
    np.testing.assert_allclose(rows @ v, 0.0, atol=rounding * np.abs(v).max())
    *_, basis = np.linalg.svd(np.vstack([rows, posture.jacobian]))
    still = basis[9:]  # moves neither foot
    np.testing.assert_allclose(still @ posture.inertia @ v, 0.0, atol=rounding * np.abs(v).max())
    wild = rng.normal(size=leg.nv)
    nearest = posture.admissible(wild)
    np.testing.assert_allclose(rows @ nearest, 0.0, atol=rounding * np.abs(nearest).max())
    for size in (1e-12, 1.0, 1e12):  # what is rounding depends on the fastest joint
        posture.check_velocity(size * nearest)
        with pytest.raises(kd.InvalidInput, match=FOOT):
            posture.check_velocity(size * wild)
    allowed = np.linalg.svd(rows)[2][6:]
    removed = posture.inertia @ (wild - nearest)
    np.testing.assert_allclose(allowed @ removed, 0.0, atol=rounding * np.abs(removed).max())
    assert (G1.posture(posture.q).admissible(wild) == wild).all()


def test_a_velocity_that_moves_a_support_is_refused_with_its_speed():
    """The elbow moves the origin of a hand that must stay, and not the foot."""
    leg = G1.with_supports(FOOT, kd.Support(HAND, point=True))
    posture = random_posture(leg, 8)
    still = posture.admissible(np.ones(leg.nv))
    for joint, name, unit in (
        ("right_elbow_joint", HAND, "m/s"), ("left_knee_joint", FOOT, "rad/s"),
    ):  # fmt: skip
        index = leg.velocity_index(joint)
        v = still + np.eye(leg.nv)[index]
        largest = np.abs(posture.constraint_projector.rows[:, index]).max()
        violation = posture.constraint_projector.find_violation(v)
        assert violation == (name, pytest.approx(largest, rel=closed_form(1e4)), unit)
        for strike in (kd.strike, strike_by_pinocchio):
            with pytest.raises(kd.InvalidInput, match=f"{name}, .* {unit} in .*admissible"):
                strike(posture, v, kd.Ball(), kd.Contact((1, 0, 0), 0.8))


def test_supports_that_leave_no_motion_contradict_each_other():
    bolt = kd.Leg.from_robot("bolt", "base_link", base="floating")
    angles = np.random.default_rng(0).uniform(-1, 1, size=6)
    q = bolt.configuration(dict(zip(bolt.joint_names[1:], angles, strict=True)))
    feet = "FL_FOOT", "FR_FOOT"
    with pytest.raises(kd.InvalidInput, match=r"FL_FOOT, FR_FOOT .* rank 12 of 12 rows"):
        bolt.with_supports(*feet).posture(q)
    points = (kd.Support(frame, point=True) for frame in feet)
    assert bolt.with_supports(*points).posture(q).constraint_projector.rank == 6


LOOP = ("shank_pin", "rocker_b_tip")
LEG = TREE.with_loops(LOOP)
"""A knee of two crossed rockers between thigh and shank."""


def flexed(drive):
    keep = ("hip", "rocker_b", "ankle")
    return LEG.close_loops(LEG.configuration({"rocker_b": drive}), keep=keep)


def test_straight_a_four_bar_knee_is_a_hinge_where_its_rockers_cross():
    """The rockers are light, so that little else differs."""
    knee, hinge = LEG.posture(np.zeros(5)), kd.Leg.human().posture(np.zeros(3))
    assert knee.contact_point == pytest.approx(hinge.contact_point, abs=closed_form())
    agrees(knee.delassus(), hinge.delassus(), 1e-3)
    assert knee.constraint_projector.rank == 2  # of 3 rows: nothing moves along y
    cut = TREE.posture(np.zeros(5))
    assert cut.effective_mass([1, 0, 0]) < 0.99 * knee.effective_mass([1, 0, 0])


@pytest.mark.parametrize("drive", [0.1, 0.4, 0.8, 1.3])
def test_a_closed_loop_is_the_intersection_of_circles(drive):
    """Two pins on the thigh, two rods, one bar between: by the law of cosines."""
    q = dict(zip(LEG.joint_names, flexed(drive), strict=True))
    assert (q["hip"], q["ankle"], q["rocker_b"]) == (0, 0, drive)

    def turned(x, z, angle):  # about y
        cosine, sine = math.cos(angle), math.sin(angle)
        return np.array([cosine * x + sine * z, cosine * z - sine * x])

    front, back, bar = np.array([0.02, 0.02]), np.array([-0.02, 0.02]), 0.03
    tip = back + turned(0.035, -0.035, drive)
    pin_a = front + turned(-0.035, -0.035, q["rocker_a"])
    flexion = q["rocker_a"] + q["shank_pin_a"]
    assert pin_a + turned(bar, 0, flexion) == pytest.approx(tip, abs=closed_form(10))
    assert LEG.lower[1] <= q["rocker_a"] <= LEG.upper[1]  # of two intersections, this one


@pytest.mark.parametrize(("q", "keep", "said"), [
    (LEG.configuration({"rocker_b": 2.5}), ("rocker_b",), r"stays open by .*rank \d of 3"),
    (LEG.configuration(), ("knee",), "'knee' is unknown"),
    (LEG.configuration(), "rocker_b", "keep is 'rocker_b'")])  # fmt: skip
def test_loops_that_cannot_be_closed_are_refused(q, keep, said):
    with pytest.raises(kd.InvalidInput, match=said):
        LEG.close_loops(q, keep)


def random_loop(rng):
    """Two random branches on one body that meet at random joint values, and these values."""
    model, ends = pin.Model(), []
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


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from(["newton", "stronge"]))
def test_random_loops_keep_momentum_and_energy(seed, law):
    """M dv is what ball and loop give, the loop does no work, and stays closed."""
    rng = np.random.default_rng(seed)
    leg, q = random_loop(rng)
    posture = leg.posture(q)
    v = posture.admissible(rng.normal(size=leg.nv))
    rows, velocity = posture.constraint_projector.rows, posture.point_velocity(v)
    normal = velocity / np.linalg.norm(velocity) + rng.uniform(-0.2, 0.2, size=3)
    contact = kd.Contact(normal, rng.uniform(0, 1), friction=rng.uniform(0, 1))
    hit = kd.strike(posture, v, kd.Ball(), contact, law)
    rounding = optimized(1e-10)
    momentum = rows.T @ hit.loop_impulses[("end_a", "end_b")] - posture.jacobian.T @ hit.impulse
    agrees(posture.inertia @ (hit.v_after - v), momentum, rounding)
    for after in (v, hit.v_after):
        np.testing.assert_allclose(rows @ after, 0.0, atol=rounding * np.abs(after).max())
    before = kinetic_energy(posture, v, hit.ball, hit.ball_before)
    lost = before - kinetic_energy(posture, hit.v_after, hit.ball, hit.ball_after)
    assert hit.energy_lost == pytest.approx(lost, abs=rounding * before)


HUMAN = kd.Leg.human()
STIFF = HUMAN.with_stiff_joints("ankle")
Q = np.array([0.1, 0.4, -0.2])


@pytest.mark.parametrize("joints", [("ankle",), ("knee", "ankle"), ("hip",)])
def test_the_delassus_matrix_is_that_of_locked_joints(joints):
    values = dict(zip(HUMAN.joint_names, Q, strict=True))
    locked = HUMAN.locked({name: values[name] for name in joints})
    right = locked.posture([values[name] for name in locked.joint_names]).delassus()
    posture = HUMAN.with_stiff_joints(*joints).posture(Q)
    agrees(posture.delassus(), right, closed_form(posture.condition))
    free = HUMAN.posture(Q)
    agrees(posture.without_stiff_joints.delassus(), free.delassus(), closed_form())
    assert posture.joint_velocity([4, 0, 1]) == pytest.approx(free.joint_velocity([4, 0, 1]))
    assert posture.admissible([1.0, 2.0, 3.0]).tolist() == [1, 2, 3]  # they may move
    posture.check_velocity(np.ones(3))


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.sampled_from(["newton", "stronge"]), st.booleans())
def test_velocities_are_kept_and_momentum_and_energy_close(seed, law, is_rough):
    """Joints that move keep their speed: their motors do work on the others."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, int(rng.integers(3, 7)))
    names = rng.choice(leg.joint_names, 2, replace=False).tolist()
    stiff = leg.with_stiff_joints(*names)
    kick, options = random_kick(rng, stiff, friction=0.4 * is_rough)
    posture, v, ball, _ = kick
    hit, rounding = kd.strike(*kick, law, **options), optimized(1e-10)
    at = [leg.velocity_index(name) for name in names]
    jump, scale = hit.v_after - v, np.abs(hit.v_after).max()
    np.testing.assert_allclose(jump[at], 0.0, atol=rounding * scale)
    holding = np.zeros(leg.nv)
    holding[at] = hit.constraint_impulses
    momentum = holding - posture.jacobian.T @ hit.impulse
    size = rounding * np.abs(posture.jacobian.T @ hit.impulse).max()
    np.testing.assert_allclose(posture.inertia @ jump, momentum, rtol=0, atol=size)
    energy = kinetic_energy(posture, v, ball, hit.ball_before)
    lost = energy - kinetic_energy(posture, hit.v_after, ball, hit.ball_after)
    work = holding @ (v + hit.v_after) / 2
    assert hit.motor_work == pytest.approx(work, abs=rounding * energy)
    assert hit.energy_lost == pytest.approx(lost + work, abs=rounding * energy)
    loads = kd.joint_loads(hit)
    for name, impulse in zip(names, hit.constraint_impulses, strict=True):
        load = np.linalg.norm(loads[name].axis)
        assert abs(load - abs(impulse)) < optimized(1e-9) * np.linalg.norm(hit.impulse), name
    if not is_rough:
        engine = strike_by_pinocchio(*kick, **options)
        agrees(engine.impulse, hit.impulse, optimized(1e-8))


def test_stiff_joints_stay_until_they_are_replaced():
    for leg in (pickle.loads(pickle.dumps(STIFF)), STIFF.with_armature({"hip": 0.1}),
                STIFF.locked({"hip": 0.1}), STIFF.with_supports().with_loops()):  # fmt: skip
        assert leg.stiff_joints == ("ankle",)
    assert STIFF.with_stiff_joints().constraints is None
    assert STIFF.locked({"ankle": 0.1}).stiff_joints == ()
