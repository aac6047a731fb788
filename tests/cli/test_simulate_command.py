"""`kickdyn simulate`: its document has the numbers of the library, and the text those of both."""

import numpy as np
import pytest
from tolerances import closed_form

import kickdyn as kd
from kickdyn.core.files import finite
from kickdyn.scene.launch_and_end import strike_scene

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
        "end_deviation": finite(answer.end_deviation), "within_tolerance": True,
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
    for key, right in right_numbers(answer).items():
        if isinstance(right, np.ndarray):
            right = pytest.approx(right, rel=closed_form(1e4), abs=closed_form(1e4))
        assert document[key] == right, key
    effects = {entry.pop("effect"): entry for entry in document["effects"]}
    assert {key: entry["size"] for key, entry in effects.items()} == answer.effect_sizes
    for key, entry in effects.items():
        assert entry["seconds"] >= 0.0
        assert entry["modelled"] == (key in answer.modelled) == (key not in answer.neglected)
        assert entry["negligible"] == (key in answer.negligible)


def test_joint_impulses_of_a_document_have_their_deviations(kickdyn, written):
    written("kick.toml", (
        '[leg]\nmodel = "human"\n[posture]\nangles_deg = { hip = 20 }\n'
        "foot_velocity_m_s = [9, 0, 3]\n"
        "[contact]\nattack_deg = 20\nrestitution = 0.7\n[uncertainty]\njoint_velocity_rad_s = 0.2\n"
    ))  # fmt: skip
    answer = kd.simulate(kd.load_scene("kick.toml"))
    document = kickdyn("simulate kick.toml --json -").json
    wrenches = strike_scene(answer.scene).joint_impulses
    joints = document["joint_impulses"]
    assert list(joints) == ["hip", "knee", "ankle"]
    for (name, entry), wrench in zip(joints.items(), wrenches, strict=True):
        assert entry["force"] == pytest.approx(np.linalg.norm(wrench[:3]))
        assert entry["moment"] == pytest.approx(np.linalg.norm(wrench[3:]))
        assert entry["force_deviation"] == answer.launch_spread.joints[name].force_deviation > 0
        assert entry["moment_deviation"] == answer.launch_spread.joints[name].moment_deviation > 0


def test_the_text_has_the_end_and_the_tolerance(kickdyn):
    answer = kd.simulate(kd.load_scene("robot_chip"), 0.2)
    text = kickdyn("simulate robot_chip --tolerance 0.2").out
    assert answer.end_text in text
    assert "0.2 m" in text
