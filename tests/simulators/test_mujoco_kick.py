"""The leg and the kick in MuJoCo: the same inertia, places and velocities as in Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.impact.approach import find_approach
from kickdyn.simulators.mujoco_kick import MujocoContact, MujocoKick, ball_spin, write_bodies

mujoco = pytest.importorskip("mujoco")

KINDS = {
    "free": pin.JointModelFreeFlyer, "ball": pin.JointModelSpherical,
    "slide": lambda: pin.JointModelPrismaticUnaligned(np.array([0.6, 0.0, 0.8])),
    "hinge": lambda: pin.JointModelRevoluteUnaligned(np.array([0.0, 0.6, 0.8])),
    "continuous": pin.JointModelRUBX}  # fmt: skip


def tree(*kinds):
    """Return a leg of joints of these kinds, with an arm beside it that is added first."""
    model, draw, parent = pin.Model(), np.random.default_rng(5), 0
    for number, kind in enumerate(kinds):
        place = pin.SE3.Identity() if kind == "free" else pin.SE3.Random()
        place.translation = 0.3 * draw.normal(size=3) if kind != "free" else np.zeros(3)
        parent = model.addJoint(parent, KINDS[kind](), place, f"{kind}{number}")
        inertia = np.diag([0.05, 0.06, 0.07])
        body = pin.Inertia(1.0 + number, 0.1 * draw.normal(size=3), inertia)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        if number == 0:
            arm = model.addJoint(parent, KINDS["hinge"](), pin.SE3.Identity(), "arm")
            model.appendBodyToJoint(arm, pin.Inertia.FromSphere(0.5, 0.1), pin.SE3.Identity())
    toe = pin.SE3(np.eye(3), np.array([0.1, 0.2, -0.3]))
    model.addFrame(pin.Frame("toe", parent, toe, pin.FrameType.OP_FRAME))
    model.armature[-1] = 0.02
    return kd.Leg.from_model(model, "toe")


@pytest.fixture(params=[("free", "ball", "hinge"), ("slide", "continuous", "hinge")], ids=str)
def kick(request):
    pin.seed(3)
    leg = tree(*request.param)
    q = pin.integrate(leg.model, pin.neutral(leg.model), np.linspace(-0.5, 0.7, leg.nv))
    posture, v = leg.posture(q), np.linspace(1.0, -2.0, leg.nv)
    contact = kd.Contact(posture.jacobian @ v, restitution=0.7)
    return find_approach(posture, v, kd.Ball(), contact, (0.1, 0.2, 0.3), (1.0, -2.0, 3.0))


def test_mujoco_has_the_same_leg_and_ball(kick):
    run = MujocoKick(kick, 1e-4, MujocoContact())
    model, data, posture, ball = run.model, run.data, kick.posture, kick.ball
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    momentum, before = np.zeros(model.nv), kick.ball_before
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    energy = 0.5 * kick.v @ posture.inertia @ kick.v
    energy += 0.5 * ball.mass * before.velocity @ before.velocity
    energy += 0.5 * ball.inertia * before.spin @ before.spin
    assert 0.5 * data.qvel @ momentum == pytest.approx(energy, rel=closed_form(1e4))
    foot, normal, place = data.geom("foot"), kick.contact.normal, posture.contact_point
    axis = foot.xmat.reshape(3, 3)[:, 2]
    agrees(axis, normal, closed_form(1e4))
    agrees(foot.xpos + 0.1 * axis, place, closed_form(1e4))
    agrees(data.geom("ball").xpos, place + ball.radius * normal, closed_form(1e4))
    velocity = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, foot.id, velocity, 0)
    at_toe = velocity[3:] + np.cross(velocity[:3], place - foot.xpos)
    agrees(at_toe, kick.foot_velocity, closed_form(1e4))
    data.qpos[-4:] = 0.8, 0.0, 0.36, 0.48  # the ball's spin is in the world's axes
    mujoco.mj_forward(model, data)
    ball_id = model.body("ball").id
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, ball_id, velocity, 0)
    agrees(ball_spin(data), velocity[:3], closed_form(10))


def test_joints_stop_at_the_ends_of_their_ranges_but_for_continuous_ones():
    model = tree("slide", "continuous", "hinge").model
    model.lowerPositionLimit, model.upperPositionLimit = np.outer([-1, 1], np.arange(1, 6))
    bodies = write_bodies(model, {}, limits=True)
    text = f'<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody></mujoco>'
    stops = mujoco.MjModel.from_xml_string(text).jnt_range.tolist()
    assert stops == [[-1, 1], [-2, 2], [0, 0], [-5, 5]]


def test_a_simulation_that_diverges_or_does_not_end_is_an_error(kick, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    hard = MujocoContact((-1e15, -1.0), (0.9999, 0.9999, 1.0, 0.5, 1.0))
    with pytest.raises(kd.KickdynError):
        MujocoKick(kick, 0.02, hard).run()
    with pytest.raises(kd.KickdynError, match=r"separate within 0\.001 s"):
        MujocoKick(kick, 5e-4, MujocoContact()).run(longest=0.001)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
