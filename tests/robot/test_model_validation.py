"""Models with unsound mechanics are refused by the joint; bounds are bounds; names and patterns."""

import math

import numpy as np
import pinocchio as pin
import pytest
from chains import at, random_leg, serial
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.robot.model_validation import check_model, cholesky_with_condition
from kickdyn.robot.names import expand_patterns, lock_remedy


def body(mass=1.0, moments=(0.1, 0.1, 0.05), at=(0.1, 0.2, 0.3)):
    turn = pin.rpy.rpyToMatrix(0.3, 0.4, 0.5)
    return pin.Inertia(mass, np.array(at), turn @ np.diag(moments) @ turn.T)


BODY, NOTHING = body(at=(0.0, 0.1, -0.25)), pin.Inertia.Zero()
SLIGHT = body(1e-6, (1e-11, 1e-11, 3e-11), (0, 0, 0))
ON_AXIS = pin.Inertia(1.0, np.array([0.0, 0.0, 0.3]), np.zeros((3, 3)))


def chain(*bodies, joints="XYZX", place=(0.0, 0.0, 0.0)):
    """A pin.Model: revolute joints in one point, then a toe, with these bodies."""
    kinds = (getattr(pin, f"JointModelR{axis}")() for axis in joints)
    links = zip(kinds, bodies, strict=False)
    named = [(f"j{k}", kind, at(*place), body) for k, (kind, body) in enumerate(links)]
    return serial(named, at(0, 0, -0.5))


@pytest.mark.parametrize("bodies", [
    (body(moments=(0.1, 0.2, 0.3)), BODY),  # a disc
    (body(moments=(0, 0.1, 0.1)), BODY),  # a rod
    (body(moments=(0, 0, 0)), BODY),  # a point
    (NOTHING, NOTHING, BODY),  # virtual links of a ball joint
    (SLIGHT, body(at=(0, 0, 0))),  # moments that are wrong by 5e-11 of all that moves
], ids=["disc", "rod", "point", "virtual links", "slight"])  # fmt: skip
def test_flat_thin_and_missing_bodies_are_sound_where_mass_moves(bodies):
    leg = kd.Leg.from_model(chain(*bodies), "toe")
    assert 0 < leg.posture(np.full(leg.nq, 0.1)).effective_mass([1, 0, 0]) < math.inf


UNSOUND = {
    "negative mass": ((body(mass=-1.0),), "'j0' .*mass -1 kg"),
    "moments of no mass": ((body(mass=0.0), BODY), "'j0' .*mass 0 kg"),
    "nothing at the end": ((NOTHING, BODY, NOTHING, NOTHING), r"'j2' .*\(mass 0 kg\), as do j3"),
    "triangle": ((body(moments=(0.1, 0.1, 0.21)),), "'j0' .*0.1, 0.1, 0.21.*triangle"),
    "slight": ((body(at=(0, 0, 0)), SLIGHT), "'j1' .*triangle"),
    "two triangles": ((BODY, body(moments=(0.1, 0.1, 0.5)), body(moments=(0.1, 0.1, 0.4))),
                      "'j1' .*0.1, 0.1, 0.5 .*as do j2"),
    "on its axis": ((BODY, ON_AXIS), "j1; .*locked={'j1': 0}"),
    "axes through a point": ((BODY, NOTHING, NOTHING, ON_AXIS), "at fault: j1, j3; ")}  # fmt: skip


@pytest.mark.parametrize("name", UNSOUND)
def test_unsound_inertia_is_refused_by_the_joint(name):
    bodies, said = UNSOUND[name]
    joints = {"on its axis": "XZ", "axes through a point": "XYXY"}.get(name, "XYZX")
    model, q = chain(*bodies, joints=joints), [0.3, 0, 0, 0][: len(bodies)]
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_model(model, "toe").posture(q)


def changed(**attributes):
    model = chain(BODY, BODY)
    for name, value in attributes.items():
        setattr(model, name, value)
    return model


@pytest.mark.parametrize(("model", "said"), [
    (chain(), "no moving joint"),
    (chain(*2 * [body(mass=1e10)], place=(0, 0, -1e98)), "exceed the range"),
    (changed(armature=np.array([0.0, -1e-9])), "armature .*0 or more"),
    (changed(velocityLimit=np.array([1.0, -1.0])), r"velocity limit .*-1\.0"),
    (changed(upperPositionLimit=np.array([math.nan, 1.0])), "joint range .*number"),
    (changed(lowerPositionLimit=np.array([5.0, 5.0]), upperPositionLimit=np.array([5.0, 4.0])),
     "lower must not exceed upper"),
    *((changed(gravity=pin.Motion(np.array([0, 0, g]), np.zeros(3))), r"\(0, 0, -9.81\)")
      for g in (-1.62, 9.81, math.nan, math.inf))])  # fmt: skip
