"""Scene files: values arrive where they belong, and all faults come at once."""

import math

import numpy as np
import pytest
from tolerances import agrees, closed_form

import kickdyn as kd
from kickdyn.core.files import shipped

SCENES = sorted(shipped("scenes").glob("*.toml"))
SMALL = """
[leg]
model = "human"
[posture]
angles_deg = { hip = 5, knee = 10, ankle = -5 }
foot_velocity_m_s = [2, 0, 1]
[contact]
attack_deg = 30
restitution = 0.8
"""
HINGES = """<mujoco><worldbody><body name="thigh"><joint name="hip" axis="0 -1 0"/>
<geom size="0.1"/><body pos="0 0 -1"><joint name="knee" {} /><geom size="0.1"/>
<site name="toe" pos="0.2 0 0"/></body></body></worldbody></mujoco>"""


@pytest.fixture
def read(tmp_path):
    """Read a scene from the small file with edits and further text."""

    def reading(*edits, more="", text=SMALL):
        for old, new in edits:
            assert old in text
            text = text.replace(old, new, 1)
        path = tmp_path / "scene.toml"
        path.write_text(text + more, encoding="utf-8")
        return kd.load_scene(path)

    return reading


@pytest.fixture
def faults(read):
    def listed(*edits, **text):
        with pytest.raises(kd.SceneError) as refused:
            read(*edits, **text)
        assert all(line.isprintable() and len(line) < 350 for line in refused.value.faults)
        return refused.value.faults

    return listed


def test_shipped_scenes_load_by_name_and_files_come_before_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(SCENES) >= 5
    for file in SCENES:
        assert kd.load_scene(file.stem).name == kd.load_scene(file).name
    (tmp_path / "volley").write_text(SMALL)
    assert kd.load_scene("volley").plane is None
    for name, word in (("freekick", "volley"), ("here/volley", "no such file")):
        with pytest.raises(kd.SceneError, match=word):
            kd.load_scene(name)


def test_effects_that_are_not_named_are_not_modelled(read):
    scene = read()
    assert (scene.air, scene.ground, scene.plane, scene.law) == (None, None, None, "newton")
    assert not scene.incoming.velocity.any()
    assert (scene.contact.friction, scene.name, dict(scene.uncertainty)) == (0.0, "scene", {})
    air = read(more="[air]\n").air
    assert (air.drag, air.lift, air.torque, air.buoyancy) == (None, None, None, False)
    assert not np.any(air.wind)


TABLES = """
ball = { model = "paper", radius_m = 0.11, velocity_m_s = [0, -1, 0], spin_rad_s = [1, 2, 3] }
plane = { point_m = [11, 0, 0], normal = [-1, 0, 0], reached_by = "back" }
wall = { distance_m = 5, height_m = 1.9 }
ground = { surface = "turf" }
uncertainty = { angles_deg = 2, restitution = 0.05 }
[air]
model = "paper"
drag = "jabulani"
lift = -0.1
torque = 0
wind_m_s = [1, 2, 0]
buoyancy = true
"""


def test_values_arrive_in_their_units(read):
    contact = "side_deg = 90\nfriction = 0.3\noffset_m = [0, 0, 0.01]\nlaw = 'stronge'\n"
    scene = read(text=TABLES + SMALL, more=contact)
    np.testing.assert_allclose(scene.q, np.radians([5, 10, -5]))
    agrees(scene.posture.point_velocity(scene.v), [2, 0, 1], closed_form(10))
    right = [0, math.cos(math.radians(30)), 0.5]
    agrees(scene.contact.normal, right, closed_form())
    assert (scene.contact.friction, scene.law) == (0.3, "stronge")
    assert scene.contact.offset.tolist() == [0, 0, 0.01]
    assert (scene.ball.mass, scene.ball.radius) == (kd.Ball.paper().mass, 0.11)
    assert scene.incoming == kd.BallState(velocity=(0, -1, 0), spin=(1, 2, 3))
    assert (scene.air.density, scene.air.drag.name, scene.air.buoyancy) == (1.22, "jabulani", True)
    assert (scene.air.lift.value, scene.air.torque.value) == (-0.1, 0.0)
    assert scene.air.wind.tolist() == [1, 2, 0]
    assert scene.ground.surface.name == "turf"
    assert scene.ground.height == pytest.approx(scene.ball_position[2] - 0.11)
    assert (scene.plane.point.tolist(), scene.plane.reached_by) == ([11, 0, 0], "back")
    assert scene.wall == kd.Wall(5, 1.9)
    assert dict(scene.uncertainty) == pytest.approx({"q": math.radians(2), "restitution": 0.05})
    standard = read(more="[air]\naltitude_m = 1500\ntemperature_c = 10\n").air
    assert standard.density == kd.Air.at(1500, 10).density
    rates = "joint_velocity_rad_s = { knee = 3 }"
    assert read(("foot_velocity_m_s = [2, 0, 1]", rates)).v.tolist() == [0, 3, 0]


@pytest.mark.parametrize(
    ("slide", "kind"), [(True, 'type="slide" axis="0 0 -1"'), (False, 'axis="0 1 0"')])  # fmt: skip
