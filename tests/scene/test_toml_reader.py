"""Scene files: every example loads, every fault is told, all at once."""

import re
from pathlib import Path

import numpy as np
import pytest
from chains import constraint_speed

import kickdyn as kd
from kickdyn.core.files import MAX_TOML_BYTES
from kickdyn.robot.urdf_file import shipped_urdf

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted((ROOT / "scenes").glob("*.toml"))

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


def test_those_of_kickdyn_load_by_name_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for file in SCENES:
        assert kd.load_scene(file.stem).name == kd.load_scene(file).name
    with pytest.raises(kd.SceneError, match=r"neither a file nor a scene.*pass_to_runner, robocup"):
        kd.load_scene("freekick")


def test_a_file_comes_before_a_name(tmp_path, monkeypatch):
    (tmp_path / "volley").write_text(SMALL, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert kd.load_scene("volley").plane is None
    assert kd.load_scene("volley").ground is None
    with pytest.raises(kd.SceneError, match="there is no such file"):
        kd.load_scene("here/volley")


@pytest.fixture
def read(tmp_path):
    def reading(text):
        path = tmp_path / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return kd.load_scene(path)

    return reading


@pytest.fixture
def faults(read):
    def found(text):
        with pytest.raises(kd.SceneError) as refused:
            read(text)
        return refused.value.faults

    return found


def test_there_are_examples():
    assert len(SCENES) >= 5


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_examples_load_and_strike(path):
    scene = kd.load_scene(path)
    motion = {"ball_velocity": scene.incoming.velocity, "ball_spin": scene.incoming.spin}
    law = "newton" if scene.is_compliant else scene.law
    hit = kd.strike(scene.posture, scene.v, scene.ball, scene.contact, law, **motion)
    assert hit.restitution_residual < 1e-12
    np.testing.assert_array_equal(hit.ball_after.position, scene.ball_position)
    assert constraint_speed(hit) < 1e-12


def test_what_is_not_named_is_not_there(read):
    scene = read(SMALL)
    assert (scene.air, scene.ground, scene.plane, scene.law) == (None, None, None, "newton")
    assert not scene.incoming.velocity.any()
    assert scene.contact.friction == 0.0
    assert scene.name == "scene"
    assert not scene.uncertainty
    air = read(SMALL + "[air]\n").air
    assert (air.drag, air.lift, air.torque, air.buoyancy) == (None, None, None, False)
    assert not np.any(air.wind)


def test_values_arrive(read):
    scene = read(
        SMALL
        + "side_deg = 90\nfriction = 0.3\noffset_m = [0, 0, 0.01]\nlaw = 'stronge'\n"
        + "[ball]\nmodel = 'paper'\nradius_m = 0.11\nvelocity_m_s = [0, -1, 0]\n"
        + "[air]\nmodel = 'paper'\ndrag = 'jabulani'\nwind_m_s = [1, 2, 0]\n"
        + "[plane]\npoint_m = [11, 0, 0]\nnormal = [-1, 0, 0]\nreached_by = 'back'\n"
        + "[ground]\nsurface = 'turf'\n[uncertainty]\nangles_deg = 2\nrestitution = 0.05\n"
    )
    np.testing.assert_allclose(scene.q, np.radians([5, 10, -5]))
    np.testing.assert_allclose(scene.posture.point_velocity(scene.v), [2, 0, 1], atol=1e-12)
    expected = [0, np.cos(np.radians(30)), 0.5]
    np.testing.assert_allclose(scene.contact.normal, expected, atol=1e-15)
    assert (scene.ball.mass, scene.ball.radius) == (0.45, 0.11)
    assert (scene.air.density, scene.air.drag.name) == (1.22, "jabulani")
    assert scene.ground.surface.name == "turf"
    assert scene.ground.height == pytest.approx(scene.ball_position[2] - 0.11, abs=1e-15)
    assert scene.plane.reached_by == "back"
    assert dict(scene.uncertainty) == {"q": pytest.approx(np.radians(2)), "restitution": 0.05}
    assert scene.law == "stronge"


def test_a_coefficient_may_be_a_number(read, faults):
    air = read(SMALL + "[air]\ndrag = 0.25\nlift = -0.1\ntorque = 0\n").air
    assert [model.value for model in (air.drag, air.lift, air.torque)] == [0.25, -0.1, 0.0]
    assert faults(SMALL + "[air]\ndrag = -0.25\nlift = nan\ntorque = true\n") == (
        "air.drag: drag coefficient is -0.25: it must be a finite number at least 0 and at most "
        "1000",
        "air.lift: lift coefficient is nan: it must be a finite number at least -1000 and at most "
        "1000",
        "air.torque: torque model True is unknown: choose smits-smith, tavares, or pass a number "
        "or a function of (reynolds, spin_parameter)",
    )


def test_a_file_is_looked_for_from_the_scenes_folder(read, tmp_path, good_urdf):
    (tmp_path / "my.urdf").write_text(good_urdf)
    text = SMALL.replace('model = "human"', 'file = "my.urdf"').replace(", ankle = -5", "")
    assert read(text).leg.joint_names == ("hip", "knee")


def test_a_file_may_be_an_mjcf(read, tmp_path):
    (tmp_path / "my.xml").write_text(
        '<mujoco><worldbody><body name="thigh"><joint name="hip" axis="0 -1 0"/><geom size="0.1"/>'
        '<body pos="0 0 -1"><joint name="knee" axis="0 1 0"/><geom size="0.1"/>'
        '<site name="toe" pos="0.2 0 -1"/></body>'
        "</body></worldbody></mujoco>"
    )
    text = SMALL.replace('model = "human"', 'file = "my.xml"').replace(", ankle = -5", "")
    assert read(text).leg.joint_names == ("hip", "knee")


def test_the_loops_of_an_mjcf_stay_closed(read, looped_mjcf):
    text = SMALL.replace('model = "human"', f'file = "{looped_mjcf}"\nframe = "c"')
    text = text.replace(
        "angles_deg = { hip = 5, knee = 10, ankle = -5 }", "angles_deg = { ja = 5 }"
    )
    rates = "joint_velocity_rad_s = { ja = -1, jb = -1, jc = 1 }"
    scene = read(re.sub("foot_velocity_m_s = .*", rates, text))
    assert scene.leg.loops == (("bar_1", "bar_2"),)
    assert constraint_speed(kd.simulate(scene, None).impact) < 1e-12


def test_positions_of_prismatic_joints_are_in_metres(read, tmp_path):
    (tmp_path / "my.xml").write_text(
        '<mujoco><worldbody><body name="thigh"><joint name="hip" axis="0 -1 0"/><geom size="0.1"/>'
        '<body pos="0 0 -1"><joint name="knee" type="slide" axis="0 0 -1"/><geom size="0.1"/>'
        '<site name="toe" pos="0.2 0 0"/></body></body></worldbody></mujoco>'
    )
    text = SMALL.replace('model = "human"', 'file = "my.xml"')
    posture = "angles_deg = { hip = 90 }\npositions_m = { knee = 0.3 }"
    text = text.replace("angles_deg = { hip = 5, knee = 10, ankle = -5 }", posture)
    scene = read(text.replace("[2, 0, 1]", "[0, 0, 1]"))
    np.testing.assert_allclose(scene.q, [np.pi / 2, 0.3])
    np.testing.assert_allclose(scene.posture.contact_point, [1.3, 0, 0.2], atol=1e-12)


def test_package_dirs_are_looked_for_from_the_scenes_folder(read, faults, tmp_path, good_urdf):
    (tmp_path / "my.urdf").write_text(good_urdf)
    (tmp_path / "share").mkdir()
    text = SMALL.replace(", ankle = -5", "")
    own = 'file = "my.urdf"\npackage_dirs = ["share"]'
    leg = read(text.replace('model = "human"', own)).leg
    assert leg.file.package_dirs == (tmp_path / "share",)
    (line,) = faults(text.replace('model = "human"', own.replace("share", "gone")))
    assert "leg: package_dirs names" in line
    assert "there is no such folder" in line
    (line,) = faults(text.replace('model = "human"', 'model = "human"\npackage_dirs = ["share"]'))
    assert "leg.package_dirs is given without file" in line


def test_all_faults_at_once_one_line_each(faults):
    lines = faults(
        "nmae = 'x'\n"
        + SMALL.replace("restitution = 0.8", "restitution = 1.8\nfricton = 0.4")
        + "[ball]\nmass_kg = -1\nradius_m = nan\n[air]\ndrag = 'brazucca'\nwind_m_s = [1, 2]\n"
        + "[grund]\n[plane]\nnormal = [0, 0, 0]\n[uncertainty]\nfriction = true\n"
    )
    expected = [
        "nmae",
        "contact.restitution: restitution is 1.8: it must be a finite number at least 0",
        "contact.fricton is unknown: did you mean friction?",
        "ball.mass_kg: ball mass is -1.0: it must be a finite number above 0 [kg]",
        "ball.radius_m: ball radius is nan",
        "air.drag: drag model 'brazucca' is unknown: choose stokes",
        "air.wind_m_s: wind has shape (2,): it must be (3,)",
        "section [grund] is unknown: did you mean ground?",
        "plane.point_m is missing",
        "plane.normal: normal of the plane is [0.0, 0.0, 0.0]",
        "uncertainty.friction: standard deviation is True",
    ]
    assert len(lines) == len(expected)
    for start in expected:
        assert sum(start in line for line in lines) == 1, start
    assert not any("\n" in line for line in lines)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('model = "human"', 'model = "human"\nrobot = "g1"', "leg has model and robot"),
        ('model = "human"', 'file = "no.urdf"', "leg: "),
        ('model = "human"', 'model = "human"\nframe = "heel"', "leg: "),
        ("hip = 5", "hipp = 5", "posture: joint 'hipp' is unknown"),
        ("foot_velocity_m_s = [2, 0, 1]", "", "posture has none of foot_velocity_m_s"),
        ("foot_velocity_m_s = [2, 0, 1]", "foot_velocity_m_s = [0, 1, 0]", "out of reach"),
        ("foot_velocity_m_s = [2, 0, 1]", "joint_velocity_rad_s = { toe = 1 }", "'toe' is unknown"),
        (
            "attack_deg = 30",
            "normal = [0, 0, 0]",
            "contact.normal: contact normal is [0.0, 0.0, 0.0]",
        ),
        ("attack_deg = 30", "normal = [1, 0, 0]\nside_deg = 3", "without attack_deg"),
        ("angles_deg = { hip = 5, knee = 10, ankle = -5 }", "angles_deg = 5", "must be a table"),
        (
            "hip = 5, knee = 10, ankle = -5 }",
            "hip = 5 }\npositions_m = { knee = 1 }",
            "moves in rad",
        ),
        (
            "[leg]",
            "[air]\nmodel = 'paper'\naltitude_m = 5\n[leg]",
            "air: the air of model 'paper' is fixed: leave out the model, or altitude",
        ),
    ],
)
def test_faults_are_named(faults, old, new, said):
    assert old in SMALL
    lines = faults(SMALL.replace(old, new))
    assert len(lines) == 1, lines
    assert said in lines[0]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "[leg]\nmodel = 'human'\narmature_kg_m2 = { hip = -1, knee = nan }\n"
            "[contact]\nnormal = [0, 0, 0]\nrestitution = 2\n"
            "[air]\nmodel = 'paper'\naltitude_m = 1e5\ntemperature_c = -99\npressure_pa = 3\n"
            "[plane]\npoint_m = [0, 0, 0]\nnormal = [0, 0, 0]\nreached_by = 'side'\n",
            [
                "leg.armature_kg_m2: hip is -1.0",
                "leg.armature_kg_m2: knee is nan",
                "contact.normal",
                "contact.restitution",
                "air.altitude_m",
                "air.temperature_c",
                "air.pressure_pa",
                "plane.normal",
                "plane.reached_by",
                "[posture] is missing",
            ],
        ),
        (
            "[leg]\nmodel = 'human'\narmature_kg_m2 = { neck = 1, nope = 2 }\n"
            "[posture]\nangles_deg = { hipp = 5, kne = 10 }\n"
            "joint_velocity_rad_s = { hi = 3, ank = 4 }\n"
            "[contact]\nattack_deg = 0\nrestitution = 0.8\n",
            ["'neck'", "'nope'", "'hipp'", "'kne'", "'hi'", "'ank'"],
        ),
    ],
    ids=["of form", "of joints"],
)
def test_faults_come_all_at_once(faults, text, expected):
    lines = faults(text)
    assert len(lines) == len(expected), lines
    for start in expected:
        assert sum(start in line for line in lines) == 1, start


