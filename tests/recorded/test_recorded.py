"""Every answer is the one that was recorded; `python tools/record.py` records intended changes."""

import re
from importlib import metadata
from pathlib import Path

import pytest

from kickdyn import errors
from recorded.differences import differences, same_text
from recorded.store import cases, expected

MADE_WITH = {
    "commands: tradeoff": "matplotlib",
    "impact: plot with deviations": "matplotlib",
    "simulators: ran": "mujoco",
}
"""Packages of which older versions draw or compute otherwise than those of constraints.txt."""
PINNED = (Path(__file__).parents[2] / "constraints.txt").read_text("utf-8")


def is_older(package):
    def numbers(version):
        return [int(number) for number in re.findall(r"\d+", version)]

    (pinned,) = re.findall(rf"^{package}==(.+)$", PINNED, re.MULTILINE)
    return numbers(metadata.version(package)) < numbers(pinned)


@pytest.mark.parametrize("label", cases())
def test_the_answer_is_the_recorded_one(label):
    case = cases()[label]
    if label in MADE_WITH and is_older(MADE_WITH[label]):
        pytest.skip(f"an older {MADE_WITH[label]} than that of constraints.txt")
    known = expected(case.group)
    if case.grows and case.name not in known:
        pytest.skip("a new module, which is not recorded yet")
    assert case.name in known, f"{label} is not recorded: python tools/record.py"
    found = case.differences(known[case.name], case.compute())
    assert not found, "\n".join(
        [f"{label!r} changed in {len(found)} fields; if meant: tools/record.py", *found[:12]]
    )


REFUSED = {
    "flight: from below", "impact: batch by stronge", "impact: in time, turning", "impact: pressed flat",
    "planning: kick into a wall", "planning: launch of a heavy ball",
}  # fmt: skip
"""Cases beside those of faults and messages whose only answer is a refusal."""


def test_no_answer_has_become_a_refusal():
    answers = {f"{group}: {name}": answer for group in {case.group for case in cases().values()}
               if group not in ("faults", "messages") for name, answer in expected(group).items()}  # fmt: skip
    refused = {label for label, answer in answers.items() if is_refusal(answer)}
    assert refused == REFUSED


def is_refusal(answer):
    return isinstance(answer, str) and hasattr(errors, answer.partition(":")[0])


def test_nothing_is_recorded_that_no_case_computes():
    labels = set(cases())
    for group in {case.group for case in cases().values()}:
        assert {f"{group}: {name}" for name in expected(group)} <= labels


def test_the_tests_whose_refusals_are_recorded_exist():
    for name in expected("refusals"):
        path, *_, function = name.partition("[")[0].split("::")
        assert f"def {function}(" in (Path(__file__).parents[1] / path).read_text("utf-8"), name


def test_what_counts_as_a_difference():
    assert differences({"a": [1.0, 2e-12]}, {"a": [1.0 + 1e-9, 0.0]}) == []
    assert differences({"a": [1.0, 0.0]}, {"a": [1.0, 1e-4]}) == ["a: [1.0, 0.0001] for [1.0, 0.0]"]
    assert differences({"a": 1.0}, {"a": 1.0001}) == ["a: 1.0001 for 1.0"]
    assert differences({"a": 1}, {"b": 1}) == ["a: missing, it was 1", "b: new, 1"]
    assert differences({"a": True}, {"a": 1}) == ["a: 1 for True"]
    assert same_text("speed  16.84 m/s, below 1e-14", "speed 16.85 m/s, below 1e-14")
    assert same_text("residual 2.1e-16 of 3", "residual 8.8e-15 of 3")
    for other in ("speed 16.86 m/s", "speed 16.84 km/s", "speed -16.84 m/s", "speed 168.4 m/s"):
        assert not same_text("speed 16.84 m/s", other)
    assert not same_text("3 bounces", "4 bounces")
    assert same_text("after 0.5 s", "after 0.499 s")
    assert not same_text("after 0.5 s", "after 0.55 s")
    for one, other in ((2e-3, 2.4e-3), (1e-9, 1.1e-9), ("K t 0.05", "K t 0.06"), (2, 2.5)):
        assert differences(one, one, 0.0) == []
        assert differences(one, other, 0.0) != []
