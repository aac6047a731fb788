"""The command simulate: its table, its numbers, and what it refuses."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.simulate_command import simulate
from kickdyn.core.files import finite, shipped
from kickdyn.scene.launch_and_end import end_of, strike_scene


def test_it_prints_the_error_budget():
    ended = CliRunner().invoke(simulate, ["robot_chip", "--tolerance", "0.2"])
    assert ended.exit_code == 0
    answer = kd.simulate(kd.load_scene("robot_chip"), 0.2)
    assert answer.end_text in ended.stdout
    assert "error less than a micrometre, within the tolerance of 0.2 m" in ended.stdout
    assert answer.error < 1e-6


def test_the_numbers_are_those_of_simulate(tmp_path):
    file = tmp_path / "answer.json"
    ended = CliRunner().invoke(simulate, ["free_kick", "--exact", "--json", str(file)])
    assert f"wrote {file}" in ended.stdout
    document = json.loads(file.read_text())
    answer = kd.simulate(kd.load_scene("free_kick"), None)
    assert document["end"] == answer.end.position.tolist()
    assert document["error"] == answer.error
    assert document["tolerance"] is None
    assert document["within_tolerance"]
    assert [effect["effect"] for effect in document["effects"]] == list(answer.modelled)
    assert all(effect["modelled"] for effect in document["effects"])
    assert {effect["effect"]: effect["size"] for effect in document["effects"]} == (
        answer.effect_sizes
    )


NUMBERS = {
    "scene": lambda answer: answer.scene.name,
    "tolerance": lambda _: 0.05,
    "within_tolerance": lambda _: True,
    "status": lambda answer: str(answer.path.status),
    "restitution": lambda answer: answer.impact.restitution,
    "restitution_given": lambda answer: answer.scene.contact.restitution,
    "ball_velocity": lambda answer: answer.impact.ball_after.velocity.tolist(),
    "ball_spin": lambda answer: answer.impact.ball_after.spin.tolist(),
    "end": lambda answer: end_of(answer.path).position.tolist(),
    "time": lambda answer: answer.path.duration,
    "error": lambda answer: answer.model_error + answer.numerical_error,
    "model_error": lambda answer: answer.model_error,
    "numerical_error": lambda answer: answer.numerical_error,
    "end_deviation": lambda answer: finite(answer.end_deviation),
    "joint_impulses": lambda answer: (
        answer.launch_spread
        and {
            name: {
                "force": pytest.approx(
                    np.linalg.norm(strike_scene(answer.scene).joint_impulses[k, :3])
                ),
                "force_deviation": joint.force_deviation,
                "moment": pytest.approx(
                    np.linalg.norm(strike_scene(answer.scene).joint_impulses[k, 3:])
                ),
                "moment_deviation": joint.moment_deviation,
            }
            for k, (name, joint) in enumerate(answer.launch_spread.joints.items())
        }
    ),
    "method": lambda answer: answer.method,
    "evaluations": lambda answer: answer.evaluations,
    "wall": lambda answer: (
        answer.passage and {"above": answer.passage.above, "beside": answer.passage.beside}
    ),
    "goal_mouth": lambda answer: (
        answer.score
        and {"end": answer.score.end, "post": answer.score.post, "bar": answer.score.bar}
    ),
    "warnings": lambda answer: list(answer.warnings),
    "effects": lambda answer: [
        {
            "effect": name,
            "modelled": name not in answer.neglected,
            "negligible": name in answer.negligible,
            "size": size,
        }
        for name, size in answer.effect_sizes.items()
    ],
}


@pytest.mark.parametrize("name", ["free_kick", "volley", "wet_grass_pass"])
def test_every_number_of_the_document_is_that_of_the_simulation(name):
    ended = CliRunner().invoke(simulate, [name, "--json", "-"])
    document, answer = json.loads(ended.stdout), kd.simulate(kd.load_scene(name))
    times = [effect.pop("seconds") for effect in document["effects"]]
    assert min(document.pop("seconds"), *times) > 0.0
    assert document == {key: number(answer) for key, number in NUMBERS.items()}


def test_the_restitution_is_that_of_the_impact_and_the_given_one_that_of_the_file(tmp_path):
    text = (shipped("scenes") / "paper_kick.toml").read_text("utf-8")
    rows = [[0.5, 0.8], [5.0, 0.6]]
    file = tmp_path / "kick.toml"
    file.write_text(text.replace("restitution = 0.8", f"restitution = {rows}"))
    document = json.loads(CliRunner().invoke(simulate, [str(file), "--json", "-"]).stdout)
    answer = kd.simulate(kd.load_scene(file))
    assert document["restitution_given"] == rows
    assert 0.6 < document["restitution"] == answer.impact.restitution < 0.8
    assert f"restitution {answer.impact.restitution:.4g}, " in answer.summary


def test_only_json_goes_to_a_pipe():
    ended = CliRunner().invoke(simulate, ["paper_kick", "--json", "-"])
    assert json.loads(ended.stdout)["status"] == "landed"


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["no_such_scene"], "neither a file nor a scene"),
        (["robot_chip", "--tolerance", "0"], "tolerance is 0.0"),
        (["robot_chip", "--json", "no/such/folder"], "cannot be written"),
    ],
)
def test_bad_input_is_refused(arguments, fault):
    ended = CliRunner().invoke(simulate, arguments)
    assert isinstance(ended.exception, kd.InvalidInput)
    assert fault in str(ended.exception)