@pytest.mark.parametrize(
    ("restitution", "said"),
    [
        ("0.8\nlaw = 'paper'", "contact: law is 'paper': a contact that takes time has no impact"),
        ("0", "restitution is 0: in a contact that takes time it must be at least 0.01"),
    ],
)
def test_a_contact_that_takes_time_has_no_law_and_needs_restitution(faults, restitution, said):
    changed = f"restitution = {restitution}\ncontact_time_s = 0.01"
    (line,) = faults(SMALL.replace("restitution = 0.8", changed))
    assert line.startswith(said)


def test_a_contact_time_in_milliseconds_is_refused(faults):
    (line,) = faults(SMALL.replace("restitution = 0.8", "restitution = 0.8\ncontact_time_s = 10"))
    assert "contact.contact_time_s: contact time is 10.0: it must be a finite number" in line
    assert "at most 0.1 [s]" in line


def test_a_contact_has_the_force_of_an_inflated_ball(read):
    changed = SMALL.replace("restitution = 0.8", "restitution = 'inflated'\nstiffness = 'inflated'")
    scene = read(changed + "[ball]\npressure_pa = 80e3\nshell_share = 0.97\n")
    ball, answer = kd.Ball(pressure=80e3, shell_share=0.97), kd.simulate(scene)
    expected = kd.collide(scene.posture, scene.v, ball, scene.contact, tol=answer.impact.tol)
    assert answer.impact.impulse.tolist() == expected.impulse.tolist()
    assert "of an inflated ball" in str(scene)
    assert kd.simulate(scene, tolerance=0.01).impact.force_model == expected.force_model


