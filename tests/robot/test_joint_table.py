import copy
import math
import pickle

import numpy as np
import pinocchio as pin
import pytest
from chains import by_pinocchio, floating_leg
from hypothesis import given, settings
from hypothesis import strategies as st
from urdf_bodies import Bodies, random_urdf

import kickdyn as kd
from kickdyn.paper.fig_1 import self_motion
from kickdyn.robot.joint_table import Mimic
from kickdyn.robot.kicking_chain import kicking_chain

BODY = pin.Inertia(1.0, np.array([0.0, 0.0, -0.25]), np.diag([0.1, 0.1, 0.05]))


def mixed():
    """One joint of each kind: limited, continuous, prismatic."""
    model = pin.Model()
    model.name = "mixed"
    parent = 0
    for kind, name, limits in (
        (pin.JointModelRY(), "turn", ([-1.0], [2.0])),
        (pin.JointModelRUBY(), "spin", ([-1.1] * 2, [1.1] * 2)),
        (pin.JointModelPZ(), "slide", ([0.0], [0.3])),
    ):
        low, high = (np.array(limit) for limit in limits)
        size = np.ones(1)
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name, size, size, low, high)
        model.appendBodyToJoint(parent, BODY, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0, 0, -1.0]))
    model.addFrame(pin.Frame("toe", parent, 0, tip, pin.FrameType.OP_FRAME))
    return kd.Leg.from_model(model, "toe")


def test_joints_of_every_kind():
    leg = mixed()
    assert (leg.nq, leg.nv) == (4, 3)
    q = leg.configuration({"spin": 3.0, "slide": 0.2})
    assert q == pytest.approx([0, math.cos(3), math.sin(3), 0.2], abs=1e-15)
    assert leg.posture(q).contact_point == pytest.approx(
        [-0.8 * math.sin(3), 0, -0.8 * math.cos(3)]
    )
    assert leg.joint_range("turn") == (-1, 2)
    assert leg.joint_range("spin") == (-math.pi, math.pi)
    assert leg.joint_range("slide") == (0, 0.3)
    assert [leg.joint_unit(name) for name in leg.joint_names] == ["rad", "rad", "m"]
    assert leg.joint_values(q) == pytest.approx({"turn": 0, "spin": 3, "slide": 0.2})
    assert leg.angles_deg(list(q)) == pytest.approx({"turn": 0, "spin": math.degrees(3)})
    assert leg.positions_m(q) == pytest.approx({"slide": 0.2})
    assert leg.display_values(q)["slide"] == (pytest.approx(0.2), "m")


def test_a_continuous_joint_may_be_given_by_its_angle():
    leg = mixed()
    q = leg.configuration({"turn": 0.5, "spin": 3.0, "slide": 0.2})
    assert leg.posture([0.5, 3.0, 0.2]).q == pytest.approx(q, abs=1e-15)
    assert leg.joint_values([0.5, -3.0, 0.2])["spin"] == pytest.approx(-3)
    said = r"q has shape \(5,\): it must be \(3,\), with one angle for each continuous joint and"
    with pytest.raises(kd.InvalidInput, match=said):
        leg.posture(np.zeros(5))
    with pytest.raises(kd.InvalidInput, match="must have length 1"):
        leg.posture([0.5, 3.0, 0.2, 0.0])


def test_a_floating_base_beside_a_continuous_joint():
    leg = floating_leg(np.random.default_rng(0))
    base = [1, 2, 3, 0, 0, 0, 1]
    q = leg.posture([*base, 0.3, 0.4]).q
    assert q == pytest.approx([*base, math.cos(0.3), math.sin(0.3), 0.4])


def test_nothing_named_is_everything_at_zero():
    assert mixed().configuration().tolist() == [0, 1, 0, 0]


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        ({"twist": 1}, "joint 'twist' is unknown: mixed has turn, spin, slide"),
        ({"turn": math.nan}, "joint turn is nan"),
        ({"turn": "30"}, "joint turn is '30'"),
        ({"universe": 1}, "joint 'universe' is unknown"),
        (["turn"], "^angles is .*must map names to values"),
    ],
)
def test_bad_angles_are_refused(angles, said):
    with pytest.raises(kd.InvalidInput, match=said):
        mixed().configuration(angles)


