"""Joints by name: configurations, ranges and limits; mimic joints against a plain reading."""

import math
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from bodies import check_bodies
from chains import floating_leg
from hypothesis import given, settings
from hypothesis import strategies as st
from random_urdf import random_urdf
from tolerances import EPSILON, agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.robot.joint_table import InDegrees, Mimic
from kickdyn.robot.standing import kicking_chain

BODY = pin.Inertia(1.0, np.array([0.0, 0.0, -0.25]), np.diag([0.1, 0.1, 0.05]))
LARGEST = np.finfo(float).max
"""What Pinocchio takes for no limit."""


def mixed(velocity_limit=(1.0, 1.0, 1.0)):
    """One joint of each kind: limited, continuous, prismatic."""
    model = pin.Model()
    model.name, parent = "mixed", 0
    for kind, name, limits, speed in (
        (pin.JointModelRY(), "turn", ([-1.0], [2.0]), velocity_limit[0]),
        (pin.JointModelRUBY(), "spin", ([-1.1] * 2, [1.1] * 2), velocity_limit[1]),
        (pin.JointModelPZ(), "slide", ([0.0], [0.3]), velocity_limit[2]),
    ):
        low, high = (np.array(limit) for limit in limits)
        size = np.array([LARGEST]), np.array([speed])
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name, *size, low, high)
        model.appendBodyToJoint(parent, BODY, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0, 0, -1.0]))
    model.addFrame(pin.Frame("toe", parent, 0, tip, pin.FrameType.OP_FRAME))
    return kd.Leg.from_model(model, "toe")


def test_joints_of_every_kind():
    leg = mixed()
    assert leg.configuration().tolist() == [0, 1, 0, 0]
    q = leg.configuration({"spin": 3.0, "slide": 0.2})
    assert q == pytest.approx([0, math.cos(3), math.sin(3), 0.2], abs=4 * EPSILON)
    tip = [-0.8 * math.sin(3), 0, -0.8 * math.cos(3)]
    assert leg.posture(q).contact_point == pytest.approx(tip)
    ranges = [leg.joint_range(name) for name in leg.joint_names]
    assert ranges == [(-1, 2), (-math.pi, math.pi), (0, 0.3)]
    assert [leg.joint_unit(name) for name in leg.joint_names] == ["rad", "rad", "m"]
    assert leg.joint_values(q) == pytest.approx({"turn": 0, "spin": 3, "slide": 0.2})
    assert leg.angles_deg(list(q)) == pytest.approx({"turn": 0, "spin": math.degrees(3)})
    assert leg.positions_m(q) == pytest.approx({"slide": 0.2})
    for short in ([0.5, 3.0, 0.2], [0.5, 3.0 - 2 * math.pi, 0.2]):  # by the angle itself
        q = leg.configuration({"turn": 0.5, "spin": 3.0, "slide": 0.2})
        assert leg.posture(short).q == pytest.approx(q, abs=closed_form())


@pytest.mark.parametrize(("q", "said"), [
    ([0, 0], r"shape \(2,\): .*\(3,\)"), ([0, math.nan, 0], "finite"),
    ([True, False, True], "real numbers"), ({"hip": 0.3}, r"\{'hip': 0.3\}: .*Leg.configuration"),
], ids=str)  # fmt: skip
def test_bad_q_is_refused(q, said):
    leg = kd.Leg.human()
    for method in (leg.posture, leg.close_loops, leg.angles_deg, leg.outside_range):
        with pytest.raises(kd.InvalidInput, match=f"^q .*{said}"):
            method(q)


@pytest.mark.parametrize(("leg", "q", "said"), [
    (mixed(), np.zeros(5), r"\(5,\): .*\(3,\), .*angle"), (mixed(), [0.1, 0, 0, 0.2], "length 1"),
    (mixed(), [0.1, 1, 1e-3, 0.2], "length 1"),
    (floating_leg(np.random.default_rng(0)), [0, 0, 0, 0, 0, 0, 2, 1, 0, 0], "xyzw.*length 1"),
    (floating_leg(np.random.default_rng(0)), np.zeros(9), "length 1")])  # fmt: skip
