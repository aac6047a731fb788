"""A plan: its warnings and status by the bodies that overlap, every number of its report."""

import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import BSpline
from tolerances import agrees, optimized

import kickdyn as kd
from kickdyn.motion.motion import Motion
from kickdyn.planning import plan_report as module
from kickdyn.planning.kick_plan import check_actuators, check_ball_overlap_after, check_drives
from kickdyn.planning.plan_report import PlanReport, describe_passage, score, verdict
from kickdyn.robot.collisions import find_ball_overlaps
from kickdyn.robot.ground_clearance import find_depths
from kickdyn.scene.scene import Wall

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


@pytest.fixture(scope="module")
def weak():
    return kd.plan_kick(HUMAN, kd.Goal(50, time=2), BALL, AIR)


@pytest.fixture(scope="module", params=[1.0, -1.0], ids=["left", "right"])
def plan(request):
    """A kick with the contact point on either side of the ball's centre, and of the launch."""
    g1, side = kd.Leg.from_robot("g1", legs_only=True), request.param
    spin = (0.0, -25.0 * side, 12.0 * side)
    return kd.plan_kick(g1, kd.Goal((6, side, 0), time=0.9, spin=spin), BALL, AIR)


def contact_point(plan):
    """Return the contact point above the ball's centre and to the left, along the launch [m]."""
    arm = plan.impact.posture.contact_point - plan.impact.ball_before.position
    along = plan.impact.ball_after.velocity * [1.0, 1.0, 0.0]
    return arm[2], np.cross([0.0, 0.0, 1.0], along / np.linalg.norm(along)) @ arm


def numbers(text):
    """Return the numbers of a line."""
    return [float(x) for x in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_every_number_of_the_json_is_that_of_the_plan(plan):
    report = json.loads(json.dumps(PlanReport(plan, Wall(3.0, 0.2), True).to_json()))
    impact, leg, (up, left) = plan.impact, plan.leg, contact_point(plan)
    after, velocity = impact.ball_after, impact.ball_after.velocity
    speed, ahead = np.linalg.norm(velocity), plan.goal.target / plan.goal.distance
    there = kd.fly(after, BALL, AIR, plane=kd.Plane(after.position + 3.0 * ahead, -ahead, "centre"))
    passes = there.landing.position - after.position
    torque = pin.nonLinearEffects(leg.model, leg.model.createData(), plan.q, plan.v)
    uses = plan.v / leg.velocity_limit, torque / leg.effort_limit
    speed_use, torque_use = (np.abs(use)[plan.v != 0.0].max() for use in uses)
    angles = leg.joint_values(plan.q)
    expected = {
        "status": plan.status, "share": 1.0, "time": 0.9, "warnings": list(plan.warnings),
        "landing_error": plan.landing_error, "time_error": plan.path.duration - 0.9,
        "goal.target_m": plan.goal.target, "goal.time": 0.9,
        "launch.speed": speed, "launch.velocity": velocity, "launch.spin": after.spin,
        "launch.time": 0.9, "launch.angle_deg": math.degrees(math.asin(velocity[2] / speed)),
        "launch.azimuth_deg": math.degrees(math.atan2(velocity[1], velocity[0])),
        "impact.impulse": BALL.mass * velocity,
        "impact.foot_velocity": impact.posture.jacobian @ plan.v,
        "impact.restitution": 0.8, "impact.restitution_given": 0.8,
        "impact.normal": (impact.ball_before.position - impact.posture.contact_point) / BALL.radius,
        "impact.up_m": up, "impact.left_m": left, "leg.name": "g1", "leg.heading_deg": 0.0,
        "leg.v": plan.v, "leg.objective": "joint-speed",
        "leg.value": np.mean((plan.v / leg.velocity_limit)[plan.v != 0.0] ** 2),
        "leg.binding": list(plan.binding), "leg.speed_use": speed_use,
        "leg.torque_use": torque_use, "leg.worst_joint": impact.worst_joint[0],
        "leg.worst_joint_impulse": impact.worst_joint[1], "wall.above": passes[2] - 0.2,
        "wall.beside": abs(np.cross(ahead, passes)[2]) - 1.25 - BALL.radius,
        "goal_mouth.end": score(plan).end,
        "sensitivity_to_ball.across.direction_deg": plan.sensitivity_to_ball.across.direction_deg,
        "leg.q_deg": {name: math.degrees(angle) for name, angle in angles.items()},
    }  # fmt: skip
    for key, value in expected.items():
        shown = report
        for name in key.split("."):
            shown = shown[name]
        if isinstance(value, str | list):
            assert shown == value, key
        else:
            assert shown == pytest.approx(value, abs=2e-6), key


def test_beyond_limits_names_them_and_where_the_ball_comes_down(weak):
    said = verdict(weak)
    assert "speed of knee" in said
    path = kd.fly(weak.impact.ball_after, BALL, AIR)
    for value in (path.range, path.duration):
        assert f"{value:.4g}" in said
    assert f"{50 - path.range:.3g} m from the target" in said
    assert f"{weak.share:.0%}" in said
    rows = {name: value for name, value, _ in weak._rows()}
    agrees(rows["launch"], weak.share * rows["wished launch"], optimized(1e-7))


def test_a_wall_is_cleared_by_what_the_goal_asked_for():
    corner = kd.plan_kick(HUMAN, kd.Goal((20, 3.4, 2.1), over=(9.15, 2.0)), BALL, AIR)
    (turn,) = (value for name, value, _ in corner._rows() if name == "heading")
    assert turn == pytest.approx(math.degrees(math.atan2(*corner.launch.velocity[1::-1])))
    assert numbers(describe_passage(Wall(9.15, 1.9), corner)) == [pytest.approx(0.1, abs=1e-3)]
    with pytest.raises(kd.InvalidInput, match=r"hits the wall.* 1\.\d+ m from its edge"):
        describe_passage(Wall(9.15, 2.5), corner)
    with pytest.raises(kd.InvalidInput, match="between the ball and the target"):
        describe_passage(Wall(30.0, 1.9), corner)


@pytest.mark.parametrize(("state", "force", "friction"), [
    ("stands", (3, -4, 10), 0.5), ("turns", (3, -4, 10), 0.5), ("lifts-off", (3, -4, -10), None),
])  # fmt: skip
def test_the_friction_that_a_foot_needs_is_that_of_its_impulse(state, force, friction):
    impulses = {"sole": np.array([*force, 0.0, 0.0, 0.0])}
    hit = SimpleNamespace(support_impulses=impulses, footing={"sole": state})
    stands = SimpleNamespace(impact=hit, balance=0.0123)
    assert module._least_friction("sole", stands) == friction
    said = module._describe_stance("sole", stands)
    assert "12.3 mm inside" in said
    assert state.replace("-", " ") in said
    assert ("friction of 0.5" in said, "the moment" in said) == (
        state == "stands",
        state == "turns",
    )
