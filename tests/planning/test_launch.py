"""Launches: flown again by `fly`, closed forms of the vacuum, dimensions, and why there is none."""

import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tolerances import agrees, integrated, optimized

import kickdyn as kd
from kickdyn.planning.goal import nominal_velocity
from kickdyn.planning.launch import OutOfReach
from kickdyn.planning.launch_family import LaunchFamily
from kickdyn.planning.launch_solver import ShootingProblem, apex, crossing

BALL, AIR, G = kd.Ball(), kd.Air(drag="brazuca"), 9.81
ERROR = 1e-7  # [m, s, m/s]: of a flight by `fly` with the tolerance 1e-12
UP = np.array([0.0, 0.0, 1.0])


def pass_plane(launch, goal, distance):
    """Return where a launch passes the vertical plane at a distance ahead, by `fly`."""
    plane = kd.Plane(distance * goal.ahead, -goal.ahead, "centre")
    path = kd.fly(launch.state, launch.ball, launch.air, kd.Ground(-90.0), 1e-12, plane=plane)
    return path.landing.position, path.duration, path.height


def check(launch, goal):
    """Check by `fly` that a launch meets the target and the condition of a goal."""
    place, duration, height = pass_plane(launch, goal, goal.distance)
    assert place == pytest.approx(goal.target, abs=ERROR)
    assert duration == pytest.approx(launch.time, abs=ERROR)
    reached = {"time": duration, "speed": launch.speed, "apex": height}
    if goal.over is not None:
        reached["over"] = pass_plane(launch, goal, goal.over[0])[0][2], goal.over[1]
        assert reached["over"][0] == pytest.approx(goal.over[1], abs=ERROR)
    else:
        assert reached[goal.kind] == pytest.approx(getattr(goal, goal.kind), abs=ERROR)
    if goal.beside is not None:
        aside = goal.left @ pass_plane(launch, goal, goal.beside[0])[0]
        assert aside == pytest.approx(goal.beside[1], abs=ERROR)


def flown(kind, seed):
    """Return a goal that a drawn launch meets, the air, and its velocity."""
    rng = np.random.default_rng(seed)
    speed, up, turn = rng.uniform(8, 34), rng.uniform(0.15, 1.0), rng.uniform(-0.4, 0.4)
    level = speed * math.cos(up)
    velocity = np.array([level * math.cos(turn), level * math.sin(turn), speed * math.sin(up)])
    air, spin = kd.Air(drag="brazuca", wind=(*rng.normal(0, 3, 2), 0)), rng.normal(0, 15, 3)
    shot = ShootingProblem(BALL, air, spin).shoot(velocity, 1.7 * velocity[2] / G)
    target = shot.position(shot.end)
    part = 0.4 * math.hypot(*target[:2])
    height = crossing(shot, kd.Goal(target, time=1).ahead, part, UP)[0]
    value = {"time": shot.end, "apex": apex(shot)[0], "speed": speed, "over": (part, height)}
    return kd.Goal(target, **{kind: value[kind]}, spin=spin), air, velocity


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("kind", ["time", "apex", "over"])
def test_a_launch_that_was_flown_is_found_again(kind, seed):
    goal, air, velocity = flown(kind, seed)
    launch = kd.plan_launch(goal, BALL, air)
    assert launch.status == "met"
    check(launch, goal)
    agrees(launch.velocity, velocity, optimized(1e-7))
    assert launch.history[-1].tolist() == launch.velocity.tolist()
    assert np.abs(launch.errors).max() < ERROR


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("kind", ["speed", "over"])
def test_a_launch_that_was_flown_is_among_all_launches_that_meet_the_goal(kind, seed):
    goal, air, velocity = flown(kind, seed)
    launch = kd.plan_launch(goal, BALL, air)
    launches = [launch, *launch.others]
    for one in launches:
        check(one, goal)
    assert min(math.dist(one.velocity, velocity) for one in launches) < 1e-6


@given(speed=st.floats(5, 35), angle=st.floats(0.15, 1.1), spin=st.floats(-40, 40))
@settings(max_examples=20)
def test_a_flight_over_level_ground_is_found_again(speed, angle, spin):
    velocity = (speed * math.cos(angle), 0.0, speed * math.sin(angle))
    path = kd.fly(kd.BallState(velocity=velocity, spin=(0, spin, 0)), BALL, AIR, tol=1e-12)
    goal = kd.Goal(path.range, time=path.duration, spin=(0, spin, 0))
    launch = kd.plan_launch(goal, BALL, AIR)
    assert launch.status == "met"
    check(launch, goal)


