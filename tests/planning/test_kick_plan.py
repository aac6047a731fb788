"""The warnings and the status of a plan, against the bodies that overlap."""

import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from scipy.interpolate import BSpline

import kickdyn as kd
from kickdyn.motion.motion import Motion
from kickdyn.planning import kick_plan
from kickdyn.robot.collisions import find_ball_overlaps
from kickdyn.robot.ground_clearance import find_depths

MODELS = Path(gymnasium.__file__).parent / "envs/mujoco/assets"
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


def test_the_ground_is_not_known_where_the_height_of_the_ball_is_free(placed):
    free = replace(placed, ball_is_placed=False)
    assert lines(free, "under the ground") == lines(placed, "under the ground")
    assert (free.status, placed.status) == ("met", "collides")


def test_a_plan_has_the_status_of_its_worst_fault(placed):
    assert replace(placed, share=0.9).status == "beyond-limits"
    higher = kd.plan_kick(HUMAN, placed.goal, BALL, AIR, ball_position=-0.654)
    assert (higher.status, higher.collisions) == ("met", ())


def test_errors_are_distances_from_the_goal(placed):
    shift = np.array([0.3, 0.4, 0.0])
    other = replace(placed, goal=kd.Goal(placed.goal.target + shift, time=1.5))
    assert other.landing_error == pytest.approx(0.5, abs=1e-6)
    slower = replace(placed.launch, velocity=placed.launch.velocity - shift, time=1.2)
    other = replace(placed, launch=slower)
    assert other.velocity_error == pytest.approx(0.5, abs=1e-8)
    assert other.time_error == pytest.approx(0.3, abs=1e-6)


def test_joints_without_an_actuator_are_named_until_they_are_locked():
    hopper, goal = kd.Leg.from_mjcf(MODELS / "hopper.xml", "foot"), kd.Goal(2, time=0.5)
    (line,) = lines(kd.plan_kick(hopper, goal, BALL, AIR), "no actuator")
    assert "rootx, rootz, rooty" in line
    assert "locked={'rootx': 0, 'rootz': " in line
    locked = hopper.locked(dict.fromkeys(("rootx", "rootz", "rooty"), 0.0))
    assert not lines(kd.plan_kick(locked, goal, BALL, AIR), "no actuator")


@pytest.mark.slow
def test_a_shank_inside_the_ball_is_announced_and_a_flatter_launch_avoids_it():
    humanoid = kd.Leg.from_mjcf(MODELS / "humanoid.xml", "right_foot", base="floating")
    humanoid = humanoid.with_supports("left_foot")
    plans = [
        kd.plan_kick(
            humanoid, kd.Goal(1.5, time=time), BALL, AIR,
            contact=kd.Contact(friction=0.4, offset=(ahead, 0, 0.1)),
        )
        for time, ahead in ((0.5, 0.075), (0.4, 0.1))
    ]  # fmt: skip
    for plan, status in zip(plans, ("collides", "met"), strict=True):
        centre = plan.impact.ball_before.position
        depths = find_ball_overlaps(plan.leg.posture(plan.q), centre, BALL.radius)
        assert (plan.share, plan.status) == (1.0, status)
        shown = [depths_in(line) for line in lines(plan, "inside the ball")]
        assert shown == ([pytest.approx(depths, abs=6e-4)] if depths else [])


