"""`kickdyn view`: its document has the numbers of the impact and of the flight that it shows."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.core.representation import distance_in_words
from kickdyn.scene.simulate import simulate_as_instant

SCENES = Path(__file__).resolve().parents[2] / "scenes"


def fast_kick(more=""):
    """Return the text of the scene of the paper, with a foot that is faster."""
    text = (SCENES / "paper_kick.toml").read_text("utf-8") + more
    return text.replace("_velocity_m_s = [1.0392, 0, 0.6]", "_velocity_m_s = [10, 0, 5]")


@pytest.mark.parametrize("name", ["free_kick", "volley", "paper_kick"])
def test_a_document_has_the_numbers_of_the_impact_and_the_flight(name, kickdyn):
    """Joint impulses in the axes of the world, as Pinocchio turns them."""
    document = kickdyn(f"view {name} --json -").json
    scene = kd.load_scene(name)
    leg, shown = scene.leg, simulate_as_instant(scene)
    hit = kd.strike(
        scene.posture, scene.v, scene.ball, scene.contact,
        ball_velocity=scene.incoming.velocity, ball_spin=scene.incoming.spin,
    )  # fmt: skip
    vx, vy, vz = hit.ball_after.velocity
    data = leg.model.createData()
    pin.forwardKinematics(leg.model, data, scene.q)
    turned = [data.oMi[k + 1].rotation @ wrench[:3] for k, wrench in enumerate(hit.joint_impulses)]
    right = {
        "impulse": hit.impulse, "launch_angle": math.atan2(vz, math.hypot(vx, vy)),
        "foot_speed": np.linalg.norm(scene.posture.jacobian @ scene.v),
        "angles_deg": dict(zip(leg.joint_names, np.degrees(scene.q), strict=True)),
        "end": shown.path.landing.position,
    }  # fmt: skip
    for key, value in right.items():
        assert document[key] == pytest.approx(value, abs=closed_form(1e4)), key
    for joint, impulse in zip(leg.joint_names, turned, strict=True):
        assert document["joint_impulses"][joint] == pytest.approx(impulse), joint
    assert (document["scene"], document["leg"], document["frame"]) == (scene.name, leg.name, "toe")
    assert document["warnings"] == list(shown.warnings)


def test_a_contact_shown_as_instantaneous_says_how_far_that_moves_the_end(kickdyn, tmp_path):
    ended = kickdyn("view volley --out kick.html --json kick.json")
    document = json.loads((tmp_path / "kick.json").read_text())
    whole = kd.simulate(kd.load_scene("volley"), None)
    distance = math.dist(document["end"], whole.end.position)
    assert document["neglected"] == {"contact time": pytest.approx(distance, rel=1e-3)}
    assert distance <= document["error"] <= 1.001 * distance
    page = (tmp_path / "kick.html").read_text("utf-8")
    assert f"by {distance:.2g} m" in page
    assert f"{math.hypot(*document['impulse']):.4g} N s" in page
    assert distance_in_words(distance) in ended.out
    assert ended.out.endswith("wrote kick.html\nwrote kick.json\n")


def test_a_bound_that_is_not_known_is_null(kickdyn, written):
    """The contact's deflection in a tenth of a second is beyond the ball's radius."""
    slow = fast_kick().replace("restitution = 0.8", "restitution = 0.8\ncontact_time_s = 0.1", 1)
    written("slow.toml", slow)
    document = kickdyn("view slow.toml --json -").json
    assert document["neglected"] == {"contact time": None}
    assert document["error"] is None


@pytest.mark.parametrize(("lengths", "shown"), [(9.5, True), (10.5, False), (-0.5, False)])
def test_a_wall_is_drawn_up_to_ten_times_the_length_of_the_path(lengths, shown, written):
    flight = kd.simulate(kd.load_scene(written("kick.toml", fast_kick())), None)
    start, end = flight.launch.position[0], flight.end.position[0]
    x = start + lengths * (end - start)
    wall = f"\n[plane]\npoint_m = [{x}, 0, 0]\nnormal = [{-np.sign(x)}, 0, 0]\n"
    html = kd.page(kd.simulate(kd.load_scene(written("wall.toml", fast_kick(wall))), None)).html
    assert ("out of the picture" in html) is not shown


def test_the_moment_of_the_picture_is_passed_on(kickdyn, monkeypatch):
    saved = []
    page = SimpleNamespace(warnings=(), save=lambda file, moment: saved.append((file, moment)))
    monkeypatch.setattr("kickdyn.view.document.find_browser", lambda: "browser")
    monkeypatch.setattr("kickdyn.view.page.page", lambda simulation: page)
    kickdyn("view paper_kick --png a.png --at 0.05")
    assert saved == [("a.png", 0.05)]
