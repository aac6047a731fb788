import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.shooting import Range

SPIN = np.array([5.0, -30.0, 20.0])
VELOCITY = np.array([18.0, 2.0, 9.0])


@pytest.mark.parametrize("air", [None, kd.Air(wind=(1, -2, 0))])
def test_the_flight_is_that_of_fly(air):
    shot = Range(kd.Ball(), air, SPIN).shoot(VELOCITY, 1.1)
    path = kd.fly(kd.BallState(velocity=VELOCITY, spin=SPIN), kd.Ball(), air, tol=1e-12)
    here = path.sample(1.1)
    assert shot.place(1.1)[0] == pytest.approx(here.position, abs=1e-9)
    assert shot.place(1.1)[1] == pytest.approx(here.velocity, abs=1e-9)
    assert shot.apex()[0] == pytest.approx(path.height, abs=1e-9)
    ahead, up = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    assert shot.crossing(ahead, 9.0, up)[0] == pytest.approx(
        path.arrival(9.0).position[2], abs=1e-9
    )
    assert np.isnan(shot.crossing(ahead, 90.0, up)[0])


def test_slopes_are_those_of_differences():
    field = Range(kd.Ball(), kd.Air(), SPIN / np.linalg.norm(SPIN), seeks_spin=True)
    ahead, left = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])

    def results(change):
        shot = field.shoot(VELOCITY + change[:3], 1.1, 30.0 + change[3])
        return np.array([*shot.place(1.1)[0], shot.apex()[0], shot.crossing(ahead, 9, left)[0]])

    steps = 1e-3 * np.eye(4)
    expected = np.array([(results(step) - results(-step)) / 2e-3 for step in steps]).T
    shot = field.shoot(VELOCITY, 1.1, 30.0)
    found = np.vstack([shot.slope(1.1), shot.apex()[1], shot.crossing(ahead, 9, left)[1]])
    assert found == pytest.approx(expected, abs=2e-5)