@pytest.mark.parametrize("method", ["velocity_index", "joint_range", "joint_unit"])
def test_joint_of_many_degrees_is_refused_by_name(method):
    leg = kd.Leg.from_robot("bolt", base="floating")
    assert leg.configuration()[:7].tolist() == [0, 0, 0, 0, 0, 0, 1]
    assert "root_joint" not in leg.angles_deg(leg.configuration())
    with pytest.raises(kd.InvalidInput, match="joint 'root_joint' has 6 degrees of freedom"):
        getattr(leg, method)("root_joint")


@pytest.mark.parametrize(
    ("q", "said"),
    [
        ([0, 0], r"shape \(2,\): it must be \(3,\)"),
        ([[0, 0, 0]], r"shape \(1, 3\)"),
        (np.zeros((3, 1)), r"shape \(3, 1\)"),
        ([0, math.nan, 0], "finite"),
        ([0, math.inf, 0], "finite"),
        ([0, 1j, 0], "real numbers"),
        ("000", "real numbers"),
        ([True, False, True], "real numbers"),
        (np.ma.array([0.0, 1.0, 2.0], mask=[0, 0, 1]), "masked"),
        ({"hip": 0.3}, r"\{'hip': 0.3\}: it must be 3 numbers; Leg.configuration makes them"),
    ],
    ids=str,
)
def test_bad_q_is_refused(q, said):
    leg = kd.Leg.human()
    for takes in (leg.posture, leg.close_loops, leg.angles_deg, leg.outside_range):
        with pytest.raises(kd.InvalidInput, match=f"^q .*{said}"):
            takes(q)


@pytest.mark.parametrize("pair", [[0, 0], [2, 0], [1, 1e-3]])
def test_cosine_and_sine_must_belong_together(pair):
    with pytest.raises(kd.InvalidInput, match="must have length 1"):
        mixed().posture([0.1, *pair, 0.2])
    assert mixed().posture([0.1, 0.6, 0.8, 0.2]).q.tolist() == [0.1, 0.6, 0.8, 0.2]


def test_a_floating_base_without_its_quaternion_is_named():
    leg = kd.Leg.from_robot("bolt", base="floating")
    with pytest.raises(kd.InvalidInput, match=r"quaternions \(xyzw, last\) and .* must have"):
        leg.posture(np.zeros(leg.nq))
    stretched = leg.configuration()
    stretched[3:7] *= 2
    with pytest.raises(kd.InvalidInput, match="must have length 1"):
        leg.posture(stretched)


@pytest.mark.parametrize(
    ("q", "is_said"),
    [
        ([30, 40, 10], True),
        ([90, 0, 0], True),
        ([0, 0, -60], True),
        ([3, 4, 1], False),
        ([30, 1, 0], False),  # the knee could mean radians
        ([0.3, 0.2, 0.1], False),
    ],
)
def test_degrees_in_place_of_radians_are_said(q, is_said):
    lines = kd.Leg.human().posture(q).warnings
    assert [line for line in lines if "these look like degrees, and q is in radians" in line] == (
        [lines[-1]] if is_said else []
    )


def test_metres_and_joints_without_a_range_are_no_degrees():
    assert not any("degrees" in line for line in mixed().posture([0.1, 0.6, 0.8, 99.0]).warnings)


def test_what_is_outside_its_range_is_named():
    leg = mixed()
    for inside in ({}, {"turn": -1, "spin": 3.1, "slide": 0.3}, {"turn": 2 + 1e-7}):
        assert leg.outside_range(leg.configuration(inside)) == []
    outside = leg.configuration({"turn": 2.001, "spin": 3.1, "slide": -0.01})
    assert leg.outside_range(outside) == [
        "turn at 114.65 deg is outside its range -57.296 to 114.59 deg",
        "slide at -0.01 m is outside its range 0 to 0.3 m",
    ]
    degrees = kd.Leg.human().outside_range(np.array([20.0, 0.25, 0.3]))
    assert degrees == ["hip at 1145.9 deg is outside its range -30 to 125 deg"]


