"""Self-motion with one contact point, and the paper's learning loop beside Newton's method."""

import math

import numpy as np
import pytest
from tolerances import agrees, closed_form, optimized

import kickdyn as kd
from kickdyn.core.mechanics import GRAVITY
from kickdyn.paper import fig_1, fig_15
from kickdyn.paper.fig_1 import self_motion
from kickdyn.paper.fig_15 import learn_launch, newton_rounds

LEG, START = kd.Leg.human(), np.radians([25, 40, 10])


@pytest.fixture(scope="module")
def postures():
    return self_motion(LEG, START)


def test_the_contact_point_stays_and_the_joints_go_from_limit_to_limit(postures):
    points = np.array([posture.contact_point for posture in postures])
    assert np.ptp(points, axis=0).max() < closed_form(100)
    q = np.array([posture.q for posture in postures])
    steps = np.linalg.norm(np.diff(q, axis=0), axis=1)
    assert steps == pytest.approx(np.full(len(steps), fig_1.STEP), rel=0.1)
    for end in (q[0], q[-1]):
        room = np.minimum(end - LEG.lower, LEG.upper - end).min()
        assert 0 <= room < 3 * fig_1.STEP


def test_items_are_the_extremes_of_impulses_by_eq_10(postures):
    """p = (1 + e) v / (1/m + 1/M) along the attack; on an obstacle, 1/M is 0."""
    items = {item.item: item for item in fig_1.items()}
    attack, start = np.array([math.cos(math.pi / 6), 0, 0.5]), postures
    for struck, mobility in (("a ball", 1 / 0.45), ("an obstacle", 0.0)):
        right = [1.8 * 1.0 / (1 / posture.effective_mass(attack) + mobility) for posture in start]
        for label, value in (("most", max(right)), ("least", min(right))):
            item = items[f"Fig. 1 {label} impulse on {struck}"]
            assert item.ours == pytest.approx(value, rel=closed_form(1e3)), item.item
            assert f"{max(right) / min(right):.2f}" in item.why
            assert item.verdict == "shape-reproduced"
            posture = start[right.index(value)]
            ball = kd.Ball(mass=1 / mobility if mobility else math.inf, radius=0.1)
            hit = kd.strike(posture, posture.joint_velocity(attack), ball, kd.Contact(attack, 0.8))
            joint, inside = hit.worst_joint
            name = f"Fig. 1 {label} impulse on {struck}, in the {joint}"
            assert items[name].ours == pytest.approx(inside, rel=closed_form(1e3)), name


@pytest.mark.parametrize(("leg", "q", "words"), [
    (LEG, [0.0, -1.0, 0], "range"), (LEG, [0.0, 0.0], r"shape \(2,\)"),
    (LEG.locked({"ankle": 0.0}), [0.1, 0.2], "0 degrees of self-motion")])  # fmt: skip
def test_a_leg_without_self_motion_and_other_bad_input_is_refused(leg, q, words):
    with pytest.raises(kd.InvalidInput, match=words):
        self_motion(leg, q)


BALL, AIR = kd.Ball.paper(), kd.Air.paper(lift=None)
GOALS = [(30.0, 1.5), (50.0, 2.0), (100.0, 3.0)]
by_goal = pytest.mark.parametrize("goal", GOALS, ids=str)


def in_vacuum(distance, time):
    """Eqs. (24)-(25): the launch velocity that covers a distance in a time."""
    return [distance / time, 0.0, GRAVITY * time / 2]


@by_goal
def test_the_loop_adds_the_errors_to_the_command(goal):
    """It ends at the first round within 0.05 m and 0.005 s, and never asks for less than a goal."""
    rounds, command = learn_launch(*goal, BALL, AIR), np.array(goal)
    for number, step in enumerate(rounds, 1):
        assert (command >= np.array(goal) * (1 - closed_form(10))).all()
        agrees(step.flight.launch.velocity, in_vacuum(*command), closed_form(10))
        landing = step.flight.landing
        errors = goal[0] - landing.position[0], goal[1] - landing.time
        assert (step.distance_error, step.time_error) == pytest.approx(errors, abs=closed_form(10))
        met = abs(errors[0]) <= 0.05 and abs(errors[1]) <= 0.005
        assert step.is_met == met == (number == len(rounds))
        command = command + errors
    assert learn_launch(*goal, BALL, AIR, rounds=len(rounds) - 1)[-1].is_met  # corrections


@by_goal
def test_newton_meets_the_goals_in_few_steps(goal):
    launch = kd.plan_launch(kd.Goal(goal[0], time=goal[1]), BALL, AIR)
    rounds = newton_rounds(launch)
    assert len(rounds) - 1 == launch.iterations <= 5
    assert rounds[0].flight.launch.velocity == pytest.approx(in_vacuum(*goal))
    errors = [abs(step.distance_error) for step in rounds]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < optimized(1e-9)
    assert abs(rounds[-1].time_error) < optimized(1e-10)


@pytest.mark.parametrize(("goal", "air"), [
    ((1000, 5), kd.Air()), ((60, 6), kd.Air(wind=(-30, 0, 0))), ((1, 1), kd.Air(wind=(0, 0, 60))),
], ids=["faster than sound", "too many rounds", "a flight that does not land"])  # fmt: skip
def test_the_loop_ends_where_it_does_not_meet_the_goal(goal, air):
    rounds = learn_launch(*goal, kd.Ball(), air)
    assert not any(step.is_met for step in rounds)
    assert all(step.flight.launch.speed <= 343 * (1 + closed_form(1e4)) for step in rounds)
    assert len(rounds) <= 201


def test_items_count_corrections_and_have_the_errors_of_the_first_flight():
    """The paper's numbers of rounds are the ends of its figure's axes: 3, 8, 25."""
    items = {item.item: item for item in fig_15.items()}
    for (distance, time), printed in zip(GOALS, (3, 8, 25), strict=True):
        goal = f"Fig. 13-15 {distance:g} m, {time:g} s"
        rounds = learn_launch(distance, time, BALL, AIR)
        loop, planner = items[f"{goal} learning loop rounds"], items[f"{goal} planner steps"]
        count = len(rounds) - 1
        assert (loop.paper, loop.ours, loop.verdict) == (printed, count, "shape-reproduced")
        assert f"{rounds[0].distance_error:.2f} m and {rounds[0].time_error:.3f} s" in loop.why
        launch = kd.plan_launch(kd.Goal(distance, time=time), BALL, AIR)
        assert (planner.paper, planner.ours, planner.verdict) == (None, launch.iterations, "ours")
        assert f"{launch.speed:.4f} m/s, {np.degrees(launch.angle):.4f} deg" in planner.why


@pytest.mark.parametrize(("goals", "reproduced", "words"), [
    (fig_15.GOALS[1::-1], [False, False], "not more"),  # the nearer one comes last
    (((1000.0, 5.0, 1), fig_15.GOALS[0]), [False, True], "more"),  # faster than sound
])  # fmt: skip
def test_goals_must_be_met_and_farther_ones_need_more_rounds(goals, reproduced, words, monkeypatch):
    monkeypatch.setattr(fig_15, "GOALS", goals)
    items = fig_15.varying(fig_15.DEFAULT)
    assert [item.verdict == "shape-reproduced" for item in items] == reproduced
    assert all(f"farther goals need {words} rounds" in item.why for item in items)
