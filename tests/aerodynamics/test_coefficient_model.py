"""Models of coefficients: found by name, copied, joined, and described in the documentation."""

import copy
import math
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift, spin_decay
from kickdyn.aerodynamics.coefficient_model import CoefficientModel, ScaledCoefficient

HALF = CoefficientModel("drag", "half", lambda reynolds, spin: 0.5 + spin, (1, 9), (0, 1), "here")
SHIPPED = [m for package in (drag, lift, spin_decay) for m in package.MODELS.values()]


def test_a_model_is_its_function_and_knows_its_range():
    assert HALF(3.0) == 0.5  # without spin
    assert HALF(3.0, 0.25) == 0.75
    assert ScaledCoefficient(HALF, 3.0)(3.0, 0.25) == 2.25
    reynolds, spin = np.array([0.5, 5.0, 9.5, 5.0, 5.0]), np.array([0.5, 0.0, 1.0, -0.1, 1.1])
    outside = HALF.beyond(reynolds, spin)
    assert outside.astype(int).tolist() == [[1, 0, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0],
        [0, 0, 0, 0, 1]]  # fmt: skip


@pytest.mark.parametrize(("reynolds", "spin"), [
    (0.0, 0.0), (math.nan, 0), (math.inf, 0), (1.0, -0.1), (1.0, math.inf)])  # fmt: skip
def test_a_model_refuses_what_is_no_flow(reynolds, spin):
    with pytest.raises(kd.InvalidInput, match=f"half at Re {reynolds!r}.*above 0"):
        HALF(reynolds, spin)


def nearly_one(reynolds, spin_parameter):
    return 0.99


@pytest.mark.parametrize("again", [
    copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])  # fmt: skip
def test_a_model_keeps_its_own_function_in_copies_and_pickles(again):
    """Also one that has the name of a shipped model; shipped models stay the same objects."""
    mine = CoefficientModel("drag", "brazuca", nearly_one, (0, 1e6), (0, 1), "here")
    air = again(kd.Air(drag=mine))
    assert air.drag(1e5) == 0.99
    assert air == kd.Air(drag=mine) != kd.Air(drag="brazuca")
    assert again(kd.Air(drag=0.25)).drag(1e5, 0.0) == 0.25
    twice = again(kd.Air(drag=ScaledCoefficient(mine, 2.0)))
    assert (twice.drag(1e5), repr(twice).count("'2 x brazuca'")) == (1.98, 1)
    assert all(again(model) is model for model in SHIPPED)


def test_the_page_has_every_model_with_its_range_and_source():
    page = Path(__file__).resolve().parents[2] / "docs" / "explanation" / "theory.md"
    number = r"([0-9.e+]+|inf)"
    row = rf"^\| (\w+) `(.*)` \| {number} to {number} \| {number} to {number} \| (.*) \|$"
    rows = re.findall(row, page.read_text("utf-8"), re.MULTILINE)
    table = {(kind, name): (tuple(map(float, ends)), source) for kind, name, *ends, source in rows}
    assert set(table) == {(model.kind, model.name) for model in SHIPPED}
    for model in SHIPPED:
        ends, source = table[model.kind, model.name]
        assert ends == pytest.approx((*model.reynolds, *model.spin), rel=0.01), model.name
        assert model.source.startswith(source), model.name