def test_a_compliant_contact_has_the_stiffness_of_the_balls_pressure(read):
    changed = SMALL.replace("restitution = 0.8", "restitution = 0.7\nstiffness = 'pressure'")
    changed += "[ball]\npressure_pa = 80e3\n"
    scene = read(changed)
    answer = kd.simulate(scene, None)
    ball = kd.Ball(pressure=80e3)
    same = kd.collide(
        scene.posture, scene.v, ball, scene.contact, stiffness="pressure", tol=answer.impact.tol,
    )  # fmt: skip
    assert answer.impact.impulse.tolist() == same.impulse.tolist()
    assert answer.impact.force_model == same.force_model
    assert "from the pressure" in str(scene)
    instant = kd.simulate(scene.as_instant(), None)
    assert instant.impact.impulse.tolist() != same.impulse.tolist()


@pytest.mark.parametrize(
    ("contact", "ball", "line"),
    [
        ("stiffness = 'pressure'\ncontact_time_s = 0.01", "pressure_pa = 8e4", "give only one"),
        ("stiffness = 'pressure'", "", "ball pressure is None: its stiffness needs it"),
        ("stiffness = 'air'", "", "contact.stiffness: 'air' is unknown: choose pressure, inflated"),
        ("stiffness = 'pressure'\nlaw = 'paper'", "pressure_pa = 8e4", "has no impact law"),
        ("stiffness = 'inflated'", "pressure_pa = 8e4", "it needs a contact with the restitution"),
        ("", "shell_share = 2", "shell share is 2"),
        (
            "",
            "pressure_pa = 0.8",
            "ball.pressure_pa: ball pressure is 0.8: it must be a finite number",
        ),
    ],
)
def test_a_compliant_contact_is_refused(faults, contact, ball, line):
    text = SMALL.replace("restitution = 0.8", f"restitution = 0.8\n{contact}")
    (found,) = faults(f"{text}\n[ball]\n{ball}\n")
    assert line in found


