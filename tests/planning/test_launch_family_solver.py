import math
from itertools import pairwise

import numpy as np
import pytest

import kickdyn as kd
from kickdyn.planning.shooting import ShootingProblem

BALL, AIR = kd.Ball(), kd.Air()


def errors(launch):
    """By `kd.fly`, another integrator's run than the plan's."""
    path, goal = launch.fly(), launch.goal
    found = [np.abs(path.landing.position - goal.target).max(), abs(path.duration - launch.time)]
    if goal.time is not None:
        found.append(abs(path.duration - goal.time))
    if goal.speed is not None:
        found.append(abs(launch.speed - goal.speed))
    if goal.apex is not None:
        found.append(abs(path.height - goal.apex))
    if goal.over is not None:
        there = goal.over[0] * goal.ahead + launch.fly().launch.position
        wall = kd.Plane(there, -goal.ahead, "centre")
        ground = kd.Ground(-50.0)
        at = kd.fly(launch.state, BALL, launch.air, ground, 1e-11, plane=wall).landing
        found.append(abs(at.position[2] - goal.over[1]))
    return max(found)


def drawn(kind, rng):
    speed, up, turn = rng.uniform(8, 34), rng.uniform(0.15, 1.1), rng.uniform(-0.4, 0.4)
    level = speed * math.cos(up)
    velocity = np.array([level * math.cos(turn), level * math.sin(turn), speed * math.sin(up)])
    air, spin = kd.Air(wind=(*rng.normal(0, 3, 2), 0)), rng.normal(0, 15, 3)
    shot = ShootingProblem(BALL, air, spin).shoot(velocity, 2 * velocity[2] / 9.81 * 0.85)
    target = shot.place(shot.time)[0]
    part = 0.4 * math.hypot(*target[:2])
    height = shot.crossing(kd.Goal(target, time=1).ahead, part, np.array([0, 0, 1.0]))[0]
    value = {"time": shot.time, "apex": shot.apex()[0], "speed": speed, "over": (part, height)}
    return kd.Goal(target, **{kind: value[kind]}), air, spin, velocity


@pytest.mark.parametrize("kind", ["time", "apex", "speed", "over"])
def test_what_was_flown_is_found_again(kind):
    rng, steps = np.random.default_rng(3), []
    for _ in range(5):
        goal, air, spin, velocity = drawn(kind, rng)
        found = kd.plan_launches(goal, BALL, air, spin=spin)
        assert found.status == "met"
        assert max(errors(one) for one in found.solutions) < 2e-8
        assert min(math.dist(one.velocity, velocity) for one in found.solutions) < 1e-6
        steps.append(found.solutions[0].steps)
    assert np.median(steps) <= (6 if kind == "speed" else 4)


@pytest.mark.parametrize("air", [kd.Air(), kd.Air.paper()])
def test_the_papers_goals_take_few_steps(air):
    goals = [kd.Goal(distance, time=time) for distance, time in ((30, 1.5), (50, 2), (100, 3))]
    found = [kd.plan_launches(goal, BALL, air).solutions[0] for goal in goals]
    assert [launch.steps for launch in found] == [3, 3, 4]
    assert all(np.abs(launch.errors).max() <= 1e-9 for launch in found)


def test_low_and_high_arc():
    found = kd.plan_launches(kd.Goal(30, speed=25), BALL, AIR)
    low, high = found.solutions
    assert low.elevation < math.radians(40) < high.elevation
    assert low.time < high.time
    assert [one.speed for one in found.solutions] == pytest.approx([25, 25], abs=1e-9)


@pytest.mark.parametrize(
    ("goal", "limit"),
    [
        (kd.Goal((25, 0, 1), speed=12), "least speed"),
        (kd.Goal((20, 0, 2.2), apex=2.0), "lowest way"),
        (kd.Goal((20, 0, 2.2), over=(9.15, 0.9)), "lowest way"),
        (kd.Goal((20, 0, 2.2), over=(9.15, 60)), "highest way"),
        (kd.Goal((20, 0, 2.2), time=0.4), "speed limit"),
        (kd.Goal((20, 0, 2.2), time=9), "speed limit"),
        (kd.Goal(200, time=5), "speed limit"),
        (kd.Goal((20, 2, 1), speed=30, beside=(9, 6)), "spin limit"),
    ],
)
def test_what_cannot_be_met_says_why_and_gives_the_nearest(goal, limit):
    found = kd.plan_launches(goal, BALL, AIR, speed_limit=35)
    assert (found.status, found.limit, found.solutions) == ("unreachable", limit, ())
    assert limit in found.said
    assert errors(found.nearest) < 1e-6
    assert found.nearest.speed <= 35 * (1 + 1e-6)
    # it is at the edge: there is none a little nearer to what was wished
    if limit == "speed limit":
        assert found.nearest.speed == pytest.approx(35, rel=1e-6)


