"""Contacts for MuJoCo: closed forms of two masses, and the errors of scenes that users simulate."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from tolerances import integrated

import kickdyn as kd
from kickdyn.impact.approach import find_approach
from kickdyn.simulators import mujoco_fit
from kickdyn.simulators.mujoco_fit import closed_form_contact, kick_cases
from kickdyn.simulators.mujoco_kick import MujocoContact, MujocoKick

mujoco = pytest.importorskip("mujoco")

POSTURE = kd.Leg.human().posture(np.radians([40, 30, -20]))
V = np.array([8.25, -18.15, 2.48])
ALONG = (math.cos(math.radians(30)), 0.0, math.sin(math.radians(30)))


def tune(e, friction=0.0, normal=ALONG, **options):
    return kd.tune_mujoco(POSTURE, V, kd.Ball(), kd.Contact(normal, e, friction), **options)


def two_masses(mass, speed, e):
    """Return a mass on a rail that hits the ball along it, without gravity."""
    model = pin.Model()
    model.gravity = pin.Motion.Zero()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(mass, 0.1), pin.SE3.Identity())
    model.addFrame(pin.Frame("face", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    posture = kd.Leg.from_model(model, "face").posture([0.0])
    contact = kd.Contact((1, 0, 0), e)
    return find_approach(posture, [speed], kd.Ball(), contact, (0, 0, 0), (0, 0, 0))


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
@pytest.mark.parametrize("e", [0.2, 0.5, 0.9, 1.0])
def test_the_closed_form_is_the_restitution_of_two_masses(integrator, e):
    kick, mass, step = two_masses(0.3, 10.0, e), 0.3, 0.010 / 200
    k, b = closed_form_contact(e, 0.010, step, integrator)
    spring = MujocoContact((-k, -b), (0.9999, 0.9999, 1.0, 0.5, 1.0))
    ball = MujocoKick(kick, step, spring, integrator).run(phase=0.25)
    share = mass / (mass + kick.ball.mass)
    assert ball.velocity[0] / (10.0 * share) - 1.0 == pytest.approx(e, abs=4e-3)
    assert ball.contact_time == pytest.approx(0.010, abs=0.5 * step)


def test_kicks_around_the_tuned_one_are_those_of_collide():
    approach = find_approach(POSTURE, V, kd.Ball(), kd.Contact(ALONG, 0.7), (0, 0, 0), (0, 0, 0))
    cases = {case.change: case for case in kick_cases(approach, 0.010)}
    hit = kd.collide(POSTURE, V, kd.Ball(), approach.contact, contact_time=0.010, tol=1e-6)
    during = hit.sample(np.linspace(0.0, hit.contact_time, 400))
    force = np.linalg.norm(during.force, axis=1)
    mean = np.trapezoid(force * during.deflection) / np.trapezoid(force)
    assert cases[""].deflection == pytest.approx(mean, rel=0.01)
    assert cases[""].target.velocity == pytest.approx(hit.ball_after.velocity, rel=integrated(1e-8))
    stiffness = hit.force_model.stiffness
    half = kd.collide(POSTURE, V / 2, kd.Ball(), approach.contact, stiffness=stiffness, tol=1e-6)
    target = cases["speed x 0.5"].target.velocity
    assert target == pytest.approx(half.ball_after.velocity, rel=integrated(1e-7))
    ahead = POSTURE.q + 0.1 * V / np.abs(V).max()
    assert cases["later in the swing"].approach.posture.q == pytest.approx(ahead)


@pytest.fixture(scope="module")
def tuned():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mujoco_fit, "SHAPES", ((1.5, 2.0),))
        return tune(0.7, timestep=0.002, contact_time=0.010)


def test_the_errors_are_those_of_the_scene(tuned):
    """Simulate the scene as a user does: no code of kickdyn runs."""
    model = mujoco.MjModel.from_xml_string(tuned.scene)
    assert (model.opt.timestep, model.opt.integrator) == (0.002, 3)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(20):
        mujoco.mj_step(model, data)
    free = data.qvel[-6:-3] - np.array([0.0, 0.0, -9.81]) * (data.time - tuned.contact_time)
    contact = kd.Contact(ALONG, 0.7)
    right = kd.collide(POSTURE, V, kd.Ball(), contact, contact_time=0.010).ball_after.velocity
    assert tuned.errors[0].velocity < 0.04
    assert np.linalg.norm(free - right) / np.linalg.norm(right) < tuned.errors[0].velocity + 0.01
    instant = kd.strike(POSTURE, V, kd.Ball(), contact).ball_after.velocity
    apart = np.linalg.norm(right - instant) / np.linalg.norm(instant)
    assert tuned.errors[-1].velocity == pytest.approx(apart, abs=1.1 * tuned.errors[0].velocity)
    around = max(error.speed for error in tuned.errors if error.change.startswith("speed x"))
    first = tuned.errors[0]
    assert [goal.error for goal in tuned.goals] == [first.speed, first.direction, around]
    assert [goal.limit for goal in tuned.goals] == [0.03, pytest.approx(math.radians(1)), 0.06]


def test_the_ball_of_the_snippet_is_that_of_the_tuning(tuned):
    model, ball = mujoco.MjModel.from_xml_string(tuned.mjcf()), kd.Ball()
    geom = model.geom("ball")
    assert (tuple(geom.solref), tuple(geom.solimp)) == (tuned.solref, tuned.solimp)
    assert (geom.condim[0], model.opt.timestep) == (1, 0.002)
    assert model.body("ball").mass[0] == ball.mass
    assert model.body("ball").inertia == pytest.approx([ball.inertia] * 3)
    rough = replace(tuned, friction=0.4, margin=0.007, solreffriction=(-1.0, -55.0))
    text = rough.mjcf().replace("<worldbody>", '<worldbody><geom name="foot" size="1"/>')
    model = mujoco.MjModel.from_xml_string(text)
    sizes = [model.geom(name).size[0] for name in ("ball", "ball_surface")]
    assert sizes == pytest.approx([ball.radius - 0.007, ball.radius])
    assert (model.pair_friction[0, 0], model.pair_margin[0]) == (0.4, 0.007)
    for factor, is_said in ((1.05, False), (1.15, True), (0.95, False), (0.85, True)):
        lasted = replace(tuned, contact_time=factor * tuned.wanted_contact_time)
        assert bool(lasted.warnings) == is_said, factor
    for name in ("", 'a"b', "a<b", "a\n", 3):
        with pytest.raises(kd.InvalidInput, match="foot"):
            tuned.mjcf(name)


@pytest.mark.slow
@pytest.mark.parametrize(("e", "friction"), [(0.3, 0.0), (0.9, 0.4), (0.7, 0.1)])
def test_two_milliseconds_are_small_enough(e, friction):
    """With friction the foot moves 30 degrees from the normal, and the ball slides first."""
    result = tune(e, friction, ALONG if friction == 0 else (1, 0, 0))
    assert result.within_tolerance
    if friction:
        assert (result.condim, result.margin > 0) == (3, True)
        assert 0.5 * friction < result.friction < 2 * friction
        model = mujoco.MjModel.from_xml_string(result.scene)
        assert model.pair_friction[0, 0] == result.friction


@pytest.mark.parametrize(("given", "message"), [
    ({"timestep": 0}, "timestep is 0.0"), ({"timestep": 0.006}, "2e-05 to 0.005 s"),
    ({"timestep": 1e-300}, "2 to 500 steps"), ({"tolerance": 1e-300}, "tolerance is 1e-300"),
    ({"friction": 1e300}, "friction is 1e"), ({"contact_time": 1e300}, "contact time is 1e"),
    ({"integrator": "euler"}, "integrator is 'euler'.* Euler"), ({"e": 0.1}, "restitution is 0.1")
])  # fmt: skip
def test_bad_input(given, message):
    with pytest.raises(kd.InvalidInput, match=message):
        tune(**({"e": 0.7} | given))
