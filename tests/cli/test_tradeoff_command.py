"""`kickdyn tradeoff`: errors of functions against exact answers, and effects of a scene."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from references.exact_impact import exact_impact, given
from tolerances import closed_form, integrated

import kickdyn as kd
from kickdyn.cli import function_costs
from kickdyn.cli.tradeoff_command import effect_figure
from kickdyn.scene.effects import EffectSize
from kickdyn.scene.simulate import measure_effects

ROOT = Path(__file__).resolve().parents[2]

ERRORS = {
    "strike": closed_form(), "strike_many": closed_form(10), "sweep": closed_form(10),
    "pin.impulseDynamics, bare": closed_form(),
    "collide": 1e-5, "collide_many": 1e-5, "fly": 1e-6, "fly_many": 1e-6, "follow": 1e-5,
    "follow_many": 1e-5, "simulate": 0.05,
}  # fmt: skip
"""Largest relative errors by rounding and integration, from the default tolerances."""


@pytest.mark.slow
def test_the_functions_are_as_exact_as_their_tolerances(kickdyn, monkeypatch, tmp_path):
    monkeypatch.setattr(function_costs, "_seconds", lambda run: 1e-3)
    monkeypatch.setattr(function_costs, "ROWS", 50)
    ended = kickdyn("tradeoff --plot x.svg --json x.json")
    rows = json.loads((tmp_path / "x.json").read_text())["functions"]
    table = {row["function"]: row for row in rows}
    for name, most in ERRORS.items():
        assert 0.0 <= table[name]["rounding"] < most, name
        count = {"strike_many": 50, "fly_many": 50, "sweep": 81**3}.get(name, 1)
        if name in ("strike", "strike_many", "sweep", "fly", "fly_many"):
            assert table[name]["seconds"] == pytest.approx(1e-3 / count), name
            assert table[name]["is_batch"] == (count > 1), name
    attack = np.array([math.cos(math.pi / 6), 0.0, 0.5])
    posture = kd.Leg.human().posture(np.radians([5, 10, -5]))
    kick = posture, posture.joint_velocity(10 * attack), kd.Ball.paper()
    contact = kd.Contact(attack, 0.8, 0.4)
    instant, lasting = (solve(*kick, contact).impulse for solve in (kd.strike, kd.collide))
    model = np.linalg.norm(instant - lasting) / np.linalg.norm(lasting)
    assert table["strike"]["model"] == pytest.approx(model, rel=integrated(1e-8))
    assert table["collide"]["model"] is None
    printed = {line.split("  ")[0].removesuffix(" (per row)"): line.split()[-3:]
               for line in ended.out.splitlines()}  # fmt: skip
    row, cells = table["strike"], [float(cell) for cell in printed["strike"]]
    assert cells == pytest.approx([1e6 * row["seconds"], row["rounding"], row["model"]], rel=0.05)


@pytest.mark.parametrize("friction", function_costs.EXACT)
def test_the_exact_impulses_are_those_with_50_digits(friction):
    exact = exact_impact(*given(function_costs.kick(friction)))["impulse"]
    right = [float(component) for component in exact.exact]
    assert function_costs.EXACT[friction] == pytest.approx(right, rel=closed_form(), abs=0)


def test_no_function_on_the_front_is_slower_at_equal_error():
    nan = math.nan
    table = [
        ("pin.impulseDynamics, bare", 1e-5, False, 5e-16, 0.1),
        ("strike", 4e-5, False, 5e-16, 0.05), ("collide", 2e-2, False, 3e-9, nan),
        ("strike_many", 1e-7, True, 5e-16, 0.05), ("sweep", 5e-7, True, 1e-15, 0.05),
        ("fly", 1e-3, False, 6e-11, nan),
    ]  # fmt: skip
    rows = [function_costs.FunctionCost(*row) for row in table]
    rounding, model = (function_costs.on_front(rows, kind) for kind in ("rounding", "model"))
    assert rounding == {"pin.impulseDynamics, bare", "collide", "strike_many", "fly"}
    assert model == {"pin.impulseDynamics, bare", "strike", "strike_many"}
    panels = function_costs.cost_figure(rows).axes
    for axes, kind, front in zip(panels, ("model", "rounding"), (model, rounding), strict=True):
        shown = [row for row in rows if not math.isnan(getattr(row, kind))]
        right = [
            (row.function, row.seconds, getattr(row, kind), row.is_batch, row.function in front)
            for row in shown
        ]
        lines = [line for line in axes.lines if len(line.get_xdata())]
        assert right == [
            (text.get_text(), line.get_xdata()[0], line.get_ydata()[0], line.get_marker() == "s",
             text.get_color() == "black") for text, line in zip(axes.texts, lines, strict=True)
        ]  # fmt: skip


def test_bars_end_where_neglecting_an_effect_moves_the_end():
    ends = {"drag": 2.0, "spin": 0.0, "law": math.nan, "wind": 0.3}
    sizes = [EffectSize(*row, 0.0, "none" if row[0] == "law" else "") for row in ends.items()]
    (axes,) = effect_figure("volley", sizes, 0.07).axes
    bars = [(b.get_y() + b.get_height() / 2, b.get_x() + b.get_width()) for b in axes.patches]
    assert np.array(bars) == pytest.approx(np.array([(0, 2.0), (3, 0.3)]))
    assert axes.lines[0].get_xdata() == [0.07, 0.07]
    assert [label.get_text() for label in axes.get_yticklabels()] == list(ends)
    assert [text.get_text() for text in axes.texts] == ["2", "below 1e-09", "no answer", "0.3"]


def test_effects_of_a_scene_are_those_of_the_library(kickdyn, tmp_path):
    """The largest comes first; the table has the numbers of the document."""
    ended = kickdyn("tradeoff --scene volley --json x.json --plot x.svg")
    document = json.loads((tmp_path / "x.json").read_text())
    exact = kd.simulate(kd.load_scene("volley"), None)
    sizes = {size.effect: size for size in measure_effects(exact)}
    assert document["end"] == pytest.approx(exact.end.position)
    assert document["impulse"] == pytest.approx(exact.impact.impulse)
    assert (document["scene"], document["status"]) == ("volley", "landed")
    ends = [row["end"] for row in document["effects"]]
    assert ends == sorted(ends, reverse=True)
    table = {line[:14].strip(): line[14:].split() for line in ended.out.splitlines()}
    assert {row["effect"] for row in document["effects"]} == set(sizes)
    for row in document["effects"]:
        size = sizes[row["effect"]]
        assert (row["end"], row["impulse"]) == pytest.approx((size.end, size.impulse))
        cells = [float(cell) for cell in table[row["effect"]]]
        assert cells == pytest.approx([size.end, size.impulse], rel=5e-3)
