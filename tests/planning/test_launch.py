import dataclasses
import math
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kickdyn as kd
from kickdyn.planning.goal import REASONS, nominal_velocity
from kickdyn.planning.launch import OutOfReach
from kickdyn.planning.launch_family import LaunchFamily
from kickdyn.planning.launch_solver import ShootingProblem, apex, crossing

BALL, AIR = kd.Ball(), kd.Air(drag="brazuca")


def errors(launch):
    """By `kd.fly`, another integrator's run than the plan's."""
    path, goal = launch.flight, launch.reached
    found = [np.abs(path.landing.position - goal.target).max(), abs(path.duration - launch.time)]
    if goal.time is not None:
        found.append(abs(path.duration - goal.time))
    if goal.speed is not None:
        found.append(abs(launch.speed - goal.speed))
    if goal.apex is not None:
        found.append(abs(path.height - goal.apex))
    if goal.over is not None:
        there = goal.over[0] * goal.ahead + launch.flight.launch.position
        wall = kd.Plane(there, -goal.ahead, "centre")
        ground = kd.Ground(-50.0)
        at = kd.fly(launch.state, BALL, launch.air, ground, 1e-11, plane=wall).landing
        found.append(abs(at.position[2] - goal.over[1]))
    return max(found)


def drawn(kind, rng):
    speed, up, turn = rng.uniform(8, 34), rng.uniform(0.15, 1.1), rng.uniform(-0.4, 0.4)
    level = speed * math.cos(up)
    velocity = np.array([level * math.cos(turn), level * math.sin(turn), speed * math.sin(up)])
    air, spin = kd.Air(drag="brazuca", wind=(*rng.normal(0, 3, 2), 0)), rng.normal(0, 15, 3)
    shot = ShootingProblem(BALL, air, spin).shoot(velocity, 2 * velocity[2] / 9.81 * 0.85)
    target = shot.position(shot.end)
    part = 0.4 * math.hypot(*target[:2])
    height = crossing(shot, kd.Goal(target, time=1).ahead, part, np.array([0, 0, 1.0]))[0]
    value = {"time": shot.end, "apex": apex(shot)[0], "speed": speed, "over": (part, height)}
    return kd.Goal(target, **{kind: value[kind]}), air, spin, velocity


@pytest.mark.parametrize("kind", ["time", "apex", "speed", "over"])
def test_what_was_flown_is_found_again(kind):
    rng, steps = np.random.default_rng(3), []
    for _ in range(3):
        goal, air, spin, velocity = drawn(kind, rng)
        launch = kd.plan_launch(dataclasses.replace(goal, spin=spin), BALL, air)
        assert launch.status == "met"
        assert launch.limit is None
        both = launch, *launch.others
        assert max(errors(one) for one in both) < 2e-8
        assert min(math.dist(one.velocity, velocity) for one in both) < 1e-6
        steps.append(launch.iterations)
    assert np.median(steps) <= (6 if kind == "speed" else 4)


@pytest.mark.parametrize("air", [kd.Air(drag="brazuca"), kd.Air.paper()])
def test_the_papers_goals_take_few_steps(air):
    goals = [kd.Goal(distance, time=time) for distance, time in ((30, 1.5), (50, 2), (100, 3))]
    found = [kd.plan_launch(goal, BALL, air) for goal in goals]
    assert [launch.iterations for launch in found] == [3, 3, 4]
    assert all(np.abs(launch.errors).max() <= 1e-9 for launch in found)
    for launch in found:
        assert launch.history.shape == (launch.iterations + 1, 3)
        assert launch.history[0] == pytest.approx(nominal_velocity(launch.goal.target, launch.time))
        assert launch.history[-1].tolist() == launch.velocity.tolist()


@pytest.mark.parametrize(
    ("goal", "time"),
    [
        (kd.Goal(30, apex=5.0), 2 * math.sqrt(2 * 5.0 / 9.81)),
        (kd.Goal((8, 0, 2), time=0.4), 0.4),  # it still rises there
    ],
)
def test_newtons_method_starts_from_the_vacuum(goal, time):
    launch = kd.plan_launch(goal, BALL, AIR)
    assert launch.history[0] == pytest.approx(nominal_velocity(goal.target, time))
    assert launch.iterations <= 4