@pytest.mark.parametrize(
    ("text", "value", "e"),
    [
        ("[[1, 0.8], [3, 0.6]]", ((1.0, 0.8), (3.0, 0.6)), 0.8 - 0.1 * (3**0.5 - 0.5)),
        ('"peacock-ball"', "peacock-ball", 0.729),
        ('"inflated"', "inflated", 0.8821),
    ],
)
def test_a_restitution_over_speed_is_read_and_used(read, text, value, e):
    changed = SMALL.replace("restitution = 0.8", f"restitution = {text}")
    changed = "[ball]\npressure_pa = 80e3\n" + changed
    scene = read(changed)
    assert scene.contact.restitution == value
    for law in ("", "contact_time_s = 0.01\n"):
        answer = kd.simulate(read(changed + law), 1e-3 if law else 0.05)
        assert answer.impact.contact.restitution == value
        assert answer.impact.restitution == pytest.approx(e, abs=1e-4 if e == 0.8821 else 1e-6)
        outside = value == "peacock-ball"
        assert any("m/s: 0.729 is used" in line for line in answer.warnings) == outside
        assert f"restitution {answer.impact.restitution:.4g}, from " in str(answer)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[[3, 0.8], [1, 0.6]]", "contact.restitution: restitution's speeds are [3.0, 1.0] m/s"),
        ("[[1, 0.8], [3, 1.6]]", "contact.restitution: restitution at 3 m/s is 1.6: it must be"),
        ('"peacok"', "contact.restitution: restitution is 'peacok': it must be"),
        ("true", "contact.restitution: restitution is True: it must be"),
        (
            "[[1, 0.8], [3, 0.0]]\ncontact_time_s = 0.01",
            "restitution is 0: in a contact that takes",
        ),
    ],
)
def test_a_restitution_over_speed_is_refused(faults, text, line):
    (found,) = faults(SMALL.replace("restitution = 0.8", f"restitution = {text}"))
    assert line in found


