"""Newton-Euler in symbols against Pinocchio's."""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning.casadi_chain import point_function, torque_function
from kickdyn.planning.swing_phase import swing_chain


def slider():
    """Return a prismatic joint, tilted, behind a turning one."""
    model = pin.Model()
    turn = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Random(), "turn")
    slide = model.addJoint(
        turn, pin.JointModelPrismaticUnaligned(np.array([0.6, 0, 0.8])), pin.SE3.Random(), "slide"
    )
    for joint in (turn, slide):
        body = pin.Inertia.FromBox(2.0, 0.1, 0.2, 0.3)
        model.appendBodyToJoint(joint, body, pin.SE3.Random())
    model.addFrame(pin.Frame("toe", slide, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model.velocityLimit = model.effortLimit = np.full(2, 10.0)
    return kd.Leg.from_model(model, "toe")


def legs():
    pin.seed(0)
    yield pytest.param(kd.Leg.human(), id="human")
    yield pytest.param(slider(), id="slider")
    for name in ("g1", "talos"):
        yield pytest.param(kd.Leg.from_robot(name), id=name)


@pytest.mark.parametrize("leg", list(legs()))
def test_the_symbols_are_pinocchio_to_rounding(leg):
    joints = swing_chain(leg)
    draw = np.random.default_rng(1)
    joints.model.armature = draw.uniform(0.0, 0.1, joints.model.nv)
    model, data = joints.model, joints.model.createData()
    in_symbols, point = torque_function(model), point_function(model)
    for _ in range(5):
        q, v, a = draw.normal(size=(3, model.nv))
        torque = pin.rnea(model, data, q, v, a)
        assert np.asarray(in_symbols(q, v, a)).ravel() == pytest.approx(torque, rel=1e-9, abs=1e-10)
        posture = leg.posture(whole(leg, joints, q))
        where = np.asarray(point(q, posture.contact_lever)).ravel()
        assert where == pytest.approx(posture.contact_point, abs=1e-12)


def whole(leg, joints, q):
    full = leg.configuration()
    full[joints.qs] = q
    return full
