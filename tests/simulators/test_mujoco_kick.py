"""The leg and the kick in MuJoCo: the same inertia, the same places, the same ball in the limit."""

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.impact.approach import find_approach
from kickdyn.simulators.mujoco_kick import MujocoContact, MujocoKick, mujoco_kick

mujoco = pytest.importorskip("mujoco")

KINDS = {
    "free": pin.JointModelFreeFlyer,
    "ball": pin.JointModelSpherical,
    "slide": lambda: pin.JointModelPrismaticUnaligned(np.array([0.6, 0.0, 0.8])),
    "hinge": lambda: pin.JointModelRevoluteUnaligned(np.array([0.0, 0.6, 0.8])),
    "continuous": pin.JointModelRUBX,
}


def tree(*kinds):
    """A leg of joints of these kinds, with an arm beside it that is added first."""
    model, draw = pin.Model(), np.random.default_rng(5)
    parent = 0
    for number, kind in enumerate(kinds):
        place = pin.SE3.Identity() if kind == "free" else pin.SE3.Random()
        place.translation = 0.3 * draw.normal(size=3) if kind != "free" else np.zeros(3)
        parent = model.addJoint(parent, KINDS[kind](), place, f"{kind}{number}")
        model.appendBodyToJoint(parent, pin.Inertia(1.0 + number, 0.1 * draw.normal(size=3),
                                np.diag([0.05, 0.06, 0.07])), pin.SE3.Identity())  # fmt: skip
        if number == 0:
            arm = model.addJoint(parent, KINDS["hinge"](), pin.SE3.Identity(), "arm")
            model.appendBodyToJoint(arm, pin.Inertia.FromSphere(0.5, 0.1), pin.SE3.Identity())
    model.addFrame(pin.Frame("toe", parent, pin.SE3(np.eye(3), np.array([0.1, 0.2, -0.3])),
                             pin.FrameType.OP_FRAME))  # fmt: skip
    model.armature[-1] = 0.02
    return kd.Leg.from_model(model, "toe")


@pytest.fixture(params=[("free", "ball", "hinge"), ("slide", "continuous", "hinge")], ids=str)
def kick(request):
    pin.seed(3)
    leg = tree(*request.param)
    q = pin.integrate(leg.model, pin.neutral(leg.model), np.linspace(-0.5, 0.7, leg.nv))
    posture, v = leg.posture(q), np.linspace(1.0, -2.0, leg.nv)
    normal = posture.jacobian @ v
    contact = kd.Contact(normal / np.linalg.norm(normal), restitution=0.7)
    return find_approach(posture, v, kd.Ball(), contact, (0.1, 0.2, 0.3), (1.0, -2.0, 3.0))


def test_mujoco_has_the_same_leg(kick):
    run = MujocoKick(kick, 1e-4, MujocoContact())
    model, data, posture = run.model, run.data, kick.posture
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    energy = 0.5 * data.qvel @ np.array([_row(model, data, k) for k in range(model.nv)]) @ data.qvel
    ball, before = kick.ball, kick.ball_before
    own = 0.5 * kick.v @ posture.inertia @ kick.v
    own += 0.5 * ball.mass * before.velocity @ before.velocity
    own += 0.5 * ball.inertia * before.spin @ before.spin
    assert energy == pytest.approx(own, rel=1e-9)
    foot, centre = data.geom("foot"), data.geom("ball")
    face = foot.xpos + 0.1 * foot.xmat.reshape(3, 3)[:, 2]
    assert face == pytest.approx(posture.contact_point, abs=1e-9)
    assert foot.xmat.reshape(3, 3)[:, 2] == pytest.approx(kick.contact.normal, abs=1e-9)
    gap = centre.xpos - posture.contact_point
    assert gap == pytest.approx(ball.radius * kick.contact.normal, abs=1e-9)
    moved = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, foot.id, moved, 0)
    at_toe = moved[3:] + np.cross(moved[:3], posture.contact_point - foot.xpos)
    assert at_toe == pytest.approx(kick.foot_velocity, abs=1e-9)


def test_a_viewer_shows_the_links(kick):
    """From each joint to the next one, and to the toe; they collide with nothing."""
    model = MujocoKick(kick, 1e-4, MujocoContact()).model
    links = [g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_CAPSULE]
    assert len(links) >= 3
    assert not model.geom_contype[links].any()
    assert not model.geom_conaffinity[links].any()


def _row(model, data, k):
    """A row of MuJoCo's joint-space inertia."""
    moved = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, moved, np.eye(model.nv)[k])
    return moved


def test_a_short_contact_tends_to_the_instant(kick):
    impact = kd.strike(
        kick.posture, kick.v, kick.ball, kick.contact,
        ball_velocity=kick.ball_before.velocity, ball_spin=kick.ball_before.spin,
    )  # fmt: skip
    found = mujoco_kick(impact, 1e8, 2e-6)()
    assert found == pytest.approx(impact.impulse, abs=0.01 * np.linalg.norm(impact.impulse))


def test_what_mujoco_has_not_is_refused():
    leg = kd.Leg.human().with_stiff_joints("ankle")
    posture = leg.posture(np.radians([5, 10, -5]))
    v = posture.joint_velocity((8, 0, 4))
    kick = find_approach(posture, v, kd.Ball(), kd.Contact((1, 0, 0), 0.7), (0, 0, 0), (0, 0, 0))
    with pytest.raises(kd.InvalidInput, match="stiff joints: a kick in MuJoCo is simulated for"):
        MujocoKick(kick, 1e-3, MujocoContact())


def test_a_simulation_that_diverges_leaves_no_log(kick, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    contact = MujocoContact((-1e15, -1.0), (0.9999, 0.9999, 1.0, 0.5, 1.0))
    with pytest.raises(kd.KickdynError):
        MujocoKick(kick, 0.02, contact).run()
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_a_contact_by_default_is_that_of_mujoco():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom size='1'/><body><freejoint/><geom name='ball' size='1'/></body>"
        "</worldbody></mujoco>"
    )
    default = MujocoContact()
    assert default.solref == tuple(model.geom("ball").solref)
    assert default.solimp == tuple(model.geom("ball").solimp)
    assert default.margin == model.geom("ball").margin[0]
