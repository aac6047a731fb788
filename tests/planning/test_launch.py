"""Launches: flown again by `fly`, closed forms of the vacuum, differences, refusals."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tolerances import agrees, closed_form, differenced, optimized

import kickdyn as kd
from kickdyn.planning import launch_solver as solver
from kickdyn.planning.launch_solver import ShootingProblem, apex

BALL, AIR, G = kd.Ball(), kd.Air(drag="brazuca"), 9.81
ERROR = 1e-7  # [m, s, m/s]: of a flight by `fly` with the tolerance 1e-12


def check(launch, goal):
    """Check by `fly` that a launch meets the target and the condition of a goal."""

    def pass_plane(distance):
        plane = kd.Plane(distance * goal.ahead, -goal.ahead, "centre")
        path = kd.fly(launch.state, launch.ball, launch.air, kd.Ground(-90.0), 1e-12, plane=plane)
        return path.landing.position, path.duration, path.height

    place, duration, height = pass_plane(goal.distance)
    assert place == pytest.approx(goal.target, abs=ERROR)
    assert duration == pytest.approx(launch.time, abs=ERROR)
    reached = {"time": duration, "speed": launch.speed, "apex": height}
    if goal.over is not None:
        reached["over"] = pass_plane(goal.over[0])[0][2], goal.over[1]
        assert reached["over"][0] == pytest.approx(goal.over[1], abs=ERROR)
    else:
        assert reached[goal.kind] == pytest.approx(getattr(goal, goal.kind), abs=ERROR)
    if goal.beside is not None:
        aside = goal.left @ pass_plane(goal.beside[0])[0]
        assert aside == pytest.approx(goal.beside[1], abs=ERROR)


@pytest.mark.parametrize("target", [(22.0, 3.0, 1.0), (15.0, -4.0, -0.6)])
@pytest.mark.parametrize("condition", [
    {"time": 1.3}, {"apex": 4.0}, {"over": (9.0, 2.5)}, {"speed": 24.0}])  # fmt: skip
def test_a_launch_with_spin_meets_its_goal_in_the_wind(condition, target):
    goal = kd.Goal(target, **condition, spin=(5.0, -12.0, 9.0))
    launch = kd.plan_launch(goal, BALL, kd.Air(drag="brazuca", wind=(3, -2, 0)))
    assert launch.status == "met"
    check(launch, goal)
    assert launch.history[-1].tolist() == launch.velocity.tolist()
    assert np.abs(launch.errors).max() < ERROR


LOW = (20.0, 0.0, 2.2)


@pytest.mark.parametrize(("goal", "limit", "nearest"), [
    (kd.Goal((25, 0, 1), speed=12), "least-speed", math.sqrt(G * (1 + math.hypot(25, 1)))),
    (kd.Goal((300, 0, 30), time=4), "speed-limit", 35**2 / G * (math.sqrt(1.01) - 0.1)),
    (kd.Goal(LOW, apex=2.0), "lowest-path", 2.2),
    (kd.Goal(LOW, over=(9.15, 80)), "highest-path", None),
    (kd.Goal(LOW, time=0.4), "speed-limit", None), (kd.Goal(LOW, time=9), "speed-limit", None)
])  # fmt: skip
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
        assert launch.speed == pytest.approx(35, rel=optimized(1e-7))
        assert launch.time == pytest.approx(time, rel=optimized(1e-7))
    else:
        value = launch.reached.distance if limit == "speed-limit" else None
        value = value or getattr(launch.reached, goal.kind)
        assert value == pytest.approx(nearest, rel=optimized())
    assert f"{launch.speed:.4g} m/s" in launch.summary
    assert limit in repr(launch)


def test_low_and_high_arc_of_the_vacuum():
    """tan a = (v2 +- sqrt(v4 - g2 x2)) / (g x) on level ground."""
    low, high = (kd.plan_launch(kd.Goal(30, speed=25, arc=arc), BALL) for arc in ("low", "high"))
    for launch, sign in ((low, -1), (high, 1)):
        tangent = (25**2 + sign * math.sqrt(25**4 - (G * 30) ** 2)) / (G * 30)
        assert launch.angle == pytest.approx(math.atan(tangent), rel=optimized(1e-10))
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
    nearest = kd.plan_launch(goal, BALL, AIR, spin_limit=0.5 * needed)
    assert nearest.limit == "spin-limit"
    check(nearest, nearest.reached)
    farther = kd.plan_launch(replace(goal, beside=(9.15, 4.0)), BALL, AIR)
    assert farther.limit == "spin-limit"
    assert np.linalg.norm(farther.spin) == pytest.approx(100, rel=closed_form())  # by default


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


@pytest.mark.parametrize("condition", [{"time": 1.1}, {"apex": 2.5}, {"speed": 23.0}])
def test_a_flight_meets_a_receiver_who_runs(condition):
    running = np.array([2.0, 1.5, 0.0])
    goal = kd.Goal((14.0, -3.0, 0.4), receiver_velocity=running, **condition)
    launch = kd.plan_launch(goal, BALL, AIR)
    assert launch.status == "met"
    met = kd.fly(launch.state, BALL, AIR, kd.Ground(-20.0), 1e-12, time_limit=launch.time)
    agrees(met.landing.position, goal.target + launch.time * running, optimized(1e-8))
    for name in {"time", "speed"} & condition.keys():
        assert getattr(launch, name) == pytest.approx(condition[name], rel=optimized(1e-10))


SPIN = np.array([5.0, -30.0, 20.0])
VELOCITY = np.array([18.0, 2.0, 9.0])


@pytest.mark.parametrize(
    "condition", [{"time": 1.0}, {"speed": 20.0}, {"over": (9.0, 2.0)}, {"apex": 3.0}])  # fmt: skip
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
    along = (VELOCITY - struck.velocity) / np.linalg.norm(VELOCITY - struck.velocity)
    assert problem.spin_of(x[:-1]) @ along == pytest.approx(struck.spin @ along, rel=closed_form())
    kept = ShootingProblem(kd.Ball(), air, struck.spin, struck=struck)  # a foot without friction
    for across in np.cross(np.pi * np.eye(3), struck.spin) / 3.0:  # but for rounding
        assert kept.spin_of(struck.velocity + across).tolist() == struck.spin.tolist()


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
