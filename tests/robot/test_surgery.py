"""Changed models have their bodies where the unchanged ones have them."""

import math

import numpy as np
import pinocchio as pin
import pytest

from kickdyn.robot.model_validation import check_model
from kickdyn.robot.surgery import angle_model, reduce_model, reroot_model, turn_body

KINDS = (pin.JointModelRY, pin.JointModelRUBX, pin.JointModelPZ, pin.JointModelRX)


def tree(draw, count=8):
    """A floating tree of joints that branch at random, a frame on each body."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    parents = {1: 0}
    path = [1]
    for k in range(count):
        del path[draw.integers(1, len(path) + 1) :]  # Pinocchio wants branch after branch
        kind = KINDS[k % len(KINDS)]()
        joint = model.addJoint(path[-1], kind, pin.SE3.Random(), f"j{k}")
        parents[joint] = path[-1]
        path.append(joint)
    for joint in parents:
        model.addJointFrame(joint)
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
        model.addBodyFrame(f"body{joint}", joint, pin.SE3.Random(), -1)
    model.armature = draw.uniform(0.0, 1.0, model.nv)
    return model


def places(model, q):
    """The placements of the frames on bodies by name."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    named = zip(model.frames, data.oMf, strict=True)
    return {f.name: place.copy() for f, place in named if f.name.startswith("body")}


def steps(model, draw):
    """A random value of each joint of one degree of freedom by name."""
    return {name: draw.uniform(-1.0, 1.0) for name in list(model.names)[2:]}


def configuration(model, values):
    """The configuration with these values, the floating base at 0."""
    step = np.zeros(model.nv)
    for name, value in values.items():
        if model.existJointName(name):
            step[model.joints[model.getJointId(name)].idx_v] = value
    return pin.integrate(model, pin.neutral(model), step)


def assert_same(left, right):
    assert left.keys() == right.keys()
    for name, place in left.items():
        np.testing.assert_allclose(place.homogeneous, right[name].homogeneous, atol=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_a_body_at_rest_becomes_the_root(seed):
    draw = np.random.default_rng(seed)
    pin.seed(seed)
    model = tree(draw)
    foot = int(draw.integers(2, model.njoints))
    placement, values = pin.SE3.Random(), steps(model, draw)
    rooted = reroot_model(model, foot, placement)
    before = places(model, configuration(model, values))
    data = model.createData()
    pin.forwardKinematics(model, data, configuration(model, values))
    shift = placement * data.oMi[foot].inverse()
    expected = {name: shift * place for name, place in before.items()}
    assert_same(places(rooted, configuration(rooted, values)), expected)
    check_order(rooted)
    assert pin.computeTotalMass(rooted) + rooted.inertias[0].mass == pytest.approx(
        pin.computeTotalMass(model)
    )
    for name in list(model.names)[2:]:
        old, new = (m.joints[m.getJointId(name)].idx_v for m in (model, rooted))
        assert rooted.armature[new] == model.armature[old]


def check_order(model):
    """Raise unless each subtree has consecutive joints; inertias here are any, limits too."""
    sound = model.copy()
    for joint in range(1, sound.njoints):
        sound.inertias[joint] = pin.Inertia.FromSphere(1.0, 0.1)
    check_model(sound)


@pytest.mark.parametrize("seed", range(4))
def test_continuous_joints_become_angles(seed):
    draw = np.random.default_rng(seed)
    pin.seed(seed)
    model = tree(draw)
    angles, values = angle_model(model), steps(model, draw)
    assert (angles.nq, angles.nv) == (model.nv + 1, model.nv)  # but for the base's quaternion
    assert_same(
        places(angles, configuration(angles, values)), places(model, configuration(model, values))
    )
    joint = angles.joints[angles.getJointId("j1")]
    assert angles.upperPositionLimit[joint.idx_q] == math.pi
    assert angles.armature.tolist() == model.armature.tolist()


@pytest.mark.parametrize("seed", range(4))
def test_locked_joints_stay_where_they_are(seed):
    draw = np.random.default_rng(seed)
    pin.seed(seed)
    model = tree(draw)
    values = steps(model, draw)
    q = configuration(model, values)
    reduced = reduce_model(model, ["base", "j2", "j5"], q)
    assert list(reduced.names)[1:] == ["j0", "j1", "j3", "j4", "j6", "j7"]
    assert_same(places(reduced, configuration(reduced, values)), places(model, q))


@pytest.mark.parametrize("joint", [0, 1, 3])
def test_what_hangs_from_a_body_turns_with_it(joint):
    draw = np.random.default_rng(0)
    pin.seed(0)
    model, turn = tree(draw), pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.8])), np.zeros(3))
    q = pin.neutral(model)
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    axes = data.oMi[joint]
    hanging = [j for j in range(model.njoints) if joint in list(model.supports[j])]
    before, after = places(model, q), places(turn_body(model, joint, turn.rotation), q)
    for name, place in before.items():
        carried = int(name.removeprefix("body")) in hanging
        move = axes * turn * axes.inverse() if carried else pin.SE3.Identity()
        np.testing.assert_allclose(after[name].homogeneous, (move * place).homogeneous, atol=1e-12)