@pytest.mark.parametrize(("excess", "is_named"), [(0.8e-6, False), (1.2e-6, True)])
def test_the_tolerance_of_limits_is_a_millionth(excess, is_named):
    model = mixed().model
    model.velocityLimit = np.full(model.nv, 7.0)
    leg = kd.Leg.from_model(model, "toe")
    assert bool(leg.outside_range(leg.configuration({"turn": 2.0 + excess}))) == is_named
    assert bool(leg.too_fast(7.0 * (1.0 + excess) * np.array([1.0, 0.0, 0.0]))) == is_named


def test_what_is_faster_than_its_limit_is_named():
    model = mixed().model
    model.velocityLimit = np.array([2.0, np.inf, 0.0])
    leg = kd.Leg.from_model(model, "toe")
    for v in ([-2, 1e300, 0], [2 * (1 + 1e-7), -1e300, 0]):
        assert leg.too_fast(np.array(v)) == []
    assert leg.too_fast(np.array([-2.96, 1e300, 1e-9])) == [
        "turn at 148 % of its speed limit",
        "slide moves, its speed limit is 0",
    ]
    assert leg.too_fast(np.array([2.0001, 0.0, 0.0])) == ["turn at 100 % of its speed limit"]
    floating = kd.Leg.from_robot("bolt", base="floating")
    assert floating.too_fast(np.full(floating.nv, 1e-3)) == []


@pytest.mark.parametrize("joint", ["turn", "spin", "slide"])
def test_a_model_without_frames_of_joints_can_be_locked(joint):
    free = mixed()
    locked = free.locked({joint: 0.2})
    assert joint not in locked.joint_names
    values = {"turn": 0.1, "spin": -0.4, "slide": 0.3, joint: 0.2}
    whole = free.posture(free.configuration(values))
    kept = {name: value for name, value in values.items() if name != joint}
    alone = locked.posture(locked.configuration(kept))
    assert alone.contact_point == pytest.approx(whole.contact_point, abs=1e-14)
    column = [index for index, name in enumerate(free.joint_names) if name != joint]
    assert alone.inertia == pytest.approx(whole.inertia[np.ix_(column, column)], abs=1e-14)


def test_without_a_limit_there_is_none():
    model = pin.Model()
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hip")
    model.addJoint(1, pin.JointModelRY(), pin.SE3.Identity(), "knee")
    for joint in (1, 2):
        model.appendBodyToJoint(joint, BODY, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0, 0, -1.0]))
    model.addFrame(pin.Frame("toe", 2, 0, tip, pin.FrameType.OP_FRAME))
    model.velocityLimit = np.array([5.0, np.finfo(float).max])  # the largest float is Pinocchio's
    leg = kd.Leg.from_model(model, "toe")
    assert leg.velocity_limit.tolist() == [5.0, math.inf]
    assert leg.effort_limit.tolist() == [math.inf, math.inf]
    assert leg.locked({"hip": 0.5}).velocity_limit.tolist() == [math.inf]
    assert leg.locked({"knee": 0.5}).velocity_limit.tolist() == [5.0]


GEAR = '<mimic joint="hip" multiplier="-0.5" offset="0.2"/>'
KNEE_AXIS = '<axis xyz="0 1 0"/>'
SEEDS = st.integers(0, 10**6)


@pytest.fixture
def geared(spoil, load):
    """A leg whose knee follows the hip."""
    return load(with_gear(spoil))


def with_gear(spoil, gear=GEAR):
    """The good leg's text with a mimic in its knee."""
    knee = spoil().index('name="knee"')
    axis = spoil().index(KNEE_AXIS, knee)
    return spoil()[:axis] + KNEE_AXIS + gear + spoil()[axis + len(KNEE_AXIS) :]


def random_leg(seed, folder, *, floats=False):
    """A random tree with up to two mimic joints."""
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, int(rng.integers(0, 3)))
    path = folder / "tree.urdf"
    path.write_text(text)
    return rng, text, kd.Leg.from_urdf(path, base="floating" if floats else "fixed")