def test_newtons_method_starts_from_the_vacuum_and_needs_no_step_there():
    goal = kd.Goal(30, apex=5.0)
    launch = kd.plan_launch(goal, BALL, AIR)
    time = 2 * math.sqrt(2 * 5.0 / G)
    agrees(launch.history[0], nominal_velocity(goal.target, time), 1e-12)
    exact = kd.plan_launch(goal, BALL)
    assert exact.iterations == 0
    agrees(exact.velocity, [30 / time, 0, G * time / 2], integrated(1e-12))


LOW, FAR = (20.0, 0.0, 2.2), (25.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("goal", "limit", "nearest"),
    [
        (kd.Goal(FAR, speed=12), "least-speed", math.sqrt(G * (1 + math.hypot(25, 1)))),
        (kd.Goal(300, time=4), "speed-limit", 35**2 / G),
        (kd.Goal(LOW, apex=2.0), "lowest-path", 2.2),
        (kd.Goal(LOW, over=(9.15, 80)), "highest-path", None),
        (kd.Goal(LOW, time=0.4), "speed-limit", None),
        (kd.Goal(LOW, time=9), "speed-limit", None),
    ],
)
def test_the_nearest_launch_in_the_vacuum_has_a_closed_form(goal, limit, nearest):
    launch = kd.plan_launch(goal, BALL, speed_limit=35)
    assert (launch.status, launch.limit, launch.others) == ("unreachable", limit, ())
    assert launch.goal is goal
    if goal.time is None:
        check(launch, launch.reached)
    if nearest is None:  # at the limit of speed: |x / t + g t / 2| = 35 m/s
        target, half = goal.target, 35.0**2 - G * goal.target[2]
        root = math.sqrt(half**2 - G**2 * (target @ target))
        low, high = (math.sqrt(2 * (half + sign * root)) / G for sign in (-1, 1))
        time = low if goal.time == 0.4 else high
        assert launch.speed == pytest.approx(35, rel=1e-6)
        assert launch.time == pytest.approx(time, rel=1e-6)
    else:
        value = launch.reached.distance if limit == "speed-limit" else None
        value = value or getattr(launch.reached, goal.kind)
        assert value == pytest.approx(nearest, rel=1e-5)
    assert f"{launch.speed:.4g} m/s" in launch.summary
    assert limit in repr(launch)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("goal", "limit"),
    [
        (kd.Goal(FAR, speed=12), "least-speed"),
        (kd.Goal(LOW, over=(9.15, 0.9)), "lowest-path"),
        (kd.Goal(LOW, over=(9.15, 60)), "highest-path"),
        (kd.Goal(LOW, time=9), "speed-limit"),
        (kd.Goal(200, time=5), "speed-limit"),
        (kd.Goal((20, 2, 1), speed=30, beside=(9, 6)), "spin-limit"),
        (kd.Goal(32, speed=19, beside=(16, -0.6)), "least-speed"),
    ],
)
def test_the_nearest_launch_in_air_meets_what_it_says_it_reaches(goal, limit):
    nearest = kd.plan_launch(goal, BALL, AIR, speed_limit=35)
    assert (nearest.status, nearest.limit, nearest.others) == ("unreachable", limit, ())
    check(nearest, nearest.reached)
    assert nearest.speed <= 35 * (1 + 1e-6)
    if limit == "speed-limit":
        assert nearest.speed == pytest.approx(35, rel=1e-6)
    if limit == "spin-limit":
        assert math.hypot(*nearest.spin) == pytest.approx(100)
        assert "100 rad/s" in nearest.summary
    if limit == "least-speed":  # at the edge: a little more is enough
        more = dataclasses.replace(goal, speed=nearest.reached.speed * 1.001)
        assert kd.plan_launch(more, BALL, AIR, speed_limit=35).status == "met"


def test_low_and_high_arc_of_the_vacuum():
    """tan a = (v2 +- sqrt(v4 - g2 x2)) / (g x) on level ground."""
    low, high = (kd.plan_launch(kd.Goal(30, speed=25, arc=arc), BALL) for arc in ("low", "high"))
    for launch, sign in ((low, -1), (high, 1)):
        tangent = (25**2 + sign * math.sqrt(25**4 - (G * 30) ** 2)) / (G * 30)
        assert launch.angle == pytest.approx(math.atan(tangent), rel=1e-9)
    agrees(low.others[0].velocity, high.velocity, optimized(1e-9))
    agrees(high.others[0].velocity, low.velocity, optimized(1e-9))
    assert low.summary.startswith("2 launches")


def test_a_curved_kick_passes_beside_the_wall_within_the_spin_limit():
    goal = kd.Goal((22, 3, 2.2), time=1.1, beside=(9.15, 0.8))
    launch = kd.plan_launch(goal, BALL, AIR)
    check(launch, goal)
    assert launch.spin[2] < 0  # it comes back to the right
    needed = float(np.linalg.norm(launch.spin))
    assert kd.plan_launch(goal, BALL, AIR, spin_limit=1.01 * needed).status == "met"


