"""Contacts for MuJoCo: what is tuned gives kickdyn's ball, and says by how much it does not."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.simulators import mujoco_fit
from kickdyn.simulators import tune_mujoco as tuning

mujoco = pytest.importorskip("mujoco")

POSTURE = kd.Leg.human().posture(np.radians([40, 30, -20]))
V = np.array([8.25, -18.15, 2.48])
ALONG = (math.cos(math.radians(30)), 0.0, math.sin(math.radians(30)))


def tune(e, friction=0.0, normal=ALONG, **options):
    return kd.tune_mujoco(POSTURE, V, kd.Ball(), kd.Contact(normal, e, friction), **options)


@pytest.fixture(scope="module")
def tuned():
    return tune(0.7, timestep=0.002, contact_time=0.010)


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("e", [0.3, 0.9])
def test_two_milliseconds_are_small_enough(monkeypatch, e, friction):
    """With friction the foot moves 30 degrees from the normal, and the ball slides first."""
    monkeypatch.setattr(mujoco_fit, "SHAPES", ((1.5, 2.0) if friction or e == 0.9 else (2.5, 3.0),))
    found = tune(e, friction, ALONG if friction == 0 else (1, 0, 0))
    assert found.within_tolerance
    assert not any("accepted" in line for line in found.warnings)
    assert found.errors[0].speed < 0.03
    assert found.errors[0].direction < math.radians(1)
    assert all(error.speed < 0.06 for error in found.errors[:5])
    late = any(line.startswith("the contact lasts ") for line in found.warnings)
    assert late == (abs(found.contact_time - found.wanted_contact_time) > 0.001)


def test_errors_name_their_kicks(tuned):
    changes = [error.change for error in tuned.errors]
    assert changes[:2] == ["", "speed x 0.5"]
    assert changes[-2:] == ["later in the swing", "against kd.strike"]


def test_the_last_error_is_that_against_strike(tuned):
    """Of the ball of `strike` it is what `collide` differs from it, but for the other errors."""
    contact = kd.Contact(ALONG, 0.7)
    instant = kd.strike(POSTURE, V, kd.Ball(), contact).ball_after.velocity
    hit = kd.collide(POSTURE, V, kd.Ball(), contact).ball_after.velocity
    apart = np.linalg.norm(hit - instant) / np.linalg.norm(instant)
    assert tuned.errors[-1].velocity == pytest.approx(apart, abs=1.1 * tuned.errors[0].velocity)


def test_a_small_time_step_meets_one_per_cent():
    found = tune(0.7, timestep=0.0005, tolerance=0.01)
    assert found.within_tolerance


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
    expected = kd.collide(POSTURE, V, kd.Ball(), contact, contact_time=0.010).ball_after.velocity
    apart = np.linalg.norm(free - expected) / np.linalg.norm(expected)
    assert apart < tuned.errors[0].velocity + 0.01
    assert data.geom("ball").xpos[0] > data.geom("foot").xpos[0]


def test_a_sliding_kick_with_friction(monkeypatch):
    monkeypatch.setattr(mujoco_fit, "SHAPES", ((0.6, 1.0),))
    given = (0.7, 0.1, (1, 0, 0.1))
    found = tune(*given, timestep=0.001, tolerance=0.05)
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
    assert model.pair_margin[0] == found.margin
    ball = kd.Ball()
    sizes = [model.geom(name).size[0] for name in ("ball", "ball_surface")]
    assert sizes == pytest.approx([ball.radius - found.margin, ball.radius])
    assert model.body("ball").mass[0] == ball.mass


def test_the_ball_of_the_snippet(tuned):
    model = mujoco.MjModel.from_xml_string(tuned.mjcf())
    assert tuple(model.geom("ball").solref) == tuned.solref
    assert tuple(model.geom("ball").solimp) == tuned.solimp
    assert (model.geom("ball").condim[0], model.geom("ball").priority[0]) == (1, 1)
    assert model.body("ball").mass[0] == kd.Ball().mass
    assert model.body("ball").inertia == pytest.approx([kd.Ball().inertia] * 3)
    assert model.opt.timestep == 0.002
    assert str(tuned).startswith("MujocoTuning\n  time step")


def test_it_prints_whether_the_goals_are_met(tuned):
    goals = [line.rsplit(" ", 1)[1] for line in str(tuned).splitlines() if "  goal, " in line]
    assert goals == ["met", "met", "met"]
    assert "  within tolerance" in str(tuned)
    rows = {name: (value, unit) for name, value, unit in tuned._rows()}
    assert any("x 0.5 to 1.5" in name for name in rows), [*rows][6:]
    for error in tuned.errors:
        text, _ = rows[f"error, {error.change or 'this kick'}"]
        assert text.startswith(f"speed {100 * error.speed:.2f}%, direction ")
        assert f"direction {math.degrees(error.direction):.2f} deg" in text
    assert rows["contact time"][0] == pytest.approx(1e3 * tuned.contact_time)
    assert rows["time step"][0] == pytest.approx(2.0)
    missed = replace(tuned, goals=(tuned.goals[0]._replace(limit=1e-9), *tuned.goals[1:]))
    (line,) = (line for line in str(missed).splitlines() if line.endswith("MISSED"))
    assert line.split(maxsplit=2)[:2] == ["goal,", "speed"]
    (verdict,) = (line for line in str(missed).splitlines() if "within tolerance" in line)
    assert verdict.split() == ["within", "tolerance", "no"]


def test_what_a_time_step_cannot_meet(monkeypatch):
    monkeypatch.setattr(mujoco_fit, "SHAPES", ((0.0, 1.0),))
    found = tune(0.9, timestep=0.005, tolerance=0.015)
    assert not found.within_tolerance
    speed, direction, around = (line for line in found.warnings if "accepted" in line)
    assert speed.startswith("with a time step of 5 ms, the ball's speed is off by up to ")
    assert speed.endswith("1.5% is accepted: choose a smaller time step")
    assert "the ball's direction is off by up to" in direction
    assert "1 deg is accepted" in direction
    assert "at 0.5 to 1.5 times all velocities, and at most 3.0% is accepted" in around


def test_a_kick_that_would_press_the_ball_too_far_is_left_out_and_said(monkeypatch):
    monkeypatch.setattr(mujoco_fit, "SHAPES", ((1.5, 1.0),))
    found = tune(0.2, timestep=0.001)
    assert "speed x 1.5" not in {error.change for error in found.errors}
    assert any("the error at 1.5 times all velocities is unknown" in w for w in found.warnings)


def test_a_contact_time_that_is_not_met_is_said(tuned):
    assert replace(tuned, contact_time=0.0125).warnings == (
        "the contact lasts 12.5 ms instead of the 10 ms asked for",
    )


@pytest.mark.parametrize(
    ("factor", "is_said"), [(1.098, False), (1.102, True), (0.902, False), (0.898, True)]
)
def test_warnings_begin_at_a_tenth_of_the_contact_time(tuned, factor, is_said):
    contact_time = factor * tuned.wanted_contact_time
    assert bool(replace(tuned, contact_time=contact_time).warnings) == is_said


def test_a_goal_is_met_up_to_its_limit():
    goal = tuning.MujocoGoal("speed", 0.03, 0.03)
    assert goal.met
    assert not goal._replace(error=0.0301).met


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"timestep": 0}, "timestep is 0.0: it must be a finite number above 0"),
        ({"timestep": -1e-3}, "timestep is -0.001: it must be"),
        ({"timestep": math.nan}, "timestep is nan: it must be"),
        ({"timestep": 1}, "timestep is 1.0: it must be .* at most 0.02"),
        ({"timestep": 0.006}, "valid time steps are 2e-05 to 0.005 s"),
        ({"timestep": 1e-300}, "a contact of 0.01 s must take 2 to 500 steps"),
        ({"tolerance": 1e-300}, "tolerance is 1e-300: it must be a finite number at least 0.001"),
        ({"friction": 1e300}, r"friction is 1e\+300: it must be .* at least 0 and at most 10$"),
        ({"contact_time": 1e-300}, "contact time is 1e-300: it must be .* at least 1e-05"),
        ({"contact_time": 1e300}, r"contact time is 1e\+300: it must be .* at most 0\.1 \[s\]"),
        ({"contact_time": 0}, "contact time is 0.0: it must be"),
        ({"integrator": "euler"}, "integrator is 'euler': it must be one of Euler, implicit"),
        ({"tolerance": 0}, "tolerance is 0.0: it must be"),
        ({"e": 0.1}, "restitution is 0.1: it must be a finite number at least 0.2"),
    ],
)  # fmt: skip
def test_bad_input(given, message):
    with pytest.raises(kd.InvalidInput, match=message):
        tune(**({"e": 0.7} | given))


def test_a_foot_slower_than_gravity_is_refused():
    with pytest.raises(
        kd.InvalidInput, match=r"approach speed is .*: it must be .* at least 0\.01"
    ):
        kd.tune_mujoco(POSTURE, 1e-4 * V, kd.Ball(), kd.Contact(ALONG, 0.7))


@pytest.mark.parametrize("name", ["", 'a"b', "a<b", "a\n", 3])
def test_names_that_mjcf_cannot_have(tuned, name):
    with pytest.raises(kd.InvalidInput, match="foot"):
        tuned.mjcf(name)


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(kd.InvalidInput, match=r'install it with pip install "kickdyn\[mjcf\]"$'):
        tune(0.7)
