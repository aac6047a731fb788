import numpy as np
import pytest

import kickdyn as kd
from kickdyn.sweeps.block import Space
from kickdyn.sweeps.grid import grid
from kickdyn.sweeps.kick import Kick, kick_from
from kickdyn.sweeps.opened import Sweep
from kickdyn.sweeps.optimum import optimum
from kickdyn.sweeps.run import sweep

GRID = {"hip": np.radians(np.arange(0.0, 20.0, 2.0)), "slide": np.arange(0.0, 1.0, 0.25)}
SPACE = Space.of({**GRID, "held": np.zeros(1)}, {"hip": "rad", "slide": "m", "held": "rad"})


def bowl(place):
    hip, slide, _ = (values[i] for values, i in zip(SPACE.axes.values(), place, strict=True))
    return 5 - 0.5 * (hip - 7) ** 2 + 3 * (hip - 7) * (slide - 0.3) - 8 * (slide - 0.3) ** 2


def test_a_bowl_has_its_own_derivatives():
    number = np.ravel_multi_index((4, 1, 0), SPACE.shape)
    found = optimum(SPACE, "height", number, bowl)
    assert found.angles == {"hip": 8.0, "slide": 0.25, "held": 0.0}
    assert found.slope[:2] == pytest.approx([-1 + 3 * -0.05, 3 + 0.8])
    assert found.slope_error[0] == pytest.approx(0, abs=1e-12)
    assert found.curvature[:2, :2] == pytest.approx(np.array([[-1, 3], [3, -16]]))
    assert np.isnan(found.curvature[2]).all()
    assert np.isnan(found.step[2])
    assert found.change[0] == pytest.approx(
        [bowl((3, 1, 0)) - bowl((4, 1, 0)), bowl((5, 1, 0)) - bowl((4, 1, 0))]
    )
    assert "\nhip     8 deg     2 " in str(found)
    assert "\nheld    0 deg     - " in str(found)


def test_at_an_end_the_slope_is_one_sided_and_of_second_order():
    for corner in ((0, 0, 0), (9, 3, 0)):
        found = optimum(SPACE, "height", np.ravel_multi_index(corner, SPACE.shape), bowl)
        hip, slide = SPACE.axes["hip"][corner[0]], SPACE.axes["slide"][corner[1]]
        assert found.slope[:2] == pytest.approx(
            [7 - hip + 3 * (slide - 0.3), 3 * (hip - 7) - 16 * (slide - 0.3)]
        )
        assert np.isnan(found.change[0]).tolist() == [corner[0] == 0, corner[0] == 9]
        assert np.isnan(found.curvature).all()


def test_slopes_of_a_kick_are_within_their_errors():
    leg, kick = kd.Leg.human(), Kick(speed=3.0, air=None)
    data = sweep(leg, grid(leg, ["hip=20:28:2", "knee=5:13:2", "ankle=-14:-6:2"]), kick)
    found = Sweep(data).optimum(where="hip == 24 and knee == 9 and ankle == -10")

    def speed(change):
        q = np.radians(np.array([24.0, 9.0, -10.0]) + change)
        return kick_from(leg.posture(q), kick).hit.ball_after.speed

    for i, h in enumerate(0.01 * np.eye(3)):
        exact = (speed(h) - speed(-h)) / 0.02
        assert abs(found.slope[i] - exact) < 2 * found.slope_error[i]
        assert found.slope_error[i] < 0.02 * abs(exact)
        bend = (speed(10 * h) - 2 * speed(0 * h) + speed(-10 * h)) / 0.01
        assert found.curvature[i, i] == pytest.approx(bend, rel=0.1)