@pytest.mark.slow
def test_a_spin_limit_bends_the_flight_less():
    goal = kd.Goal((22, 3, 2.2), time=1.1, beside=(9.15, 0.8))
    needed = float(np.linalg.norm(kd.plan_launch(goal, BALL, AIR).spin))
    short = kd.plan_launch(goal, BALL, AIR, spin_limit=0.8 * needed)
    assert (short.status, short.limit) == ("unreachable", "spin-limit")
    assert np.linalg.norm(short.spin) == pytest.approx(0.8 * needed)
    assert 0 < short.reached.beside[1] < 0.8
    check(short, short.reached)


@pytest.mark.slow
def test_the_walk_along_the_family_finds_what_newton_does_not():
    """With a wind from behind, a slower ball arrives than in the vacuum."""
    wind = kd.Air(drag="brazuca", wind=(25.0, 0, 0), lift=None)
    speed, vacuum = kd.plan_launch(kd.Goal(30, speed=3), BALL, wind).speed, math.sqrt(G * 30)
    assert speed < 0.95 * vacuum
    goal = kd.Goal(30, speed=0.5 * (speed + vacuum))
    assert goal.nominal_times() == []
    low = kd.plan_launch(goal, BALL, wind)
    (high,) = low.others
    check(low, goal)
    check(high, goal)
    assert low.time < high.time


@pytest.mark.slow
def test_every_launch_of_a_light_ball_that_the_wind_carries():
    """Its launches form a closed curve, and it gets there in 2.4 to 3.1 s only."""
    ball, air = kd.Ball(0.02, 0.15), kd.Air(wind=(6.2, -6, 0.08), drag="goff-carre")
    goal = kd.Goal((16.0916, -17.4704, 1.2390), apex=2.3946, spin=(127, 37.5, 42))
    launch = kd.plan_launch(goal, ball, air)
    launches = [launch, *launch.others]
    assert len(launches) == 2
    for one in launches:
        check(one, goal)


@pytest.mark.slow
def test_two_launches_nearer_to_each_other_than_a_walk_steps_are_both_found():
    least = kd.plan_launch(kd.Goal(FAR, speed=12), BALL, AIR).speed
    goal = kd.Goal(FAR, speed=least * (1 + 1e-6))
    family = LaunchFamily(ShootingProblem(BALL, AIR, np.zeros(3)), goal, 40.0, 100.0)
    family.direct = []  # as where Newton's method fails from the vacuum's answers
    low, high = family.solutions
    assert [low.speed, high.speed] == pytest.approx([goal.speed] * 2, rel=1e-10)
    assert low.time * (1 + 1e-4) < high.time < low.time * 1.02


@pytest.mark.slow
def test_of_launches_through_the_ground_the_nearest_clear_one_starts_level():
    goal = kd.Goal(25, time=0.8, spin=(0, -80, 0))
    nearest = kd.plan_launch(goal, BALL, AIR)
    assert (nearest.status, nearest.limit) == ("unreachable", "ground")
    heights = nearest.flight.sample(np.linspace(0, nearest.flight.duration, 5000)).position[:, 2]
    assert heights.min() > -1e-9
    assert 0 <= nearest.angle < 1e-3  # a little sooner, it would have to start downwards
    high = kd.plan_launch(kd.Goal(25, speed=40, spin=(0, -80, 0)), BALL, AIR)
    assert (high.status, high.others) == ("met", ())
    assert high.angle > math.radians(50)


def test_a_target_below_the_start_is_met_from_above():
    goal = kd.Goal((20, 0, -3), time=0.5)
    launch = kd.plan_launch(goal, BALL, AIR)
    assert launch.angle < 0
    check(launch, goal)
    assert launch.flight.ground.height == pytest.approx(-3 - BALL.radius, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("distance", "time", "spin"), [(5, 0.05, -100), (0.5, 1e-4, 0), (1000, 5, 0), (30, 60, 0)]
)
def test_status_is_what_the_flight_of_a_hard_goal_shows(distance, time, spin):
    launch = kd.plan_launch(kd.Goal(distance, time=time, spin=(0, spin, 0)), BALL, AIR)
    reached = abs(launch.flight.range - distance) <= ERROR
    reached &= abs(launch.flight.duration - time) <= ERROR
    assert (launch.status == "met") == reached


def test_where_the_ground_is_in_the_way_of_every_launch_none_is_given():
    with pytest.raises(OutOfReach, match="ground is in the way") as error:
        kd.plan_launch(kd.Goal(5, speed=0.01), BALL, kd.Air(drag="brazuca", wind=(0, 0, 40)))
    again = pickle.loads(pickle.dumps(error.value))
    assert (again.limit, again.nearest) == ("ground", None)
    assert str(again) == str(error.value)


