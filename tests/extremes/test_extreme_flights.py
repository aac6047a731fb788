"""Coefficients and flights of every Reynolds number; a coefficient that is off is seen."""

import dataclasses
import math

import numpy as np
import pytest

import kickdyn as kd
from extremes import extreme_flights
from extremes.exact_coefficients import FORMULAS, MODELS
from kickdyn.aerodynamics.drag import constant


def test_a_coefficient_that_is_off_is_seen(monkeypatch):
    model = MODELS["drag"]["sphere"]
    wrong = dataclasses.replace(model, function=lambda re, sp: model.function(re, sp) * (1 + 1e-13))
    monkeypatch.setitem(MODELS["drag"], "sphere", wrong)
    rows = {row.case: row for row in extreme_flights.coefficients()}
    assert rows["drag sphere, Re to 1e9"].verdict == "wrong"
    assert rows["drag stokes, Re to 1e9"].verdict == "right"


def test_joins_are_among_the_reynolds_numbers():
    found = extreme_flights.reynolds_numbers()
    assert found == sorted(found)
    assert found[0] == 5e-324
    assert found[-1] == 1e9
    assert {1.0, math.nextafter(1.0, 0), math.nextafter(1.0, 2)} <= set(found)


def test_a_fall_from_rest_against_quadrature():
    row = next(extreme_flights.shipped_drag(["brazuca"]))
    assert row.case == "drag brazuca, dropped, from Re 0"
    assert row.verdict in ("right", "as-claimed")
    assert row.digits > 12


def test_the_quadrature_knows_the_closed_form_of_constant_drag():
    """Vertical shot with quadratic drag: v_t^2/2g ln(1 + v^2/v_t^2), and back at a known speed."""
    ball, air, up = kd.Ball(), kd.Air(drag=constant(0.5), lift=None, buoyancy=False), 30.0
    found = extreme_flights.vertical(lambda c, re, sp: c(0.5), up, 0.0, ball, air, 16.19)
    square = 2 * ball.mass * 9.81 / (air.density * ball.cross_section * 0.5)
    height = square / 19.62 * np.log1p(up**2 / square)
    assert float(found["height"].exact[0]) == pytest.approx(height, rel=1e-13)
    down = up / np.sqrt(1 + up**2 / square)
    assert float(found["landing speed"].exact[0]) == pytest.approx(down, rel=1e-13)


def test_what_is_no_reynolds_number_is_refused():
    rows = extreme_flights.flight_refusals()
    assert sum(" at Re " in row.case for row in rows) == 3 * len(FORMULAS)
    assert {row.verdict for row in rows} == {"refused"}


def test_pieces_add_up():
    pieces = [row for row in extreme_flights.tolerances() if "in a row" in row.case]
    assert len(pieces) == 6
    assert all(row.digits > 10 for row in pieces)
