"""The command simulate: its table, its numbers, and what it refuses."""

import json

import pytest
from click.testing import CliRunner

import kickdyn as kd
from kickdyn.cli.simulate_command import simulate


def test_it_prints_the_error_budget():
    ended = CliRunner().invoke(simulate, ["robot_chip", "--tolerance", "0.2"])
    assert ended.exit_code == 0
    answer = kd.simulate(kd.load_scene("robot_chip"), 0.2)
    assert answer.end_text in ended.stdout
    assert f"error {answer.error:.2g} m, within the tolerance of 0.2 m" in ended.stdout


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
