"""Every number of a plan's report, against strikes, flights and Pinocchio."""

import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import kickdyn as kd
from kickdyn.planning.plan_report import (
    PlanReport,
    _describe_stance,
    _limit_use,
    describe_passage,
    score,
    unreachable_json,
    verdict,
)
from kickdyn.scene.pitch import Wall

LEG, BALL, AIR = kd.Leg.human(), kd.Ball(), kd.Air()


@pytest.fixture(scope="module")
def weak():
    return kd.plan_kick(LEG, kd.Goal(50, time=2), BALL, AIR)


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


def static_use(plan):
    """Return the largest speed and the torque that keeps it, over their limits."""
    leg = plan.leg
    torque = pin.nonLinearEffects(leg.model, leg.model.createData(), plan.q, plan.v)
    moving = plan.v != 0.0
    return [
        np.abs(used / limit)[moving].max()
        for used, limit in ((plan.v, leg.velocity_limit), (torque, leg.effort_limit))
    ]


def numbers(text):
    """Return the numbers of a line."""
    return [float(x) for x in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_every_number_of_the_table_is_that_of_the_plan(plan):
    launch, impact, leg, drives, *rows = PlanReport(plan).table()
    velocity, (up, left) = plan.impact.ball_after.velocity, contact_point(plan)
    speed, azimuth = np.linalg.norm(velocity), math.degrees(math.atan2(velocity[1], velocity[0]))
    rises = math.degrees(math.asin(velocity[2] / speed))
    assert numbers(launch) == pytest.approx([speed, rises, abs(azimuth)], abs=1e-3)
    assert ("left" if azimuth > 0 else "right") in launch
    assert abs(up) > 0.005
    assert abs(left) > 0.001
    assert re.findall("above|below|left|right", impact) == [
        "above" if up > 0 else "below",
        "left" if left > 0 else "right",
    ]
    foot = np.linalg.norm(plan.impact.posture.jacobian @ plan.v)
    expected = [1e3 * abs(up), 1e3 * abs(left), BALL.mass * speed, foot]
    assert numbers(impact) == pytest.approx(expected, abs=0.06)
    used = np.multiply(static_use(plan), 100)
    assert numbers(leg)[:2] == pytest.approx(used, abs=0.51)
    joint, largest = plan.impact.worst_joint
    assert joint in leg
    ratios = (plan.v / plan.leg.velocity_limit)[plan.v != 0.0]
    assert numbers(leg)[2:] == pytest.approx([largest, np.mean(ratios**2)], rel=5e-3)
    bare = plan.leg.with_armature(dict.fromkeys(plan.leg.single_joints, 0.0)).posture(plan.q)
    normal = plan.impact.contact.normal
    masses = [bare.effective_mass(normal), plan.impact.effective_mass]
    assert numbers(drives) == pytest.approx(masses, rel=5e-3)
    angles = plan.leg.joint_values(plan.q)
    shown = {row.split()[0]: numbers(row) for row in rows}
    assert len(shown) == np.count_nonzero(plan.v)
    for name, (q, v) in shown.items():
        assert q == pytest.approx(math.degrees(angles[name]), abs=0.0051), name
        assert v == pytest.approx(plan.v[plan.leg.velocity_index(name)], abs=5.1e-4), name


def test_every_number_of_the_json_is_that_of_the_plan(plan):
    report = json.loads(json.dumps(PlanReport(plan, Wall(3.0, 0.2), True).to_json()))
    impact, leg, (up, left) = plan.impact, plan.leg, contact_point(plan)
    after, velocity = impact.ball_after, impact.ball_after.velocity
    speed, ahead = np.linalg.norm(velocity), plan.goal.target / plan.goal.distance
    there = kd.fly(after, BALL, AIR, plane=kd.Plane(after.position + 3.0 * ahead, -ahead, "centre"))
    passes = there.landing.position - after.position
    speed_use, torque_use = static_use(plan)
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
    reached, wished = PlanReport(weak).table()[:2]
    assert numbers(reached)[0] == pytest.approx(weak.impact.ball_after.speed, abs=1e-4)
    assert numbers(wished)[0] == pytest.approx(weak.launch.speed, abs=1e-4)


@pytest.mark.parametrize(
    ("goal", "options", "leg", "ends"),
    [
        (kd.Goal(15, time=0.55), {"surface": "carpet"}, LEG, "too late"),
        (kd.Goal(40, time=9), {"surface": "turf"}, kd.Leg.testbed(), "stops"),
        (kd.Goal((30, 0, 5), time=1.3), {}, LEG, "passes"),
    ],
)
def test_where_a_weak_kick_ends_is_said(goal, options, leg, ends):
    late = kd.plan_kick(leg, goal, BALL, AIR, **options)
    said = verdict(late)
    assert ends in said
    assert f"{late.path.duration:.4g} s" in said
    amount = late.path.distance if ends == "stops" else late.time_error
    assert f"{amount:.4g}" in said or f"{amount:.3g}" in said


def test_joints_near_0_have_no_sign_and_joints_at_rest_away_from_0_have_a_row(weak):
    for q, v, names in (
        (np.full(3, -1e-6), np.full(3, -1e-6), ["hip", "knee", "ankle"]),
        (np.array([0.3, 0.2, 0.0]), np.zeros(3), ["hip", "knee"]),
    ):
        posture, contact = LEG.posture(q), weak.impact.contact
        still = kd.strike(posture, v, BALL, contact, ball_velocity=[-5, 0, 0])
        rows = PlanReport(replace(weak, impact=still)).table()[-len(names) :]
        assert [row.split()[0] for row in rows] == names
        for row, angle in zip(rows, q, strict=False):
            assert "-0.0" not in row
            assert numbers(row)[0] == pytest.approx(math.degrees(angle), abs=0.0051)


def test_the_restitution_is_named_where_it_depends_on_the_speed():
    contact = kd.Contact(None, "peacock-ball", 0.4)
    plan = kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR, contact=contact)
    line = PlanReport(plan).table()[1]
    assert "peacock-ball" in line
    assert numbers(line)[-2:] == pytest.approx(
        [plan.impact.restitution, plan.impact.approach_speed], rel=1e-3
    )


