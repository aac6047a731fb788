"""`kickdyn kick-library` makes a library, reads it, and writes the motion of a kick."""

import json
import math

import numpy as np
import pytest

import kickdyn as kd

MAKE = "kick-library one.npz --ball-height -0.7042 --speed 12 --elevation 10"


def test_a_library_is_made_and_gives_a_kick(kickdyn, tmp_path):
    assert kickdyn(f"{MAKE} --json -").json["covered"] == 1.0
    kickdyn("kick-library one.npz --kick 12,10 --json kick.json --out kick.csv")
    shown = json.loads((tmp_path / "kick.json").read_text())
    assert shown["met"]
    assert (shown["speed"], shown["elevation"]) == pytest.approx((12.0, math.radians(10)))
    library = kd.kick_library(kd.Leg.human(), tmp_path / "one.npz")
    samples = library.kick_at(library.reader.lower).motion.samples(100.0)
    written = np.loadtxt(tmp_path / "kick.csv", delimiter=",")
    np.testing.assert_array_equal(written, samples.joint_positions)
    refused = kickdyn("kick-library one.npz --kick 13,10 --out kick.csv", code=2)
    assert "speed is 13 m/s, outside of 12 m/s" in refused.err
    assert "--kick is '12'" in kickdyn("kick-library one.npz --kick 12", code=2).err


@pytest.mark.parametrize(("words", "said"), [
    ("--speed 12,a", "12,a"), ("--speed 12 --out kick.csv", "--kick"),
    ("--speed 12 --elevation 95", "elevation"), ("", "one.npz does not exist"),
])  # fmt: skip
def test_bad_input_is_named(kickdyn, words, said):
    assert said in kickdyn(f"kick-library one.npz --ball-height 0 {words}", code=2).err
