"""heyoka's Taylor series: its equations are those of kickdyn, and it lands where kickdyn does."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from flight_methods import kicks
from tolerances import agrees, closed_form, integrated

import kickdyn as kd
from kickdyn.flight.forces import acceleration_function

SCRIPT = Path(__file__).resolve().parents[1] / "benchmarks" / "heyoka_flight.py"
if not SCRIPT.exists():
    pytest.skip("benchmarks come with the checkout only", allow_module_level=True)
script = runpy.run_path(str(SCRIPT))
BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")


def test_the_rates_are_those_of_forces():
    hy = pytest.importorskip("heyoka")
    system = script["equations"](hy, BALL, AIR)
    rates = hy.cfunc([rate for _, rate in system], [name for name, _ in system])
    acting = acceleration_function(BALL, AIR)
    rng = np.random.default_rng(4)
    for _ in range(20):
        velocity = rng.normal(size=3)
        velocity *= rng.uniform(7, 34) / np.linalg.norm(velocity)
        spin, left = rng.normal(size=3) * 40, rng.uniform(0.5, 1)
        ax, ay, az, k = acting(3.0, *velocity, *(left * spin))
        result = rates([1.0, 2.0, 3.0, *velocity, left], pars=spin)
        right = [*velocity, ax, ay, az, -k * left]
        assert result == pytest.approx(right, rel=closed_form(100)), velocity


@pytest.mark.slow
@pytest.mark.parametrize("air", [AIR, kd.Air(drag=0.2, lift=0.15, torque=0.01)])
@pytest.mark.parametrize("ending", ["event", "dense output", "known time"])
def test_batches_land_where_fly_many_does(air, ending):
    pytest.importorskip("heyoka")
    states = kd.BallState(velocity=[state.velocity for state in kicks(4)], spin=(3, -30, 20))
    many = kd.fly_many(states, BALL, air, tol=1e-13)
    fly = script["heyoka_batch_landings"](BALL, air, 1e-14, ending, 4)
    landed, _ = fly(states, many.duration.values)
    agrees(landed, many.landing_position.values, integrated(1e-13))