def test_a_torque_that_binds_is_named():
    model = LEG.model
    model.effortLimit = np.array([60.0, 40.0, 20.0])
    leg = kd.Leg.from_model(model, "toe")
    plan = kd.plan_kick(leg, kd.Goal(60, time=2), BALL, AIR, objective="kinetic-energy")
    (limit,) = (limit for limit in plan.binding if limit.startswith("torque of "))
    assert limit in verdict(plan)


@pytest.mark.parametrize("side", [1, -1])
def test_a_leg_that_is_turned_says_to_which_side(side):
    plan = kd.plan_kick(LEG, kd.Goal((20, 3 * side, 0), time=1), BALL, AIR)
    (base,) = (line for line in PlanReport(plan).table() if line.startswith("base"))
    assert numbers(base) == [pytest.approx(abs(np.degrees(plan.heading)), abs=0.006)]
    assert base.endswith("left" if side > 0 else "right")


def test_what_the_flight_warns_of_is_said_of_the_plan():
    far = kd.plan_kick(LEG, kd.Goal(100, time=3), BALL, AIR, limits=False)
    assert far.path.warnings
    assert set(far.path.warnings) <= set(far.warnings)
    report = PlanReport(far)
    assert report.to_json()["warnings"] == list(far.warnings)
    assert all(any(line in said for said in report.sentences()) for line in far.warnings)


def passing(place):
    """Return a plan of a straight path to a place, of the target (20, 0, 1), from the origin."""
    goal = kd.Goal((20.0, 0.0, 1.0), time=1.0)

    def sample(t):
        return SimpleNamespace(position=np.asarray(t)[..., None] * np.array(place))

    path = SimpleNamespace(duration=1.0, sample=sample, launch=kd.BallState())
    ball = SimpleNamespace(radius=BALL.radius)
    return SimpleNamespace(aim=goal, goal=goal, path=path, impact=SimpleNamespace(ball=ball))


R = BALL.radius


@pytest.mark.parametrize(
    ("left", "up", "end"),
    [
        (3.66 - R - 0.01, 1.0, "goal"),
        (3.66 - R + 0.01, 1.0, "post"),
        (3.77 + R, 1.0, "post"),
        (3.79 + R, 1.0, "beside"),
        (0.0, 2.44 - 2 * R - 0.01, "goal"),
        (0.0, 2.44 - 2 * R + 0.01, "bar"),
        (0.0, 2.55, "bar"),
        (0.0, 2.57, "over"),
    ],
)
@pytest.mark.parametrize("side", [1, -1])
def test_a_kick_is_scored_by_the_goal_of_the_laws_of_the_game(left, up, end, side):
    """7.32 m between posts of 0.12 m, the bar at 2.44 m: the ball's lower edge is at `up`."""
    shown = score(passing((20.0, side * left, up)))
    assert end in str(shown.end) or (end == "goal" and shown.end not in ("post", "bar"))
    assert ("enters" in str(shown)) == (end == "goal")


