"""`kickdyn tune-mujoco`: its files are models of MuJoCo in which the ball bounces as asked."""

import json

import pytest

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


@pytest.mark.slow
def test_the_files_are_models_of_mujoco_with_the_numbers_of_the_document(
    kickdyn, written, tmp_path
):
    written("kick.toml", KICK)
    files = "--out ball.xml --scene-out whole.xml --json numbers.json"
    kickdyn(f"tune-mujoco kick.toml --timestep 0.001 --integrator Euler --tolerance 0.05 {files}")
    document = json.loads((tmp_path / "numbers.json").read_text())
    assert document["within_tolerance"]
    assert (document["timestep"], document["integrator"]) == (0.001, "Euler")
    assert (document["tolerance"], document["wanted_contact_time"]) == (0.05, 0.01)
    assert document["mjcf"] == (tmp_path / "ball.xml").read_text()
    robot = written("robot.xml", f'<mujoco>{FOOT}<include file="ball.xml"/></mujoco>')
    model = mujoco.MjModel.from_xml_path(str(robot))
    assert model.opt.timestep == 0.001
    assert list(model.geom("ball").solref) == document["solref"]
    whole = mujoco.MjModel.from_xml_path(str(tmp_path / "whole.xml"))
    assert whole.nv == 3 + 6
    assert list(whole.pair_solref[0]) == document["solref"]


ROBOT = """<mujoco><worldbody><body name="thigh" pos="0 0 1"><joint name="hip" axis="0 -1 0"/>
<geom type="capsule" size="0.05" fromto="0 0 0 0 0 -0.4"/><body name="foot" pos="0 0 -0.4">
<joint name="knee" axis="0 -1 0"/><geom name="shoe" type="box" size="0.05 0.05 0.1" pos="0 0 -0.3"/>
<site name="toe" pos="0.05 0 -0.3"/></body></body></worldbody></mujoco>"""
TOE_KICK = (
    '[leg]\nfile = "robot.xml"\nframe = "toe"\n[posture]\nfoot_velocity_m_s = [5, 0, 0]\n'
    "[contact]\nattack_deg = 0\nrestitution = 0.75\nfriction = 0.4\n"
)
SHOE = '<geom name="shoe" type="box" size="0.05 0.05 0.1" pos="0 0 -0.3"/>'


@pytest.mark.parametrize(("shoes", "line", "words"), [
    (SHOE + SHOE.replace("shoe", "heel"), "", ("'toe'", "--foot", "shoe, heel")),
    ('<geom size="0.1"/>', "", ("'toe'", "--foot", "none with a name")),
    (SHOE, "--foot shoes", ("'shoes'", "'shoe'")),
], ids=["two geoms", "a geom without a name", "an unknown geom"])  # fmt: skip
def test_the_geom_that_strikes_must_be_clear(shoes, line, words, kickdyn, written):
    written("robot.xml", ROBOT.replace(SHOE, shoes))
    written("kick.toml", TOE_KICK)
    fault = kickdyn(f"tune-mujoco kick.toml {line}", code=2).err
    assert fault.count("\n") == 1
    assert all(word in fault for word in words), fault