def random_kick(rng, leg, floats):
    """A kick of such a tree."""
    names = leg.single_joints
    free = [name for name in names if name not in {mimic.joint for mimic in leg.mimics}]
    q = leg.configuration({name: rng.uniform(-1, 1) for name in free})
    if floats:
        turn = rng.normal(size=4)
        q[:7] = *rng.uniform(-1, 1, size=3), *(turn / np.linalg.norm(turn))
    posture = leg.posture(q)
    v = posture.admissible(rng.normal(size=leg.nv) * 2)
    closing = posture.point_velocity(v)
    normal = closing / np.linalg.norm(closing) + rng.uniform(-0.3, 0.3, size=3)
    contact = kd.Contact(normal, rng.uniform(0, 1), friction=rng.choice([0.0, 0.4]))
    return posture, v, kd.Ball(), contact


@settings(max_examples=8)
@given(SEEDS, st.booleans())
def test_an_impact_is_that_of_free_bodies_tied_by_joints_and_gears(tmp_path_factory, seed, floats):
    rng, text, leg = random_leg(seed, tmp_path_factory.mktemp("tree"), floats=floats)
    kick = posture, v, ball, contact = random_kick(rng, leg, floats)
    hit = kd.strike(*kick)
    places = leg.workspace.placements
    model, base, twist = leg.model, None, None
    pin.forwardKinematics(leg.workspace.model, leg.workspace.data, posture.q)
    if floats:
        turn = pin.Quaternion(posture.q[3:7]).matrix()
        base = turn, posture.q[:3]
        twist = np.concatenate([turn @ v[:3], turn @ v[3:6]])
    bodies = Bodies(text, leg.joint_values(posture.q), base)
    rates = {name: v[leg.velocity_index(name)] for name in leg.single_joints}
    before = bodies.velocities(rates, twist)
    after, wrenches = bodies.struck(before, "toe", -hit.impulse)
    size = np.abs(after).max()

    foot = bodies.motion("toe", bodies.places["toe"][1])[:3]
    assert np.abs(bodies.places["toe"][1] - posture.contact_point).max() <= 1e-13
    assert np.abs(posture.jacobian @ hit.v_after - foot @ after).max() <= 1e-10 * size
    for name in leg.single_joints:
        rate = bodies.rates[name][1] @ after
        assert abs(hit.v_after[leg.velocity_index(name)] - rate) <= 1e-10 * size
        number = model.getJointId(name)
        turn = places[number].rotation
        ours = hit.joint_impulses[number - 1].reshape(2, 3) @ turn.T
        assert np.abs(ours.ravel() - wrenches[name]).max() <= 1e-10 * np.linalg.norm(hit.impulse)
    # energy of leg and ball, and momentum with the ball's where nothing holds the base
    ball_gain = 0.5 * ball.mass * hit.ball_after.velocity @ hit.ball_after.velocity
    ball_gain += 0.5 * ball.inertia * hit.ball_after.spin @ hit.ball_after.spin
    lost = bodies.energy(before) - bodies.energy(after) - ball_gain
    assert hit.energy_lost == pytest.approx(lost, abs=1e-11 * bodies.energy(before))
    if floats:
        kick_of_ball = np.concatenate([hit.impulse, np.cross(posture.contact_point, hit.impulse)])
        gap = bodies.momentum(after) + kick_of_ball - bodies.momentum(before)
        assert np.abs(gap).max() <= 1e-11 * np.abs(bodies.momentum(before)).max()
    assert hit.momentum_residual <= 1e-12
    separation = contact.normal @ (hit.ball_after.velocity - foot @ after)
    approach = contact.normal @ (foot @ before)
    assert separation == pytest.approx(contact.restitution * approach, rel=1e-9, abs=1e-12)


