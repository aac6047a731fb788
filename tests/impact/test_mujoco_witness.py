"""MuJoCo's simulation approaches the instant impact as its contact gets stiffer."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the witness is MuJoCo")

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "mujoco_witness.py"
spec = importlib.util.spec_from_file_location("mujoco_witness", SCRIPT)
witness = importlib.util.module_from_spec(spec)
spec.loader.exec_module(witness)


@pytest.mark.parametrize("kick", witness.KICKS, ids=lambda kick: kick.name)
def test_stiffer_is_nearer(kick):
    apart = [witness.difference(kick, stiffness, 5e-6) for stiffness in witness.STIFFNESSES]
    assert apart[0] > apart[1] > apart[2]
    assert apart[2] <= 0.015
    assert apart[0] / apart[2] > 5  # with the root of the stiffness: 10


def test_friction_matters_in_the_kicks_that_have_it():
    for kick in witness.KICKS:
        hit, smooth = witness.ours(kick), witness.ours(kick._replace(friction=0.0))
        change = np.linalg.norm(hit.impulse - smooth.impulse) / np.linalg.norm(hit.impulse)
        assert hit.sticking == (kick.friction > 0)
        assert change > 0.1 if kick.friction else change == 0