def test_the_vacuum_needs_no_correction():
    launch = kd.plan_launch(kd.Goal(20, time=1.2), BALL)
    assert launch.iterations == 0
    assert launch.speed * math.cos(launch.angle) == pytest.approx(20 / 1.2, rel=1e-14)
    assert launch.speed * math.sin(launch.angle) == pytest.approx(9.81 * 0.6, rel=1e-14)


@given(speed=st.floats(5, 35), angle=st.floats(0.15, 1.2), spin=st.floats(-40, 40))
@settings(max_examples=60, deadline=None)
def test_a_flight_over_level_ground_is_found_again(speed, angle, spin):
    velocity = (speed * math.cos(angle), 0.0, speed * math.sin(angle))
    path = kd.fly(
        kd.BallState(velocity=velocity, spin=(0, spin, 0)), BALL, kd.Air(drag="brazuca"), tol=1e-12
    )
    goal = kd.Goal(path.range, time=path.duration, spin=(0, spin, 0))
    launch = kd.plan_launch(goal, BALL, kd.Air(drag="brazuca"))
    assert launch.status == "met"
    assert launch.flight.range == pytest.approx(path.range, abs=1e-8)
    assert launch.flight.duration == pytest.approx(path.duration, abs=1e-8)


def test_the_largest_error_is_shown():
    launch = kd.plan_launch(kd.Goal(20, time=1.5), BALL, AIR)
    wrong = dataclasses.replace(launch, errors=np.array([1e-4, 0.0, -2e-3, 3e-5]))
    assert re.search(r"largest error +0\.002\n", repr(wrong))


def test_low_and_high_arc():
    low = kd.plan_launch(kd.Goal(30, speed=25), BALL, AIR)
    (high,) = low.others
    assert low.angle < math.radians(40) < high.angle
    assert low.time < high.time
    assert [low.speed, high.speed] == pytest.approx([25, 25], abs=1e-9)
    assert low.summary == "2 launches meet the goal"
    first = kd.plan_launch(kd.Goal(30, speed=25, arc="high"), BALL, AIR)
    assert first.velocity.tolist() == high.velocity.tolist()
    assert first.others[0].velocity.tolist() == low.velocity.tolist()


@pytest.mark.parametrize(
    ("goal", "limit"),
    [
        (kd.Goal((25, 0, 1), speed=12), "least-speed"),
        (kd.Goal((20, 0, 2.2), apex=2.0), "lowest-path"),
        (kd.Goal((20, 0, 2.2), over=(9.15, 0.9)), "lowest-path"),
        (kd.Goal((20, 0, 2.2), over=(9.15, 60)), "highest-path"),
        (kd.Goal((20, 0, 2.2), time=0.4), "speed-limit"),
        (kd.Goal((20, 0, 2.2), time=9), "speed-limit"),
        (kd.Goal(200, time=5), "speed-limit"),
        (kd.Goal((20, 2, 1), speed=30, beside=(9, 6)), "spin-limit"),
        (kd.Goal(32, speed=19, beside=(16, -0.6)), "least-speed"),
    ],
)
def test_what_cannot_be_met_says_why_and_gives_the_nearest(goal, limit):
    nearest = kd.plan_launch(goal, BALL, AIR, speed_limit=35)
    assert (nearest.status, nearest.limit, nearest.others) == ("unreachable", limit, ())
    assert nearest.goal is goal
    reason = REASONS[limit].format(speed=35, spin=100)
    assert nearest.summary.startswith(f"out of reach: {reason}; the ")
    assert "Goal(" not in nearest.summary
    assert limit in repr(nearest)
    assert errors(nearest) < 1e-6
    assert nearest.speed <= 35 * (1 + 1e-6)
    # it is at the edge: there is none a little nearer to what was wished
    if limit == "speed-limit":
        assert nearest.speed == pytest.approx(35, rel=1e-6)


def test_least_speed_and_farthest_point_are_those_of_the_vacuum():
    launch = kd.plan_launch(kd.Goal((25, 0, 1), speed=12), BALL)
    least = math.sqrt(9.81 * (1 + math.hypot(25, 1)))
    assert launch.speed == pytest.approx(least, rel=1e-6)
    launch = kd.plan_launch(kd.Goal((300, 0, 0), time=4), BALL, speed_limit=30)
    assert launch.reached.distance == pytest.approx(900 / 9.81, rel=1e-6)