@settings(max_examples=25)
@given(SEEDS, st.booleans())
def test_gears_are_the_reduced_coordinates(tmp_path_factory, seed, floats):
    """v = G v_r, M_r = G^T M G, J_r = J G."""
    rng, _, leg = random_leg(seed, tmp_path_factory.mktemp("tree"), floats=floats)
    posture, v, ball, contact = random_kick(rng, leg, floats)
    mimicking = [leg.velocity_index(mimic.joint) for mimic in leg.mimics]
    columns = [i for i in range(leg.nv) if i not in mimicking]
    basis = np.eye(leg.nv)[:, columns]
    for mimic in leg.mimics:
        driver = columns.index(leg.velocity_index(mimic.driver))
        basis[leg.velocity_index(mimic.joint), driver] = mimic.multiplier
    reduced = basis.T @ posture.inertia @ basis
    jacobian = posture.jacobian @ basis
    delassus = jacobian @ np.linalg.solve(reduced, jacobian.T)
    assert np.abs(posture.delassus() - delassus).max() <= 1e-10 * np.abs(delassus).max()
    hit = kd.strike(posture, v, ball, contact)
    jump = basis @ np.linalg.solve(reduced, -jacobian.T @ hit.impulse)
    assert np.abs(hit.v_after - v - jump).max() <= 1e-10 * np.abs(hit.v_after).max()
    wish = posture.point_velocity(v)
    least = basis @ np.linalg.solve(
        reduced, jacobian.T @ (np.linalg.pinv(delassus, rcond=1e-9) @ wish)
    )
    assert np.abs(posture.joint_velocity(wish) - least).max() <= 1e-8 * np.abs(least).max()


def test_the_tolerance_of_mimic_joints_is_a_billionth(geared):
    q = geared.configuration({"hip": 0.4})
    knee = geared.joint_names.index("knee")
    assert geared.posture(q + 0.8e-9 * np.eye(len(q))[knee]).q.tolist() == q.tolist()
    with pytest.raises(kd.InvalidInput, match="mimics hip"):
        geared.posture(q + 1.2e-9 * np.eye(len(q))[knee])


def test_pinocchio_confirms_it(geared):
    posture = geared.posture(geared.configuration({"hip": 0.4}))
    v = posture.joint_velocity(posture.point_velocity(posture.admissible([1.0, 0.0])))
    kick = posture, v, kd.Ball(), kd.Contact(posture.point_velocity(v), 0.8)
    ours, theirs = kd.strike(*kick), by_pinocchio(*kick)
    assert theirs.impulse == pytest.approx(ours.impulse, rel=1e-12)
    assert theirs.momentum_residual <= 1e-12
    assert theirs.joint_impulses == pytest.approx(ours.joint_impulses, abs=1e-12)


def test_the_gear_acts_along_both_axes(geared):
    posture = geared.posture(geared.configuration({"hip": 0.4}))
    v = posture.admissible([1.0, 0.0])
    hit = kd.strike(posture, v, kd.Ball(), kd.Contact(posture.point_velocity(v), 0.8))
    (gear,) = hit.constraint_impulses
    along = hit.joint_impulses[:, 4] * [-1, 1]  # about the axes -y of the hip and y of the knee
    assert along == pytest.approx([0.5 * gear, gear], rel=1e-12)
    assert abs(gear) > 1e-4
    assert kd.joint_loads(hit)["knee"].axis[4] == pytest.approx(gear, rel=1e-12)


def test_mimic_joints_are_where_their_drivers_put_them(geared):
    assert geared.mimics == (Mimic("knee", "hip", -0.5, 0.2),)
    q = geared.configuration({"hip": 0.6})
    assert q.tolist() == [0.6, pytest.approx(-0.1)]
    assert geared.posture([0.6]).q.tolist() == q.tolist()
    assert geared.posture(q).q.tolist() == q.tolist()
    assert geared.configuration(geared.joint_values(q)).tolist() == q.tolist()
    assert geared.configuration().tolist() == [0.0, 0.2]
    said = r"joint knee is 0.3: it mimics hip, which puts it at -0.1 \(leave mimic joints out"
    with pytest.raises(kd.InvalidInput, match=said):
        geared.posture([0.6, 0.3])
    with pytest.raises(kd.InvalidInput, match=r"joint knee is 0.3: it mimics hip"):
        geared.configuration({"hip": 0.6, "knee": 0.3})
    with pytest.raises(
        kd.InvalidInput, match=r"q has shape \(3,\): it must be \(1,\), with .* no mim"
    ):
        geared.posture(np.zeros(3))


