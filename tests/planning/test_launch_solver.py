from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

import kickdyn as kd
from kickdyn.planning.launch_solver import ShootingProblem, apex, crossing, distinct, lowest

SPIN = np.array([5.0, -30.0, 20.0])
VELOCITY = np.array([18.0, 2.0, 9.0])


@pytest.mark.parametrize("air", [None, kd.Air(drag="brazuca", wind=(1, -2, 0))])
def test_the_flight_is_that_of_fly(air):
    shot = ShootingProblem(kd.Ball(), air, SPIN).shoot(VELOCITY, 1.1)
    path = kd.fly(kd.BallState(velocity=VELOCITY, spin=SPIN), kd.Ball(), air, tol=1e-12)
    here = path.sample(1.1)
    assert shot.position(1.1) == pytest.approx(here.position, abs=1e-9)
    assert shot.velocity(1.1) == pytest.approx(here.velocity, abs=1e-9)
    assert apex(shot)[0] == pytest.approx(path.height, abs=1e-9)
    ahead, up = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    assert crossing(shot, ahead, 9.0, up)[0] == pytest.approx(
        path.arrival(9.0).position[2], abs=1e-9
    )
    assert np.isnan(crossing(shot, ahead, 90.0, up)[0])


def test_slopes_are_those_of_differences():
    field = ShootingProblem(
        kd.Ball(), kd.Air(drag="brazuca"), SPIN / np.linalg.norm(SPIN), seeks_spin=True
    )
    ahead, left = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])

    def results(change):
        shot = field.shoot(np.append(VELOCITY, 30.0) + change, 1.1)
        return np.array([*shot.position(1.1), apex(shot)[0], crossing(shot, ahead, 9, left)[0]])

    steps = 1e-3 * np.eye(4)
    expected = np.array([(results(step) - results(-step)) / 2e-3 for step in steps]).T
    shot = field.shoot(np.append(VELOCITY, 30.0), 1.1)
    found = np.vstack([shot.slopes(1.1), apex(shot)[1], crossing(shot, ahead, 9, left)[1]])
    assert found == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("spin", [(0, -80.0, 0), (0, 0, 0)])
@pytest.mark.parametrize("up", [-0.05, 0.4])
def test_lowest_and_highest_places(spin, up):
    velocity = 35 * np.array([np.cos(up), 0, np.sin(up)])
    shot = ShootingProblem(kd.Ball(), kd.Air(drag="brazuca"), np.array(spin)).shoot(velocity, 1.3)
    heights = [shot.position(at)[2] for at in np.linspace(0, 1.3, 20_001)]
    assert lowest(shot) == pytest.approx(min(heights), abs=1e-6)
    assert apex(shot)[0] == pytest.approx(max(heights), abs=1e-6)
    if up < 0 and spin[1]:
        assert lowest(shot) < -0.05
        assert apex(shot)[0] > 0.2


def test_a_short_dip_is_not_overlooked():
    field = ShootingProblem(kd.Ball(), kd.Air(drag="brazuca"), np.array([0, -80.0, 0]))
    velocity = np.array([35, 0, -0.02])
    far = field.shoot(velocity, 3.0)
    lands = brentq(lambda at: far.position(at)[2] + 1e-9, 0.2, 3.0)  # a hair lower than the start
    first = [far.position(at)[2] for at in np.linspace(0, lands / 64, 2001)]
    assert min(first) < -1e-6
    assert lowest(field.shoot(velocity, lands)) == pytest.approx(min(first), rel=1e-3)


def test_a_flight_that_fails_is_none():
    def broken(reynolds, spin_parameter):
        raise ArithmeticError("no coefficient")

    assert ShootingProblem(kd.Ball(), kd.Air(drag=broken), SPIN).shoot(VELOCITY, 1.1) is None


def test_solutions_are_distinct_and_in_the_order_of_time():
    def solution(time, speed):
        return SimpleNamespace(unknowns=np.array([speed, 0.0, 1.0, time]), time=time)

    problem = SimpleNamespace(sizes=lambda unknowns: np.ones(4))
    late, early, again = solution(2.0, 20.0), solution(1.0, 10.0), solution(2.0 + 1e-9, 20.0)
    assert distinct([late, early, again], problem) == [early, late]