def test_least_speed_and_farthest_point_are_those_of_the_vacuum():
    found = kd.plan_launches(kd.Goal((25, 0, 1), speed=12), BALL)
    least = math.sqrt(9.81 * (1 + math.hypot(25, 1)))
    assert found.nearest.speed == pytest.approx(least, rel=1e-6)
    found = kd.plan_launches(kd.Goal((300, 0, 0), time=4), BALL, speed_limit=30)
    assert found.nearest.goal.distance == pytest.approx(900 / 9.81, rel=1e-6)


def test_a_curved_kick_passes_beside_the_wall():
    goal = kd.Goal((22, 3, 2.2), speed=27, beside=(9.15, 0.8))
    for one in kd.plan_launches(goal, BALL, AIR).solutions:
        assert errors(one) < 2e-8
        left = np.cross((0, 0, 1.0), goal.ahead)
        wall = kd.Plane(9.15 * goal.ahead, -goal.ahead, "centre")
        at = kd.fly(one.state, BALL, AIR, kd.Ground(-50.0), 1e-11, plane=wall).landing
        assert left @ at.position == pytest.approx(0.8, abs=1e-7)
        assert one.spin[2] < 0  # it comes back to the right


def test_an_apex_right_before_the_target_is_found():
    target, spin = (16.45467826, -3.77789215, 4.09194422), (-3.876, -33.9, 3.775)
    found = kd.plan_launches(kd.Goal(target, apex=4.1193), BALL, AIR, spin=spin)
    assert found.status == "met"
    assert errors(found.solutions[0]) < 2e-8


def test_the_walk_along_the_family_finds_what_newton_does_not():
    wind = kd.Air(wind=(25.0, 0, 0), lift=None)
    speed = kd.plan_launches(kd.Goal(30, speed=3), BALL, wind).nearest.speed
    vacuum = math.sqrt(9.81 * 30)
    assert speed < 0.95 * vacuum
    found = kd.plan_launches(kd.Goal(30, speed=0.5 * (speed + vacuum)), BALL, wind)
    assert [one.steps for one in found.solutions] == [-1, -1]
    assert max(errors(one) for one in found.solutions) < 2e-8
    assert all(a.time < b.time for a, b in pairwise(found.solutions))


@pytest.mark.parametrize(("distance", "time", "spin"), [(25, 0.8, -80), (15, 0.62, -90)])
def test_a_way_through_the_ground_is_none(distance, time, spin):
    found = kd.plan_launches(kd.Goal(distance, time=time), BALL, AIR, spin=(0, spin, 0))
    assert (found.status, found.limit) == ("unreachable", "ground")
    assert "the ground is in the way: nearest" in found.said
    assert errors(found.nearest) < 1e-6
    path = found.nearest.fly()
    times = np.linspace(0, path.duration, 5000)
    assert path.sample(times).position[:, 2].min() > -1e-9
    # it is the first that is clear: a little sooner, it would have to start downwards
    assert 0 <= found.nearest.elevation < 1e-3


def test_of_two_arcs_only_the_one_above_the_ground_is_left():
    (high,) = kd.plan_launches(kd.Goal(25, speed=40), BALL, AIR, spin=(0, -80, 0)).solutions
    assert high.elevation > math.radians(50)


def test_a_target_below_the_start_lies_on_the_ground():
    (launch,) = kd.plan_launches(kd.Goal((20, 0, -3), time=0.5), BALL, AIR).solutions
    assert launch.elevation < 0
    assert errors(launch) < 1e-8


def test_where_all_launches_go_down_the_nearest_has_a_time_for_an_apex():
    wind = kd.Air(wind=(15.0, 0, 0))
    found = kd.plan_launches(kd.Goal((5, 0, -60), apex=10), BALL, wind, speed_limit=4.59)
    assert (found.limit, found.nearest.goal.kind) == ("highest way", "time")
    assert found.nearest.elevation < 0
    assert errors(found.nearest) < 1e-6


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        ((30,), {}, "goal is 30: it must be a kickdyn.Goal"),
        ((kd.Goal(30, time=1),), {"speed_limit": 500}, "speed limit is 500"),
        ((kd.Goal(30, time=1, beside=(9, 1)),), {}, "name air with lift"),
        ((kd.Goal(30, time=1),), {"spin": (0, 1)}, "spin has shape"),
    ],
)
def test_bad_input(arguments, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_launches(*arguments, BALL, **options)
