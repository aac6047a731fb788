"""Changed models have their bodies where the unchanged ones have them."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_inertia, random_rotation
from tolerances import closed_form

from kickdyn.robot.surgery import turn_body

KINDS = (pin.JointModelRY, pin.JointModelRUBX, pin.JointModelPZ, pin.JointModelRX)
EXACT = {"rtol": 0, "atol": closed_form(100)}


def random_place(draw):
    return pin.SE3(random_rotation(draw), draw.uniform(-1, 1, 3))


def tree(draw, count=8):
    """A floating tree of joints that branch at random, a frame on each body."""
    model, path = pin.Model(), [1]
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    for k in range(count):
        del path[draw.integers(1, len(path) + 1) :]  # Pinocchio wants branch after branch
        kind = KINDS[k % len(KINDS)]()
        path.append(model.addJoint(path[-1], kind, random_place(draw), f"j{k}"))
    for joint in range(1, model.njoints):
        model.addJointFrame(joint)
        model.appendBodyToJoint(joint, random_inertia(draw), pin.SE3.Identity())
        model.addBodyFrame(f"body{joint}", joint, random_place(draw), -1)
    model.armature = np.append(np.zeros(6), draw.uniform(0.0, 1.0, model.nv - 6))
    model.effortLimit = draw.uniform(0.0, 1.0, model.nv)
    return model


def places(model, q):
    """The poses of the frames on bodies by name."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    named = zip(model.frames, data.oMf, strict=True)
    return {f.name: place.homogeneous for f, place in named if f.name.startswith("body")}


@pytest.mark.parametrize("joint", [0, 1, 3])
@pytest.mark.parametrize("centre", [(0, 0, 0), (0.1, -0.2, 0.3)])
def test_what_hangs_from_a_body_turns_with_it_about_a_point(joint, centre):
    draw = np.random.default_rng(0)
    model, rotation = tree(draw), pin.exp3(np.array([0.3, -0.5, 0.8]))
    q, data = pin.neutral(model), model.createData()
    pin.forwardKinematics(model, data, q)
    turn = pin.SE3(rotation, np.array(centre) - rotation @ centre)  # keeps the centre
    move = (data.oMi[joint] * turn * data.oMi[joint].inverse()).homogeneous
    turned = turn_body(model, joint, rotation, centre)
    before, after = places(model, q), places(turned, q)
    for name, place in before.items():
        carried = joint in list(model.supports[int(name.removeprefix("body"))])
        right = move @ place if carried else place
        np.testing.assert_allclose(after[name], right, err_msg=name, **EXACT)
    data, other = model.createData(), turned.createData()
    for robot, workspace in ((model, data), (turned, other)):
        pin.centerOfMass(robot, workspace, q)
    assert other.com[joint] == pytest.approx(turn.act(data.com[joint]), abs=closed_form(100))
