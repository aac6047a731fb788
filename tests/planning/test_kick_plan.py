"""What a plan warns of."""

import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import gymnasium
import pytest

import kickdyn as kd
from kickdyn.planning.kick_plan import _in_motion, _times_of_motion
from kickdyn.planning.plan_report import verdict
from kickdyn.robot.collisions import find_ball_overlaps
from kickdyn.robot.ground_clearance import find_depths

MODELS = Path(gymnasium.__file__).parent / "envs/mujoco/assets"
BALL, AIR = kd.Ball(), kd.Air()


def lines(plan, words):
    return [line for line in plan.warnings if words in line]


def test_a_shank_inside_the_ball_is_announced_and_a_flatter_launch_avoids_it():
    humanoid = kd.Leg.from_mjcf(MODELS / "humanoid.xml", "right_foot", base="floating")
    humanoid = humanoid.with_supports("left_foot")
    front = kd.Contact(friction=0.4, offset=(0.075, 0, 0.1))
    plan = kd.plan_kick(humanoid, kd.Goal(1.5, time=0.5), BALL, AIR, contact=front)
    (line,) = lines(plan, "inside the ball")
    depths = dict(re.findall(r"(right_\w+) by (0\.\d+) m", line))
    assert depths.keys() == {"right_foot", "right_shin"}
    assert all(0.02 < float(depth) < 0.06 for depth in depths.values())
    assert plan.share == 1.0
    assert plan.status == "collides"
    assert verdict(plan).endswith(
        " But a body is inside the ball or another body, or under the ground."
    )
    flat = kd.plan_kick(
        humanoid,
        kd.Goal(1.5, time=0.4),
        BALL,
        AIR,
        contact=kd.Contact(friction=0.4, offset=(0.1, 0, 0.1)),
    )
    assert not lines(flat, "inside the ball")
    assert flat.status == "met"


@pytest.mark.parametrize("name", ["human", "testbed", "g1"])
def test_the_toe_of_a_known_leg_touches_the_ball(name):
    known = {"human": kd.Leg.human, "testbed": kd.Leg.testbed}
    leg = known[name]() if name in known else kd.Leg.from_robot(name, legs_only=True)
    assert not lines(kd.plan_kick(leg, kd.Goal(3, time=0.6), BALL, AIR), "inside the ball")


def test_joints_without_an_actuator_are_named_until_they_are_locked():
    hopper, goal = kd.Leg.from_mjcf(MODELS / "hopper.xml", "foot"), kd.Goal(2, time=0.5)
    (line,) = lines(kd.plan_kick(hopper, goal, BALL, AIR), "have no actuator")
    assert "in the leg's file: rootx, rootz, rooty; to" in line
    assert "to keep them at rest, lock them by locked={'rootx': 0, 'rootz': " in line
    standing = hopper.locked(dict.fromkeys(("rootx", "rootz", "rooty"), 0.0))
    assert not lines(kd.plan_kick(standing, goal, BALL, AIR), "no actuator")


@pytest.mark.parametrize(("height", "under"), [(-0.704, True), (-0.654, False)])
def test_bodies_under_the_ground_are_one_line_with_a_remedy(height, under):
    goal = kd.Goal((30, 0, 2), time=1.5)
    plan = kd.plan_kick(kd.Leg.human(), goal, BALL, AIR, ball_position=height)
    assert plan.status == ("collides" if under else "met")
    found = lines(plan, "under the ground")
    assert [re.sub(r"0\.0\d\d m", "D", line) for line in found] == under * [
        "bodies are under the ground at the impact: foot by D; the ground is level with the ball's "
        "lowest point: try another height of the ball (ball_position, --ball-height)"
    ]


@pytest.mark.parametrize("low", [0.0, -0.3])
def test_the_ground_is_under_the_ball_or_under_a_lower_target(low):
    """The foot reaches 0.04 m below the ball's lowest point: under the one, above the other."""
    goal = kd.Goal((30, 0, 2), time=1.5)
    plan = kd.plan_kick(kd.Leg.human(), goal, BALL, AIR, ball_position=-0.704)
    plan = replace(plan, goal=kd.Goal((30, 0, low), time=1.5))
    floor = plan.impact.ball_before.position[2] - BALL.radius + low
    depths = find_depths(plan.leg, plan.q, floor)
    assert bool(depths) == (low == 0.0)
    assert len(lines(plan, "under the ground")) == len(depths)


def test_the_ground_is_not_known_where_the_height_of_the_ball_is_free():
    plan = kd.plan_kick(kd.Leg.human(), kd.Goal(15, time=1.5), BALL, AIR)
    assert len(lines(plan, "under the ground")) == 1
    assert plan.status == "met"
    height = plan.impact.ball_before.position[2]
    placed = kd.plan_kick(plan.leg, plan.goal, BALL, AIR, ball_position=height)
    assert placed.warnings == plan.warnings
    assert placed.status == "collides"


