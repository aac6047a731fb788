import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift
from kickdyn.aerodynamics import spin_decay as torque
from kickdyn.aerodynamics.coefficient_model import CoefficientModel, find, smoothstep

HALF = CoefficientModel("drag", "half", lambda reynolds, spin: 0.5 + spin, (0, 1), (0, 1), "here")


def test_model_is_a_function_with_a_name():
    assert HALF(3.0) == 0.5  # without spin if not named
    assert HALF(3.0, 0.25) == 0.75


def test_find_by_name_or_take_as_it_is():
    assert find("drag", {"half": HALF}, "half") is HALF
    assert find("drag", {}, HALF) is HALF
    assert find("drag", {}, math.hypot) is math.hypot


@pytest.mark.parametrize("choice", ["Half", "", " half", 0.5, ("half",)])
def test_unknown_model_is_refused_with_the_names(choice):
    with pytest.raises(kd.InvalidInput, match=r"drag model .* is unknown: choose half, or pass"):
        find("drag", {"half": HALF}, choice)


@given(st.floats(1e-300, 1e300), st.floats(1e-300, 1e300))
def test_smoothstep_climbs_from_0_to_1(x, more):
    low, high = sorted((x, more))
    below, above = (smoothstep(value, 1.0, 10.0) for value in (low, high))
    assert 0 <= below <= above <= 1


S = 0.25


@pytest.mark.parametrize(
    ("x", "weight"),
    [
        *((0.5, 0), (1, 0), (math.sqrt(10), 0.5), (10, 1), (99, 1)),
        (10**S, 35 * S**4 - 84 * S**5 + 70 * S**6 - 20 * S**7),
    ],
)
def test_smoothstep_is_a_polynomial_of_the_logarithm(x, weight):
    assert smoothstep(x, 1.0, 10.0) == pytest.approx(weight, rel=1e-14)


def test_three_derivatives_of_smoothstep_vanish_at_both_ends():
    """So that near them it is flatter than any cubic: h^4 and no less."""
    for h in (1e-2, 1e-3):
        assert smoothstep(10.0**h, 1.0, 10.0) == pytest.approx(35 * h**4, rel=3 * h)
        assert 1 - smoothstep(10.0 ** (1 - h), 1.0, 10.0) == pytest.approx(35 * h**4, rel=0.05)


def test_the_page_has_every_model_with_its_range_and_source():
    text = (Path(__file__).resolve().parents[2] / "docs" / "theory.md").read_text("utf-8")
    number = r"([0-9.e+]+|inf)"
    rows = re.findall(
        rf"^\| (\w+) `(.*)` \| {number} to {number} \| {number} to {number} \| (.*) \|$",
        text,
        re.MULTILINE,
    )
    said = {(kind, name): (tuple(map(float, ends)), source) for kind, name, *ends, source in rows}
    models = [model for room in (drag, lift, torque) for model in room.MODELS.values()]
    assert len(rows) == len(models)
    for model in models:
        ends, source = said[model.kind, model.name]
        assert ends == pytest.approx((*model.reynolds, *model.spin), rel=0.01)
        assert source == model.source