def test_what_a_terminal_would_obey_is_refused_or_escaped(faults):
    assert "printable" in faults('name = "\\u001b[31mred"\n' + SMALL)[0]
    (line,) = faults(SMALL + '"\\u001b[31mred" = 1\n')
    assert "\\x1b[31mred" in line
    assert line.isprintable()


@pytest.mark.parametrize("digits", [400, 5001])
def test_endless_integers_are_not_echoed(faults, digits):
    (line,) = faults(SMALL + f"friction = {'7' * digits}\n")
    assert len(line) < 300


def test_true_is_no_number_of_a_vector(faults):
    (line,) = faults(SMALL.replace("attack_deg = 30", "normal = [true, 0, 1]"))
    assert "must contain real numbers" in line


def test_missing_sections(faults):
    assert [line.split()[1] for line in faults("")] == ["[leg]", "[posture]", "[contact]"]
    assert any("it must be a section" in line for line in faults("leg = 3\n"))


def test_what_is_no_scene(tmp_path, faults):
    assert "is not TOML" in faults("[leg")[0]
    with pytest.raises(kd.SceneError, match="there is no such file"):
        kd.load_scene(tmp_path / "none.toml")
    with pytest.raises(kd.SceneError, match="not a regular file"):
        kd.load_scene(tmp_path)
    with pytest.raises(kd.InvalidInput, match="must be a str or a Path"):
        kd.load_scene(3)
    large = tmp_path / "large.toml"
    large.write_bytes(b"#" * (MAX_TOML_BYTES + 1))
    with pytest.raises(kd.SceneError, match="are read"):
        kd.load_scene(large)
    large.write_bytes(b"name = '\xff'")
    with pytest.raises(kd.SceneError, match="UTF-8"):
        kd.load_scene(large)


def test_a_key_at_the_top_is_not_called_a_section(faults):
    assert faults("mass_kg = 1\n" + SMALL)[0].startswith("mass_kg is unknown")


