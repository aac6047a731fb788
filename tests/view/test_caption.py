import html
import re
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.view.caption import kick_panel, panel_of


def panel(kick, caption=""):
    hit, _, path = kick
    return kick_panel(hit, path, caption)


def rows(text):
    text = text.replace("<wbr>", "")
    found = re.findall(r"<tr[^>]*><th>(.*?)</th><td>(.*?)</td></tr>", text)
    plain = [[html.unescape(re.sub(r" ?<.*?>", "", cell)) for cell in row] for row in found]
    return dict(plain)


def numbers(**changed):
    """Return an impact of round numbers, as far as a caption reads it."""
    leg = kd.Leg.human()
    impact = {
        "posture": leg.posture(np.radians([20.0, 30.0, -12.5])),
        "impulse": np.array([0.0, -0.6, 0.8]),
        "effective_mass": 1.25,
        "joint_impulses": np.array([[0, 0, 0.25], [1.2, 0, 1.6], [0, 0.5, 0]]) @ np.eye(3, 6),
        "worst_joint": ("knee", 2.0),
        "foot_velocity": np.array([3.0, 0.0, 4.0]),
        "contact": kd.Contact((1, 0, 0), 0.8),
        "speed_ratio": 2.0,
        "ball": kd.Ball(),
        "ball_after": kd.BallState(velocity=(6, 0, 8), spin=(0, -30, 40)),
        "v_before": np.array([0.0, 1.0, 0.0]),
    }
    return SimpleNamespace(**{**impact, **changed})


FLIGHT = {"method": "DOP853, drag", "status": "landed", "range": 17.25, "height": 3.5,
          "duration": 1.5}  # fmt: skip


def test_says_the_numbers():
    text = kick_panel(numbers(), SimpleNamespace(**FLIGHT), "")
    assert text.startswith("<h1>Ball at 10 m/s</h1>")
    said = rows(text)
    assert said == {
        "leg": "leg_human",
        "impulse on ball": "1 N s",
        "worst joint": "2 N s at knee",
        "effective mass": "1.25 kg",
        "foot speed": "5 m/s",
        "ball speed": "10 m/s",
        "ball / foot speed": "2",
        "launch angle": "53.1°",
        "spin": "50 rad/s",
        "range": "17.25 m",
        "flight time": "1.5 s",
        "flight": "DOP853, drag",
        "knee": "30.0°, 2 N s",
        "ankle": "-12.5°, 0.5 N s",
        "hip": "20.0°, 0.25 N s",
    }
    assert list(said)[12:] == ["knee", "ankle", "hip"]  # by their impulses


def test_a_joint_that_neither_moves_nor_transmits_is_not_listed():
    impulses = np.array([[0, 0, 0.09], [1.2, 0, 1.6], [0, 0.05, 0]]) @ np.eye(3, 6)
    impact = numbers(joint_impulses=impulses, v_before=np.array([0.0, 0.0, 1.0]))
    text = kick_panel(impact, SimpleNamespace(**FLIGHT), "")
    said = rows(text)
    assert "2 joints: angle, and impulse on" in text
    assert "hip" not in said
    assert said["ankle"] == "-12.5°, 0.05 N s"  # it moves


def test_a_course_along_the_ground():
    """Rolling 8 m at a deceleration of 1 m/s2, from 4 m/s to rest."""
    ball, felt = kd.Ball(), kd.Surface("felt", 0.5, 0.5, rolling_deceleration=1.0)
    launch = kd.BallState(velocity=(4, 0, 0), spin=(0, 4 / ball.radius, 0))
    for end, length, time, speed in (
        (None, 8, 4, 0),
        (kd.Plane((6, 0, 0), (-1, 0, 0), "centre"), 6, 2, 2),
    ):
        course = kd.follow(launch, ball, ground=kd.Ground(-ball.radius, felt), plane=end)
        said = rows(kick_panel(numbers(), course, ""))
        assert said["path"] == f"{length} m along the ground"
        assert said["time"] == f"{time} s"
        assert said["final speed"] == f"{speed} m/s"


@pytest.mark.parametrize(("spin", "shown"), [(0.5, "0.5"), (1e-3, "0.001"), (1e-13, "0")])
def test_a_slow_spin_is_shown_and_rounding_is_not(spin, shown):
    impact = numbers(ball_after=kd.BallState(velocity=(6, 0, 8), spin=(0, -spin, 0)))
    said = rows(kick_panel(impact, SimpleNamespace(**FLIGHT), ""))
    assert said["spin"] == f"{shown} rad/s"


def test_a_prismatic_joint_is_in_metres(load, spoil):
    leg = load(spoil(('name="knee" type="revolute"', 'name="knee" type="prismatic"')))
    hit = kd.strike(leg.posture([0.1, 0.25]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    said = rows(panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()))))
    assert re.fullmatch(r"0\.25 m, [\d.]+ N s", said["knee"])


