"""The warnings and the status of a plan, against the bodies that overlap."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import BSpline
from tolerances import optimized

import kickdyn as kd
from kickdyn.motion.motion import Motion
from kickdyn.planning.kick_plan import check_actuators, check_ball_overlap_after, check_drives
from kickdyn.robot.collisions import find_ball_overlaps
from kickdyn.robot.ground_clearance import find_depths

HUMAN, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()


def lines(plan, words):
    return [line for line in plan.warnings if words in line]


def depths_in(line):
    """Return the depths [m] that a line has by the names of bodies."""
    return {name: float(depth) for name, depth in re.findall(r"(\w+) by (\d\.\d+) m", line)}


@pytest.fixture(scope="module")
def placed():
    goal = kd.Goal((30, 0, 2), time=1.5)
    return kd.plan_kick(HUMAN, goal, BALL, AIR, ball_position=-0.704)


@pytest.mark.parametrize("low", [0.0, -0.3])
def test_the_ground_is_under_the_ball_or_under_a_lower_target(placed, low):
    """The foot reaches 0.04 m below the ball's lowest point: under the one, above the other."""
    plan = replace(placed, goal=kd.Goal((30, 0, low), time=1.5))
    floor = plan.impact.ball_before.position[2] - BALL.radius + low
    depths = find_depths(plan.leg, plan.q, floor)
    named = lines(plan, "under the ground")
    assert plan.status == ("collides" if low == 0.0 else "met")
    assert len(named) == (low == 0.0)
    if named:
        assert depths_in(named[0]) == pytest.approx(depths, abs=6e-4)
        assert "--ball-height" in named[0]
        assert plan.collisions == tuple(named)


def test_errors_are_distances_from_the_goal(placed):
    shift = np.array([0.3, 0.4, 0.0])
    other = replace(placed, goal=kd.Goal(placed.goal.target + shift, time=1.5))
    assert other.landing_error == pytest.approx(0.5, abs=optimized(1e-7))
    slower = replace(placed.launch, velocity=placed.launch.velocity - shift, time=1.2)
    other = replace(placed, launch=slower)
    assert other.velocity_error == pytest.approx(0.5, abs=optimized(1e-9))
    assert other.time_error == pytest.approx(0.3, abs=optimized(1e-7))


def test_bodies_that_overlap_in_the_motion_are_named_with_the_deepest_time(placed):
    """Of a leg that stays 0.15 rad before the posture of the impact: its foot is in the ball."""
    assert placed.motion is None
    q = placed.q + 0.15 * np.eye(3)[0]
    splines = [BSpline([a, a, b, b], [q] * 2, 1) for a, b in ((-0.79, 0.0), (0.0, 0.79))]
    plan = replace(placed, motion=Motion(HUMAN, HUMAN.joint_names, *splines))
    centre = placed.impact.ball_before.position
    depths = find_ball_overlaps(HUMAN.posture(q), centre, BALL.radius)
    (line,) = lines(plan, "inside the ball before the impact")
    assert depths_in(line) == pytest.approx(depths, abs=6e-4)
    assert max(depths.values()) > 0.02
    assert plan.status == "collides"
    before = SimpleNamespace(begin=-0.79, end=0.0, q=lambda t: q, warnings=())
    high = replace(plan, goal=kd.Goal((30, 0, -0.3), time=1.5), motion=before)
    assert depths_in(*high.collisions) == depths_in(line)
    assert high.status == "collides"


@pytest.mark.parametrize("back", [True, False])
def test_bodies_in_the_way_of_the_ball_after_the_impact_are_named(placed, back):
    """Of a leg that stays as it is, and a ball that flies through the shank, or away."""
    still = SimpleNamespace(begin=-0.1, end=0.2, q=lambda t: placed.q)
    launch = kd.BallState(placed.impact.ball_before.position, (-6, 0, 6) if back else (9, 0, 6))
    path = kd.fly(launch, BALL, ground=kd.Ground(-9.0))
    named = check_ball_overlap_after(replace(placed, motion=still, path=path))
    posture, deepest = placed.impact.posture, {}
    for t in np.arange(1e-3, 0.2, 1e-3):
        overlaps = find_ball_overlaps(posture, path.sample(t).position, BALL.radius)
        deepest |= {name: max(x, deepest.get(name, 0.0)) for name, x in overlaps.items()}
    at_impact = find_ball_overlaps(posture, launch.position, BALL.radius)
    right = {name: depth for name, depth in deepest.items() if name not in at_impact}
    assert (bool(right), len(named)) == (back, int(back))
    for line in named:
        depths = depths_in(line)
        assert depths == pytest.approx({name: right[name] for name in depths}, abs=0.01)
        assert max(depths.values()) == pytest.approx(max(right.values()), abs=0.01)


def test_a_restitution_out_of_its_range_of_speeds_is_a_warning_only():
    contact = kd.Contact(restitution=[[1.0, 0.8], [2.0, 0.75]], friction=0.4)
    plan = kd.plan_kick(HUMAN, kd.Goal(8, time=1), BALL, AIR, contact=contact)
    assert plan.status == "met"
    assert lines(plan, "restitution")


def test_joints_without_an_actuator_are_named_if_they_move():
    names = "single_joints", "velocity_index", "workspace"
    leg = SimpleNamespace(file=SimpleNamespace(passive_joints=("knee", "ankle", "waist")))
    vars(leg).update((name, getattr(HUMAN, name)) for name in names)
    plan = SimpleNamespace(leg=leg, v=np.array([3.0, 0.0, -1.0]))
    (line,) = check_actuators(plan)
    assert [name in line for name in ("ankle", "knee", "waist")] == [True, False, False]
    plan.v[2] = 0.0
    assert not check_actuators(plan)


@pytest.mark.parametrize(("rotor", "balance", "said"), [
    (0.0, 0.1, True), (0.1, 0.1, False), (0.0, None, False)])  # fmt: skip
def test_a_motion_of_a_standing_robot_without_rotors_asks_more_of_drives(rotor, balance, said):
    leg = HUMAN.with_armature({"hip": rotor})
    plan = SimpleNamespace(leg=leg, motion="moves", balance=balance)
    assert bool(check_drives(plan)) is said
