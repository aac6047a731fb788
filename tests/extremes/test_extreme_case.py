"""Verdicts on cases, and what JSON can hold of them."""

import json
import math

import pytest

from extremes.extreme_case import ExtremeCase, compare, digits, expect_refusal
from kickdyn.errors import InvalidInput


def test_verdicts():
    assert digits(0.0) == digits(1e-20) == 16
    assert digits(1e-5) == pytest.approx(5)
    assert digits(10.0) == 0
    assert ExtremeCase("", "", "", 1e-9, 1e5).verdict == "wrong"
    assert ExtremeCase("", "", "", 1e-11, 1e5).verdict == "right"
    assert ExtremeCase("", "", "", 1e-9, 1e5, claimed=8).verdict == "as-claimed"
    assert ExtremeCase("", "", "", 1e-9, 1e5, claimed=9.5).verdict == "wrong"
    assert ExtremeCase("", "", "", math.inf, 1e20).verdict == "wrong"
    row = compare("f", "c", {"a": 1e-15, "b": 1e-12}, {"a": 1.0, "b": 1e4}, {})
    assert (row.quantity, row.worst_error) == ("a", 1e-12)


def test_what_is_taken_though_it_must_not_be_is_wrong():
    def raises():
        raise InvalidInput("no")

    assert expect_refusal("x", raises).verdict == "refused"
    assert expect_refusal("x", lambda: None).verdict == "wrong"


def test_json_holds_no_infinity():
    said = expect_refusal("x", lambda: None).as_json()
    assert (said["case"], said["verdict"], said["error"], said["condition"]) == (
        "x",
        "wrong",
        None,
        1,
    )
    json.dumps(said, allow_nan=False)