def test_a_curved_kick_passes_beside_the_wall():
    goal = kd.Goal((22, 3, 2.2), speed=27, beside=(9.15, 0.8))
    launch = kd.plan_launch(goal, BALL, AIR)
    for one in (launch, *launch.others):
        assert errors(one) < 2e-8
        wall = kd.Plane(9.15 * goal.ahead, -goal.ahead, "centre")
        at = kd.fly(one.state, BALL, AIR, kd.Ground(-50.0), 1e-11, plane=wall).landing
        assert goal.left @ at.position == pytest.approx(0.8, abs=1e-7)
        assert one.spin[2] < 0  # it comes back to the right


def test_an_apex_right_before_the_target_is_found():
    target, spin = (16.45467826, -3.77789215, 4.09194422), (-3.876, -33.9, 3.775)
    launch = kd.plan_launch(kd.Goal(target, apex=4.1193, spin=spin), BALL, AIR)
    assert launch.status == "met"
    assert errors(launch) < 2e-8


def test_the_walk_along_the_family_finds_what_newton_does_not():
    wind = kd.Air(drag="brazuca", wind=(25.0, 0, 0), lift=None)
    speed = kd.plan_launch(kd.Goal(30, speed=3), BALL, wind).speed
    vacuum = math.sqrt(9.81 * 30)
    assert speed < 0.95 * vacuum
    goal = kd.Goal(30, speed=0.5 * (speed + vacuum))
    assert goal.nominal_times() == []
    low = kd.plan_launch(goal, BALL, wind)
    (high,) = low.others
    assert max(errors(low), errors(high)) < 2e-8
    assert low.time < high.time


def test_every_launch_of_a_light_ball_that_the_wind_carries():
    """Its launches form a closed curve, and it gets there in 2.4 to 3.1 s only."""
    ball, air = kd.Ball(0.02, 0.15), kd.Air(wind=(6.2, -6, 0.08), drag="goff-carre")
    goal = kd.Goal((16.0916, -17.4704, 1.2390), apex=2.3946, spin=(127, 37.5, 42))
    launch = kd.plan_launch(goal, ball, air)
    assert launch.status == "met"
    found = [launch, *launch.others]
    assert len(found) == 2
    assert min(math.dist(one.velocity, (-0.37, -1.7, 13.9)) for one in found) < 0.05
    for one in found:
        assert np.abs(one.flight.landing.position - goal.target).max() < 1e-6


def test_a_second_launch_over_the_same_point_is_listed():
    """Of steep launches with back spin, the fast ones pass the point lower again."""
    goal = kd.Goal((14.28, 1.49, 1.33), over=(3.84, 11.5), spin=(3, -33, 17))
    slow, fast = (
        kd.plan_launch(dataclasses.replace(goal, arc=arc), BALL, AIR, speed_limit=60)
        for arc in ("low", "high")
    )
    assert slow.speed < 33 < fast.speed
    assert [one.speed for one in slow.others] == pytest.approx([fast.speed])
    assert [one.speed for one in fast.others] == pytest.approx([slow.speed])
    assert max(errors(slow), errors(fast)) < 2e-8


@pytest.mark.parametrize(("distance", "time", "spin"), [(25, 0.8, -80), (15, 0.62, -90)])
def test_a_way_through_the_ground_is_none(distance, time, spin):
    nearest = kd.plan_launch(kd.Goal(distance, time=time, spin=(0, spin, 0)), BALL, AIR)
    assert (nearest.status, nearest.limit) == ("unreachable", "ground")
    assert "lead through the ground; the nearest is time" in nearest.summary
    assert errors(nearest) < 1e-6
    path = nearest.flight
    times = np.linspace(0, path.duration, 5000)
    assert path.sample(times).position[:, 2].min() > -1e-9
    # it is the first that is clear: a little sooner, it would have to start downwards
    assert 0 <= nearest.angle < 1e-3


def test_of_two_arcs_only_the_one_above_the_ground_is_left():
    high = kd.plan_launch(kd.Goal(25, speed=40, spin=(0, -80, 0)), BALL, AIR)
    assert (high.status, high.others) == ("met", ())
    assert high.angle > math.radians(50)


def test_a_target_below_the_start_lies_on_the_ground():
    launch = kd.plan_launch(kd.Goal((20, 0, -3), time=0.5), BALL, AIR)
    assert launch.angle < 0
    assert errors(launch) < 1e-8


