import math

import numpy as np
import pinocchio as pin
import pytest
from chains import random_leg

import kickdyn as kd
from kickdyn.robot.model_validation import (
    check_model,
    cholesky_with_condition,
    find_singular_joints,
    frame_id,
    frames_by_name,
)

BODY = pin.Inertia(1.0, np.array([0.0, 0.1, -0.25]), np.diag([0.1, 0.1, 0.05]))
NOTHING = pin.Inertia.Zero()


def chain(*bodies, joints="XYZX"):
    """A pin.Model: revolute joints in one point, then a toe, with these bodies."""
    model, parent = pin.Model(), 0
    model.name = "chain"
    for k, body in enumerate(bodies):
        kind = getattr(pin, f"JointModelR{joints[k]}")()
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), f"j{k}")
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    tip = pin.SE3(np.eye(3), np.array([0, 0, -0.5]))
    model.addFrame(pin.Frame("toe", parent, 0, tip, pin.FrameType.OP_FRAME))
    return model


def test_virtual_links_without_mass_are_sound_where_mass_moves_with_them():
    ball_joint = kd.Leg.from_model(chain(NOTHING, NOTHING, BODY), "toe")
    assert ball_joint.posture(np.zeros(3)).effective_mass([1, 0, 0]) > 0


@pytest.mark.parametrize(
    ("bodies", "said"),
    [
        ((NOTHING, BODY, NOTHING, NOTHING), r"'j2' .*\(mass 0 kg\), as do j3: what moves"),
        ((BODY, NOTHING), r"'j1' .*\(mass 0 kg\): what moves"),
        (
            (pin.Inertia(0.0, np.zeros(3), np.eye(3)), BODY),
            r"'j0' moves an unsound .*mass 0 kg\): .*0 without moments",
        ),
        ((BODY, pin.Inertia(-0.1, np.zeros(3), np.eye(3)), BODY), "'j1' .*mass -0.1 kg"),
    ],
)
def test_what_moves_no_mass_is_named(bodies, said):
    with pytest.raises(kd.InvalidInput, match=said):
        kd.Leg.from_model(chain(*bodies), "toe")


def test_joints_that_move_nothing_together_are_named():
    """A mass on the axis of a joint; three axes through one point that carry a point."""
    on_axis = pin.Inertia(1.0, np.array([0.0, 0.0, 0.3]), np.zeros((3, 3)))
    leg = kd.Leg.from_model(chain(BODY, on_axis, joints="XZ"), "toe")
    with pytest.raises(
        kd.InvalidInput,
        match=r"not positive definite.*at fault: j1; lock it by locked=\{'j1': 0\} in Python",
    ):
        leg.posture([0.1, 0.2])
    leg = kd.Leg.from_model(chain(BODY, NOTHING, NOTHING, on_axis, joints="XYXY"), "toe")
    with pytest.raises(kd.InvalidInput, match=r"at fault: j1, j3; "):
        leg.posture([0.3, 0.0, 0.0, 0.0])


def test_no_null_vector_names_the_nearest():
    model = chain(BODY, BODY, BODY)
    inertia = np.diag([1.0, 1e-3, 1.0])
    inertia[0, 2] = inertia[2, 0] = 1 - 1e-6
    assert find_singular_joints(model, inertia) == ["j0", "j2"]


def branched(parents):
    model = pin.Model()
    for number, parent in enumerate(parents, 1):
        shift = pin.SE3(np.eye(3), np.array([0.1, 0.2, -0.3]))
        model.addJoint(parent, pin.JointModelRY(), shift, f"j{number}")
        model.appendBodyToJoint(number, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    return model


@pytest.mark.parametrize("parents", [(0, 1, 2, 1, 4, 0), (0, 0, 0), (0, 1, 1, 0, 4)])
def test_branches_in_one_piece_are_taken(parents):
    check_model(branched(parents))


@pytest.mark.parametrize(("parents", "late"), [((0, 0, 1), "j3"), ((0, 1, 1, 2), "j4")])
def test_branches_in_pieces_are_refused(parents, late):
    """Pinocchio's crba answers these, wrongly."""
    model = branched(parents)
    q = np.full(len(parents), 0.4)
    data, unit = model.createData(), np.eye(len(parents))
    still, gravity = np.zeros(len(parents)), pin.Motion.Zero()
    model.gravity = gravity
    newton_euler = np.column_stack([pin.rnea(model, data, q, still, column) for column in unit])
    assert np.abs(pin.crba(model, data, q) - newton_euler).max() > 1e-3
    with pytest.raises(kd.InvalidInput, match=f"joint '{late}' comes after joints of another"):
        check_model(model)


@pytest.mark.parametrize("seed", range(40))
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
    assert cholesky_with_condition(inertia)[1] >= 0.999 * exact


def test_an_inertia_that_is_not_positive_definite_has_no_bound():
    assert cholesky_with_condition(np.array([[1.0, 2.0], [2.0, 1.0]]))[1] == math.inf
    assert cholesky_with_condition(np.array([[1.0, math.nan], [math.nan, 1.0]]))[1] == math.inf


@pytest.mark.parametrize("seed", range(10))
def test_rounding_bounds_what_an_error_of_the_inertia_does(seed):
    rng = np.random.default_rng(seed)
    leg = random_leg(rng, joints=4)
    posture = leg.posture(rng.uniform(-2, 2, size=leg.nq))
    size = np.sqrt(posture.inertia.diagonal())
    wrong = posture.inertia + 1e-9 * np.outer(size, size) * rng.choice((-1, 1))
    changed = posture.jacobian @ np.linalg.solve(wrong, posture.jacobian.T)
    gap = np.abs((changed - posture.delassus()).diagonal()) / posture.delassus().diagonal()
    assert gap.max() <= 1.001e-9 * posture.rounding_gain


def test_a_name_is_first_that_of_a_body():
    """Then of the first frame that is no joint's."""
    model, here = pin.Model(), pin.SE3.Identity()
    joint = model.addJoint(0, pin.JointModelRX(), here, "a")
    kinds = pin.FrameType
    for name, kind in (
        *(("a", kinds.JOINT), ("b", kinds.JOINT), ("b", kinds.OP_FRAME), ("b", kinds.SENSOR)),
        *(("a", kinds.FIXED_JOINT), ("a", kinds.BODY), ("c", kinds.JOINT)),
    ):
        model.addFrame(pin.Frame(name, joint, 0, here, kind))
    assert frames_by_name(model) == {"a": 6, "b": 3, "c": 7}
    assert frame_id(model, "b") == 3
    for unknown in ("universe", ["a"]):
        with pytest.raises(kd.InvalidInput, match="is unknown"):
            frame_id(model, unknown)


def test_all_unsound_inertias_are_named_once():
    """A slab's moments are at most the sum of the others; the first one's are printed."""
    unsound = [pin.Inertia(1.0, np.zeros(3), np.diag([0.1, 0.1, third])) for third in (0.4, 0.5)]
    words = (
        r"joint 'j1' moves an unsound inertia \(principal moments 0.1, 0.1, 0.5 kg m2\), as do j2:"
    )
    with pytest.raises(kd.InvalidInput, match=words):
        check_model(chain(BODY, unsound[1], unsound[0], BODY))