def test_a_file_name_that_a_terminal_would_obey_is_escaped(tmp_path):
    path = tmp_path / "a\x1b[31m.toml"
    path.write_text("[leg")
    with pytest.raises(kd.SceneError) as refused:
        kd.load_scene(path)
    assert refused.value.source.isprintable()


@pytest.mark.parametrize("key", ["a." * 49_000 + "a = 1", "[" + "a." * 49_000 + "a]"])
def test_deep_keys_are_refused_before_they_are_parsed(faults, monkeypatch, key):
    def parse(text):
        raise AssertionError(f"{len(text)} characters were parsed")

    monkeypatch.setattr("tomllib.loads", parse)
    assert faults(SMALL + key) == ("has more than 1000 dots in a line",)


def test_a_long_key_is_cut(faults):
    (line,) = faults(SMALL + "restitution" * 5000 + " = 1")
    assert len(line) < 300


def test_a_hundred_faults_are_listed(faults):
    unknown = faults(SMALL + "\n".join(f"k{i} = 1" for i in range(5000)))
    assert (len(unknown), unknown[-1]) == (101, "and 4900 more faults")
    joints = ", ".join(f"h{i} = 1" for i in range(150))
    of_joints = faults(SMALL.replace("hip = 5", joints))
    assert (len(of_joints), of_joints[-1]) == (101, "and 50 more faults")


def test_supports_are_few(faults):
    supports = ", ".join(f"'h{i}'" for i in range(101))
    (line,) = faults(SMALL.replace('"human"', f'"human"\nsupports = [{supports}]'))
    assert "at most 100" in line


def test_a_support_is_a_name_or_a_table(tmp_path, faults):
    text = """
        [leg]
        robot = "bolt"
        frame = "FR_FOOT:heel"
        base = "floating"
        supports = [{ frame = "FL_FOOT", friction = 0.6, point = true }]
        [posture]
        foot_velocity_m_s = [-2, 0, 0.5]
        [contact]
        normal = [-1, 0, 0.1]
        restitution = 0.8
    """
    (tmp_path / "scene.toml").write_text(text)
    leg = kd.load_scene(tmp_path / "scene.toml").leg
    assert leg.supports == (kd.Support("FL_FOOT", friction=0.6, point=True),)
    assert leg.frame == "heel"
    (line,) = faults(SMALL.replace('"human"', '"human"\nsupports = [{ sole = [] }]'))
    assert line.startswith("leg: support has sole: it needs frame")


def test_loops_are_closed_by_the_joints_that_are_not_named(tmp_path):
    (tmp_path / "leg_fourbar.urdf").write_text(shipped_urdf("leg_fourbar.urdf").read_text())
    text = """
        [leg]
        file = "leg_fourbar.urdf"
        drives = "none"
        loops = [["shank_pin", "rocker_b_tip"]]
        [posture]
        angles_deg = {rocker_b = 40, hip = 10}
        foot_velocity_m_s = [2, 0, 0.5]
        [contact]
        normal = [1, 0, 0.3]
        restitution = 0.8
    """
    (tmp_path / "scene.toml").write_text(text)
    scene = kd.load_scene(tmp_path / "scene.toml")
    leg, q = scene.leg, scene.q
    assert leg.constraints.loops == (("shank_pin", "rocker_b_tip"),)
    assert leg.angles_deg(q)["rocker_b"] == pytest.approx(40, rel=1e-12)
    leg.posture(q).check_velocity(scene.v)
    assert constraint_speed(kd.simulate(scene).impact) <= 1e-12
    assert kd.simulate(scene).warnings == ()


@pytest.mark.parametrize(
    ("loops", "said"),
    [
        ("['toe']", "leg: loop is 'toe': it must be a pair of frames' names"),
        ("[['toe', 'foot', 'hip']]", "leg: loop is .* it must be a pair of frames' names"),
        ("[['toe', 3]]", "leg: frame 3 is unknown"),
        ("'toe'", "leg.loops: 'toe': it must be a list"),
        ("[['toe', 'foot']]", "leg: loop toe - foot joins a body to itself"),
        ("[['toe', 'tow']]", "leg: frame 'tow' is unknown"),
        ("[['toe', 'base']]", "posture: loop toe - base stays open"),
    ],
)
def test_bad_loops_are_refused(faults, loops, said):
    (line,) = faults(SMALL.replace('"human"', f'"human"\nloops = {loops}'))
    assert re.search(said, line)