def test_where_all_launches_go_down_the_nearest_has_a_time_for_an_apex():
    wind = kd.Air(drag="brazuca", wind=(15.0, 0, 0))
    nearest = kd.plan_launch(kd.Goal((5, 0, -60), apex=10), BALL, wind, speed_limit=4.59)
    assert (nearest.limit, nearest.reached.kind) == ("highest-path", "time")
    assert nearest.angle < 0
    assert errors(nearest) < 1e-6


@pytest.mark.parametrize(
    ("goal", "air", "spin"),
    [
        ((5, 0.05), kd.Air(drag="brazuca"), -100),
        ((0.5, 1e-4), kd.Air(drag="brazuca"), 0),
        ((1000, 5), kd.Air(drag="brazuca"), 0),
        ((30, 60), kd.Air(drag="brazuca"), 0),
    ],
)
def test_status_is_what_the_flight_of_a_hard_goal_shows(goal, air, spin):
    launch = kd.plan_launch(kd.Goal(goal[0], time=goal[1], spin=(0, spin, 0)), BALL, air)
    reached = abs(launch.flight.range - goal[0]) <= 1e-7
    reached &= abs(launch.flight.duration - goal[1]) <= 1e-8
    assert (launch.status == "met") == reached


def test_where_the_ground_is_in_the_way_of_every_launch_none_is_given():
    with pytest.raises(OutOfReach, match="the ground is in the way of every launch") as error:
        kd.plan_launch(kd.Goal(5, speed=0.01), BALL, kd.Air(drag="brazuca", wind=(0, 0, 40)))
    again = pickle.loads(pickle.dumps(error.value))
    assert (again.limit, again.nearest) == ("ground", None)
    assert str(again) == str(error.value)


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        ((30,), {}, "goal is 30: it must be a kickdyn.Goal"),
        ((kd.Goal(30, time=1),), {"speed_limit": 500}, "speed limit is 500"),
        ((kd.Goal(30, time=1, beside=(9, 1)),), {}, "needs air with density and lift"),
    ],
)
def test_bad_input(arguments, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_launch(*arguments, BALL, **options)


def test_the_spin_limit_leaves_out_what_turns_faster():
    goal = kd.Goal((22, 3, 2.2), time=1.1, beside=(9.15, 0.8))
    free = kd.plan_launch(goal, BALL, AIR)
    needed = float(np.linalg.norm(free.spin))
    assert 5 < needed < 100
    assert kd.plan_launch(goal, BALL, AIR, spin_limit=1.01 * needed).status == "met"
    short = kd.plan_launch(goal, BALL, AIR, spin_limit=0.8 * needed)
    assert (short.status, short.limit) == ("unreachable", "spin-limit")
    assert np.linalg.norm(short.spin) == pytest.approx(0.8 * needed)
    assert 0 < short.reached.beside[1] < 0.8


def test_other_launches_keep_the_spin_limit():
    goal = kd.Goal((22, 3, 2.2), speed=27, beside=(9.15, 0.8))
    low = kd.plan_launch(goal, BALL, AIR)
    (high,) = low.others
    assert np.linalg.norm(high.spin) < 25 < np.linalg.norm(low.spin)
    only = kd.plan_launch(goal, BALL, AIR, spin_limit=25)
    assert only.velocity == pytest.approx(high.velocity)
    assert only.others == ()


@pytest.mark.parametrize(("kg", "half"), [(7, 0), (-9, 0), (0, 1), (3, -1)])
@pytest.mark.parametrize("named", [{"time": 1.3}, {"over": (7.0, 3.0)}, {"beside": (8.0, 0.2)}])
def test_a_launch_does_not_depend_on_the_units(named, kg, half):
    """Powers of two change no digit; m as the square of s, for that leaves gravity's number."""
    mass, metre, second = 2.0**kg, 4.0**half, 2.0**half
    size = {"time": second, "over": metre, "beside": metre}
    named = {"time": 1.1, **named} if "beside" in named else named
    ball, air = kd.Ball(), kd.Air(drag="brazuca", wind=(1, -2, 0))
    thick = {
        "density": air.density * mass / metre**3,
        "viscosity": air.viscosity * mass / metre / second,
    }
    launches = [
        kd.plan_launch(kd.Goal((18, 2, 1), **named, spin=(3, -20, 5)), ball, air, spin_limit=900),
        kd.plan_launch(
            kd.Goal(
                metre * np.array([18, 2, 1]),
                **{name: np.multiply(size[name], value) for name, value in named.items()},
                spin=np.array([3, -20, 5]) / second,
            ),
            kd.Ball(mass * ball.mass, metre * ball.radius),
            kd.Air(drag="brazuca", wind=metre / second * np.array([1, -2, 0]), **thick),
            spin_limit=900 / second,
        ),
    ]
    plain, scaled = launches
    assert plain.status == scaled.status == "met"
    assert scaled.iterations == plain.iterations
    assert scaled.velocity.tolist() == (metre / second * plain.velocity).tolist()
    assert scaled.spin.tolist() == (plain.spin / second).tolist()
    assert scaled.time == second * plain.time


def test_two_launches_nearer_to_each_other_than_a_walk_steps_are_both_found():
    least = kd.plan_launch(kd.Goal((25, 0, 1), speed=12), BALL, AIR).speed
    goal = kd.Goal((25, 0, 1), speed=least * (1 + 1e-6))
    family = LaunchFamily(ShootingProblem(BALL, AIR, np.zeros(3)), goal, 40.0, 100.0)
    family.direct = []  # as where Newton's method fails from the vacuum's answers
    low, high = family.solutions
    assert [low.speed, high.speed] == pytest.approx([goal.speed] * 2, rel=1e-10)
    assert low.time * (1 + 1e-4) < high.time < low.time * 1.02


def test_a_spin_limit_is_named_as_it_was_given():
    goal = kd.Goal(20, time=1, beside=(10, 4))
    launch = kd.plan_launch(goal, BALL, kd.Air(), spin_limit=20)
    assert launch.limit == "spin-limit"
    assert math.hypot(*launch.spin) == pytest.approx(20)
    assert "spin faster than 20 rad/s" in launch.summary


def test_the_farthest_that_is_named_is_where_the_ball_comes_down():
    launch = kd.plan_launch(kd.Goal(200, time=5), BALL, AIR, speed_limit=35)
    path = kd.fly(launch.state, BALL, AIR, kd.Ground(-BALL.radius))
    assert f"the farthest is {path.range:.4g} m, at 35 m/s" in launch.summary


@pytest.mark.parametrize(
    "condition", [{"time": 1.1}, {"apex": 2.5}, {"speed": 23.0}, {"speed": 16.0, "arc": "high"}]
)
def test_a_flight_meets_a_receiver_who_runs(condition):
    """The ball is where the receiver is, and nobody else runs there."""
    ball, air, running = kd.Ball(), kd.Air(), np.array([2.0, 1.5, 0.0])
    goal = kd.Goal((14.0, -3.0, 0.4), receiver_velocity=running, **condition)
    launch = kd.plan_launch(goal, ball, air)
    assert launch.status == "met"
    met = kd.fly(launch.state, ball, air, kd.Ground(-20.0), 1e-12, time_limit=launch.time)
    assert met.landing.position == pytest.approx(goal.target + launch.time * running, abs=1e-8)
    for name in {"time", "speed"} & condition.keys():
        assert getattr(launch, name) == pytest.approx(condition[name], rel=1e-9)


def test_a_receiver_who_runs_away_is_not_met():
    with pytest.raises(kd.InvalidInput, match=r"speed of the receiver is .* at most 100"):
        kd.Goal(10, time=1, receiver_velocity=(101, 0, 0))
    launch = kd.plan_launch(kd.Goal(10, speed=12, receiver_velocity=(30, 0, 0)), kd.Ball())
    assert (launch.status, launch.limit) == ("unreachable", "least-speed")


@pytest.mark.parametrize(
    ("condition", "other"),
    [({"time": 1.1}, {"time": 1.101}), ({"speed": 18.0}, {"speed": 18.01}), ({"apex": 2.0},) * 2],
    ids=["time", "speed", "apex"],
)
def test_a_launch_near_another_takes_one_or_two_steps(condition, other):
    spin = {"spin": (3.0, -20.0, 5.0)}
    near = kd.plan_launch(kd.Goal((15.0, 2.0, 0.3), **condition, **spin), BALL, AIR)
    goal = kd.Goal((15.02, 2.01, 0.3), **other, **spin)
    again, direct = kd.plan_launch(goal, BALL, AIR, near=near), kd.plan_launch(goal, BALL, AIR)
    assert again.iterations <= (2 if "apex" in condition else 1) < direct.iterations
    assert again.velocity == pytest.approx(direct.velocity, abs=1e-9)
    assert again.time == pytest.approx(direct.time, abs=1e-10)