def test_a_file_is_looked_for_from_the_folder_of_the_scene(read, tmp_path, slide, kind):
    (tmp_path / "my.xml").write_text(HINGES.format(kind))
    angles = "angles_deg = { hip = 90 }\npositions_m = { knee = 0.3 }"
    angles = angles if slide else "angles_deg = { hip = 90, knee = 0 }"
    here = "angles_deg = { hip = 5, knee = 10, ankle = -5 }", angles
    scene = read(('model = "human"', 'file = "my.xml"'), here, ("[2, 0, 1]", "[0, 0, 1]"))
    np.testing.assert_allclose(scene.q, [np.pi / 2, 0.3 * slide])
    reach = 1.0 + 0.3 * slide  # along x; the toe is 0.2 m above
    agrees(scene.posture.contact_point, [reach, 0, 0.2], closed_form(10))


@pytest.mark.parametrize(("contact", "options"), [
    ("restitution = 'inflated'\nstiffness = 'inflated'", {}),
    ("restitution = 0.7\nstiffness = 'pressure'", {"stiffness": "pressure"}),
    ("restitution = 0.7\ncontact_time_s = 0.008", {"contact_time": 0.008}),
], ids=["inflated", "pressure", "time"])  # fmt: skip
def test_a_contact_that_takes_time_is_collide(read, contact, options):
    more = "[ball]\npressure_pa = 80e3\nshell_share = 0.97\n"
    scene = read(("restitution = 0.8", contact), more=more)
    answer = kd.simulate(scene, None)
    ball = kd.Ball(pressure=80e3, shell_share=0.97)
    kick = scene.posture, scene.v, ball, scene.contact
    right = kd.collide(*kick, tol=answer.impact.tol, **options)
    assert answer.impact.impulse.tolist() == right.impulse.tolist()
    assert answer.impact.force_model == right.force_model


def test_supports_locked_stiff_and_geared_joints(read):
    leg = """robot = "bolt"
        frame = "FR_FOOT:heel"
        base = "floating"
        supports = [{ frame = "FL_FOOT", friction = 0.6, point = true }]"""
    angles = ("angles_deg = { hip = 5, knee = 10, ankle = -5 }", "")
    scene = read(('model = "human"', leg), angles, ("[2, 0, 1]", "[-2, 0, 0.5]"))
    assert scene.leg.supports == (kd.Support("FL_FOOT", friction=0.6, point=True),)
    assert scene.leg.frame == "heel"
    more = 'stiff_joints = ["knee"]\nlocked = { ankle = -5 }\narmature_kg_m2 = { hip = 0.1 }'
    scene = read((HUMAN, f"{HUMAN}\n{more}"), (", ankle = -5 }\nfoot", " }\nfoot"))
    assert scene.leg.joint_names == ("hip", "knee")
    assert scene.leg.model.armature.tolist() == [0.1, 0]
    agrees(scene.posture.contact_point, read().posture.contact_point, closed_form())
    impact = kd.simulate(scene).impact
    assert impact.v_after[1] == pytest.approx(impact.v_before[1])


FAULTY = SMALL.replace("restitution = 0.8", "restitution = 1.8\nfricton = 0.4")
JOINTS = """
[leg]
model = "human"
armature_kg_m2 = { neck = 1 }
[posture]
angles_deg = { hipp = 5 }
joint_velocity_rad_s = { hi = 3 }
[contact]
attack_deg = 0
restitution = 0.8
"""


@pytest.mark.parametrize(("text", "words"), [
    (f"nmae = 1\n{FAULTY}[ball]\nmass_kg = -1\n[grund]\n[plane]\nnormal = [0, 0, 0]\n",
     ["nmae", "contact.restitution", "friction?", "ball.mass_kg", "ground?",
      "plane.point_m is missing", "plane.normal"]),
    (JOINTS, ["'neck'", "'hipp'", "'hi'"]), ("", ["[leg]", "[posture]", "[contact]"]),
], ids=["tables", "joints", "empty"])  # fmt: skip
def test_all_faults_come_at_once_a_line_each(faults, text, words):
    lines = faults(text=text)
    assert len(lines) == len(words), lines
    for word in words:
        assert sum(word in line for line in lines) == 1, (word, lines)


HUMAN, E = '"human"', "restitution = 0.8"


@pytest.mark.parametrize(("old", "new", "word"), [
    (HUMAN, '"human"\nrobot = "g1"', "model and robot"),
    ('model = "human"', 'file = "no.urdf"', "no.urdf"), (HUMAN, '"human"\nframe = "heel"', "heel"),
    (HUMAN, '"humn"', "human?"), (HUMAN, "\"human\"\nsupports = 'toe'", "leg.supports"),
    (HUMAN, '"human"\nloops = ["toe"]', "loop is 'toe'"),
    ("[2, 0, 1]", "[0, 1, 0]", "out of reach"),
    ("attack_deg = 30", "normal = [0, 0, 0]", "contact.normal"),
    ("attack_deg = 30", "normal = [1, 0, 0]\nside_deg = 3", "without attack_deg"),
    (E, f"{E}\ncontact_time_s = 0.01\nlaw = 'paper'", "law is 'paper'"),
    (E, f"{E}\nstiffness = 'inflated'", "restitution"),
    (E, f"{E}\n[ground]\nheight_m = 5", "ground.height_m is 5"),
    ("[leg]", 'name = "\\u001b[31mred"\n[leg]', "printable"), ("[leg]", "[leg", "TOML"),
], ids=lambda text: repr(text[-40:]))  # fmt: skip
def test_a_fault_is_one_line_that_names_it(faults, old, new, word):
    lines = faults((old, new))
    assert len(lines) == 1, lines
    assert word in lines[0]