def test_quaternions_and_cosines_have_length_1(leg, q, said):
    with pytest.raises(kd.InvalidInput, match=said):
        leg.posture(q)


@pytest.mark.parametrize(("limit", "q", "is_announced"), [
    (math.inf, [30, 0, 0.1], True), (math.inf, [30, -45, 0.1], True), (2, [0, -45, 0.1], True),
    (2, [30, 0, 0.1], True), (2, [30, 1, 0.1], False), (math.inf, [6, 0, 0.1], False),
    (math.inf, [30, 1, 0.1], False), (40, [30, 0, 0.1], False),
    (math.inf, [0, 0, 9], False), (math.inf, [0, 0, 0], False)])  # fmt: skip
def test_degrees_in_place_of_radians_are_announced_by_all_that_takes_q(limit, q, is_announced):
    """Beyond a turn, only the angle itself shows how far a continuous joint was turned."""
    model = mixed().model
    model.upperPositionLimit[0] = limit
    leg, full = kd.Leg.from_model(model, "toe"), [q[0], math.cos(q[1]), math.sin(q[1]), q[2]]
    posture = leg.posture(q).with_contact_offset((0, 0, 0.01))
    contact = kd.Contact((0, 0, 1), 0.5)
    lines = [posture.warnings]
    if q[1] == 0.0:
        rows = [full], [[0.0, 0.0, 1.0]], kd.Ball(), contact
        lines += [function(leg, *rows).warnings for function in (kd.strike_many, kd.collide_many)]
        lines += [leg.posture(full).warnings]
        if limit > q[0] and q[2] < 0.3:
            swept = kd.sweep(leg, {"turn": [min(0.0, q[0]), q[0]][q[0] == 0 :]}, kd.Kick(air=None))
            lines.append([swept.warnings])
    said = [any("look like degrees" in line for line in some) for some in lines]
    assert said == [is_announced] * len(lines)


@pytest.mark.parametrize(("values", "outside"), [
    ({}, {}), ({"turn": 2 + 0.5e-6}, {}),  # a millionth is rounding
    ({"turn": 2 + 2e-6}, {"turn": "deg"}), ({"slide": 99.0}, {"slide": "99 m"}),  # no degrees
    ({"turn": 2.001, "spin": 3.1, "slide": -0.01}, {"turn": "114.65 deg", "slide": "-0.01 m"}),
    ({"slide": 0.31}, {"slide": "0.31 m is outside its range 0 to 0.3 m"}),
])  # fmt: skip
def test_joints_outside_their_range_are_named_with_their_value(values, outside):
    leg = mixed()
    lines = leg.outside_range(leg.configuration(values))
    assert [line.split()[0] for line in lines] == list(outside)
    for line, value in zip(lines, outside.values(), strict=True):
        assert value in line


@pytest.mark.parametrize(("v", "too_fast"), [
    ([-2, 1e300, 0], {}), ([2 * (1 + 0.5e-6), -1e300, 0], {}),  # a millionth is rounding
    ([2 * (1 + 2e-6), 0, 0], {"turn": "100 %"}),
    ([-2.96, 1e300, 1e-9], {"turn": "148 %", "slide": "speed limit is 0"})])  # fmt: skip
def test_joints_that_are_too_fast_are_named_with_their_share(v, too_fast):
    leg = mixed(velocity_limit=(2.0, LARGEST, 0.0))
    assert leg.velocity_limit.tolist() == [2.0, math.inf, 0.0]
    assert leg.effort_limit.tolist() == [math.inf] * 3
    lines = leg.too_fast(np.array(v))
    assert [line.split()[0] for line in lines] == list(too_fast)
    for line, value in zip(lines, too_fast.values(), strict=True):
        assert value in line


