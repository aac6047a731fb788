import json
import math
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.view_command import view
from kickdyn.core import console
from kickdyn.core.representation import distance_in_words
from kickdyn.scene.simulate import simulate_as_instant

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SLOW = "foot_velocity_m_s = [1.0392, 0, 0.6]"


def fast_kick():
    """Return the text of the scene of the paper, with a foot that is faster."""
    text = (SCENES / "paper_kick.toml").read_text("utf-8")
    assert SLOW in text
    return text.replace(SLOW, "foot_velocity_m_s = [10, 0, 5]")


def run(*arguments):
    return CliRunner().invoke(view, [str(each) for each in arguments])


def test_a_page_and_numbers(tmp_path):
    page, said = tmp_path / "kick.html", tmp_path / "kick.json"
    ended = run(SCENES / "volley.toml", "--out", page, "--json", said)
    assert ended.exit_code == 0
    assert ended.output.endswith(f"wrote {page}\nwrote {said}\n")
    html = page.read_text("utf-8")
    numbers = json.loads(said.read_text())
    scene = kd.load_scene(SCENES / "volley.toml")
    whole = kd.simulate(scene, None)
    apart = np.linalg.norm(np.subtract(numbers["end"], whole.end.position))
    assert numbers["neglected"] == {"contact time": pytest.approx(apart, rel=1e-3)}
    assert apart <= numbers["error"] <= 1.001 * apart
    assert (
        f"error {distance_in_words(apart)}; all effects are modelled except contact time ("
        in ended.output
    )
    told = (
        f"Volley, contact shown as instantaneous; this moves the end of the path by {apart:.2g} m"
    )
    assert told in html
    hit = kd.strike(
        scene.posture,
        scene.v,
        scene.ball,
        scene.contact,
        ball_velocity=scene.incoming.velocity,
        ball_spin=scene.incoming.spin,
    )
    assert numbers["angles_deg"] == {"hip": 50, "knee": 20, "ankle": 20}  # as the file has them
    assert numbers["impulse"] == pytest.approx(hit.impulse)
    assert numbers["ball_spin"] == pytest.approx(hit.ball_after.spin)
    assert np.linalg.norm(numbers["ball_spin"]) > 1.0
    for joint, sent in enumerate(numbers["joint_impulses"].values()):
        whole = np.linalg.norm(hit.joint_impulses[joint, :3])
        assert np.linalg.norm(sent) == pytest.approx(whole)
    assert f"{np.linalg.norm(hit.impulse):.4g} N s" in html


def test_a_scene_without_time_for_its_contact_has_all_modelled(tmp_path):
    said = tmp_path / "kick.json"
    ended = run(SCENES / "paper_kick.toml", "--json", said)
    assert "; all effects are modelled\n" in ended.output
    numbers = json.loads(said.read_text())
    assert numbers["neglected"] == {}
    assert numbers["error"] < 1e-6


def test_a_bound_that_is_not_known_is_null(tmp_path):
    """The contact's deflection in a tenth of a second is beyond the ball's radius."""
    slow = fast_kick().replace("restitution = 0.8", "restitution = 0.8\ncontact_time_s = 0.1", 1)
    (tmp_path / "slow.toml").write_text(slow)
    assert run(tmp_path / "slow.toml", "--json", tmp_path / "slow.json").exit_code == 0
    numbers = json.loads((tmp_path / "slow.json").read_text())
    assert numbers["neglected"] == {"contact time": None}
    assert numbers["error"] is None


def test_it_fits_the_screen(tmp_path, monkeypatch):
    said = [run(SCENES / "free_kick.toml", "--json", tmp_path / "x.json").stdout]
    monkeypatch.setattr(console, "screen_width", lambda: 80)
    said.append(run(SCENES / "free_kick.toml", "--json", tmp_path / "x.json").stdout)
    wide, narrow = (text.split("wrote")[0] for text in said)
    assert max(map(len, narrow.splitlines())) <= 80 < max(map(len, wide.splitlines()))
    assert narrow.split() == wide.split()


def test_nothing_to_write():
    ended = run(SCENES / "paper_kick.toml")
    assert isinstance(ended.exception, kd.InvalidInput)
    assert "give --out, --png or --json" in str(ended.exception)


@pytest.mark.parametrize("at", ["-1", "nan", "0.1169", "99"])
def test_a_moment_outside_the_motion_is_refused(at, tmp_path, monkeypatch):
    monkeypatch.setattr("kickdyn.view.document.find_browser", lambda: "browser")
    files = "--png", tmp_path / "a.png", "--json", tmp_path / "a.json"
    ended = run(SCENES / "paper_kick.toml", *files, "--at", at)
    assert isinstance(ended.exception, kd.InvalidInput)
    assert re.search(r"^at is .*at least 0 and at most 0\.11\d+ \[s\]$", str(ended.exception))
    assert list(tmp_path.iterdir()) == []


