"""The flight that a launch is solved with: against differences and dense samples."""

import numpy as np
import pytest
from tolerances import agrees, closed_form, differenced

import kickdyn as kd
from kickdyn.planning import launch_solver as solver
from kickdyn.planning.launch_solver import ShootingProblem, apex

SPIN = np.array([5.0, -30.0, 20.0])
VELOCITY = np.array([18.0, 2.0, 9.0])


@pytest.mark.parametrize(
    "condition", [{"time": 1.0}, {"speed": 20.0}, {"over": (9.0, 2.0)}, {"apex": 3.0}]
)
def test_slopes_of_all_equations_are_those_of_differences(condition):
    struck = kd.BallState(velocity=(-3.0, 1.0, 0.5), spin=(9.0, -4.0, 6.0))
    air, axis = kd.Air(drag="brazuca"), SPIN / np.linalg.norm(SPIN)
    goal = kd.Goal((18.0, 2.0, 1.0), **condition, beside=(8.0, 0.5))
    for before in (None, struck):
        problem = ShootingProblem(kd.Ball(), air, axis, True, before)

        def equations(x, problem=problem):
            flight = problem.shoot(x[:-1], x[-1])
            errors, slopes = solver.target_equations(goal, x, flight)
            error, row = solver.goal_condition(goal, x, flight)
            return np.append(errors, error), np.vstack([slopes, row])

        x = np.array([*VELOCITY, 30.0, 1.6])  # the apex is inside the flight
        expected = [
            (equations(x + step)[0] - equations(x - step)[0]) / 2e-3 for step in 1e-3 * np.eye(5)
        ]
        agrees(equations(x)[1], np.transpose(expected), differenced(1))
    along = VELOCITY - struck.velocity
    along /= np.linalg.norm(along)
    assert problem.spin_of(x[:-1]) @ along == pytest.approx(struck.spin @ along, rel=closed_form())


@pytest.mark.parametrize("spin", [(0, -80.0, 0), (0, 0, 0)])
@pytest.mark.parametrize("up", [-0.05, 0.4])
def test_lowest_and_highest_places(spin, up):
    velocity = 35 * np.array([np.cos(up), 0, np.sin(up)])
    shot = ShootingProblem(kd.Ball(), kd.Air(drag="brazuca"), np.array(spin)).shoot(velocity, 1.3)
    heights = shot.states(np.linspace(0, 1.3, 20_001))[:, 2]
    assert solver.lowest(shot) == pytest.approx(heights.min(), abs=1e-6)  # of samples
    assert apex(shot)[0] == pytest.approx(heights.max(), abs=1e-6)
    if up < 0 and spin[1]:
        assert solver.lowest(shot) < -0.05
        assert apex(shot)[0] > 0.2