@pytest.mark.parametrize("joint", ["turn", "spin", "slide"])
def test_a_locked_joint_stays_at_its_value(joint):
    free = mixed(velocity_limit=(2.0, LARGEST, 3.0))
    locked = free.locked({joint: 0.2})
    values = {"turn": 0.1, "spin": -0.4, "slide": 0.3, joint: 0.2}
    whole = free.posture(free.configuration(values))
    kept = {name: value for name, value in values.items() if name != joint}
    alone = locked.posture(locked.configuration(kept))
    assert locked.joint_names == tuple(kept)
    columns = [index for index, name in enumerate(free.joint_names) if name != joint]
    agrees(alone.contact_point, whole.contact_point, closed_form())
    agrees(alone.inertia, whole.inertia[np.ix_(columns, columns)], closed_form())
    assert locked.velocity_limit.tolist() == free.velocity_limit[columns].tolist()


GEAR = '<mimic joint="hip" multiplier="-0.5" offset="0.2"/>'
KNEE_AXIS = '<axis xyz="0 1 0"/>'
END = (
    '<link name="end"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
    'ixz="0" iyz="0"/></inertial></link><joint name="extra" type="{}"><parent link="toe"/>'
    '<child link="end"/><axis xyz="0 1 0"/>{}<limit lower="-9" upper="9" effort="1" velocity="1"/>'
    "</joint></robot>"
)
SEEDS = st.integers(0, 10**6)


def with_gear(spoil, gear=GEAR):
    """The good leg's text with a mimic in its knee."""
    start = spoil().index(KNEE_AXIS, spoil().index('name="knee"')) + len(KNEE_AXIS)
    return spoil()[:start] + gear + spoil()[start:]


@pytest.fixture
def geared(spoil, load):
    """A leg whose knee follows the hip."""
    return load(with_gear(spoil))


def coupled_kick(rng, folder, floats):
    """The text of a random tree with up to two mimic joints, and a kick of it."""
    text = random_urdf(rng, int(rng.integers(0, 3)))
    (folder / "tree.urdf").write_text(text)
    leg = kd.Leg.from_urdf(folder / "tree.urdf", base="floating" if floats else "fixed")
    q = pin.integrate(leg.model, pin.neutral(leg.model), rng.uniform(-1, 1, size=leg.nv))
    posture = leg.posture(leg.gears.follow(q))
    v = posture.admissible(rng.normal(size=leg.nv) * 2)
    closing = posture.point_velocity(v)
    normal = closing / np.linalg.norm(closing) + rng.uniform(-0.3, 0.3, size=3)
    return text, posture, v, kd.Contact(normal, rng.uniform(0, 1), rng.choice([0.0, 0.4]))


@settings(max_examples=20)
@given(SEEDS, st.booleans())
def test_an_impact_of_joints_that_follow_others_by_a_plain_reading(tmp_path_factory, seed, floats):
    r"""Pinocchio reads no gears: with v = P x, :math:`P^T M P \Delta x = -(J P)^T p`.

    Gears do no work, and every body gains what its joints and the ball give it.
    """
    folder, rng = tmp_path_factory.mktemp("tree"), np.random.default_rng(seed)
    text, posture, v, contact = coupled_kick(rng, folder, floats)
    leg, hit = posture.leg, kd.strike(posture, v, kd.Ball(), contact)
    plain, base = pin.buildModelFromXML(text, *floats * [pin.JointModelFreeFlyer()]), 6 * floats
    values, names = leg.joint_values(posture.q), list(plain.names)[1 + floats :]
    q = pin.neutral(plain)
    q[: 7 * floats] = posture.q[: 7 * floats]
    q = pin.integrate(plain, q, np.array([0.0] * base + [values[name] for name in names]))
    data, toe = plain.createData(), plain.getFrameId("toe", pin.BODY)
    inertia = pin.crba(plain, data, q)
    jacobian = pin.computeFrameJacobian(plain, data, q, toe, pin.LOCAL_WORLD_ALIGNED)[:3]
    place = pin.updateFramePlacement(plain, data, toe).translation
    agrees(posture.contact_point, place, closed_form())
    moves, driven = np.eye(plain.nv), []
    for joint in ElementTree.fromstring(text).iter("joint"):
        if (gear := joint.find("mimic")) is not None:
            name, driver = joint.get("name"), gear.get("joint")
            ratio, driven = float(gear.get("multiplier")), [*driven, base + names.index(name)]
            assert values[name] == pytest.approx(ratio * values[driver] + float(gear.get("offset")))
            moves[driven[-1]] = ratio * moves[base + names.index(driver)]
    moves, order = np.delete(moves, driven, axis=1), [*range(base), *map(leg.velocity_index, names)]
    pushed = moves.T @ jacobian.T @ -hit.impulse
    jump = moves @ np.linalg.solve(moves.T @ inertia @ moves, pushed)
    agrees(hit.v_after[order], v[order] + jump, optimized(1e-11))
    axes = [np.reshape(joint.S, (6, -1)) for joint in list(leg.workspace.data.joints)[1:]]
    loads = zip(axes, hit.joint_impulses, strict=True)
    along = np.concatenate([axis.T @ impulse for axis, impulse in loads])[order]
    near = optimized(1e-11) * np.linalg.norm(hit.impulse)
    np.testing.assert_allclose(moves.T @ along, 0.0, atol=near)
    check_bodies(hit)
    assert hit.restitution_residual < optimized(1e-11)


