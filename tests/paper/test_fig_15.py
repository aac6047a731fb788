import numpy as np
import pytest

import kickdyn as kd
from kickdyn.paper.fig_15 import learn_launch, newton_rounds
from kickdyn.planning.goal import nominal_velocity

BALL, AIR = kd.Ball.paper(), kd.Air.paper(lift=None)
GOALS = {(30.0, 1.5): 3, (50.0, 2.0): 3, (100.0, 3.0): 4}
"""And how many steps Newton's method takes."""


@pytest.mark.parametrize("goal", GOALS)
def test_newton_meets_the_papers_goals_in_few_steps(goal):
    launch = kd.plan_launch(kd.Goal(goal[0], time=goal[1]), BALL, AIR)
    rounds = newton_rounds(launch)
    assert len(rounds) - 1 == launch.iterations == GOALS[goal]
    assert abs(rounds[-1].distance_error) < 1e-8
    assert abs(rounds[-1].time_error) < 1e-9
    last = rounds[-1].flight.launch
    assert (last.speed, last.elevation) == pytest.approx((launch.speed, launch.angle))


@pytest.mark.parametrize("goal", GOALS)
def test_the_learning_loop_adds_the_errors_to_the_command(goal):
    rounds, command = learn_launch(*goal, BALL, AIR), np.array(goal)
    for this in rounds:
        velocity = this.flight.launch.velocity
        wished = nominal_velocity(np.array([command[0], 0, 0]), command[1])
        assert velocity == pytest.approx(wished, rel=1e-12)
        command = np.add(command, [this.distance_error, this.time_error])
    assert [this.is_met for this in rounds] == [False] * (len(rounds) - 1) + [True]


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("drag", ["brazuca", "sphere"])
def test_no_command_falls_below_the_goal(goal, drag):
    """So a bound at the goal's own launch, a reading of the paper's words, would not act."""
    command = np.array(goal)
    for this in learn_launch(*goal, BALL, kd.Air.paper(drag=drag, lift=None)):
        assert (command >= np.array(goal) * (1 - 1e-12)).all()
        command = np.add(command, [this.distance_error, this.time_error])


def test_farther_goals_take_the_learning_loop_longer():
    rounds = [len(learn_launch(*goal, BALL, AIR)) for goal in GOALS]
    assert rounds == sorted(rounds)
    assert rounds[0] < rounds[-1]


def test_the_vacuum_needs_no_correction():
    assert len(learn_launch(20, 1.2, BALL, None)) == 1


@pytest.mark.parametrize(
    ("goal", "air"),
    [
        ((1000, 5), kd.Air()),  # faster than sound
        ((60, 6), kd.Air(wind=(-30, 0, 0))),  # too many rounds
        ((1, 1), kd.Air(wind=(0, 0, 60))),  # a flight that does not land
    ],
)
def test_the_learning_loop_ends_where_it_does_not_meet_the_goal(goal, air):
    rounds = learn_launch(*goal, kd.Ball(), air)
    assert not any(this.is_met for this in rounds)
    assert all(this.flight.launch.speed <= 343 * (1 + 1e-9) for this in rounds)
    assert len(rounds) <= 201
