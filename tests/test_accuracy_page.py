"""The short table of docs/explanation/accuracy.md has the errors that are measured."""

import re
from pathlib import Path

import pytest
from impact_methods import kick
from references.exact_impact import exact_impact, given

PAGE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "accuracy.md"


def test_the_rows_on_the_kick_of_the_paper():
    pytest.importorskip("mujoco")
    from kickdyn.simulators.mujoco_kick import mujoco_kick

    text = PAGE.read_text("utf-8")
    impact = kick(0.0)
    exact = exact_impact(*given(impact))["impulse"]
    # Below 1e-15 the error is rounding, and its digits differ between machines.
    assert "| `kd.strike` | < 1e-15 |" in text
    assert exact.error(impact.impulse) < 1e-15
    rows = re.findall(r"^\| MuJoCo, (\S+) N/m, dt (\S+) s \| (\S+) \|", text, re.MULTILINE)
    assert len(rows) == 2
    for stiffness, dt, error in rows:
        assert f"{exact.error(mujoco_kick(impact, float(stiffness), float(dt))()):.1e}" == error