def test_mimic_joints_are_where_their_drivers_put_them(geared):
    assert geared.mimics == (Mimic("knee", "hip", -0.5, 0.2),)
    q = geared.configuration({"hip": 0.6})
    assert q == pytest.approx([0.6, -0.1])
    for same in ([0.6], q, q + np.array([0, 0.5e-9])):  # a billionth is rounding
        assert geared.posture(same).q.tolist() == q.tolist()
    far = geared.configuration({"hip": 2e5})
    assert geared.posture(far + np.array([0, 0.9e-4])).q.tolist() == far.tolist()
    assert geared.configuration().tolist() == [0.0, 0.2]
    assert geared.configuration(geared.joint_values(q)).tolist() == q.tolist()
    posture = geared.posture(q)
    assert posture.admissible([1.0, 1.0]) @ [0.5, 1.0] == pytest.approx(0, abs=closed_form())
    for refused, said in (
        (lambda: geared.posture([0.6, 0.3]), "knee is 0.3: it mimics hip, .*-0.1"),
        (lambda: geared.posture(q + np.array([0, 2e-9])), "mimics hip"),
        (lambda: geared.posture(far + np.array([0, 1.1e-4])), "mimics hip"),
        (lambda: geared.configuration({"hip": 0.6, "knee": 0.3}), "knee is 0.3: it mimics hip"),
        (lambda: geared.posture(np.zeros(3)), r"\(3,\): .*\(1,\)"),
        (lambda: posture.check_velocity(np.ones(2)), "knee, which mimics hip, .* 1.5 rad/s"),
        (lambda: kicking_chain(geared), "'knee' mimics 'hip'"),
    ):
        with pytest.raises(kd.InvalidInput, match=said):
            refused()