LEG = """<mujoco><worldbody><body name="shank" pos="0 0 1">
  <joint name="knee" type="hinge" axis="0 -1 0" range="-90 90"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.8" size="0.04"/>
  <body name="foot" pos="0 0 -0.9"><geom type="sphere" size="0.05" pos="{} 0 0"/></body>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("ahead", "offset", "expected"),
    [
        (0.1, (0.15, 0, 0), {}),
        (0.1, (0.12, 0, 0), {"foot": 0.03}),
        (0.1, (0.1, 0, 0.05), {"foot": BALL.radius + 0.05 - math.hypot(BALL.radius, 0.05)}),
        (0.0, (-0.02, 0, 0.2), {"shank": BALL.radius + 0.04 - (BALL.radius - 0.02)}),
    ],
    ids=["at the front", "behind the front", "on top", "beside the shank"],
)
def test_bodies_count_by_their_depth_in_the_ball(tmp_path, ahead, offset, expected):
    """The foot is a sphere ahead of its origin; the ball touches it at an offset."""
    (tmp_path / "leg.xml").write_text(LEG.format(ahead))
    leg = kd.Leg.from_mjcf(tmp_path / "leg.xml", "foot")
    hit = kd.strike(leg.posture([0.0]), [1.0], BALL, kd.Contact((1, 0, 0), 0.8, offset=offset))
    depths = find_ball_overlaps(hit.posture, hit.ball_before.position, BALL.radius)
    assert depths == pytest.approx(expected, abs=1e-9)


def standing_still(q, robot=HUMAN):
    """Return a motion that stays at a posture from -0.79 to 0.79 s."""
    splines = [BSpline([a, a, b, b], [q] * 2, 1) for a, b in ((-0.79, 0.0), (0.0, 0.79))]
    return Motion(robot, robot.joint_names, *splines)


def test_bodies_that_overlap_in_the_motion_are_named_with_the_deepest_time(placed):
    """Of a leg that stays 0.15 rad before the posture of the impact: its foot is in the ball."""
    assert placed.motion is None
    q = placed.q + 0.15 * np.eye(3)[0]
    plan = replace(placed, motion=standing_still(q))
    centre = placed.impact.ball_before.position
    depths = find_ball_overlaps(HUMAN.posture(q), centre, BALL.radius)
    (line,) = lines(plan, "inside the ball before the impact")
    assert depths_in(line) == pytest.approx(depths, abs=6e-4)
    assert max(depths.values()) > 0.02
    assert plan.status == "collides"


def test_bodies_in_the_way_of_the_ball_after_the_impact_are_named(placed):
    still = replace(placed, motion=standing_still(placed.q))
    assert not lines(still, "in the way of the ball")
    ball = placed.impact.ball_after
    back = kd.fly(replace(ball, velocity=(-10.0, 0.0, 1.0)), BALL, AIR, kd.Ground(-9))
    plan = replace(still, path=back)
    (line,) = lines(plan, "in the way of the ball after the impact")
    deepest = {}
    for t in np.linspace(0.001, 0.1, 100).tolist():
        at = find_ball_overlaps(HUMAN.posture(placed.q), back.sample(t).position, BALL.radius)
        deepest = {
            name: max(at.get(name, 0.0), deepest.get(name, 0.0)) for name in {**at, **deepest}
        }
    name, depth = max(depths_in(line).items(), key=lambda item: item[1])
    assert deepest[name] - 0.03 <= depth <= deepest[name] + 1e-3  # at steps of half a radius


def test_a_line_about_the_motion_has_each_body_where_it_is_deepest():
    motion = SimpleNamespace(begin=-0.79, end=0.79, q=lambda t: t)
    plan = SimpleNamespace(q=0.0, motion=motion)

    def depths_at(_, q, t):
        assert q == t
        depths = {"hand": 0.2 - abs(t + 0.39), "foot": 0.1 - abs(t - 0.47), "toe": 0.3 - abs(t)}
        return {name: depth for name, depth in depths.items() if depth > 0.0}

    times = kick_plan._times_of_motion(plan)
    (line,) = kick_plan._in_motion(plan, depths_at, "inside a wall", "move it", times)
    assert depths_in(line) == pytest.approx({"hand": 0.2, "foot": 0.1}, abs=0.011)
    assert re.search(r"hand by \S+ m at -0\.39 s.*foot by \S+ m at 0\.4[678] s", line)
    before = kick_plan._times_of_motion(plan, 0.0)
    (line,) = kick_plan._in_motion(plan, depths_at, "inside a wall", "move it", before)
    assert depths_in(line).keys() == {"hand"}


def test_a_motion_of_a_standing_robot_without_rotors_is_warned_of():
    driven, bare = (
        kd.Leg.from_robot("g1", base="floating", legs_only=True, **options)
        for options in ({}, {"drives": False})
    )
    for leg, motion, count in ((driven, True, 0), (bare, True, 1), (bare, None, 0)):
        plan = SimpleNamespace(motion=motion, balance=0.01, leg=leg)
        warned = kick_plan.check_drives(plan)
        assert len(warned) == count
        assert all("--drives" in line for line in warned)
