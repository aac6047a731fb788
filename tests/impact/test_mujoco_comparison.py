"""MuJoCo's simulation approaches the instantaneous impact with increasing stiffness."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs MuJoCo")

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "benchmarks" / "mujoco_comparison.py"
spec = importlib.util.spec_from_file_location("mujoco_comparison", SCRIPT)
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


@pytest.mark.parametrize("kick", witness.KICKS, ids=lambda kick: kick.name)
def test_the_limit_of_mujocos_law_is_ours_where_nothing_slides_under_friction(kick):
    assert witness.apart(witness.relaxed(kick), witness.ours(kick).impulse) <= 1e-6


@pytest.mark.parametrize(("friction", "restitution"), [(0.05, 0.8), (0.05, 1.0), (0.07, 0.9)])
def test_sliding_it_approaches_its_own_limit(friction, restitution):
    kick = witness.SLIDING._replace(friction=friction, restitution=restitution)
    limit, hit = witness.relaxed(kick), witness.ours(kick)
    assert not hit.sticking
    assert witness.apart(limit, hit.impulse) > 0.02
    apart = [
        witness.apart(witness.mujoco_kick(hit, stiffness, 2e-6)(), limit)
        for stiffness in witness.STIFFNESSES
    ]
    assert apart[0] > apart[1] > apart[2]
    assert apart[2] <= 0.01
    assert apart[0] / apart[2] > 5  # with the root of the stiffness: 10
