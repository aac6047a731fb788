"""`kickdyn simulate`: its document has the numbers of the library, and the text those of both."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from references.exact_impact import exact_impact, given
from tolerances import closed_form, integrated

import kickdyn as kd
from kickdyn.cli import function_costs
from kickdyn.cli.scene_commands import effect_figure
from kickdyn.core.files import plain
from kickdyn.core.representation import distance_in_words, format_value
from kickdyn.scene.launch_and_end import strike_scene
from kickdyn.scene.simulate import EffectSize, simulate_as_instant

SCENES = ["free_kick", "volley", "wet_grass_pass"]


def right_numbers(answer):
    """Return the numbers that a document must have, from the attributes of a simulation."""
    impact, passage, score = answer.impact, answer.passage, answer.score
    return {
        "scene": answer.scene.name,
        "restitution": impact.restitution,
        "restitution_given": answer.scene.contact.restitution,
        "ball_velocity": impact.ball_after.velocity, "ball_spin": impact.ball_after.spin,
        "end": answer.path.sample(answer.path.duration).position, "time": answer.path.duration,
        "error": answer.model_error + answer.numerical_error, "model_error": answer.model_error,
        "numerical_error": answer.numerical_error, "evaluations": answer.evaluations,
        "end_deviation": plain(answer.end_deviation), "within_tolerance": True,
        "wall": passage and {"above": passage.above, "beside": passage.beside},
        "goal_mouth": score and {"end": score.end, "post": score.post, "bar": score.bar},
        "warnings": list(answer.warnings),
    }  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("tolerance", [0.05, None], ids=["to a tolerance", "exact"])
def test_a_document_has_the_numbers_of_the_simulation(name, tolerance, kickdyn):
    document = kickdyn(f"simulate {name} --json -", *([] if tolerance else ["--exact"])).json
    answer = kd.simulate(kd.load_scene(name), tolerance)
    assert document["tolerance"] == tolerance

    def about(right):  # either may be computed in machine code
        if isinstance(right, dict):
            return {name: about(number) for name, number in right.items()}
        if not isinstance(right, np.ndarray | float):
            return right
        return pytest.approx(right, rel=closed_form(1e4), abs=closed_form(1e4))

    for key, right in right_numbers(answer).items():
        assert document[key] == about(right), key
    effects = {entry.pop("effect"): entry for entry in document["effects"]}
    assert {key: entry["size"] for key, entry in effects.items()} == about({**answer.effect_sizes})
    for key, entry in effects.items():
        assert entry["seconds"] >= 0.0
        assert entry["modelled"] == (key in answer.modelled) == (key not in answer.neglected)
        assert entry["negligible"] == (key in answer.negligible)


def test_joint_impulses_have_their_deviations_and_the_text_has_the_end(kickdyn, written):
    written("kick.toml", (
        '[leg]\nmodel = "human"\n[posture]\nangles_deg = { hip = 20 }\n'
        "foot_velocity_m_s = [9, 0, 3]\n"
        "[contact]\nattack_deg = 20\nrestitution = 0.7\n[uncertainty]\njoint_velocity_rad_s = 0.2\n"
    ))  # fmt: skip
    answer = kd.simulate(kd.load_scene("kick.toml"))
    document = kickdyn("simulate kick.toml --json -").json
    text = kickdyn("simulate kick.toml --tolerance 0.2").out
    assert (format_value(answer.end.position) in text, "0.2 m" in text) == (True, True)
    wrenches = strike_scene(answer.scene).joint_impulses
    joints = document["joint_impulses"]
    assert list(joints) == ["hip", "knee", "ankle"]
    for (name, entry), wrench in zip(joints.items(), wrenches, strict=True):
        assert entry["force"] == pytest.approx(np.linalg.norm(wrench[:3]))
        assert entry["moment"] == pytest.approx(np.linalg.norm(wrench[3:]))
        assert entry["force_deviation"] == answer.launch_spread.joints[name].force_deviation > 0
        assert entry["moment_deviation"] == answer.launch_spread.joints[name].moment_deviation > 0


FOLDER = Path(__file__).resolve().parents[2] / "scenes"


def fast_kick(more=""):
    """Return the text of the scene of the paper, with a foot that is faster."""
    text = (FOLDER / "paper_kick.toml").read_text("utf-8") + more
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


ROOT = Path(__file__).resolve().parents[2]

ERRORS = {
    "strike": closed_form(), "strike_many": closed_form(10), "sweep": closed_form(10),
    "pin.impulseDynamics, bare": closed_form(),
    "collide": 1e-5, "collide_many": 1e-5, "fly": 1e-6, "fly_many": 1e-6, "follow": 1e-5,
    "follow_many": 1e-5, "simulate": 0.05,
}  # fmt: skip
"""Largest relative errors by rounding and integration, from the default tolerances."""


@pytest.mark.slow
def test_the_functions_are_as_exact_as_their_tolerances(kickdyn, monkeypatch, tmp_path):
    monkeypatch.setattr(function_costs, "_seconds", lambda run: 1e-3)
    monkeypatch.setattr(function_costs, "ROWS", 50)
    ended = kickdyn("tradeoff --plot x.svg --json x.json")
    rows = json.loads((tmp_path / "x.json").read_text())["functions"]
    table = {row["function"]: row for row in rows}
    for name, most in ERRORS.items():
        assert 0.0 <= table[name]["rounding"] < most, name
        count = {"strike_many": 50, "fly_many": 50, "sweep": 81**3}.get(name, 1)
        if name in ("strike", "strike_many", "sweep", "fly", "fly_many"):
            assert table[name]["seconds"] == pytest.approx(1e-3 / count), name
            assert table[name]["is_batch"] == (count > 1), name
    attack = np.array([math.cos(math.pi / 6), 0.0, 0.5])
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    kick = posture, posture.joint_velocity(10 * attack), kd.Ball.paper()
    contact = kd.Contact(attack, 0.8, 0.4)
    instant, lasting = (solve(*kick, contact).impulse for solve in (kd.strike, kd.collide))
    model = np.linalg.norm(instant - lasting) / np.linalg.norm(lasting)
    assert table["strike"]["model"] == pytest.approx(model, rel=integrated(1e-8))
    assert table["collide"]["model"] is None
    printed = {line.split("  ")[0].removesuffix(" (per row)"): line.split()[-3:]
               for line in ended.out.splitlines()}  # fmt: skip
    row, cells = table["strike"], [float(cell) for cell in printed["strike"]]
    assert cells == pytest.approx([1e6 * row["seconds"], row["rounding"], row["model"]], rel=0.05)


@pytest.mark.parametrize("friction", function_costs.EXACT)
def test_the_exact_impulses_are_those_with_50_digits(friction):
    exact = exact_impact(*given(function_costs.kick(friction)))["impulse"]
    right = [float(component) for component in exact.exact]
    assert function_costs.EXACT[friction] == pytest.approx(right, rel=closed_form(), abs=0)


def test_no_function_on_the_front_is_slower_at_equal_error():
    nan = math.nan
    table = [
        ("pin.impulseDynamics, bare", 1e-5, False, 5e-16, 0.1),
        ("strike", 4e-5, False, 5e-16, 0.05), ("collide", 2e-2, False, 3e-9, nan),
        ("strike_many", 1e-7, True, 5e-16, 0.05), ("sweep", 5e-7, True, 1e-15, 0.05),
        ("fly", 1e-3, False, 6e-11, nan),
    ]  # fmt: skip
    rows = [function_costs.FunctionCost(*row) for row in table]
    rounding, model = (function_costs.on_front(rows, kind) for kind in ("rounding", "model"))
    assert rounding == {"pin.impulseDynamics, bare", "collide", "strike_many", "fly"}
    assert model == {"pin.impulseDynamics, bare", "strike", "strike_many"}
    panels = function_costs.cost_figure(rows).axes
    for axes, kind, front in zip(panels, ("model", "rounding"), (model, rounding), strict=True):
        shown = [row for row in rows if not math.isnan(getattr(row, kind))]
        right = [
            (row.function, row.seconds, getattr(row, kind), row.is_batch, row.function in front)
            for row in shown
        ]
        lines = [line for line in axes.lines if len(line.get_xdata())]
        assert right == [
            (text.get_text(), line.get_xdata()[0], line.get_ydata()[0], line.get_marker() == "s",
             text.get_color() == "black") for text, line in zip(axes.texts, lines, strict=True)
        ]  # fmt: skip


def test_bars_end_where_neglecting_an_effect_moves_the_end():
    ends = {"drag": 2.0, "spin": 0.0, "law": math.nan, "wind": 0.3}
    sizes = [EffectSize(*row, 0.0, "none" if row[0] == "law" else "") for row in ends.items()]
    (axes,) = effect_figure("volley", sizes, 0.07).axes
    bars = [(b.get_y() + b.get_height() / 2, b.get_x() + b.get_width()) for b in axes.patches]
    assert np.array(bars) == pytest.approx(np.array([(0, 2.0), (3, 0.3)]))
    assert axes.lines[0].get_xdata() == [0.07, 0.07]
    assert [label.get_text() for label in axes.get_yticklabels()] == list(ends)
    assert [text.get_text() for text in axes.texts] == ["2", "below 1e-09", "no answer", "0.3"]


def test_effects_of_a_scene_are_those_of_the_library(kickdyn, tmp_path):
    """The largest comes first; the rows have the numbers of the document."""
    ended = kickdyn("tradeoff --scene volley --json x.json --plot x.svg")
    document = json.loads((tmp_path / "x.json").read_text())
    exact = kd.simulate(kd.load_scene("volley"), None)
    sizes = {size.effect: size for size in exact.effects}
    assert document["end"] == pytest.approx(exact.end.position)
    assert document["impulse"] == pytest.approx(exact.impact.impulse)
    assert (document["scene"], document["status"]) == ("volley", "landed")
    ends = [row["end"] for row in document["effects"]]
    assert ends == sorted(ends, reverse=True)
    assert {row["effect"] for row in document["effects"]} == set(sizes)
    for row in document["effects"]:
        size = sizes[row["effect"]]
        assert (row["end"], row["impulse"]) == pytest.approx((size.end, size.impulse))
        assert f"{size.end:.4g} m away" in ended.out