def test_a_velocity_that_the_gear_forbids_is_refused(geared):
    posture = geared.posture([0.6])
    with pytest.raises(kd.InvalidInput, match=r"v moves knee, which mimics hip, .* 1.5 rad/s or m"):
        posture.check_velocity(np.array([1.0, 1.0]))
    assert posture.admissible([1.0, 1.0]) @ [0.5, 1.0] == pytest.approx(0, abs=1e-15)


def test_locking_the_driver_locks_both(geared, spoil, tmp_path):
    path = tmp_path / "two.urdf"
    third = (
        '<link name="end"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
        'ixz="0" iyz="0"/></inertial></link><joint name="extra" type="continuous"><parent '
        'link="toe"/><child link="end"/><axis xyz="0 1 0"/></joint></robot>'
    )
    path.write_text(with_gear(spoil).replace("</robot>", third))
    leg = kd.Leg.from_urdf(path, "end")
    read = [kd.Leg.from_urdf(path, "end", locked={name: 0.6}) for name in ("hip", "[hk]*")]
    for locked in (leg.locked({"hip": 0.6}), *read):
        assert (locked.joint_names, locked.mimics, locked.constraints) == (("extra",), (), None)
        there = leg.posture([0.6, 0.0]).contact_point
        assert locked.posture([0.0]).contact_point == pytest.approx(there, abs=1e-15)
    rest = leg.locked({"extra": 0.1})
    assert (rest.joint_names, rest.mimics) == (("hip", "knee"), leg.mimics)
    for refused in (leg.locked, lambda locked: kd.Leg.from_urdf(path, "end", locked=locked)):
        with pytest.raises(kd.InvalidInput, match="joint 'knee' mimics 'hip': lock that one"):
            refused({"knee": 0.1})
    with pytest.raises(kd.InvalidInput, match="'knee' mimics 'hip': the model must have both or"):
        leg.with_model(pin.buildReducedModel(leg.model, [1], pin.neutral(leg.model)))


def test_copies_and_other_constraints_keep_the_gears(geared):
    for leg in (
        copy.deepcopy(geared),
        pickle.loads(pickle.dumps(geared)),
        geared.with_armature({"hip": 0.1}),
        geared.with_supports().with_loops(),
    ):
        assert leg.mimics == geared.mimics
        assert leg.constraints.names == ["knee, which mimics hip"]


@pytest.mark.parametrize(
    ("gear", "said"),
    [
        ('<mimic joint="?"/>', r"'knee' mimics '\?', and there is no such joint: correct the name"),
        ('<mimic joint="hi"/>', r"did you mean 'hip'\? Correct the name, or lock it: locked="),
        ("<mimic/>", "'knee' mimics '', and there is no such joint"),
        ('<mimic joint="knee"/>', "joints knee mimic each other in a loop"),
        ('<mimic joint="toe_fixed"/>', "both must be revolute or prismatic"),
        ('<mimic joint="hip" multiplier="x"/>', "mimic multiplier is 'x': it must be a finite"),
        ('<mimic joint="hip" offset="inf"/>', "mimic offset is 'inf': it must be a finite"),
        (GEAR + GEAR, "joint 'knee' has 2 of <mimic>: it must have one at most"),
    ],
)
def test_bad_gears_are_refused_by_name(spoil, load, gear, said):
    fixed = spoil().index('type="fixed"')
    name = spoil()[spoil().rindex('name="', 0, fixed) + 6 :].partition('"')[0]
    with pytest.raises(kd.UrdfError, match=said.replace("toe_fixed", name)):
        load(with_gear(spoil, gear.replace("toe_fixed", name)))


def test_a_gear_to_nowhere_does_not_matter_where_the_joint_is_locked(spoil, tmp_path):
    path = tmp_path / "leg.urdf"
    path.write_text(with_gear(spoil, '<mimic joint="?"/>'))
    for name in ("knee", "k*"):
        assert kd.Leg.from_urdf(path, locked={name: 0.3}).joint_names == ("hip",)


