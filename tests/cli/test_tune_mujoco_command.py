"""The command tune-mujoco: its table, its files, and what it refuses."""

import json

import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.tune_mujoco_command import tune_mujoco

mujoco = pytest.importorskip("mujoco")

KICK = """[leg]
model = "human"
[posture]
angles_deg = { hip = 40, knee = 30, ankle = -20 }
joint_velocity_rad_s = { hip = 8.25, knee = -18.15, ankle = 2.48 }
[contact]
attack_deg = 30
restitution = 0.7
contact_time_s = 0.010
"""
FOOT = '<worldbody><body><joint/><geom name="foot" size="0.1"/></body></worldbody>'


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "kick.toml"
    file.write_text(KICK)
    return str(file)


def run(*arguments):
    return CliRunner().invoke(tune_mujoco, [str(argument) for argument in arguments])


def test_the_files_are_models_of_mujoco(scene, tmp_path):
    ball, whole, numbers = (tmp_path / name for name in ("ball.xml", "whole.xml", "numbers.json"))
    ended = run(scene, "--timestep", 0.001, "--out", ball, "--scene-out", whole, "--json", numbers)
    assert (ended.exit_code, ended.stderr) == (0, "")
    assert f"wrote {ball}" in ended.stdout
    assert "error" in ended.stdout
    document = json.loads(numbers.read_text())
    assert document["within_tolerance"]
    assert document["mjcf"] == ball.read_text()
    robot = tmp_path / "robot.xml"
    robot.write_text(f'<mujoco>{FOOT}<include file="ball.xml"/></mujoco>')
    model = mujoco.MjModel.from_xml_path(str(robot))
    assert model.opt.timestep == document["timestep"] == 0.001
    assert list(model.geom("ball").solref) == document["solref"]
    leg = mujoco.MjModel.from_xml_path(str(whole))
    assert leg.nv == 3 + 6
    assert list(leg.pair_solref[0]) == document["solref"]


def test_the_ball_can_go_to_a_pipe(scene):
    ended = run(scene, "--out", "-")
    assert mujoco.MjModel.from_xml_string(ended.stdout).nv == 6


ROBOT = """<mujoco model="leg">
  <compiler inertiafromgeom="true"/>
  <default><geom type="capsule" size="0.05" margin="0.001" rgba="1 0 0 1"/></default>
  <option integrator="RK4" solver="PGS" timestep="0.003"/>
  <worldbody>
    <body name="thigh" pos="0 0 1">
      <joint name="hip" axis="0 -1 0"/>
      <geom fromto="0 0 0 0 0 -0.4"/>
      <body name="shank" pos="0 0 -0.4">
        <joint name="knee" axis="0 -1 0"/>
        <geom fromto="0 0 0 0 0 -0.3"/>
        <body name="foot" pos="0 0 -0.4">
          <geom name="shoe" type="box" size="0.05 0.05 0.12"/>
          <site name="toe" pos="0.05 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def kicked_in_bare_mujoco(folder, robot, v):
    """Velocity of the ball after a kick in the robot's own file, 5 m/s forward at the toe."""
    path = folder / "field.xml"
    path.write_text(robot.replace("</mujoco>", '<include file="ball.xml"/></mujoco>'))
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qvel[:2] = v
    mujoco.mj_integratePos(model, data.qpos, data.qvel, -0.001)
    while data.time < 0.020:
        mujoco.mj_step(model, data)
    fallen = -9.81 * 0.009  # after the contact
    return model, data.qvel[2:5] - (0, 0, fallen)


@pytest.mark.parametrize("friction", [0, 0.3])
def test_from_the_mjcf_of_a_robot_to_a_ball_that_bounces_as_asked(tmp_path, friction):
    file = tmp_path / "robot.xml"
    file.write_text(ROBOT)
    ended = run(scene_of(file, friction), "--out", tmp_path / "ball.xml")
    assert (ended.exit_code, ended.stderr) == (0, "")
    posture = kd.Leg.from_mjcf(file, "toe").posture([0, 0])
    v, contact = posture.joint_velocity((5, 0, 0)), kd.Contact((1, 0, 0), 0.75, friction)
    hit = kd.collide(posture, v, kd.Ball(), contact)
    model, velocity = kicked_in_bare_mujoco(tmp_path, ROBOT, v)
    assert velocity == pytest.approx(hit.ball_after.velocity, abs=0.03 * hit.ball_after.speed)
    assert model.body("ball").mass[0] == pytest.approx(kd.Ball().mass)
    assert model.body("ball").inertia == pytest.approx([kd.Ball().inertia] * 3)
    assert model.npair == (friction > 0)


def scene_of(file, friction=0.4):
    """Return a scene file beside an MJCF file: its toe at 5 m/s ahead."""
    scene = file.with_suffix(".toml")
    scene.write_text(
        f"""[leg]
file = "{file.name}"
frame = "toe"
[posture]
foot_velocity_m_s = [5, 0, 0]
[contact]
attack_deg = 0
restitution = 0.75
friction = {friction}
"""
    )
    return scene


SHOE = '<geom name="shoe" type="box" size="0.05 0.05 0.12"/>'


@pytest.mark.parametrize(
    ("shoes", "known"),
    [(SHOE + SHOE.replace("shoe", "heel"), "shoe, heel"), ("<geom/>", "none with a name")],
)
def test_of_several_geoms_the_command_asks_which(tmp_path, shoes, known):
    file = tmp_path / "robot.xml"
    file.write_text(ROBOT.replace(SHOE, shoes.replace("<geom/>", '<geom type="sphere"/>')))
    ended = run(scene_of(file))
    assert str(ended.exception) == (
        "which geom of 'toe' strikes the ball? MuJoCo needs its name for friction: name it with "
        f"--foot (there are {known}), or choose a contact without friction"
    )


def test_a_geom_that_the_robot_does_not_have_is_refused(tmp_path):
    file = tmp_path / "robot.xml"
    file.write_text(ROBOT)
    ended = run(scene_of(file), "--foot", "shoes")
    assert str(ended.exception).startswith("geom 'shoes' is unknown: did you mean 'shoe'?")


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["no_such_scene"], "neither a file nor a scene"),
        (["free_kick", "--timestep", 0], "timestep is 0.0"),
        (["free_kick", "--timestep", 0.006], "valid time steps are 2e-05 to 0.005 s"),
        (["free_kick", "--out", "no/such/folder"], "cannot be written"),
        (["free_kick", "--out", "-", "--json", "-"], "only one of them can be stdout"),
        (["free_kick", "--out", "no_file", "--json", "no_file"], "named for two outputs"),
    ],
)
def test_bad_input_is_refused(arguments, fault):
    ended = run(*arguments)
    assert isinstance(ended.exception, kd.InvalidInput), ended.output
    assert fault in str(ended.exception)


def test_another_law_is_refused(tmp_path):
    file = tmp_path / "kick.toml"
    file.write_text(KICK.replace("contact_time_s = 0.010", 'law = "stronge"'))
    ended = run(file)
    assert isinstance(ended.exception, kd.InvalidInput)
    assert str(ended.exception).startswith("law is 'stronge': a contact of MuJoCo is tuned for")
    text = KICK.replace("contact_time_s = 0.010", 'stiffness = "pressure"')
    file.write_text(f"{text}\n[ball]\npressure_pa = 80e3\n")
    ended = run(file)
    assert isinstance(ended.exception, kd.InvalidInput)
    assert str(ended.exception).startswith("stiffness is 'pressure': a contact of MuJoCo is tuned")
