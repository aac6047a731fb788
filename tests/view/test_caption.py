import html
import re
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.view.caption import kick_panel
from kickdyn.view.playback import kick_pace


def panel(kick, caption=""):
    hit, _, path = kick
    return kick_panel(hit, path, kick_pace(hit, path.duration), 1.0, caption)


def rows(text):
    text = text.replace("<wbr>", "")
    found = re.findall(r"<tr[^>]*><th>(.*?)</th><td>(.*?)</td></tr>", text)
    return {re.sub(r" ?<.*?>", "", head): html.unescape(value) for head, value in found}


def test_says_the_numbers(make_kick):
    hit, ball, path = make_kick(kd.Leg.human(), 8.0, air=kd.Air())
    said = rows(panel((hit, ball, path)))
    assert said["hip"] == "5.0°"
    assert said["ankle"] == "-5.0°"
    assert said["impulse"] == f"{np.linalg.norm(hit.impulse):.4g} N s"
    name, size = hit.worst_joint
    assert said["worst joint"] == f"{size:.4g} N s at {name}"
    assert said["ball speed"] == f"{hit.ball_after.speed:.4g} m/s"
    assert said["ball / foot"] == f"{hit.speed_ratio:.4g}"
    assert said["launch angle"] == f"{np.degrees(hit.ball_after.elevation):.1f}°"
    assert said["carry"] == f"{path.range:.4g} m"
    assert said["flight"] == path.method
    assert re.fullmatch(
        r"strike [\d.]+ times slower, flight [\d.]+ times (slow|fast)er", said["shown"]
    )
    assert said["stripes"] == "1 m"


def test_one_pace_is_said_once(make_kick):
    assert re.fullmatch(r"[\d.]+ times slower", rows(panel(make_kick(kd.Leg.human(), 1)))["shown"])


def test_a_prismatic_joint_is_in_metres(load, spoil):
    leg = load(spoil(('name="knee" type="revolute"', 'name="knee" type="prismatic"')))
    hit = kd.strike(leg.posture([0.1, 0.25]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    assert rows(panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()))))["knee"] == "0.25 m"


def test_a_floating_base_has_no_angles():
    model = pin.buildModelFromXML(kd.Leg.human().urdf.text, pin.JointModelFreeFlyer())
    model.inertias[1] = pin.Inertia(10.0, np.zeros(3), 0.2 * np.eye(3))
    leg = kd.Leg.from_model(model, "toe")
    posture = leg.posture(leg.configuration({"knee": 0.5}))
    hit = kd.strike(posture, posture.joint_velocity([4, 1, 3]), kd.Ball(),
                       kd.Contact([4, 1, 3], 0.8, 0.4))  # fmt: skip
    said = rows(panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()))))
    assert "knee" not in said
    assert "impulse" in said


def test_a_foot_at_rest_has_no_ratio():
    hit = kd.strike(kd.Leg.human().posture(np.zeros(3)), np.zeros(3), kd.Ball(),
                    kd.Contact([1, 0, 0.3], 0.8), ball_velocity=[-5, 0, 0])  # fmt: skip
    assert "ball / foot" not in rows(panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()))))


def test_a_ball_still_aloft(make_kick):
    hit, ball, _ = make_kick(kd.Leg.human(), 8.0)
    path = kd.fly(hit.ball_after, ball, time_limit=0.1)
    assert rows(panel((hit, ball, path)))["carry"].endswith("(still aloft)")


def test_a_flight_to_a_plane_is_no_carry(make_kick):
    hit, ball, _ = make_kick(kd.Leg.human(), 8.0)
    said = rows(
        panel((hit, ball, kd.fly(hit.ball_after, ball, plane=kd.Plane((2, 0, 0), (-1, 0, 0)))))
    )
    assert "carry" not in said
    assert said["to the plane"].endswith(" m")


def test_names_are_escaped(load, spoil):
    evil = "&lt;script&gt;alert(1)&lt;/script&gt;"
    leg = load(spoil(('robot name="leg"', f'robot name="{evil}"'), ('"knee"', f'"{evil}&amp;"')))
    assert "<script>alert(1)</script>" in leg.name
    assert "<script>alert(1)</script>&" in leg.joint_names
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    path = SimpleNamespace(method="<script>alert(1)", status="landed", range=1.0, duration=1.0)
    text = panel((hit, kd.Ball(), path), caption="<script>alert(1)</script>")
    assert "<script" not in text
    assert text.count("&lt;script&gt;alert(1)") == 5


@pytest.mark.parametrize(("caption", "there"), [("", False), ("best of 12", True)])
def test_the_caption_is_optional(kick, caption, there):
    assert ("<p>" in panel(kick, caption)) is there


def test_many_joints_are_folded_the_most_loaded_first():
    leg = kd.Leg.from_robot("g1")
    posture = leg.posture(leg.configuration({"right_knee_joint": 0.5}))
    hit = kd.strike(posture, posture.joint_velocity([4, 0, 1]), kd.Ball(),
                       kd.Contact([4, 0, 1], 0.8))  # fmt: skip
    plain, folded = panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()))).split("<details>")
    name, size = hit.worst_joint
    assert rows(plain)["worst joint"] == f"{size:.4g} N s at {name}"
    assert not any(joint in rows(plain) for joint in leg.joint_names)
    said = rows(folded)
    assert f"{len(said)} joints: angle and impulse" in folded
    knee = np.linalg.norm(hit.joint_impulses[leg.joint_names.index("right_knee_joint"), :3])
    assert said["right_knee_joint"] == f"28.6°, {knee:.3g} N s"
    assert "left_knee_joint" not in said
    assert next(iter(said)) == name
    sizes = [float(value.split(", ")[1][:-4]) for value in said.values()]
    assert sizes == sorted(sizes, reverse=True)


def test_a_floating_robot_says_what_its_joints_transmit():
    leg = kd.Leg.from_robot("g1", base="floating")
    posture = leg.posture(leg.configuration({"right_knee_joint": 0.5}))
    hit = kd.strike(posture, posture.joint_velocity([4, 0, 1]), kd.Ball(),
                       kd.Contact([4, 0, 1], 0.8))  # fmt: skip
    folded = panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()))).split("<details>")[1]
    said = rows(folded)
    assert "joints: impulse" in folded
    assert re.fullmatch(r"[\d.]+ N s", said["right_knee_joint"])
    assert len(said) < len(leg.joint_names)
