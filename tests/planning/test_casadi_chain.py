"""Newton-Euler in symbols against Pinocchio's."""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning.casadi_chain import CasadiChain
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
    chain, data = CasadiChain(joints.model, leg.contact_lever), joints.model.createData()
    for _ in range(5):
        q, v, a = draw.normal(size=(3, chain.n))
        torque = pin.rnea(joints.model, data, q, v, a)
        assert np.asarray(chain.torque(q, v, a)).ravel() == pytest.approx(
            torque, rel=1e-9, abs=1e-10
        )
        inertia = pin.crba(joints.model, data, q)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        assert np.asarray(chain.momentum(q, v)).ravel() == pytest.approx(
            inertia @ v, rel=1e-9, abs=1e-10
        )
        posture = leg.posture(whole(leg, joints, q))
        rows = posture.jacobian[:, joints.vs]
        where = np.asarray(chain.point_position(q)).ravel()
        assert where == pytest.approx(posture.contact_point, abs=1e-12)
        assert np.asarray(chain.point_velocity(q, v)).ravel() == pytest.approx(rows @ v, abs=1e-11)
        force = draw.normal(size=3)
        assert np.asarray(chain.impulse(q, force)).ravel() == pytest.approx(
            rows.T @ force, abs=1e-11
        )


def whole(leg, joints, q):
    full = leg.configuration()
    full[joints.qs] = q
    return full
