"""The numbers of docs/explanation/verification.md are those that are measured."""

import re
from pathlib import Path

import pytest
from extremes.gains import gains
from flight_methods import measure_flights
from impact_methods import kick
from references.exact_impact import exact_impact, given

PAGE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "verification.md"


def rows(heading):
    """Return the cells of the table with this heading, row by row."""
    lines = PAGE.read_text("utf-8").split(f"| {heading} |", 1)[1].split("\n\n", 1)[0].splitlines()
    return [[cell.strip(" `") for cell in line.strip("|").split(" | ")] for line in lines[2:]]


def test_the_errors_of_the_kick():
    pytest.importorskip("mujoco")
    from mujoco_comparison import mujoco_kick

    impact = kick(0.0)
    exact = exact_impact(*given(impact))["impulse"]
    (ours, error, _), *simulated = rows("Impulse")
    # Below 1e-15 the error is rounding, and its digits differ between machines.
    assert (ours, error) == ("kd.strike", "< 1e-15")
    assert exact.error(impact.impulse) < 1e-15
    assert len(simulated) == 2
    for name, error, _ in simulated:
        stiffness, dt = map(float, re.fullmatch(r"MuJoCo, (\S+) N/m, dt (\S+) s", name).groups())
        assert f"{exact.error(mujoco_kick(impact, stiffness, dt)()):.1e}" == error


def test_the_errors_of_the_flights():
    measured = {
        row.method: f"{row.error:.1e}" for row in measure_flights([1e-9]) if row.scene == "full"
    }
    shown = {name.removeprefix("scipy's `"): error for name, error, _ in rows("Method")}
    assert len(shown) == 5
    assert shown.items() <= measured.items()


def test_the_formulas_of_kickdyn_have_more_digits_than_those_of_textbooks():
    compared = list(gains())
    assert len(compared) == 6
    for gain in compared:
        assert gain.our_error < 1e-2 * gain.plain_error, gain.what