def test_a_single_leg_is_not_told_to_stand_on_the_other_one():
    plan = kd.plan_kick(kd.Leg.human(), kd.Goal(25, time=1.6), BALL, AIR, ball_position=0.1)
    (line,) = lines(plan, "under the ground")
    assert "base by" in line
    assert line.endswith("(ball_position, --ball-height)")


def test_a_body_with_the_name_of_its_joint_is_under_the_ground():
    cheetah = kd.Leg.from_mjcf(MODELS / "half_cheetah.xml", "ffoot")
    (line,) = lines(kd.plan_kick(cheetah, kd.Goal(2, time=0.5), BALL, AIR), "under the ground")
    assert "at the impact: ffoot by " in line


LEG = """<mujoco><worldbody><body name="shank" pos="0 0 1">
  <joint name="knee" type="hinge" axis="0 -1 0" range="-90 90"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.8" size="0.04"/>
  <body name="foot" pos="0 0 -0.9"><geom type="sphere" size="{}" pos="{} 0 0"/></body>
</body></worldbody></mujoco>"""


def kick(tmp_path, size, ahead, offset):
    """An impact at an offset from the foot, which is a sphere ahead of the origin."""
    (tmp_path / "leg.xml").write_text(LEG.format(size, ahead))
    leg = kd.Leg.from_mjcf(tmp_path / "leg.xml", "foot")
    contact = kd.Contact((1, 0, 0), 0.8, offset=offset)
    return kd.strike(leg.posture([0.0]), [1.0], BALL, contact)


def find_overlaps(hit):
    return find_ball_overlaps(hit.posture, hit.ball_before.position, hit.ball.radius)


def test_a_foot_counts_where_it_is_inside_the_ball(tmp_path):
    """The contact point at the front touches; behind the front, the ball is in the foot."""
    assert find_overlaps(kick(tmp_path, 0.05, 0.1, (0.15, 0, 0))) == {}
    inside = find_overlaps(kick(tmp_path, 0.05, 0.1, (0.12, 0, 0)))
    assert inside == pytest.approx({"foot": 0.03}, abs=1e-9)
    top = find_overlaps(kick(tmp_path, 0.05, 0.1, (0.1, 0, 0.05)))
    radius = BALL.radius
    assert top == pytest.approx({"foot": radius + 0.05 - math.hypot(radius, 0.05)})


def test_another_body_counts_where_it_is_inside_the_ball(tmp_path):
    (tmp_path / "leg.xml").write_text(LEG.format(0.05, 0.0))
    leg = kd.Leg.from_mjcf(tmp_path / "leg.xml", "foot")
    contact = kd.Contact((1, 0, 0), 0.8, offset=(-0.02, 0, 0.2))
    hit = kd.strike(leg.posture([0.0]), [1.0], BALL, contact)
    distance = BALL.radius - 0.02  # of the ball's centre from the axis of the shank
    found = find_overlaps(hit)
    assert found.keys() == {"shank"}
    assert found["shank"] == pytest.approx(BALL.radius + 0.04 - distance, abs=1e-9)


def test_a_leg_without_shapes_has_nothing_to_compare():
    leg = kd.Leg.from_model(kd.Leg.human().model, "toe")
    hit = kd.strike(leg.posture([0.0, 0.0, 0.0]), [1, 0, 0], BALL, kd.Contact((1, 0, 0), 0.8))
    assert find_overlaps(hit) == {}


@pytest.mark.parametrize("end", [math.inf, 0.0])
def test_a_line_about_the_motion_has_each_body_with_its_depth_and_time(end):
    """The deepest first, each where it is deepest, without what overlaps at the impact."""
    motion = SimpleNamespace(begin=-0.79, end=0.79, q=lambda t: t)
    plan = SimpleNamespace(q=0.0, motion=motion)

    def find(_, q, t):
        assert q == t
        depths = {"hand": 0.2 - abs(t + 0.39), "foot": 0.1 - abs(t - 0.47), "toe": 0.3 - abs(t)}
        return {name: depth for name, depth in depths.items() if depth > 0.0}

    times = _times_of_motion(plan, end)
    (line,) = _in_motion(plan, find, "inside a wall", "move it", times)
    (deepest,) = re.findall(r"hand by 0\.(\d+) m at -0\.39 s", line)
    assert 190 <= int(deepest) <= 200
    assert ("foot by 0." in line) == (end > 0.0)
    assert "toe" not in line
    assert line.startswith("bodies are inside a wall: hand")
    assert line.endswith("; move it")
    assert not end or re.search(r"foot by 0\.(09\d|100) m at 0\.4[678] s", line)