@pytest.mark.parametrize(("kg", "half"), [(7, 0), (0, 1), (3, -1)])
@pytest.mark.parametrize("named", [{"time": 1.3}, {"over": (7.0, 3.0)}, {"beside": (8.0, 0.2)}])
def test_a_launch_does_not_depend_on_the_units(named, kg, half):
    """Of powers of two, in which a metre is the square of a second, so that g has its number."""
    mass, metre, second = 2.0**kg, 4.0**half, 2.0**half
    size = {"time": second, "over": metre, "beside": metre}
    named = {"time": 1.1, **named} if "beside" in named else named
    wind, spin, target = np.array([1, -2, 0]), np.array([3, -20, 5]), np.array([18, 2, 1])
    air = kd.Air(drag="brazuca", wind=wind)
    other_air = kd.Air(
        drag="brazuca",
        wind=metre / second * wind,
        density=air.density * mass / metre**3,
        viscosity=air.viscosity * mass / metre / second,
    )
    scaled = {name: np.multiply(size[name], value) for name, value in named.items()}
    plain = kd.plan_launch(kd.Goal(target, **named, spin=spin), BALL, air, spin_limit=900)
    other = kd.plan_launch(
        kd.Goal(metre * target, **scaled, spin=spin / second),
        kd.Ball(mass * BALL.mass, metre * BALL.radius),
        other_air,
        spin_limit=900 / second,
    )
    assert plain.status == other.status == "met"
    agrees(other.velocity, metre / second * plain.velocity, optimized(1e-10))
    agrees(other.spin, plain.spin / second, optimized(1e-10))
    assert other.time == pytest.approx(second * plain.time, rel=optimized(1e-10))


@pytest.mark.parametrize("condition", [{"time": 1.1}, {"apex": 2.5}, {"speed": 23.0}])
def test_a_flight_meets_a_receiver_who_runs(condition):
    running = np.array([2.0, 1.5, 0.0])
    goal = kd.Goal((14.0, -3.0, 0.4), receiver_velocity=running, **condition)
    launch = kd.plan_launch(goal, BALL, AIR)
    assert launch.status == "met"
    met = kd.fly(launch.state, BALL, AIR, kd.Ground(-20.0), 1e-12, time_limit=launch.time)
    agrees(met.landing.position, goal.target + launch.time * running, optimized(1e-8))
    for name in {"time", "speed"} & condition.keys():
        assert getattr(launch, name) == pytest.approx(condition[name], rel=1e-9)


def test_a_launch_of_a_struck_ball_keeps_its_spin_along_the_impulse():
    before = kd.BallState(velocity=(-4, 1, 0), spin=(8, -17, 3))
    goal = kd.Goal((14.0, 2.0, 0.4), time=1.0)
    launch = kd.plan_launch(goal, BALL, AIR, struck=before)
    along = launch.velocity - before.velocity
    along /= np.linalg.norm(along)
    agrees(launch.spin, (before.spin @ along) * along, 1e-9)
    check(launch, goal)


@pytest.mark.parametrize(
    ("condition", "other"),
    [({"time": 1.1}, {"time": 1.101}), ({"speed": 18.0}, {"speed": 18.01}), ({"apex": 2.0},) * 2],
    ids=["time", "speed", "apex"],
)
def test_a_launch_near_another_is_that_from_the_vacuum_in_fewer_steps(condition, other):
    spin = {"spin": (3.0, -20.0, 5.0)}
    near = kd.plan_launch(kd.Goal((15.0, 2.0, 0.3), **condition, **spin), BALL, AIR)
    goal = kd.Goal((15.02, 2.01, 0.3), **other, **spin)
    again, direct = kd.plan_launch(goal, BALL, AIR, near=near), kd.plan_launch(goal, BALL, AIR)
    assert again.iterations < direct.iterations
    agrees(again.velocity, direct.velocity, optimized(1e-9))
    assert again.time == pytest.approx(direct.time, rel=optimized(1e-9))


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        ((30,), {}, "goal is 30"),
        ((kd.Goal(30, time=1),), {"speed_limit": 500}, "speed limit is 500"),
        ((kd.Goal(30, time=1),), {"spin_limit": 0}, "spin limit is 0"),
        ((kd.Goal(30, time=1, beside=(9, 1)),), {}, "beside is 9 m.*air with density and lift"),
    ],
)
def test_bad_input(arguments, options, words):
    with pytest.raises(kd.InvalidInput, match=words):
        kd.plan_launch(*arguments, BALL, **options)
