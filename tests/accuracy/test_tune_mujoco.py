"""Contacts for MuJoCo: what is tuned gives kickdyn's ball, and says by how much it does not."""

import math
import sys

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.accuracy import tune_mujoco as tuning
from kickdyn.accuracy.mujoco_kick import MujocoContact, MujocoKick
from kickdyn.accuracy.tune_mujoco import closed_form_contact
from kickdyn.impact.approach import find_approach

mujoco = pytest.importorskip("mujoco")

POSTURE = kd.Leg.human().posture(np.radians([40, 30, -20]))
V = np.array([8.25, -18.15, 2.48])
ALONG = (math.cos(math.radians(30)), 0.0, math.sin(math.radians(30)))


def tune(e, friction=0.0, normal=ALONG, **options):
    return kd.tune_mujoco(POSTURE, V, kd.Ball(), kd.Contact(normal, e, friction), **options)


@pytest.fixture(scope="module")
def tuned():
    return tune(0.7, timestep=0.002, contact_time=0.010)


def two_masses(mass, speed, e):
    """A mass on a rail that hits the ball along it."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(mass, 0.1), pin.SE3.Identity())
    model.addFrame(pin.Frame("face", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    posture = kd.Leg.from_model(model, "face").posture([0.0])
    contact = kd.Contact((1, 0, 0), e)
    return find_approach(posture, [speed], kd.Ball(), contact, (0, 0, 0), (0, 0, 0))


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
@pytest.mark.parametrize("e", [0.2, 0.5, 0.9, 1.0])
def test_the_closed_form_is_the_restitution_of_two_masses(integrator, e):
    kick = two_masses(mass := 0.3, 10.0, e)
    step = 0.010 / 200
    k, b = closed_form_contact(e, 0.010, step, integrator)
    contact = MujocoContact((-k, -b), (0.9999, 0.9999, 1.0, 0.5, 1.0))
    found = MujocoKick(kick, step, contact, integrator).run()
    share = mass / (mass + kick.ball.mass)
    assert found.velocity[0] / (10.0 * share) - 1.0 == pytest.approx(e, abs=4e-3)
    assert found.contact_time == pytest.approx(0.010, abs=2.1 * step)


@pytest.mark.parametrize("e", [0.5, 0.9])
def test_steps_of_euler_keep_frequency_and_decay(e):
    kick, step = two_masses(0.3, 10.0, e), 0.001
    k, b = closed_form_contact(e, 0.010, step)
    contact = MujocoContact((-k, -b), (0.9999, 0.9999, 1.0, 0.5, 1.0))
    run = MujocoKick(kick, step, contact)
    mujoco.mj_resetDataKeyframe(run.model, run.data, 0)
    depths = []
    for _ in range(6):
        mujoco.mj_step(run.model, run.data)
        depths.append(run.data.qpos[0] - (run.data.qpos[1] - kick.ball.radius))
    k, b = closed_form_contact(e, 0.010, 0.0, "RK4")
    turn, times = math.sqrt(k - b * b / 4), step * np.arange(1, 7)
    exact = np.exp(-b / 2 * times) * np.sin(turn * times)
    assert np.array(depths) / depths[0] == pytest.approx(exact / exact[0], rel=1e-3)


def test_wishes_that_common_time_steps_meet(tuned):
    for found in (tuned, tune(0.5, contact_time=0.010), tune(0.9, contact_time=0.010)):
        assert found.within_tolerance
        assert found.warnings == ()
        assert found.errors[0].speed < 0.03
        assert found.errors[0].direction < math.radians(1.05)
        assert all(error.speed < 0.06 for error in found.errors[:5])
        assert found.contact_time == pytest.approx(0.010, rel=0.1)
    assert [error.change for error in tuned.errors[:2]] == ["", "speed x 0.5"]


def test_an_impedance_that_grows_makes_the_moment_of_contact_matter_less(monkeypatch):
    """docs/how-to/mujoco.md: up to 5 % at 2 ms and e = 0.5 without it."""
    growing = tune(0.5, contact_time=0.010).errors[0].speed
    monkeypatch.setattr(tuning, "WIDTHS", (0.0,))
    constant = tune(0.5, contact_time=0.010, tolerance=0.1).errors[0].speed
    assert 0.03 < constant < 0.06
    assert growing < 0.5 * constant


def test_a_small_time_step_meets_one_per_cent():
    found = tune(0.7, timestep=0.0005, contact_time=0.010)
    assert found.errors[0].velocity < 0.01
    assert found.largest_timestep == 0.0005


def test_the_errors_are_those_of_the_scene(tuned):
    """Simulate the scene as a user does: no code of kickdyn runs."""
    model = mujoco.MjModel.from_xml_string(tuned.scene)
    assert (model.opt.timestep, model.opt.integrator) == (0.002, 3)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(20):
        mujoco.mj_step(model, data)
    gravity = np.array([0.0, 0.0, -9.81])
    free = data.qvel[-6:-3] - gravity * (data.time - tuned.contact_time)
    contact = kd.Contact(ALONG, 0.7)
    damped = {"contact_time": 0.010, "dissipation": "hunt-crossley"}
    expected = kd.collide(POSTURE, V, kd.Ball(), contact, **damped).ball_after.velocity
    apart = np.linalg.norm(free - expected) / np.linalg.norm(expected)
    assert apart < tuned.errors[0].velocity + 0.01
    assert data.geom("ball").xpos[0] > data.geom("foot").xpos[0]


def test_both_forms_of_solref_are_one_contact(tuned):
    contact = kd.Contact(ALONG, 0.7)
    approach = find_approach(POSTURE, V, kd.Ball(), contact, (0, 0, 0), (0, 0, 0))
    kick = MujocoKick(approach, 0.002, MujocoContact(tuned.solref, tuned.solimp))
    one = kick.run(0.5)
    kick.set_contact(MujocoContact(tuned.solref_time, tuned.solimp))
    assert kick.run(0.5).velocity == pytest.approx(one.velocity, rel=1e-3)


def test_a_sliding_kick_with_friction(monkeypatch):
    monkeypatch.setattr(tuning, "WIDTHS", (0.3,))
    given = (0.7, 0.1, (1, 0, 0.1))
    found = tune(*given, timestep=0.001, contact_time=0.010, tolerance=0.05)
    impact = kd.strike(POSTURE, V, kd.Ball(), kd.Contact((1, 0, 0.1), 0.7, 0.1))
    assert not impact.sticking
    assert found.errors[0].velocity < 0.03
    assert found.errors[0].spin < 0.2 * np.linalg.norm(impact.ball_after.spin)
    assert found.condim == 3
    assert 0.05 < found.friction < 0.2
    assert found.solreffriction[1] < found.solref[1] < 0
    text = found.mjcf("toe_geom")
    robot = '<worldbody><body><joint/><geom name="toe_geom" size="0.1"/></body></worldbody>'
    model = mujoco.MjModel.from_xml_string(text.replace("</mujoco>", f"{robot}</mujoco>"))
    assert tuple(model.pair_solref[0]) == found.solref
    assert model.pair_solreffriction[0, 1] == found.solreffriction[1]
    assert model.pair_friction[0, 0] == found.friction


def test_the_first_kick_counts_in_full_and_its_neighbours_in_part(monkeypatch):
    approach = find_approach(POSTURE, V, kd.Ball(), kd.Contact(ALONG, 0.7), (0, 0, 0), (0, 0, 0))
    cases = tuning.kick_cases(approach, 0.010)
    kicks = [MujocoKick(case.approach, 0.002, MujocoContact(), "Euler", True) for case in cases]
    found = tuning.fit_contact(cases, kicks, 0.010, 0.0, "Euler")
    own, *others = (error.velocity for error in found.errors)
    assert found.score == max(own, tuning.OTHERS * max(others))


def test_the_ball_of_the_snippet(tuned):
    model = mujoco.MjModel.from_xml_string(tuned.mjcf())
    assert tuple(model.geom("ball").solref) == tuned.solref
    assert tuple(model.geom("ball").solimp) == tuned.solimp
    assert (model.geom("ball").condim[0], model.geom("ball").priority[0]) == (1, 1)
    assert model.body("ball").mass[0] == kd.Ball().mass
    assert model.body("ball").inertia == pytest.approx([kd.Ball().inertia] * 3)
    assert model.opt.timestep == 0.002
    assert str(tuned).startswith("MujocoTuning\n  time step")


def test_what_a_time_step_cannot_meet(monkeypatch):
    monkeypatch.setattr(tuning, "WIDTHS", (0.0,))
    monkeypatch.setattr(tuning, "STEPS", (2e-3, 5e-4))
    found = tune(0.5, timestep=0.005, contact_time=0.010, tolerance=0.02)
    assert not found.within_tolerance
    assert found.largest_timestep == 5e-4
    (line,) = found.warnings
    assert line.endswith("2.0% is asked for: the largest time step that meets it is 0.5 ms")
    monkeypatch.setattr(tuning, "STEPS", ())
    found = tune(0.5, timestep=0.005, contact_time=0.010, tolerance=0.02)
    assert found.largest_timestep is None
    assert found.warnings[0].endswith("no time step that was tried meets it")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"timestep": 0}, "timestep is 0.0: it must be a finite number above 0"),
        ({"timestep": -1e-3}, "timestep is -0.001: it must be"),
        ({"timestep": math.nan}, "timestep is nan: it must be"),
        ({"timestep": 1}, "timestep is 1.0: it must be .* at most 0.02"),
        ({"timestep": 0.006, "contact_time": 0.01}, "so it must be at most 0.005 s"),
        ({"contact_time": 0}, "contact time is 0.0: it must be"),
        ({"integrator": "euler"}, "integrator is 'euler': it must be one of Euler, implicit"),
        ({"tolerance": 0}, "tolerance is 0.0: it must be"),
        ({"e": 0.1}, "restitution is 0.1: it must be a finite number at least 0.2"),
    ],
)  # fmt: skip
def test_bad_input(given, message):
    with pytest.raises(kd.InvalidInput, match=message):
        tune(**({"e": 0.7} | given))


@pytest.mark.parametrize("name", ["", 'a"b', "a<b", "a\n", 3])
def test_names_that_mjcf_cannot_have(tuned, name):
    with pytest.raises(kd.InvalidInput, match="foot"):
        tuned.mjcf(name)


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(kd.InvalidInput, match=r'install it with pip install "kickdyn\[mjcf\]"$'):
        tune(0.7)
