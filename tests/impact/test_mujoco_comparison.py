"""MuJoCo's simulation approaches the instantaneous impact with increasing stiffness."""

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs MuJoCo")
pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "mujoco_comparison.py"
spec = importlib.util.spec_from_file_location("mujoco_comparison", SCRIPT)
peer = importlib.util.module_from_spec(spec)
spec.loader.exec_module(peer)


@pytest.mark.parametrize("kick", peer.KICKS, ids=lambda kick: kick.name)
def test_stiffer_is_nearer(kick):
    """The error falls with the root of the stiffness, here 10 in all."""
    errors = [peer.difference(kick, stiffness, 5e-6) for stiffness in peer.STIFFNESSES]
    assert errors == sorted(errors, reverse=True)
    assert errors[2] <= min(0.015, errors[0] / 5)


@pytest.mark.parametrize("kick", peer.KICKS, ids=lambda kick: kick.name)
def test_the_limit_of_mujocos_law_is_ours_where_nothing_slides_under_friction(kick):
    assert peer.apart(peer.relaxed(kick), peer.ours(kick).impulse) <= 1e-6


@pytest.mark.parametrize(("friction", "restitution"), [(0.05, 0.8), (0.07, 0.9)])
def test_sliding_it_approaches_a_limit_of_its_law(friction, restitution):
    kick = peer.SLIDING._replace(friction=friction, restitution=restitution)
    limit, impact = peer.relaxed(kick), peer.ours(kick)
    assert not impact.sticking
    assert peer.apart(limit, impact.impulse) > 0.02
    errors = [
        peer.apart(peer.mujoco_kick(impact, stiffness, 2e-6)(), limit)
        for stiffness in peer.STIFFNESSES
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[2] <= min(0.01, errors[0] / 5)