def test_locking_the_driver_locks_both(spoil, tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(with_gear(spoil).replace("</robot>", END.format("continuous", "")))
    leg = kd.Leg.from_urdf(path, "end")
    locked = leg.locked({"hip": 0.6})
    assert (locked.joint_names, locked.mimics, locked.constraints) == (("extra",), (), None)
    unlocked = leg.locked({"extra": 0.1})
    assert (unlocked.joint_names, unlocked.mimics) == (("hip", "knee"), leg.mimics)
    alone = pin.buildReducedModel(leg.model, [1], pin.neutral(leg.model))
    with pytest.raises(kd.InvalidInput, match="both or"):
        leg.with_model(alone)


@pytest.mark.parametrize("driver", ["revolute", "continuous"])
@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_any_joint_of_a_gear_can_be_locked(spoil, tmp_path, driver, kind):
    """A joint that is named is locked where it says, another one where its driver puts it."""
    path, more = tmp_path / "two.urdf", END.format("revolute", "")
    path.write_text(spoil().replace("</robot>", more))
    plain = kd.Leg.from_urdf(path, "end")
    text = with_gear(spoil).replace("</robot>", more)
    for name, other in (("hip", driver), ("knee", kind)):
        text = text.replace(f'"{name}" type="revolute"', f'"{name}" type="{other}"')
    path.write_text(text)
    leg = kd.Leg.from_urdf(path, "end")
    for locked, hip, knee in (
        ({}, 0.6, -0.1), ({"knee": 0.1}, 0.6, 0.1), ({"hip": 0.6}, 0.6, -0.1),
        ({"hip": 0.6, "knee": 0.0}, 0.6, 0.0),
    ):  # fmt: skip
        for one in (kd.Leg.from_urdf(path, "end", locked=locked), leg.locked(locked)):
            free = {} if "hip" in locked else {"hip": hip}
            tip = one.posture(one.configuration(free)).contact_point
            right = plain.posture([hip, knee, 0.0]).contact_point
            assert tip == pytest.approx(right, abs=closed_form())


@pytest.mark.parametrize(("gear", "said"), [
    ('<mimic joint="?"/>', r"'knee' mimics '\?'.*no such joint"),
    ('<mimic joint="hi"/>', "'hip'.*locked="), ("<mimic/>", "'knee' mimics ''"),
    ('<mimic joint="knee"/>', "knee mimic each other in a loop"),
    ('<mimic joint="tip"/>', "'tip', which is fixed: lock"),
    ('<mimic joint="hip" multiplier="x"/>', "multiplier is 'x'"),
    ('<mimic joint="hip" offset="inf"/>', "offset is 'inf'"),
    (GEAR + GEAR, "'knee' has 2 of <mimic>")])  # fmt: skip
def test_bad_gears_are_refused_by_name(spoil, load, gear, said):
    with pytest.raises(kd.UrdfError, match=said):
        load(with_gear(spoil, gear))


@pytest.mark.parametrize("side", ["Left_", "Right_"])
def test_a_name_that_is_cut_means_the_joint_of_the_same_side(spoil, load, side):
    text = with_gear(spoil, '<mimic joint="index_q1"/>').replace('"hip"', '"Left_index_q1"')
    text = text.replace("</robot>", END.format("revolute", "")).replace(
        '"extra"', '"Right_index_q1"'
    )
    with pytest.raises(kd.UrdfError, match=f"did you mean '{side}index_q1'"):
        load(text.replace('"knee"', f'"{side}index_q2"'))


def test_locked_angles_that_look_like_degrees_are_announced(spoil, load):
    text = spoil().replace("</robot>", END.format("continuous", ""))
    for value, is_announced in ((90, True), (1.5, False), (0, False)):
        leg = load(text).locked({"extra": value})
        assert any("degrees" in line for line in leg.warnings) == is_announced
    with pytest.raises(kd.InvalidInput, match="degrees"):
        load(text).locked({"extra": 90, "knee": 45})
    assert not any("degrees" in line for line in load(text).locked(InDegrees(extra=900)).warnings)


def test_a_mimic_of_a_mimic_has_the_driver_of_that(spoil, load):
    gear = '<mimic joint="knee" multiplier="2" offset="1"/>'
    leg = load(with_gear(spoil).replace("</robot>", END.format("revolute", gear)))
    assert leg.mimics[1] == Mimic("extra", "hip", -1.0, 1.4)  # 2 (-0.5 q + 0.2) + 1
    plain = load(spoil().replace("</robot>", END.format("revolute", "")), "end")
    right = plain.posture([0.3, 0.1, 1.2]).with_contact_offset([1, 2, 3])  # 2 * 0.1 + 1
    for values in ({"knee": 0.1}, {"knee": 0.1, "ex*": 0.0}):
        locked = replace(leg, frame="end").locked(values)
        assert locked.joint_names == ("hip",)
        tip = locked.posture([0.3]).with_contact_offset([1, 2, 3]).contact_point
        agrees(tip, right.contact_point, closed_form())