def test_unsound_models_are_refused(model, said):
    with pytest.raises(kd.InvalidInput, match=said):
        check_model(model)


@pytest.mark.parametrize(("parents", "late"), [
    ((0, 1, 2, 1, 4, 0), None), ((0, 0, 0), None), ((0, 0, 1), "j2"), ((0, 1, 1, 2), "j3"),
])  # fmt: skip
def test_branches_in_pieces_are_refused(parents, late):
    """Pinocchio's crba answers these, wrongly."""
    model = pin.Model()
    for number, parent in enumerate(parents):
        shift = pin.SE3(np.eye(3), np.array([0.1, 0.2, -0.3]))
        joint = model.addJoint(parent, pin.JointModelRY(), shift, f"j{number}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    if late is None:
        check_model(model)
    else:
        with pytest.raises(kd.InvalidInput, match=f"'{late}' comes after"):
            check_model(model)


@settings(max_examples=50)
@given(st.integers(0, 10**6))
def test_the_bound_on_the_condition_is_one(seed):
    """Of random inertias, up to near-singular ones, and of joints as unlike as 1e-6 and 1e3."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 40))
    turn, _ = np.linalg.qr(rng.normal(size=(n, n)))
    inertia = (turn * 10 ** rng.uniform(-rng.uniform(0, 11), 0, size=n)) @ turn.T
    sizes = 10 ** rng.uniform(-3, 1.5, size=n)
    inertia = (inertia + inertia.T) / 2 * sizes * sizes[:, None]
    unit = 1 / np.sqrt(inertia.diagonal())
    exact = np.linalg.cond(inertia * unit * unit[:, None], 1)
    assert cholesky_with_condition(inertia)[1] >= 0.99 * exact


@pytest.mark.parametrize("seed", range(5))
def test_rounding_gain_bounds_what_an_error_of_the_inertia_does(seed):
    """The bound is reached where the error has the signs of the response."""
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, joints=4)
    posture = leg.posture(rng.uniform(-2, 2, size=leg.nq))
    size, delassus, largest = np.sqrt(posture.inertia.diagonal()), posture.delassus(), 0.0
    for axis in posture.jacobian:
        signs = size * np.sign(np.linalg.solve(posture.inertia, axis))
        wrong = posture.inertia + 1e-9 * np.outer(signs, signs)
        change = posture.jacobian @ np.linalg.solve(wrong, posture.jacobian.T) - delassus
        largest = max(largest, (np.abs(change.diagonal()) / delassus.diagonal()).max())
    assert largest == pytest.approx(1e-9 * posture.rounding_gain, rel=1e-3)  # to first order


JOINTS = ("hip", "knee", "finger1", "finger2", "finger[1]", "thumb")


def hand(names, **lower):
    """A chain of joints about x with the range -1 to 2, or from `lower`; a rail is along x."""
    model, parent = pin.Model(), 0
    for name in names:
        kind = pin.JointModelPX() if name == "rail" else pin.JointModelRX()
        limits = [np.array([limit]) for limit in (9.0, 9.0, lower.get(name, -1.0), 2.0)]
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name, *limits)
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    return model


@pytest.mark.parametrize(("values", "expanded"), [
    ({"hip": 1.0}, {"hip": 1.0}), ({"finger?": 1.0}, {"finger1": 1.0, "finger2": 1.0}),
    ({"finger[1]": 1.0}, {"finger[1]": 1.0}),  # a name, so no pattern
    ({"*": 0.0, "knee": 2.0}, dict.fromkeys(JOINTS, 0.0) | {"knee": 2.0}),
    ({"finger*": 1.0, "*1": 1.0}, {"finger1": 1.0, "finger2": 1.0, "finger[1]": 1.0})])  # fmt: skip
def test_patterns_stand_for_names(values, expanded):
    assert expand_patterns(values, JOINTS) == expanded


@pytest.mark.parametrize(("lower", "joints", "values", "options"), [
    ({}, ("finger 1", "palm"), "{'finger 1': 0, 'palm': 0}", "'finger 1=0' --lock palm=0"),
    ({}, ("palm",), "{'palm': 0}", "palm=0"),
    # in the middle of a range without 0; 1.5 rad are 85.94 degrees
    ({"palm": 1.0, "rail": 1.0}, ("palm", "rail"), "{'palm': 1.5, 'rail': 1.5}",
     "palm=85.94 --lock rail=1.5")])  # fmt: skip
def test_a_remedy_can_be_copied(lower, joints, values, options):
    text = lock_remedy(hand(("hip", "finger 1", "palm", "rail"), **lower), joints)
    assert f"locked={values} " in text
    assert f"--lock {options} " in text
