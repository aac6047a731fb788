"""The errors on verification.md are those that are measured."""

import re
from pathlib import Path

import pytest
from flight_methods import measure_flights
from impact_methods import kick
from references.exact_impact import exact_impact, given

PAGE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "verification.md"


def rows(heading):
    """Return the cells of the table with this heading, row by row."""
    lines = PAGE.read_text("utf-8").split(f"| {heading} |", 1)[1].split("\n\n", 1)[0].splitlines()
    return [[cell.strip(" `") for cell in line.strip("|").split(" | ")] for line in lines[2:]]


@pytest.mark.slow
def test_the_errors_of_the_kick():
    pytest.importorskip("mujoco")
    from mujoco_comparison import mujoco_kick

    impact = kick(0.0)
    exact = exact_impact(*given(impact))["impulse"]
    (_, bound, _), *simulated = rows("Impulse")
    assert exact.error(impact.impulse) < float(bound.removeprefix("<"))
    assert len(simulated) == 2
    for name, error, _ in simulated:
        stiffness, dt = map(float, re.fullmatch(r"MuJoCo, (\S+) N/m, dt (\S+) s", name).groups())
        assert float(error) == pytest.approx(
            exact.error(mujoco_kick(impact, stiffness, dt)()), rel=0.02
        ), name


@pytest.mark.slow
def test_the_errors_of_the_flights():
    """An integrator's error at a tolerance depends on rounding in the choice of its steps."""
    measured = {row.method: row.error for row in measure_flights([1e-9]) if row.scene == "full"}
    for name, error, _ in rows("Method"):
        right = measured[name.removeprefix("scipy's `")]
        assert float(error) == pytest.approx(right, rel=0.1), name
