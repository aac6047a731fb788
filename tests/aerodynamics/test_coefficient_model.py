import copy
import math
import pickle
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.aerodynamics import drag, lift
from kickdyn.aerodynamics import spin_decay as torque
from kickdyn.aerodynamics.coefficient_model import CoefficientModel, find_model, smoothstep

HALF = CoefficientModel("drag", "half", lambda reynolds, spin: 0.5 + spin, (0, 1), (0, 1), "here")


def test_model_is_a_function_with_a_name():
    assert HALF(3.0) == 0.5  # without spin if not named
    assert HALF(3.0, 0.25) == 0.75


def test_find_by_name_or_take_as_it_is():
    assert find_model("drag", {"half": HALF}, "half") is HALF
    assert find_model("drag", {}, HALF) is HALF
    assert find_model("drag", {}, math.hypot) is math.hypot
    assert find_model("drag", {}, None) is None


@pytest.mark.parametrize("choice", ["Half", "", " half", ("half",)])
def test_unknown_model_is_refused_with_the_names(choice):
    with pytest.raises(kd.InvalidInput, match=r"drag model .* is unknown: choose half, or pass"):
        find_model("drag", {"half": HALF}, choice)


def nearly_one(reynolds, spin_parameter):
    return 0.99


@pytest.mark.parametrize("name", ["brazuca", "mine"])
@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))]
)
def test_a_model_keeps_its_own_function_in_copies_and_pickles(name, again):
    mine = CoefficientModel("drag", name, nearly_one, (0, 1e6), (0, 1), "here")
    air = again(kd.Air(drag=mine))
    assert air.drag == mine
    assert air.drag(1e5) == 0.99
    assert air == kd.Air(drag=mine) != kd.Air()


@pytest.mark.parametrize("module", [drag, lift, torque])
def test_a_shipped_model_stays_the_same_object(module):
    for model in module.MODELS.values():
        assert (
            copy.deepcopy(model) is copy.copy(model) is pickle.loads(pickle.dumps(model)) is model
        )


def test_a_shipped_model_can_be_unpickled_by_itself():
    text = pickle.dumps(drag.MODELS["brazuca"])
    code = f"import pickle; print(pickle.loads({text!r}).name)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "brazuca\n"


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
    text = (Path(__file__).resolve().parents[2] / "docs" / "explanation" / "theory.md").read_text(
        "utf-8"
    )
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
        assert re.match(rf"{re.escape(source)}($|[,; ])", model.source)