def test_a_mimic_of_a_mimic_has_the_first_driver(spoil, load):
    gear = '<mimic joint="knee" multiplier="2" offset="1"/>'
    third = (
        '<link name="end"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
        'ixz="0" iyz="0"/></inertial></link><joint name="extra" type="revolute"><parent '
        f'link="toe"/><child link="end"/><axis xyz="0 1 0"/>{gear}'
        '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint></robot>'
    )
    leg = load(with_gear(spoil).replace("</robot>", third))
    assert leg.mimics[1] == Mimic("extra", "hip", -1.0, 1.4)
    knee, extra = (leg.joint_values(leg.posture([0.6]).q)[name] for name in ("knee", "extra"))
    assert extra == pytest.approx(2 * knee + 1)


def test_a_contact_that_takes_time_keeps_the_gear(geared):
    posture = geared.posture([0.6])
    v = posture.admissible([1.0, 0.0])
    kick = posture, v, kd.Ball(), kd.Contact(posture.point_velocity(v), 0.8)
    hit, instant = kd.collide(*kick, contact_time=1e-4), kd.strike(*kick)
    assert hit.impulse == pytest.approx(instant.impulse, rel=1e-2, abs=1e-3 * hit.impulse.max())
    geared.posture(hit.q_after).check_velocity(hit.v_after)
    assert hit.energy_residual < 1e-6


def test_where_mimic_joints_are_not_supported(geared):
    with pytest.raises(kd.InvalidInput, match="joint 'knee' mimics 'hip': kicks are planned"):
        kicking_chain(geared)
    with pytest.raises(kd.InvalidInput, match="supports, loops and mimic joints"):
        self_motion(geared, [0.6])


@settings(max_examples=8)
@given(SEEDS)
def test_feet_that_may_lift_off_leave_the_gears_alone(tmp_path_factory, seed):
    rng, _, leg = random_leg(seed, tmp_path_factory.mktemp("tree"), floats=True)
    posture, _, ball, _ = random_kick(rng, leg, True)
    free = [name for name in leg.single_joints if leg.contact_joint not in leg_joints(leg, name)]
    if not free:
        return
    held = leg.with_supports(kd.Support(f"l{free[-1][1:]}", point=True, friction=0.5))
    standing = held.posture(posture.q)
    v = standing.admissible(rng.normal(size=leg.nv))
    normal = standing.point_velocity(v)
    if np.linalg.norm(normal) < 1e-6:
        return
    hit = kd.unilateral_strike(standing, v, ball, kd.Contact(normal, 0.7))
    assert hit.momentum_residual <= 1e-11
    for row in leg.gears.rows if leg.gears else ():
        assert abs(row @ hit.v_after) <= 1e-10 * np.abs(hit.v_after).max()


def leg_joints(leg, name):
    """Numbers of the joints that carry a joint, or that it carries."""
    number, supports = leg.model.getJointId(name), leg.model.supports
    return {*supports[number], *(j for j in range(leg.model.njoints) if number in supports[j])}


def test_derivatives_follow_the_gear(geared):
    """A central difference along what the gear allows."""
    posture = geared.posture([0.6])
    v = posture.admissible([2.0, 0.0])
    contact = kd.Contact(posture.point_velocity(v) + 0.1, 0.8, friction=0.4)
    hit = kd.strike(posture, v, kd.Ball(), contact)
    by_q = hit.sensitivity().impulse["q"]
    assert np.abs(by_q @ [0.5, 1.0]).max() <= 1e-12 * np.abs(by_q).max()  # not along the gear's row
    h, (ahead, behind) = 1e-6, (
        kd.strike(geared.posture([0.6 + step]), v, kd.Ball(), contact).impulse
        for step in (1e-6, -1e-6)
    )  # fmt: skip
    assert by_q @ [1.0, -0.5] == pytest.approx((ahead - behind) / (2 * h), rel=1e-6, abs=1e-8)