@pytest.mark.parametrize("key", ["supports", "stiff_joints"])
@pytest.mark.parametrize("names", ["[3]", "'toe'", "[['toe']]"])
def test_lists_of_names_hold_names(faults, key, names):
    (line,) = faults(SMALL.replace('"human"', f'"human"\n{key} = {names}'))
    assert line.startswith("leg")


def test_stiff_joints(tmp_path, faults):
    file = tmp_path / "scene.toml"
    file.write_text(SMALL.replace('"human"', '"human"\nstiff_joints = ["ankle"]'))
    scene = kd.load_scene(file)
    impact = kd.simulate(scene).impact
    assert scene.leg.stiff_joints == ("ankle",)
    assert impact.v_after[2] == pytest.approx(scene.v[2], rel=1e-12, abs=1e-12)
    (line,) = faults(SMALL.replace('"human"', '"human"\nstiff_joints = ["toe"]'))
    assert "leg: joint 'toe' is unknown" in line


def test_locked_joints(tmp_path, faults):
    file = tmp_path / "scene.toml"
    small = SMALL.replace(", ankle = -5", "")
    file.write_text(small.replace('"human"', '"human"\nlocked = { ankle = -5 }'))
    free = tmp_path / "free.toml"
    free.write_text(SMALL)
    scene = kd.load_scene(file)
    assert scene.leg.joint_names == ("hip", "knee")
    pair = scene, kd.load_scene(free)
    places = [each.leg.posture(each.q).contact_point for each in pair]
    assert places[0] == pytest.approx(places[1], abs=1e-14)
    for locked, said in (
        ("{ ankel = 5 }", "leg: joint 'ankel' is unknown: did you mean 'ankle'"),
        ("{ ankle = nan }", "leg.locked: ankle is nan"),
        ("5", "leg.locked: 5: it must be a table, joint = number [deg; m]"),
        ("{ ankle = 5, hip = 5, knee = 0 }", "leg: all joints of leg_human are locked"),
    ):
        (line,) = faults(small.replace('"human"', f'"human"\nlocked = {locked}'))
        assert said in line


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"human"', "human", "'model = human'; keys are written as key = value"),
        ("restitution = 0.8", "restitution = 0,8", "restitution = 0,8"),
        ('model = "human"', 'robot = "g2"', "leg: robot 'g2' is unknown"),
        ('model = "human"', "robot = 2", "leg.robot: 2: it must be printable text"),
        ('"human"', '"humn"', "leg.model: 'humn' is unknown: did you mean human?"),
        ("restitution = 0.8", "restitution = 0.8\n[ground]\nheight_m = 5", "is 5: the ball would"),
        ("restitution = 0.8", 'restitution = 0.8\n[air]\ndrag = "x"', "choose stokes, brown"),
    ],
)  # fmt: skip
def test_mistakes_of_beginners(faults, old, new, said):
    assert any(said in line for line in faults(SMALL.replace(old, new)))


@pytest.mark.parametrize(
    ("drives", "armature"), [("", 0.1), ('drives = "none"', 0.0), ('drives = "d.toml"', 0.02)]
)
def test_a_scene_can_name_the_drives_of_its_robot(tmp_path, drives, armature):
    (tmp_path / "d.toml").write_text('[joints]\n"*" = { rotor_inertia_kg_m2 = 0.02 }')
    (tmp_path / "scene.toml").write_text(f"""
        [leg]
        robot = "talos"
        legs_only = true
        {drives}
        [posture]
        foot_velocity_m_s = [2, 0, 0.5]
        [contact]
        normal = [1, 0, 0.3]
        restitution = 0.8
    """)
    leg = kd.load_scene(tmp_path / "scene.toml").leg
    assert leg.model.armature == pytest.approx(np.full(leg.nv, armature))