NUMBERS = {
    "scene": lambda shown: shown.scene.name,
    "leg": lambda shown: shown.scene.leg.name,
    "frame": lambda shown: shown.scene.leg.frame,
    "angles_deg": lambda shown: {
        name: pytest.approx(angle)
        for name, angle in shown.scene.leg.angles_deg(shown.scene.q).items()
    },
    "restitution": lambda shown: shown.impact.restitution,
    "restitution_given": lambda shown: shown.scene.contact.restitution,
    "impulse": lambda shown: shown.impact.impulse.tolist(),
    "joint_impulses": lambda shown: {
        name: pytest.approx(placement.rotation @ impulse[:3])
        for name, placement, impulse in zip(
            shown.scene.leg.joint_names,
            placements(shown.scene),
            shown.impact.joint_impulses,
            strict=True,
        )
    },
    "foot_speed": lambda shown: np.linalg.norm(shown.scene.posture.point_velocity(shown.scene.v)),
    "ball_velocity": lambda shown: shown.impact.ball_after.velocity.tolist(),
    "ball_spin": lambda shown: shown.impact.ball_after.spin.tolist(),
    "launch_angle": lambda shown: math.atan2(
        shown.launch.velocity[2], math.hypot(*shown.launch.velocity[:2])
    ),
    "end": lambda shown: shown.path.landing.position.tolist(),
    "time": lambda shown: shown.path.duration,
    "error": lambda shown: shown.model_error + shown.numerical_error,
    "neglected": lambda shown: dict.fromkeys(shown.neglected, shown.model_error),
    "wall": lambda shown: (
        shown.passage and {"above": shown.passage.above, "beside": shown.passage.beside}
    ),
    "goal_mouth": lambda shown: (
        shown.score and {"end": shown.score.end, "post": shown.score.post, "bar": shown.score.bar}
    ),
    "warnings": lambda shown: list(shown.warnings),
}


def placements(scene):
    """Return the placements of the joints in the world, as Pinocchio computes them."""
    model = scene.leg.model
    data = model.createData()
    pin.forwardKinematics(model, data, scene.q)
    return list(data.oMi)[1:]


@pytest.mark.parametrize("name", ["free_kick", "volley"])
def test_every_number_of_the_document_is_that_of_the_simulation(name):
    ended = run(name, "--json", "-")
    shown = simulate_as_instant(kd.load_scene(name))
    document = json.loads(ended.stdout)
    assert document.keys() == NUMBERS.keys()
    for key, number in NUMBERS.items():
        assert (
            document[key] == pytest.approx(number(shown))
            if key == "foot_speed"
            else (document[key] == number(shown))
        ), key


def test_the_summary_is_that_of_the_simulation(tmp_path):
    ended = run("free_kick", "--json", tmp_path / "x.json")
    assert simulate_as_instant(kd.load_scene("free_kick")).summary in ended.stdout


def test_a_name_is_escaped(tmp_path):
    text = (SCENES / "paper_kick.toml").read_text("utf-8")
    file = tmp_path / "evil.toml"
    file.write_text(text.replace('name = "the paper', 'name = "<script>alert(1)</script>the paper'))
    html = kd.page(kd.simulate(kd.load_scene(file), None)).html
    assert "<script>alert(1)" not in html
    assert "&lt;script&gt;alert(1)" in html


@pytest.mark.parametrize(
    ("x", "shown"), [(5.0, True), (60.0, True), (-5.0, False), (-1e3, False), (-1e9, False),
                     (1e6, False)]
)  # fmt: skip
def test_a_wall_is_shown_where_the_ball_could_come_to_it(x, shown, tmp_path, commands_of):
    file = tmp_path / "wall.toml"
    file.write_text(
        f"{fast_kick()}\n[plane]\npoint_m = [{x}, 0, 0]\nnormal = [{-np.sign(x)}, 0, 0]\n"
    )
    html = kd.page(kd.simulate(kd.load_scene(file), None)).html
    drawn = any(c["path"].startswith("/meshcat/scenery") for c in commands_of(html))
    assert drawn is shown
    assert ("its plane out of the picture" in html) is not shown


@pytest.mark.parametrize(("lengths", "shown"), [(9.5, True), (10.5, False)])
def test_a_wall_is_shown_up_to_ten_times_the_length_of_the_path(lengths, shown, tmp_path):
    file = tmp_path / "wall.toml"
    file.write_text(fast_kick())
    free = kd.simulate(kd.load_scene(file), None)
    start, end = free.launch.position[0], free.end.position[0]
    x = start + lengths * (end - start)
    file.write_text(f"{fast_kick()}\n[plane]\npoint_m = [{x}, 0, 0]\nnormal = [-1, 0, 0]\n")
    html = kd.page(kd.simulate(kd.load_scene(file), None)).html
    assert ("its plane out of the picture" in html) is not shown


def test_a_scene_with_a_goal_shows_it(commands_of):
    said = commands_of(kd.page(kd.simulate(kd.load_scene(SCENES / "paper_kick.toml"), None)).html)
    assert not any(c["path"].startswith("/meshcat/scenery") for c in said)
    kick = kd.page(kd.load_scene(SCENES / "free_kick.toml")).html
    boxes = {c["path"] for c in commands_of(kick) if c["path"].startswith("/meshcat/scenery")}
    assert len(boxes) == 5 + 3  # players, posts and bar
    assert (
        "The ball passes 0.269 m to the right of the wall. The ball enters the goal, 1.29 m" in kick
    )
    timed = kd.simulate(kd.load_scene(SCENES / "volley.toml"), None)
    with pytest.raises(kd.InvalidInput, match="contact of finite time"):
        kd.page(timed)


def test_an_angle_that_is_rounded_to_zero_has_no_sign(tmp_path):
    scene = (SCENES / "free_kick.toml").read_text().replace("ankle = 15", "ankle = -1e-12")
    assert "ankle = -1e-12" in scene
    file = tmp_path / "kick.toml"
    file.write_text(scene)
    ended = run(file, "--json", "-")
    assert ended.exit_code == 0
    assert '"ankle": 0.0' in ended.output
