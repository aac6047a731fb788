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


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["no_such_scene"], "neither a file nor a scene"),
        (["free_kick", "--timestep", 0], "timestep is 0.0"),
        (["free_kick", "--timestep", 0.006], "it must be at most 0.005 s"),
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