def test_a_floating_base_is_not_listed():
    model = pin.buildModelFromXML(kd.Leg.human().file.text, pin.JointModelFreeFlyer())
    model.inertias[1] = pin.Inertia(10.0, np.zeros(3), 0.2 * np.eye(3))
    leg = kd.Leg.from_model(model, "toe")
    posture = leg.posture(leg.configuration({"knee": 0.5}))
    hit = kd.strike(posture, posture.joint_velocity([4, 1, 3]), kd.Ball(),
                       kd.Contact([4, 1, 3], 0.8, 0.4))  # fmt: skip
    said = rows(panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball()))))
    assert "root_joint" not in said  # free, it transmits nothing
    assert re.fullmatch(r"28\.6°, [\d.]+ N s", said["knee"])


def test_a_foot_at_rest_has_no_ratio():
    hit = kd.strike(kd.Leg.human().posture(np.zeros(3)), np.zeros(3), kd.Ball(),
                    kd.Contact([1, 0, 0.3], 0.8), ball_velocity=[-5, 0, 0])  # fmt: skip
    assert "ball / foot speed" not in rows(
        panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball())))
    )


def test_a_ball_still_aloft(make_kick):
    hit, ball, _ = make_kick(kd.Leg.human(), 8.0)
    path = kd.fly(hit.ball_after, ball, time_limit=0.1)
    assert rows(panel((hit, ball, path)))["range"].endswith("(still aloft)")


def test_a_flight_to_a_plane_is_no_range(make_kick):
    hit, ball, _ = make_kick(kd.Leg.human(), 8.0)
    said = rows(
        panel((hit, ball, kd.fly(hit.ball_after, ball, plane=kd.Plane((2, 0, 0), (-1, 0, 0)))))
    )
    assert "range" not in said
    assert said["distance"].endswith(" m")


def test_a_long_value_has_a_line_of_its_own():
    text = panel_of("leg", [("worst joint", "2.8 N s at hip")], "All & met. More.")
    assert "<p>All &amp; met. </p>" in text
    assert '<tr class="long"><th>worst joint</th>' in text
    assert "<tr><th>knee</th><td>30.0°, 2 N s</td>" in kick_panel(
        numbers(), SimpleNamespace(**FLIGHT), ""
    )


def test_names_are_escaped(load, spoil):
    evil = "&lt;script&gt;alert(1)&lt;/script&gt;"
    leg = load(spoil(('robot name="leg"', f'robot name="{evil}"'), ('"knee"', f'"{evil}&amp;"')))
    assert "<script>alert(1)</script>" in leg.name
    assert "<script>alert(1)</script>&" in leg.joint_names
    hit = kd.strike(leg.posture([0.1, 0.2]), [1, 0], kd.Ball(), kd.Contact([1, 0, 0.1], 0.8))
    path = SimpleNamespace(method="<script>alert(1)", status="landed", range=1.0, duration=1.0)
    text = panel((hit, kd.Ball(), path), caption="<script>alert(1)</script>")
    assert "<script" not in text
    assert text.count("&lt;script&gt;alert(1)") == 5  # leg, caption, worst joint, flight, joint


@pytest.mark.parametrize(("caption", "there"), [("", False), ("best of 12", True)])
def test_the_caption_is_optional(kick, caption, there):
    assert ("<p>" in panel(kick, caption)) is there


def test_many_joints_are_folded_the_most_loaded_first():
    leg = kd.Leg.from_robot("g1")
    posture = leg.posture(leg.configuration({"right_knee_joint": 0.5}))
    hit = kd.strike(posture, posture.joint_velocity([4, 0, 1]), kd.Ball(),
                       kd.Contact([4, 0, 1], 0.8))  # fmt: skip
    text = panel((hit, kd.Ball(), kd.fly(hit.ball_after, kd.Ball())))
    plain, folded = text.split("<details>")
    name, size = hit.worst_joint
    assert rows(plain)["worst joint"] == f"{size:.4g} N s at {name}"
    assert not any(joint in rows(plain) for joint in leg.joint_names)
    said = rows(folded)
    assert f"{len(said)} joints: angle, and impulse on" in folded
    knee = np.linalg.norm(hit.joint_impulses[leg.joint_names.index("right_knee_joint"), :3])
    assert said["right_knee_joint"] == f"28.6°, {knee:.3g} N s"
    assert "left_knee_joint" not in said
    assert next(iter(said)) == name
    sizes = [float(value.split(", ")[1][:-4]) for value in said.values()]
    assert sizes == sorted(sizes, reverse=True)


def test_long_sentences_below_the_table_are_folded():
    short, long = panel_of("a", [], "One. Two."), panel_of("a", [], "One. " + 40 * "Sentence. ")
    assert "<p>Two.</p>" in short
    assert "<details>" not in short
    assert "<summary>explanation</summary>\n<p>Sentence. " in long
