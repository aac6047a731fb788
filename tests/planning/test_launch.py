import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.planning.goal import nominal_velocity

BALL = kd.Ball.paper()
AIR = kd.Air.paper(lift=None)
GOALS = {(30.0, 1.5): 3, (50.0, 2.0): 3, (100.0, 3.0): 4}
"""And how many steps they take."""


@pytest.mark.parametrize("goal", GOALS)
def test_newton_meets_the_papers_goals_in_few_steps(goal):
    plan = kd.plan_launch(*goal, BALL, AIR)
    assert plan.status == "met"
    assert plan.limit == ""
    assert plan.iterations == GOALS[goal]
    assert kd.plan_launch(*goal, kd.Ball(), kd.Air()).iterations == GOALS[goal]
    # an independent flight, at another tolerance
    flown = kd.fly(plan.launch, BALL, AIR, tol=1e-11)
    assert flown.range == pytest.approx(goal[0], abs=1e-8)
    assert flown.duration == pytest.approx(goal[1], abs=1e-9)


@pytest.mark.parametrize("goal", GOALS)
def test_the_learning_loop_adds_the_errors_to_the_command(goal):
    plan = kd.plan_launch(*goal, BALL, AIR, "learned")
    assert plan.status == "met"
    command = np.array(goal)
    for this in plan.history:
        velocity = this.speed * np.array([math.cos(this.angle), 0, math.sin(this.angle)])
        wished = nominal_velocity(np.array([command[0], 0, 0]), command[1])
        assert velocity == pytest.approx(wished, rel=1e-12)
        command = np.add(command, [this.distance_error, this.time_error])
    assert abs(plan.best.distance_error) <= 0.05
    assert abs(plan.best.time_error) <= 0.005
    assert plan.best == plan.history[-1]


def test_farther_goals_take_the_learning_loop_longer():
    rounds = [kd.plan_launch(*goal, BALL, AIR, "learned").iterations for goal in GOALS]
    assert rounds == sorted(rounds)
    assert rounds[0] < rounds[-1]


@pytest.mark.parametrize("method", ["newton", "learned"])
def test_the_vacuum_needs_no_correction(method):
    plan = kd.plan_launch(20, 1.2, BALL, None, method)
    assert plan.iterations == 0
    assert plan.speed * math.cos(plan.angle) == pytest.approx(20 / 1.2, rel=1e-14)
    assert plan.speed * math.sin(plan.angle) == pytest.approx(9.81 * 0.6, rel=1e-14)


@given(speed=st.floats(5, 35), angle=st.floats(0.15, 1.2), spin=st.floats(-40, 40))
@settings(max_examples=60, deadline=None)
def test_what_was_flown_is_found_again(speed, angle, spin):
    velocity = (speed * math.cos(angle), 0.0, speed * math.sin(angle))
    path = kd.fly(kd.BallState(velocity=velocity, spin=(0, spin, 0)), BALL, kd.Air(), tol=1e-12)
    plan = kd.plan_launch(path.range, path.duration, BALL, kd.Air(), spin=(0, spin, 0))
    assert plan.status == "met"
    assert plan.flight.range == pytest.approx(path.range, abs=1e-8)
    assert plan.flight.duration == pytest.approx(path.duration, abs=1e-8)


def test_a_goal_that_is_not_met_says_so_and_gives_the_closest():
    heavy_wind = kd.Air(wind=(-80.0, 0, 0), lift=None)
    plan = kd.plan_launch(60, 6.0, kd.Ball(mass=0.02, radius=0.11), heavy_wind, "learned")
    assert plan.status == "not met"
    misses = [max(abs(r.distance_error) / 0.05, abs(r.time_error) / 0.005) for r in plan.history]
    assert plan.best == plan.history[int(np.argmin(misses))]


@pytest.mark.parametrize(
    ("goal", "spin", "limit"),
    [((1000, 5), 0, "speed limit"), ((30, 60), 0, "speed limit"), ((25, 0.8), -80, "ground")],
)
def test_newton_says_why_and_gives_the_nearest_as_plan_launches_does(goal, spin, limit):
    plan = kd.plan_launch(*goal, kd.Ball(), kd.Air(), spin=(0, spin, 0))
    wish = kd.Goal(goal[0], time=goal[1])
    near = kd.plan_launches(wish, kd.Ball(), kd.Air(), spin=(0, spin, 0))
    assert (plan.status, plan.limit, near.limit) == ("not met", limit, limit)
    assert plan.launch.velocity == pytest.approx(near.nearest.velocity, rel=1e-12)
    assert plan.flight.range == pytest.approx(near.nearest.goal.distance, abs=1e-6)
    assert plan.flight.duration == pytest.approx(near.nearest.time, abs=1e-6)
    assert limit in repr(plan)


@pytest.mark.parametrize(
    ("goal", "air", "spin", "limit"),
    [
        ((1000, 5), kd.Air(), 0, "speed limit"),
        ((1000, 1), None, 0, "speed limit"),
        ((25, 0.8), kd.Air(), -80, "time"),
        ((60, 6), kd.Air(wind=(-30, 0, 0)), 0, "rounds"),
        ((1, 1), kd.Air(wind=(0, 0, 60)), 0, "aloft"),
    ],
)
def test_the_learning_loop_says_what_ends_it(goal, air, spin, limit):
    plan = kd.plan_launch(*goal, kd.Ball(), air, "learned", spin=(0, spin, 0))
    assert (plan.status, plan.limit) == ("not met", limit)
    assert all(this.speed <= 343 * (1 + 1e-9) for this in plan.history)


def test_tolerances_finer_than_flights_are_computed():
    plan = kd.plan_launch(100, 3, BALL, AIR, tolerances=(1e-14, 1e-14))
    assert (plan.status, plan.limit) == ("not met", "tolerances")
    assert abs(plan.best.distance_error) < 1e-9


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        ((0, 1), {}, "distance is 0"),
        ((10, -1), {}, r"time is -1"),
        ((math.nan, 1), {}, "distance is nan"),
        ((10, "soon"), {}, "time is 'soon'"),
        ((2e4, 1), {}, "distance is 20000.*at most 10000"),
        ((10, 1), {"method": "guess"}, "'guess' is unknown: choose newton, learned"),
        ((10, 1), {"spin": (0, 0, 5)}, "out of the x-z plane"),
        ((10, 1), {"air": kd.Air(wind=(0, 3, 0))}, "out of the x-z plane"),
        ((10, 1), {"tolerances": (0, 1e-3)}, "must be above 0"),
    ],
)
def test_bad_input(arguments, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_launch(*arguments, BALL, **options)


@pytest.mark.parametrize(
    ("goal", "air", "spin", "tolerances"),
    [
        ((5, 0.05), kd.Air(), (0, -100, 0), None),
        ((20, 3), kd.Air(wind=(0, 0, 60)), (0, 0, 0), None),
        ((0.5, 1e-4), kd.Air(), (0, 0, 0), None),
        ((1, 1), kd.Air(wind=(0, 0, 60)), (0, 0, 0), (1e9, 1e9)),
    ],
)
def test_status_tells_the_truth_of_hard_goals(goal, air, spin, tolerances):
    plan = kd.plan_launch(*goal, BALL, air, spin=spin, tolerances=tolerances)
    met = tolerances or (1e-7, 1e-8)
    reached = abs(plan.flight.range - goal[0]) <= met[0] * 1.01
    reached &= abs(plan.flight.duration - goal[1]) <= met[1] * 1.01
    assert (plan.status == "met") == (reached and plan.flight.status == "landed")