def test_a_kick_that_does_not_arrive_is_no_goal():
    assert "does not reach" in str(score(passing((19.0, 0.0, 1.0))))


@pytest.fixture(scope="module")
def corner():
    return kd.plan_kick(LEG, kd.Goal((20, 3.4, 2.1), over=(9.15, 2.0)), BALL, AIR)


def test_a_wall_is_cleared_by_what_the_goal_asked_for(corner):
    assert numbers(describe_passage(Wall(9.15, 1.9), corner)) == [pytest.approx(0.1, abs=1e-3)]
    with pytest.raises(kd.InvalidInput, match=r"hits the wall.* 0\.\d+ m from its edge"):
        describe_passage(Wall(9.15, 2.5), corner)
    with pytest.raises(kd.InvalidInput, match="between the ball and the target"):
        describe_passage(Wall(30.0, 1.9), corner)


def test_a_weak_kick_hits_the_wall_or_lands_before(weak):
    with pytest.raises(kd.InvalidInput, match=r"beyond the limits .* hits the wall"):
        describe_passage(Wall(9.15, 9.0), weak)
    assert "lands before" in describe_passage(Wall(49.0, 1.9), weak)


def test_joints_without_a_limit_have_no_use_of_it():
    assert numbers(_limit_use(speed=0.25, torque=0.5).replace("%", " ")) == [25, 50]
    assert "speed" not in _limit_use(speed=0.0, torque=0.5)
    assert not numbers(_limit_use(speed=0.0, torque=0.0))


@pytest.mark.parametrize("state", ["stands", "turns", "slips", "lifts-off"])
def test_each_state_of_a_support_has_its_sentence(state):
    impulse = np.array([3.0, 4.0, 20.0, 0.0, 0.0, 0.0])  # of which the friction is 5 / 20
    impact = SimpleNamespace(footing={"sole": state}, support_impulses={"sole": impulse})
    line = _describe_stance("sole", SimpleNamespace(impact=impact, balance=0.0123))
    assert "12.3 mm" in line
    assert state.replace("-", " ") in line
    assert ("0.25" in line) == (state == "stands")


def test_a_goal_out_of_reach_has_its_nearest_in_json():
    goal = kd.Goal((25, 0, 1), speed=12)
    launch = kd.plan_launch(goal, BALL)
    report = unreachable_json(goal, SimpleNamespace(nearest=launch, limit=launch.limit))
    assert report["goal"] == {"target_m": [25, 0, 1], "speed": 12}
    assert report["nearest"]["speed"] == pytest.approx(launch.speed)
    assert (report["status"], report["limit"]) == ("unreachable", "least-speed")


def test_a_meeting_is_in_the_report():
    state = kd.BallState((2, 0, -0.7042), (-2.5, 0, 0), (0, -2.5 / BALL.radius, 0), 5.0)
    incoming = kd.IncomingBall(state, meet_at=5.62)
    plan = kd.plan_kick(LEG, kd.Goal(18, time=1.2), BALL, AIR, incoming=incoming)
    report = PlanReport(plan)
    meeting, slopes = report.to_json()["meeting"], plan.meeting.landing_slopes
    assert (meeting["time"], meeting["share"]) == (pytest.approx(5.62), 1.0)
    assert meeting["target_position"] == pytest.approx(state.position + 18 * np.eye(3)[0])
    assert meeting["landing_slopes"]["time"] == pytest.approx(slopes.time.tolist())
    lines = " ".join(report.sentences())
    assert "0.62 s" in lines
    for value, unit in zip(
        slopes.tolerances, ("{:.2g} ms", "{:.3g} mm/s", "{:.2g} mm"), strict=True
    ):
        assert unit.format(1e3 * value) in lines


@pytest.mark.slow
def test_a_motion_has_a_sentence_and_samples_in_json():
    plan = kd.plan_kick(LEG, kd.Goal(15, time=1), BALL, AIR, motion=True)
    motion = plan.motion
    line = PlanReport(plan).sentences()[1]
    assert numbers(line)[:2] == pytest.approx([-motion.begin, motion.end], rel=1e-2)
    shown = json.loads(json.dumps(PlanReport(plan).to_json(), allow_nan=False))["motion"]
    assert shown["joints"] == list(LEG.joint_names)
    for time, q, torque in zip(shown["time"], shown["q"], shown["torque"], strict=True):
        assert q == motion.q(time).tolist()
        assert torque == motion.torque(time).tolist()
