"""Errors: their kinds, one printable line, and copies that a process pool needs."""

import pickle

import numpy as np
import pytest

import kickdyn as kd

LONG = "folder/" * 200 + "leg.urdf"

ERRORS = {
    "input": kd.InvalidInput("a is 1:\n it must be 2", "b is 3"),
    "urdf": kd.UrdfError("leg.urdf", ["has no link", "a joint has no name"]),
    "scene": kd.SceneError("s.toml", ["has no leg", "has no contact"]),
    "long": kd.InvalidInput(f"{LONG} is full"),
    "long urdf": kd.UrdfError(LONG, ["has no link"]),
    "long scene": kd.SceneError(LONG.replace("/", " "), ["has no leg", "has no contact"]),
}


def test_an_error_can_be_caught_by_its_kinds():
    assert issubclass(kd.UrdfError, kd.InvalidInput)
    assert issubclass(kd.InvalidInput, kd.KickdynError)
    assert issubclass(kd.InvalidInput, ValueError)
    assert issubclass(kd.NoImpact, kd.KickdynError)
    assert not issubclass(kd.NoImpact, ValueError)  # an answer, not a bad value


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_survives_a_process_pool(name):
    error = ERRORS[name]
    copied = pickle.loads(pickle.dumps(error))
    assert (type(copied), str(copied), copied.faults) == (type(error), str(error), error.faults)
    assert getattr(copied, "source", None) == getattr(error, "source", None)


def test_every_fault_is_in_the_message_and_on_its_own():
    assert ERRORS["input"].faults == ("a is 1: it must be 2", "b is 3")
    assert str(ERRORS["input"]) == "a is 1: it must be 2; b is 3"
    assert str(ERRORS["urdf"]) == "leg.urdf: has no link; a joint has no name"
    assert str(ERRORS["scene"]).splitlines() == ["s.toml:", "has no leg", "has no contact"]


def test_a_long_name_of_a_file_loses_its_middle():
    for name in ("long", "long urdf", "long scene"):
        text = str(ERRORS[name])
        assert all(end in text for end in ("folder", "leg.urdf")), name
        assert len(text) < 300, name


def test_a_message_is_one_printable_line():
    assert str(kd.KickdynError("a\xa0b\x7fc\r\n   d\te")) == "a\\xa0b\\x7fc d\\te"
    with pytest.raises(kd.InvalidInput, match="array") as refusal:
        kd.Ball(mass=np.eye(3))
    assert str(refusal.value).isprintable()
